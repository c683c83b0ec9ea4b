"""The trace of a run: one JSON object per line, keys in a fixed order, nothing that differs from run to run."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel.task import SUCCEEDED, Status
from planlang.kernel.tree import Node

SCHEMA = 1
LONGEST = 256
"""Sequences longer than this are told by their length."""


class Trace:
    """Writes what happens, line by line, to a text file or a list.

    Every record begins with ``step`` (plan time in world steps) and ``event``; the first one is the header. Without
    ``out`` the records are kept in :attr:`events`. ``header`` is what the caller knows: versions, hashes, names.
    """

    def __init__(
        self, out: TextIO | list[dict[str, Any]] | None = None, header: Mapping[str, object] | None = None
    ) -> None:
        self.events: list[dict[str, Any]] = out if isinstance(out, list) else []
        self._file: TextIO | io.FileIO | None = None
        self._put: Callable[[str], object] | None = None
        self._header = dict(header or {})
        if out is not None and not isinstance(out, list):
            self._file, self._put = out, _through(out)

    @classmethod
    def at(cls, path: str | os.PathLike[str], header: Mapping[str, object] | None = None) -> Self:
        """A trace in a file at its final name, flushed line by line; an older one is renamed ``NAME.old``."""
        target = Path(path)
        if target.exists():
            target.replace(target.with_name(target.name + ".old"))
        trace = cls(None, header)
        trace._file = io.FileIO(target, "w")
        trace._put = _unbuffered(trace._file)
        return trace

    def begin(self, **known: object) -> None:
        """Write the header."""
        self.write(0, "header", schema=SCHEMA, **known, **self._header)

    def write(self, step: int, event: str, **details: object) -> None:
        """Write one record; details are encoded now, in the order given."""
        record: dict[str, Any] = {"step": step, "event": event}
        for key, value in details.items():
            record[key] = value if value.__class__ in _PLAIN else encode(value)
        if self._put is None:
            self.events.append(record)
        else:
            self._put(_line(record))

    def started(self, step: int, node: Node, **details: object) -> None:
        """A node of the tree begins."""
        if details:
            self.write(step, "started", kind=node.kind, path=node.path, **details)
        elif self._put is None:
            self.events.append({"step": step, "event": "started", "kind": node.kind, "path": node.path})
        else:  # the same bytes as write() gives, several times faster
            self._put(f'{{"step": {step}, "event": "started", "kind": "{node.kind}", "path": {_quoted(node.path)}}}\n')

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """A node of the tree ends."""
        word = outcome._value_
        if failure is not None:
            try:
                self.write(step, "ended", kind=node.kind, path=node.path, status=word, failure=failure)
                return
            except RecursionError:  # too deep to tell why it ended, not to tell that it did
                result = None
        if result is not None and outcome is SUCCEEDED:
            self.write(step, "ended", kind=node.kind, path=node.path, status=word, result=result)
        elif self._put is None:
            self.events.append({"step": step, "event": "ended", "kind": node.kind, "path": node.path, "status": word})
        else:
            self._put(
                f'{{"step": {step}, "event": "ended", "kind": "{node.kind}", "path": {_quoted(node.path)}, '
                f'"status": "{word}"}}\n'
            )

    def text(self) -> str:
        """The kept records as JSON Lines."""
        return "".join(map(_line, self.events))

    def flush(self) -> None:
        """Write through."""
        if self._file is not None and not self._file.closed:
            self._file.flush()

    def close(self) -> None:
        """Close a file that :meth:`at` opened."""
        if isinstance(self._file, io.FileIO):
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


_PLAIN = frozenset({str, int, bool, type(None)})
_json = json.JSONEncoder(ensure_ascii=False).encode
_quoted = json.encoder.encode_basestring


def _through(file: TextIO) -> Callable[[str], object]:
    def put(text: str) -> None:
        file.write(text)
        file.flush()

    return put


def _unbuffered(file: io.FileIO) -> Callable[[str], object]:
    write = file.write

    def put(text: str) -> None:
        data = text.encode()
        while data:  # a full disk takes a part, and refuses the rest
            data = data[write(data) :]

    return put


def _line(record: dict[str, Any]) -> str:
    return _json(record) + "\n"


def encode(value: object) -> Any:
    """A JSON value. Designators become their text, sets are sorted, unknown types their qualified name."""
    if value is None or isinstance(value, (bool, str)):
        return value
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        number = float(value)
        return number if math.isfinite(number) else str(number)
    if isinstance(value, BaseException):
        return _encode_failure(value)
    if isinstance(value, Mapping):
        return {key if isinstance(key, str) else str(encode(key)): encode(item) for key, item in value.items()}
    if isinstance(value, Set):
        return sorted((encode(item) for item in value), key=lambda item: json.dumps(item, sort_keys=True))
    if isinstance(value, Sequence) and not isinstance(value, (bytes, bytearray, memoryview)):
        return [encode(item) for item in value] if len(value) <= LONGEST else {"length": len(value)}
    return _encode_object(value)


def _encode_object(value: object) -> Any:
    module = type(value).__module__
    if module == "planlang.designators":
        return str(value)
    if module == "planlang.protocols" and is_dataclass(value):
        return {field.name: encode(getattr(value, field.name)) for field in fields(value)}
    if module == "numpy":
        if getattr(value, "size", LONGEST + 1) <= LONGEST:
            return encode(value.tolist())  # type: ignore[attr-defined]
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
        record: dict[str, Any] = {"type": type(link).__name__, "message": str(link)}
        if isinstance(link, PlanFailure):
            if link.where is not None:
                record["where"] = str(link.where)
            if link.siblings:
                record["siblings"] = {name: f"{type(other).__name__}: {other}" for name, other in link.siblings}
            if link.cleanup_failures:
                record["cleanup"] = [f"{type(other).__name__}: {other}" for other in link.cleanup_failures]
        if isinstance(link, CompositeFailure):
            members = zip(link.names, link.failures, strict=True)
            record["members"] = {name: f"{type(member).__name__}: {member}" for name, member in members}
        if outer is not None:
            record["cause"] = outer
        outer = record
    assert outer is not None
    return outer
