"""The trace of a run: one JSON object per line, keys in a fixed order, nothing that differs from run to run."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import SUCCEEDED, Node, Status
from planlang.misuse import Usage, WrongType, contrast, written
from planlang.runs.encoding import PLAIN, SCHEMA, encode
from planlang.runs.recorded_run import Past

_AT = Usage("Trace.at", {"path": '"run.jsonl"'}, {"header": '{"version": "1.0"}'})


def _check_header(header: object) -> None:
    if header is not None:
        _AT.instance("header", header, Mapping, "a mapping of what the caller knows")


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
        if out is not None and not isinstance(out, list) and not (hasattr(out, "write") and not isinstance(out, type)):
            code = written(out)
            message = f"out of Trace has to be None, a list or an open text file, not {code}"
            raise WrongType(contrast(message, f"Trace({code})", 'Trace()    or    Trace.at("run.jsonl")'))
        _check_header(header)
        self.events: list[dict[str, Any]] = out if isinstance(out, list) else []
        self._file: TextIO | io.FileIO | None = None
        self._put: Callable[[bytes], int] | None = None
        """Writes a line through, and says how much of it was taken."""
        self._on_failure: Callable[[BaseException], object] | None = None
        self._header = dict(header or {})
        self._nodes = 0
        self.continues = False
        """Whether it begins with the records of an earlier trace."""
        self._names: dict[str, str] = {}
        self._above = -1
        self._around = ""
        self._turn_to(0)
        if out is not None and not isinstance(out, list):
            self._file, self._put = out, _through(out)

    @classmethod
    def at(
        cls, path: str | os.PathLike[str], header: Mapping[str, object] | None = None, *, past: Past | None = None
    ) -> Self:
        """Return a trace in a file at its final name, flushed line by line; an older one is renamed ``NAME.old``.

        What is no file but a device or a pipe is written to as it is.

        With ``past``, what a resumed run takes over, it begins with those records, complete before the older trace
        gives way; and no older one is lost: the next free of ``NAME.old``, ``NAME.old2``, ... is taken.
        """
        _AT.instance("path", path, (str, os.PathLike), "the path of a file")
        if path == "":
            raise _AT.empty("path")
        _check_header(header)
        target = Path(path)
        trace = cls(None, header)
        if past is None:
            if target.is_file():
                target.replace(target.with_name(target.name + ".old"))
            trace._file = io.FileIO(target, "w")
            trace._put = trace._file.write
            return trace
        coming = target.with_name(f".{target.name}.new") if target.is_file() or not target.exists() else target
        trace._file = io.FileIO(coming, "w")
        trace._put = trace._file.write
        trace.take_over((line.record for line in past.kept), past.nodes)
        if target.is_file():
            target.replace(_free(target))
        if coming is not target:
            coming.replace(target)
        return trace

    def write_header(self, **known: object) -> None:
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
                self._send(_line(dict(record)))

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
            record[key] = value if value.__class__ in PLAIN else encode(value)
        if self._put is None:
            self.events.append(record)
        else:
            self._send(_line(record))

    def _send(self, text: str) -> None:
        self._write_through(text.encode(*_UTF8))

    def _write_through(self, data: bytes) -> None:
        """A disk that is nearly full takes a part of a line, and refuses the rest; then no more is written."""
        assert self._put is not None
        try:
            while data:
                data = data[self._put(data) :]
        except _UNWRITABLE as error:
            self._stop(error)

    def _stop(self, error: Exception) -> None:
        self._put = len
        self._fail(error)

    def _fail(self, error: BaseException) -> None:
        if self._on_failure is None:
            raise error
        self._on_failure(error)

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hand what goes wrong in writing to ``fail``, instead of raising it amid the work of the event loop."""
        self._on_failure = fail

    def end(self) -> None:
        """Write through; what goes wrong afterwards is raised."""
        self._on_failure = None
        self.flush()

    def started(self, step: int, node: Node, /, **details: object) -> None:
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
            return
        # the same bytes as write() gives, in a fraction of the time: what is many times the same is put together once
        if step != self._step:
            self._turn_to(step)
        above = parent.number
        if above != self._above:
            self._above = above
            self._around = f', "parent": {above}, "kind": "'
        name = self._names.get(node.base_name)
        if name is None:
            name = self._names[node.base_name] = _quoted(node.base_name)[:-1].encode(*_UTF8).decode()
        ordinal = "" if node.ordinal == 1 else f"#{node.ordinal}"
        told = node.told = f'{number}{self._around}{node.kind}", "name": {name}{ordinal}"'
        data = f"{self._started}{told}}}\n".encode()
        try:
            taken = self._put(data)
        except _UNWRITABLE as error:
            self._stop(error)
            return
        if taken != len(data):
            self._write_through(data[taken:])

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """A node of the tree ends."""
        word = outcome._value_
        if failure is not None:
            try:
                self.write(step, "ended", node, status=word, failure=failure)
                return
            except RecursionError:
                pass  # too deep to tell why it ended, not to tell that it did
        elif result is not None and outcome is SUCCEEDED:
            self.write(step, "ended", node, status=word, result=result)
            return
        if node.told and self._put is not None:
            if step != self._step:
                self._turn_to(step)
            data = f'{self._ended}{node.told}, "status": "{word}"}}\n'.encode()
            try:
                taken = self._put(data)
            except _UNWRITABLE as error:
                self._stop(error)
                return
            if taken != len(data):
                self._write_through(data[taken:])
        elif node.number and node.parent is not None and self._put is None:
            self.events.append(
                {
                    "step": step,
                    "event": "ended",
                    "node": node.number,
                    "parent": node.parent.number,
                    "kind": node.kind,
                    "name": node.name,
                    "status": word,
                }
            )
        else:
            self.write(step, "ended", node, status=word)

    def _turn_to(self, step: int) -> None:
        """Prepare how records of this step begin."""
        self._step = step
        self._started = f'{{"step": {step}, "event": "started", "node": '
        self._ended = f'{{"step": {step}, "event": "ended", "node": '

    def text(self) -> str:
        """Return the kept records as JSON Lines."""
        return "".join(map(_line, self.events))

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """Not recorded by itself: what a plan does with a fluent is."""

    def charged(self, kind: str, part: str, number: int) -> None:
        """Not recorded by itself."""

    def sync(self) -> None:
        """Have what was written so far survive a crash of the machine, if it is in a file of our own."""
        if isinstance(self._file, io.FileIO):
            with suppress(OSError):  # a pipe or a device has no disk to be written to
                os.fsync(self._file.fileno())

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
    """Return the records of a trace with the ``path`` of their nodes: names from the root, joined by ``/``."""
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


_UNWRITABLE = (OSError, ValueError)
"""What a file raises that is full, or closed."""
_SPANS = frozenset({"started", "ended"})
_UTF8 = ("utf-8", "backslashreplace")
"""What is no text stands as JSON writes it with an escape."""
_json = json.JSONEncoder(ensure_ascii=False).encode
_quoted = json.encoder.encode_basestring


def _free(target: Path) -> Path:
    """Return the first name for an older file that is not taken."""
    number = 1
    while True:
        older = target.with_name(f"{target.name}.old{number if number > 1 else ''}")
        if not older.exists():
            return older
        number += 1


def _through(file: TextIO) -> Callable[[bytes], int]:
    def put(data: bytes) -> int:
        file.write(data.decode())
        file.flush()
        return len(data)

    return put


def _line(record: dict[str, Any]) -> str:
    return _json(record) + "\n"
