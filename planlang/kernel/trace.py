"""The trace of a run: one JSON object per line, keys in a fixed order, nothing that differs from run to run."""

from __future__ import annotations

import io
import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import fields, is_dataclass
from enum import Enum
from numbers import Integral, Real
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel.exact import Exact
from planlang.kernel.task import SUCCEEDED, Status
from planlang.kernel.tree import Node

if TYPE_CHECKING:
    from planlang.kernel.past import Past

SCHEMA = 2
LONGEST = 256
"""Sequences longer than this are told by their length."""
DEEPEST = 20
"""So are sequences, sets and mappings inside as many others."""
LONGEST_TEXT = 1000
"""Characters of a failure's message or place that are told."""


class Trace:
    """Writes what happens, line by line, to a text file or a list.

    Every record begins with ``step`` (plan time in world steps) and ``event``; the first one is the header. What
    happens in a node of the tree has its number as ``node`` and its path element as ``name``; when a node starts or
    ends, ``parent`` is the number of the node around it and ``kind`` what it is. Numbers count from 1, the root, in the
    order in which nodes are told of; so a record is as long at any depth. :func:`with_paths` gives back the paths.

    Without ``out`` the records are kept in :attr:`events`. ``header`` is what the caller knows: versions, hashes.
    """

    def __init__(
        self, out: TextIO | list[dict[str, Any]] | None = None, header: Mapping[str, object] | None = None
    ) -> None:
        self.events: list[dict[str, Any]] = out if isinstance(out, list) else []
        self._file: TextIO | io.FileIO | None = None
        self._put: Callable[[str], object] | None = None
        self._header = dict(header or {})
        self._nodes = 0
        self.continues = False
        """Whether it begins with the records of an earlier trace."""
        if out is not None and not isinstance(out, list):
            self._file, self._put = out, _through(out)

    @classmethod
    def at(
        cls, path: str | os.PathLike[str], header: Mapping[str, object] | None = None, *, past: Past | None = None
    ) -> Self:
        """A trace in a file at its final name, flushed line by line; an older one is renamed ``NAME.old``.

        With ``past``, what a resumed run takes over, it begins with those records, complete before the older trace
        gives way; and no older one is lost: the next free of ``NAME.old``, ``NAME.old2``, ... is taken.
        """
        target = Path(path)
        trace = cls(None, header)
        if past is None:
            if target.exists():
                target.replace(target.with_name(target.name + ".old"))
            trace._file = io.FileIO(target, "w")
            trace._put = _unbuffered(trace._file)
            return trace
        coming = target.with_name(f".{target.name}.new")
        trace._file = io.FileIO(coming, "w")
        trace._put = _unbuffered(trace._file)
        trace.take_over((line.record for line in past.kept), past.nodes)
        if target.exists():
            target.replace(_free(target))
        coming.replace(target)
        return trace

    def begin(self, **known: object) -> None:
        """Write the header."""
        self._nodes = 0
        self.write(0, "header", schema=SCHEMA, **known, **self._header)

    def take_over(self, records: Iterable[Mapping[str, Any]], nodes: int) -> None:
        """Begin with the records of an earlier trace, in which ``nodes`` numbers were given."""
        self.continues = True
        self._nodes = nodes
        for record in records:
            if self._put is None:
                self.events.append(dict(record))
            else:
                self._put(_line(dict(record)))

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Write one record, of what happened in a node if it did in one; details are encoded now, in their order."""
        record: dict[str, Any] = {"step": step, "event": event}
        if node is not None:
            new = not node.number
            if new:
                self._nodes = node.number = self._nodes + 1
            record["node"] = node.number
            if new or event in _SPANS:
                record["parent"] = None if node.parent is None else node.parent.number
                record["kind"] = node.kind
            record["name"] = node.name
        for key, value in details.items():
            record[key] = value if value.__class__ in _PLAIN else encode(value)
        if self._put is None:
            self.events.append(record)
        else:
            self._put(_line(record))

    def started(self, step: int, node: Node, **details: object) -> None:
        """A node of the tree begins."""
        parent = node.parent
        if details or parent is None:
            self.write(step, "started", node, **details)
            return
        self._nodes = number = node.number = self._nodes + 1
        if self._put is None:
            self.events.append(
                {
                    "step": step,
                    "event": "started",
                    "node": number,
                    "parent": parent.number,
                    "kind": node.kind,
                    "name": node.name,
                }
            )
        else:  # the same bytes as write() gives, several times faster
            self._put(
                f'{{"step": {step}, "event": "started", "node": {number}, "parent": {parent.number}, '
                f'"kind": "{node.kind}", "name": {_quoted(node.name)}}}\n'
            )

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """A node of the tree ends."""
        word = outcome._value_
        if failure is not None:
            try:
                self.write(step, "ended", node, status=word, failure=failure)
                return
            except RecursionError:  # too deep to tell why it ended, not to tell that it did
                result = None
        parent, number = node.parent, node.number
        if result is not None and outcome is SUCCEEDED:
            self.write(step, "ended", node, status=word, result=result)
        elif parent is None or not number:
            self.write(step, "ended", node, status=word)
        elif self._put is None:
            self.events.append(
                {
                    "step": step,
                    "event": "ended",
                    "node": number,
                    "parent": parent.number,
                    "kind": node.kind,
                    "name": node.name,
                    "status": word,
                }
            )
        else:
            self._put(
                f'{{"step": {step}, "event": "ended", "node": {number}, "parent": {parent.number}, '
                f'"kind": "{node.kind}", "name": {_quoted(node.name)}, "status": "{word}"}}\n'
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


def with_paths(events: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """The records of a trace; what happened in a node gets the node's ``path``, names from the root joined by ``/``."""
    paths: dict[int, str] = {}
    for event in events:
        number = event.get("node")
        if number is None:
            yield dict(event)
            continue
        if number not in paths:
            around = paths.get(event["parent"])
            paths[number] = event["name"] if around is None else f"{around}/{event['name']}"
        yield {**event, "path": paths[number]}


_SPANS = frozenset({"started", "ended"})
_PLAIN = frozenset({str, int, bool, type(None)})
_json = json.JSONEncoder(ensure_ascii=False).encode
_quoted = json.encoder.encode_basestring


def _free(target: Path) -> Path:
    """The first name for an older file that is not taken."""
    number = 1
    while True:
        older = target.with_name(f"{target.name}.old{number if number > 1 else ''}")
        if not older.exists():
            return older
        number += 1


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


def encode(value: object, depth: int = 0) -> Any:
    """A JSON value. Designators become their text, sets are sorted, unknown types their qualified name."""
    if value is None or isinstance(value, (bool, str)):
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
    if module == "planlang.protocols" and is_dataclass(value):
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
    """The text; the middle of a long one is left out: a failure is told again by each node that it leaves."""
    left_out = len(text) - LONGEST_TEXT
    return text if left_out <= 0 else f"{text[: LONGEST_TEXT // 2]} ... {left_out} ... {text[-LONGEST_TEXT // 2 :]}"
