"""The trace of a run: one JSON object per line, keys in a fixed order, nothing that differs from run to run.

That of a resumed run begins with the records that it takes over; the plan repeats them, and goes on behind them.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Protocol, Self, TextIO

from planlang.kernel.errors import RunError
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import SUCCEEDED, Node, Status
from planlang.misuse import Usage, WrongType, contrast, written
from planlang.runs.codec import PLAIN, SCHEMA, Exact, encode
from planlang.runs.recorded_run import BOOKKEEPING, SPANS, Line, Past, details

_AT = Usage("Trace.at", {"path": '"run.jsonl"'}, {"header": '{"version": "1.0"}'})


Listener = Callable[[Mapping[str, Any], Node | None], object]


def _check_header(header: object) -> None:
    if header is not None:
        _AT.instance("header", header, Mapping, "a mapping of what the caller knows")


class Earlier(Protocol):
    """What the trace of a run that goes on begins with."""

    @property
    def kept(self) -> Sequence[Line]:
        """The records, the header first."""

    @property
    def nodes(self) -> int:
        """The highest number that a node has been given."""


class Trace:
    """Writes what happens, line by line, to a text file or a list.

    Every record begins with ``step`` (plan time in world steps) and ``event``; the first one is the header. What
    happens in a node of the tree has its number as ``node`` and its path element as ``name``; when a node starts or
    ends, ``parent`` is the number of the node around it and ``kind`` what it is. Numbers count from 1, the root, in the
    order in which nodes come; so a record is as long at any depth. ``planlang.runs.with_paths`` gives back the paths.

    Without ``out`` the records are kept in ``events``. ``header`` is what the caller knows: versions, hashes.
    """

    is_compared = False
    """True if records are compared with recorded ones in :meth:`write`, so that all have to go through it."""

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
        self.listeners: tuple[Listener, ...] = ()
        """Given each record as it is written, with the node that it is about."""
        self._nodes = 0
        self.continues = False
        """True if it begins with the records of an earlier trace."""
        self._names: dict[str, str] = {}
        self._above = -1
        self._around = ""
        self._turn_to(0)
        if out is not None and not isinstance(out, list):
            self._file, self._put = out, _through(out)

    @classmethod
    def at(
        cls, path: str | os.PathLike[str], header: Mapping[str, object] | None = None, *, earlier: Earlier | None = None
    ) -> Self:
        """Return a trace in a file at its final name, flushed line by line; an older one is renamed ``NAME.old``.

        What is no file but a device or a pipe is written to as it is.

        With ``earlier``, the records of a run that goes on, it begins with those, complete before the older trace
        gives way; and no older one is lost: the next free of ``NAME.old``, ``NAME.old2``, ... is taken.
        """
        _AT.instance("path", path, (str, os.PathLike), "the path of a file")
        if path == "":
            raise _AT.empty("path")
        _check_header(header)
        target = Path(path)
        trace = cls(None, header)
        if earlier is None:
            if target.is_file():
                target.replace(target.with_name(target.name + ".old"))
            trace._file = io.FileIO(target, "w")
            trace._put = trace._file.write
            return trace
        coming = target.with_name(f".{target.name}.new") if target.is_file() or not target.exists() else target
        trace._file = io.FileIO(coming, "w")
        trace._put = trace._file.write
        trace.take_over((line.record for line in earlier.kept), earlier.nodes)
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
            if new or event in SPANS:
                record["parent"] = None if node.parent is None else node.parent.number
                record["kind"] = node.kind
            record["name"] = node.name
        for key, value in details.items():
            record[key] = value if value.__class__ in PLAIN else encode(value)
        if self._put is None:
            self.events.append(record)
        else:
            self._send(_line(record))
        self._tell(record, node)

    def _tell(self, record: Mapping[str, Any], node: Node | None) -> None:
        for listener in self.listeners:
            try:
                listener(record, node)
            except BaseException as problem:  # this listener gets no more; the run ends with its problem
                self.listeners = tuple(other for other in self.listeners if other is not listener)
                self._fail(problem)

    def _send(self, text: str) -> None:
        self._write_through(text.encode(*_UTF8))

    def _write_through(self, data: bytes) -> None:
        """Write all of a line, of which a nearly full disk takes a part; write no more once it refuses the rest."""
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
        """Write that a node of the tree begins."""
        parent = node.parent
        if details or parent is None or self.is_compared or self.listeners:
            self.write(step, "started", node, **details)
            return
        self._nodes = number = node.number = self._nodes + 1
        if self._put is None:
            self.events.append(_span(step, "started", node, parent))
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
        written = node.written = f'{number}{self._around}{node.kind}", "name": {name}{ordinal}"'
        data = f"{self._started}{written}}}\n".encode()
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
        """Write that a node of the tree ends."""
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
        if node.written and self._put is not None:
            if step != self._step:
                self._turn_to(step)
            data = f'{self._ended}{node.written}, "status": "{word}"}}\n'.encode()
            try:
                taken = self._put(data)
            except _UNWRITABLE as error:
                self._stop(error)
                return
            if taken != len(data):
                self._write_through(data[taken:])
        elif node.number and node.parent is not None and self._put is None and not (self.is_compared or self.listeners):
            self.events.append(_span(step, "ended", node, node.parent) | {"status": word})
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
        """Record nothing: what a plan does with a fluent is recorded."""

    def charged(self, kind: str, part: str, number: int) -> None:
        """Record nothing."""

    def sync(self) -> None:
        """Let what was written so far survive a crash of the machine, if it is in a file of our own."""
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


class Different(RunError):
    """A run that repeats a recorded one does something else; ``line`` is that of the record, None at its end."""

    def __init__(self, message: str, line: int | None, recorded: object = None, found: object = None) -> None:
        super().__init__(message)
        self.line, self.recorded, self.found = line, recorded, found


class ResumedTrace(Trace):
    """A trace that compares with what is recorded until :meth:`go_on`, and hands on to ``inner`` from then.

    What the plan writes on its way is compared with the records of the same step: tasks that run side by side may
    come to it in another order. The first difference is kept in :attr:`problem` for the scheduler to raise.
    """

    is_compared = True

    def __init__(self, inner: Trace, past: Past) -> None:
        super().__init__(inner.events)
        self._inner = inner
        self._ahead: dict[int, list[Line]] = {}
        for line in past.expected():
            self._ahead.setdefault(line.step, []).append(line)
        self._going_on = False
        self.problem: Different | None = None
        if not inner.continues:
            inner.take_over((line.record for line in past.kept), past.nodes)

    def go_on(self, step: int, past: Past) -> None:
        """Write what comes from here on: the records that are repeated end."""
        self._going_on = True
        again = {"again": Exact(list(past.again))} if past.again else {}
        self._inner.write(step, "resumed", **again)

    def check(self, now: int) -> None:
        """Raise Different if something recorded of this step, which is over, has not happened."""
        if self.problem is None and self._ahead:
            step = min(self._ahead)
            if step <= now:
                line = self._ahead[step][0]
                self.problem = Different(
                    f"the plan does not repeat what is recorded in line {line.number}: {shown(line.record)}",
                    line.number,
                    line.record,
                )
        if self.problem is not None:
            raise self.problem

    def write(self, step: int, event: str, node: Node | None = None, /, **more: object) -> None:
        """Compare or write a record."""
        if self._is_recorded(step, event, node, more) or (event in BOOKKEEPING and not self._going_on):
            return
        if self._going_on or event in FROM_OUTSIDE:
            self._inner.write(step, event, node, **more)
        elif self.problem is None:
            found = {"step": step, "event": event, "path": None if node is None else node.path, **encode(more)}
            ahead = self._ahead.get(min(self._ahead, default=step), [])
            line = ahead[0].number if ahead else None
            where = f" where line {line} says {shown(ahead[0].record)}" if ahead else ""
            message = f"the plan does not repeat what is recorded: it does {shown(found)}{where}"
            self.problem = Different(message, line, ahead[0].record if ahead else None, found)

    def _is_recorded(self, step: int, event: str, node: Node | None, more: Mapping[str, object]) -> bool:
        lines = self._ahead.get(step)
        if not lines or node is None:
            return False
        inside = {key: encode(value) for key, value in more.items()}
        for place, line in enumerate(lines):
            if line.event == event and line.path == node.path and details(line.record) == inside:
                node.number = int(line.record["node"])
                del lines[place]
                if not lines:
                    del self._ahead[step]
                return True
        return False

    def begin(self, root: Node, fail: Callable[[BaseException], object]) -> None:
        """Hand what goes wrong with the file to ``fail``."""
        self._inner.begin(root, fail)

    def end(self) -> None:
        """Write through."""
        self._inner.end()

    def sync(self) -> None:
        """Let what was written so far survive a crash of the machine."""
        self._inner.sync()


def shown(record: Mapping[str, Any]) -> str:
    """Return a record in one line: step, place in the tree, event, details."""
    where = record.get("path") or record.get("name")
    more = ", ".join(f"{key} {value}" for key, value in details(record).items() if key != "path")
    return " ".join(str(part) for part in (f"step {record['step']}:", where, record["event"], more) if part)


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


FROM_OUTSIDE = frozenset({"interrupted", "drained"})
"""Events that need not be the same when a run is repeated."""
_UNWRITABLE = (OSError, ValueError)
"""Errors of writing to a full or closed file."""
_UTF8 = ("utf-8", "backslashreplace")
"""Characters that UTF-8 cannot encode (lone surrogates) become JSON escapes."""
_json = json.JSONEncoder(ensure_ascii=False).encode
_quoted = json.encoder.encode_basestring


def _span(step: int, event: str, node: Node, parent: Node) -> dict[str, Any]:
    """Return what :meth:`Trace.write` makes of a node that starts or ends, in a fraction of the time."""
    number, above = node.number, parent.number
    return {"step": step, "event": event, "node": number, "parent": above, "kind": node.kind, "name": node.name}


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
