"""Values as JSON: what a trace tells of results, parameters and failures, by a closed set of rules."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from typing import Any

from planlang.failures import CompositeFailure, PlanFailure
from planlang.runs.codec import Exact

SCHEMA = 3
"""Of a trace: 2 had the state of a random stream as ``numbers`` where 3 has the count of its ``draws``."""
PLAIN = frozenset({str, int, bool, type(None)})
"""Classes of values that stand for themselves in JSON."""
LONGEST = 256
"""Longer sequences are written as their length: an image of bytes is no news in a trace, a list of poses is."""
DEEPEST = 20
"""So are sequences, sets and mappings inside as many others: results of nested constructs repeat each other."""
LONGEST_TEXT = 1000
"""Characters of a failure's message or place that are written: each construct that it passes repeats it."""


def encode(value: object, depth: int = 0) -> Any:
    """Return a JSON value. Designators become their text, sets are sorted, unknown types their qualified name."""
    kind = value.__class__
    if kind in PLAIN:
        return value
    if kind is list or kind is tuple:  # as below, but without asking abstract classes, which costs ten times as much
        items: Sequence[Any] = value  # type: ignore[assignment]
        if depth >= DEEPEST or len(items) > LONGEST:
            return {"length": len(items)}
        return [encode(item, depth + 1) for item in items]
    if isinstance(value, str):
        return value
    if isinstance(value, Exact):
        return value.json
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        number = float(value)
        return number if math.isfinite(number) else str(number)
    if isinstance(value, BaseException):
        return _encode_failure(value)
    if isinstance(value, (Mapping, Set, Sequence)) and not isinstance(value, (bytes, bytearray, memoryview)):
        return _encode_container(value, depth) if depth < DEEPEST else {"length": len(value)}
    return _encode_object(value, depth)


def _encode_container(value: Mapping[Any, Any] | Set[Any] | Sequence[Any], depth: int) -> Any:
    deeper = depth + 1
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(encode(key)): encode(item, deeper) for key, item in value.items()}
    if isinstance(value, Set):
        return sorted((encode(item, deeper) for item in value), key=lambda item: json.dumps(item, sort_keys=True))
    return [encode(item, deeper) for item in value] if len(value) <= LONGEST else {"length": len(value)}


def _encode_object(value: object, depth: int) -> Any:
    module = type(value).__module__
    if module == "planlang.designators":
        return str(value)
    if module in ("planlang.geometry.pose", "planlang.protocols") and is_dataclass(value):
        return {field.name: encode(getattr(value, field.name), depth + 1) for field in fields(value)}
    if module == "numpy":
        if getattr(value, "size", LONGEST + 1) <= LONGEST:
            return encode(value.tolist(), depth)  # type: ignore[attr-defined]
        return {"shape": list(value.shape)}  # type: ignore[attr-defined]
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}"
    name = getattr(value, "__qualname__", None)
    if isinstance(name, str):
        return f"{getattr(value, '__module__', module)}.{name}"
    return f"{module}.{type(value).__qualname__}"


def _encode_failure(error: BaseException) -> dict[str, Any]:
    """Type, message, place, members and the chain of causes."""
    links = list(error.chain()) if isinstance(error, PlanFailure) else [error]
    outer: dict[str, Any] | None = None
    for link in reversed(links):
        record: dict[str, Any] = {"type": type(link).__name__, "message": _shortened(str(link))}
        if isinstance(link, PlanFailure):
            if link.where is not None:
                record["where"] = _shortened(str(link.where))
            if link.siblings:
                record["siblings"] = {name: _told(other) for name, other in link.siblings}
            if link.cleanup_failures:
                record["cleanup"] = [_told(other) for other in link.cleanup_failures]
        if isinstance(link, CompositeFailure):
            record["members"] = {name: _told(one) for name, one in zip(link.names, link.failures, strict=True)}
        if outer is not None:
            record["cause"] = outer
        outer = record
    assert outer is not None
    return outer


def _told(failure: BaseException) -> str:
    return _shortened(f"{type(failure).__name__}: {failure}")


def _shortened(text: str) -> str:
    """Return the text; the middle of a long one is left out: a failure is told again by each node that it leaves."""
    left_out = len(text) - LONGEST_TEXT
    return text if left_out <= 0 else f"{text[: LONGEST_TEXT // 2]} ... {left_out} ... {text[-LONGEST_TEXT // 2 :]}"
