"""The trace of a run: one JSON object per line, keys in a fixed order, equal bytes for equal runs.

The trace of a resumed run begins with the records of its past, which the plan repeats before it continues.
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

from planlang.closure import grouped
from planlang.kernel.errors import RunError
from planlang.kernel.signals import BaseFluent
from planlang.kernel.tree import SUCCEEDED, Node, Status
from planlang.misuse import Usage, WrongType, contrast, written
from planlang.outputs import beside, is_device, open_output
from planlang.runs.codec import PLAIN, SCHEMA, Exact, encode
from planlang.runs.recorded_run import BOOKKEEPING, SPANS, Line, Past, details

_AT = Usage("Trace.at", {"path": '"run.jsonl"'}, {"header": '{"version": "1.0"}'})


Listener = Callable[[Mapping[str, Any], Node | None], object]


def _check_header(header: object) -> None:
    if header is not None:
        _AT.instance("header", header, Mapping, "a mapping, such as versions")


class Earlier(Protocol):
    """Records at the start of the trace of a continued run."""

    @property
    def kept(self) -> Sequence[Line]:
        """The records, the header first."""

    @property
    def nodes(self) -> int:
        """The highest number of a node."""


class Trace:
    """Writes the events of a run, line by line, to a text file or a list.

    Every record begins with ``step`` (plan time in world steps) and ``event``; the first one is the header. A record of
    a node has its number as ``node`` and its path element as ``name``; records of starts and ends also have ``parent``,
    the number of the parent node, and ``kind``. Numbers count from 1, the root, in order of appearance, so that the
    length of a record does not grow with the depth; ``planlang.runs.with_paths`` restores the paths.

    Without ``out`` the records are stored in ``events``. ``header`` has further entries of the header, such as versions
    and hashes.
    """

    is_compared = False
    """True if :meth:`write` compares records, so that all of them have to pass through it."""

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
        """Writes and flushes a line; returns the number of bytes written."""
        self._on_failure: Callable[[BaseException], object] | None = None
        self._header = dict(header or {})
        self.listeners: tuple[Listener, ...] = ()
        """Called with each record when it is written, and with its node."""
        self._nodes = 0
        self.continues = False
        """True if the trace begins with the records of an earlier one."""
        self._names: dict[str, str] = {}
        self._parent_number = -1
        self._parent_text = ""
        self._format_step(0)
        if out is not None and not isinstance(out, list):
            self._file, self._put = out, _through(out)

    @classmethod
    def at(
        cls, path: str | os.PathLike[str], header: Mapping[str, object] | None = None, *, earlier: Earlier | None = None
    ) -> Self:
        """Open a trace file, flushed line by line; an existing file is renamed to ``NAME.old``.

        Devices and pipes are written to directly.

        ``earlier`` has the records of a continued run. They are written before an existing file is renamed, to the next
        free name of ``NAME.old``, ``NAME.old2``, ..., so that no trace is lost.
        """
        _AT.instance("path", path, (str, os.PathLike), "the path of a file")
        if path == "":
            raise _AT.empty("path")
        _check_header(header)
        target = Path(path)
        trace = cls(None, header)
        if earlier is None:
            if _is_file(target):
                target.replace(beside(target, ".old"))
            trace._open(target)
            return trace
        new_file = target if is_device(target) else beside(target, ".new", ".")
        if new_file is not target:
            new_file.unlink(missing_ok=True)
        trace._open(new_file)
        trace.take_over((line.record for line in earlier.kept), earlier.nodes)
        if new_file is not target:
            if _is_file(target):
                target.replace(_free(target))
            new_file.replace(target)
        return trace

    def _open(self, path: Path) -> None:
        self._file = open_output(path)
        self._put = self._file.write

    def write_header(self, **known: object) -> None:
        """Write the header, with these entries and those of the constructor."""
        self._nodes = 0
        self.write(0, "header", schema=SCHEMA, **known, **self._header)

    def take_over(self, records: Iterable[Mapping[str, Any]], nodes: int) -> None:
        """Begin with the records of an earlier trace, whose highest node number is ``nodes``."""
        self.continues = True
        self._nodes = nodes
        for record in records:
            if self._put is None:
                self.events.append(dict(record))
            else:
                self._send(_line(dict(record)))

    def write(self, step: int, event: str, node: Node | None = None, /, **details: object) -> None:
        """Write a record of a node, or of the run as a whole; details are encoded at once, in their order."""
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
            except BaseException as problem:  # the listener is removed, and its error ends the run
                self.listeners = tuple(other for other in self.listeners if other is not listener)
                self._fail(problem)

    def _send(self, text: str) -> None:
        self._write_through(text.encode(*_UTF8))

    def _write_through(self, data: bytes) -> None:
        """Write a whole line, in parts if a nearly full disk requires it; stop writing after an error."""
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
        """Pass errors of writing to ``fail`` during the run, as raising them would interrupt the event loop."""
        self._on_failure = fail

    def end(self) -> None:
        """Flush the trace; later errors are raised."""
        self._on_failure = None
        self.flush()

    def started(self, step: int, node: Node, /, **details: object) -> None:
        """Write the start of a node."""
        parent = node.parent
        if details or parent is None or self.is_compared or self.listeners:
            self.write(step, "started", node, **details)
            return
        self._nodes = number = node.number = self._nodes + 1
        if self._put is None:
            self.events.append(_span(step, "started", node, parent))
            return
        # The same bytes as from write(), in a fraction of the time: repeated parts are formatted only once.
        if step != self._step:
            self._format_step(step)
        parent_number = parent.number
        if parent_number != self._parent_number:
            self._parent_number = parent_number
            self._parent_text = f', "parent": {parent_number}, "kind": "'
        name = self._names.get(node.base_name)
        if name is None:
            name = self._names[node.base_name] = _quoted(node.base_name)[:-1].encode(*_UTF8).decode()
        ordinal = "" if node.ordinal == 1 else f"#{node.ordinal}"
        written = node.written = f'{number}{self._parent_text}{node.kind}", "name": {name}{ordinal}"'
        data = f"{self._started}{written}}}\n".encode()
        try:
            written_bytes = self._put(data)
        except _UNWRITABLE as error:
            self._stop(error)
            return
        if written_bytes != len(data):
            self._write_through(data[written_bytes:])

    def ended(
        self, step: int, node: Node, outcome: Status, result: object = None, failure: BaseException | None = None
    ) -> None:
        """Write the end of a node."""
        word = outcome._value_
        if failure is not None:
            try:
                self.write(step, "ended", node, status=word, failure=failure)
                return
            except RecursionError:
                pass  # the failure is nested too deeply to be encoded: write the end without it
        elif result is not None and outcome is SUCCEEDED:
            self.write(step, "ended", node, status=word, result=result)
            return
        if node.written and self._put is not None:
            if step != self._step:
                self._format_step(step)
            data = f'{self._ended}{node.written}, "status": "{word}"}}\n'.encode()
            try:
                written_bytes = self._put(data)
            except _UNWRITABLE as error:
                self._stop(error)
                return
            if written_bytes != len(data):
                self._write_through(data[written_bytes:])
        elif node.number and node.parent is not None and self._put is None and not (self.is_compared or self.listeners):
            self.events.append(_span(step, "ended", node, node.parent) | {"status": word})
        else:
            self.write(step, "ended", node, status=word)

    def _format_step(self, step: int) -> None:
        """Format the beginnings of records of a step."""
        self._step = step
        self._started = f'{{"step": {step}, "event": "started", "node": '
        self._ended = f'{{"step": {step}, "event": "ended", "node": '

    def text(self) -> str:
        """The records in memory as JSON Lines."""
        return "".join(map(_line, self.events))

    def changed(self, fluent: BaseFluent[Any]) -> None:
        """Ignore changes of fluents; only their effects on the plan are recorded."""

    def charged(self, kind: str, part: str, number: int) -> None:
        """Ignore charges to budgets."""

    def sync(self) -> None:
        """Write a file opened by :meth:`at` to disk, so that it survives a crash of the machine."""
        if isinstance(self._file, io.FileIO):
            with suppress(OSError):  # fsync fails for pipes and devices
                os.fsync(self._file.fileno())

    def flush(self) -> None:
        """Flush the file."""
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
    """A run deviates from the recorded one that it repeats; ``line`` is that of the record, None after the last."""

    def __init__(self, message: str, line: int | None, recorded: object = None, found: object = None) -> None:
        super().__init__(message)
        self.line, self.recorded, self.found = line, recorded, found


class ResumedTrace(Trace):
    """Trace of a resumed run: compares records with the past until :meth:`go_on`, then writes them to ``inner``.

    A record may match any one of the same step, as concurrent tasks may write theirs in a different order. The first
    difference is stored in :attr:`problem`, to be raised by the journal.
    """

    is_compared = True

    def __init__(self, inner: Trace, past: Past) -> None:
        super().__init__(inner.events)
        self._inner = inner
        self._ahead = grouped((line.step, line) for line in past.expected())
        self._going_on = False
        self.problem: Different | None = None
        if not inner.continues:
            inner.take_over((line.record for line in past.kept), past.nodes)

    def go_on(self, step: int, past: Past) -> None:
        """Write all further records, as the past has been repeated."""
        self._going_on = True
        again = {"again": Exact(list(past.again))} if past.again else {}
        self._inner.write(step, "resumed", **again)

    def check(self, now: int) -> None:
        """Raise Different if a record of a step up to ``now`` was not repeated."""
        if self.problem is None and self._ahead:
            step = min(self._ahead)
            if step <= now:
                line = self._ahead[step][0]
                self.problem = Different(
                    f"the plan does not repeat line {line.number} of the trace: {shown(line.record)}",
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
            where = f" instead of line {line} of the trace, {shown(ahead[0].record)}" if ahead else ""
            message = f"the plan does not repeat the recorded run: {shown(found)}{where}"
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
        """Pass errors of writing to ``fail``."""
        self._inner.begin(root, fail)

    def end(self) -> None:
        """Flush the trace."""
        self._inner.end()

    def sync(self) -> None:
        """Write the trace to disk."""
        self._inner.sync()


def shown(record: Mapping[str, Any]) -> str:
    """Format a record in one line: step, path, event, details."""
    where = record.get("path") or record.get("name")
    more = ", ".join(f"{key} {value}" for key, value in details(record).items() if key != "path")
    return " ".join(str(part) for part in (f"step {record['step']}:", where, record["event"], more) if part)


def with_paths(events: Iterable[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the records of a trace with the ``path`` of their nodes: names from the root, joined by ``/``."""
    paths: dict[int, str] = {}
    for event in events:
        number = event.get("node")
        if number is None:
            yield dict(event)
            continue
        if number not in paths:
            parent_path = paths.get(event["parent"])
            paths[number] = event["name"] if parent_path is None else f"{parent_path}/{event['name']}"
        yield {**event, "path": paths[number]}


FROM_OUTSIDE = frozenset({"interrupted", "drained"})
"""Events caused from outside, which a repeated run need not repeat."""
_UNWRITABLE = (OSError, ValueError)
"""Errors of writing to a full or closed file."""
_UTF8 = ("utf-8", "backslashreplace")
"""Characters that UTF-8 cannot encode (lone surrogates) become JSON escapes."""
_json = json.JSONEncoder(ensure_ascii=False).encode
_quoted = json.encoder.encode_basestring


def _span(step: int, event: str, node: Node, parent: Node) -> dict[str, Any]:
    """Make the same record as :meth:`Trace.write` for the start or end of a node, in a fraction of the time."""
    number, parent_number = node.number, parent.number
    return {"step": step, "event": event, "node": number, "parent": parent_number, "kind": node.kind, "name": node.name}


def _free(target: Path) -> Path:
    """First free name for an older file."""
    number = 1
    while True:
        older = beside(target, f".old{number if number > 1 else ''}")
        if not os.path.lexists(older):
            return older
        number += 1


def _is_file(path: Path) -> bool:
    """Check for a file or a link, wherever it leads; not for a folder or a device."""
    return os.path.lexists(path) and not path.is_dir() and not is_device(path)


def _through(file: TextIO) -> Callable[[bytes], int]:
    def put(data: bytes) -> int:
        file.write(data.decode())
        file.flush()
        return len(data)

    return put


def _line(record: dict[str, Any]) -> str:
    return _json(record) + "\n"
