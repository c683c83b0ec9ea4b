"""Files of sweeps: a line that says what is swept, then a line of JSON for each world that has been done.

Lines are appended as worlds are done, and sorted by world when all are. What a killed process left of a last line is
dropped. No line depends on time, on the number of processes or on shards: equal sweeps have equal files.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import stat
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from executive.sweeps.records import Row, World
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import read_file
from planlang.outputs import MARK, write_text
from planlang.records import dataclass

LARGEST = 1_000_000_000
"""Largest file that is read [bytes]."""
SYNCED_EVERY = 5.0
"""Seconds after which lines are forced to the disk: so much is lost if the machine fails; if planlang does, nothing."""
_WHOLE = [1, 1]
Header = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Sweep:
    """The content of a file: what is swept, and the rows of worlds that have been done, in the order of the file."""

    file: str
    header: Header
    rows: tuple[Row, ...]
    torn: int = 0
    """Length of an incomplete last line [bytes]."""

    @property
    def missing(self) -> tuple[Any, ...]:
        """The keys of worlds without a row: of all worlds, also those of other shards."""
        done = {row["world"] for row in self.rows}
        return tuple(key for key in self.header["worlds"] if key not in done)


def header_of(job: str, about: Mapping[str, Any], worlds: Sequence[World], shard: tuple[int, int]) -> Header:
    """Return the first line of a sweep's file; it is the same for equal sweeps only."""
    digest = hashlib.sha256("\n".join(map(_line, worlds)).encode())
    return {
        "sweep": MARK,
        "version": version("planlang"),
        "job": job,
        "about": json.loads(_line(about)),
        "shard": list(shard),
        "worlds_sha256": digest.hexdigest(),
        "worlds": [world["world"] for world in worlds],
    }


class SweepFile:
    """A file that a sweep is written to."""

    def __init__(self, path: Path, descriptor: int, sweep: Sweep) -> None:
        self.rows = sweep.rows
        self._path, self._descriptor, self._header = path, descriptor, sweep.header
        self._synced = time.monotonic()

    @classmethod
    @contextmanager
    def opened(cls, path: Path, header: Header) -> Iterator[SweepFile]:
        """Open a file to go on with its sweep, or a new one.

        Raises BadInput if it holds something else or another sweep, if another process writes it, or it cannot be
        written.
        """
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK, 0o666)
        except OSError as problem:
            raise BadInput([error("C004", f"{path} cannot be written: {problem.strerror}")]) from None
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise BadInput([error("C004", f"{path} is no file: a sweep reads it, too")])
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise BadInput([error("C032", f"another process is writing {path}")]) from None
            yield cls(path, descriptor, _gone_on_with(path, descriptor, header))
        finally:
            os.close(descriptor)

    def append(self, row: Row) -> None:
        """Write a row as the last line."""
        os.write(self._descriptor, f"{_line(row)}\n".encode())
        if time.monotonic() - self._synced > SYNCED_EVERY:
            os.fsync(self._descriptor)
            self._synced = time.monotonic()

    def finish(self, rows: Sequence[Row]) -> None:
        """Sort the lines, at once or not at all: these are all rows, in their order."""
        write_sweep(self._path, self._header, rows)


def write_sweep(path: Path, header: Header, rows: Sequence[Row]) -> None:
    """Write a whole file, at once or not at all. Raises BadInput."""
    write_text(path, "".join(f"{_line(one)}\n" for one in (header, *rows)))


def read_sweep(path: Path) -> Sweep:
    """Read the file of a sweep. Raises BadInput if it is none, or damaged other than by an incomplete last line."""
    content = read_file(path, largest=LARGEST)
    *lines, rest = content.split(b"\n")
    if not lines:
        raise BadInput([_none(path, 1)])
    header = _parsed(lines[0], path, 1)
    if header.get("sweep") != MARK or not _is_header(header):
        raise BadInput([_none(path, 1)])
    known, rows = set(header["worlds"]), dict[Any, Row]()
    for number, line in enumerate(lines[1:], 2):
        row = _parsed(line, path, number)
        key = row.get("world")
        if not isinstance(key, int | str) or key not in known or key in rows:
            message = f"this is no world of the sweep, or a second line of one: {str(key)[:100]}"
            raise BadInput([error("C030", message, Span(str(path), number))])
        rows[key] = row
    return Sweep(str(path), header, tuple(rows.values()), len(rest))


def differences(header: Header, other: Header) -> list[str]:
    """Return what differs between two sweeps, in words; nothing for the same one, or shards of it."""
    found = [f"{name} is {there!s:.200}, not {here!s:.200}" for name, there, here in _different(header, other)]
    if len(header["worlds"]) != len(other["worlds"]):
        found.append(f"it has {len(header['worlds'])} worlds, not {len(other['worlds'])}")
    elif not found and header["worlds_sha256"] != other["worlds_sha256"]:
        found.append("the worlds differ")
    return found


def _different(header: Header, other: Header) -> Iterator[tuple[str, Any, Any]]:
    for name in ("version", "job"):
        if header[name] != other[name]:
            yield name, header[name], other[name]
    there, here = header["about"], other["about"]
    for name in sorted({*there, *here}):
        if there.get(name) != here.get(name):
            yield name, there.get(name), here.get(name)


def _gone_on_with(path: Path, descriptor: int, header: Header) -> Sweep:
    """Return what a file has of a sweep, without a torn last line; begin it if it is empty."""
    first = f"{_line(header)}\n".encode()
    if first.startswith(os.pread(descriptor, len(first), 0)) and os.fstat(descriptor).st_size < len(first):
        os.ftruncate(descriptor, 0)  # empty, or its first line is torn
        os.write(descriptor, first)
        return Sweep(str(path), header, ())
    sweep = read_sweep(path)
    found = differences(sweep.header, header)
    if not found and sweep.header["shard"] != header["shard"]:
        found = [f"shard is {_shard(sweep.header)}, not {_shard(header)}"]
    if found:
        advice = "name another file, or delete this one"
        raise BadInput([error("C031", f"{path} has another sweep: {'; '.join(found)}", Span(str(path), 1), advice)])
    if sweep.torn:
        os.ftruncate(descriptor, os.fstat(descriptor).st_size - sweep.torn)
    return sweep


def merged(sweeps: Sequence[Sweep]) -> Sweep:
    """Return shards of one sweep together; raises BadInput for different sweeps, and for rows that contradict."""
    first, problems = sweeps[0], list[Diagnostic]()
    rows: dict[Any, tuple[Row, str]] = {}
    for sweep in sweeps:
        if found := differences(sweep.header, first.header):
            message = f"{sweep.file} has another sweep than {first.file}: {'; '.join(found)}"
            problems.append(error("C031", message, Span(sweep.file, 1)))
            continue
        for row in sweep.rows:
            before, file = rows.setdefault(row["world"], (row, sweep.file))
            if before != row:
                message = f"world {row['world']} ended otherwise than in {file}"
                problems.append(
                    error("C031", message, Span(sweep.file), "repeat it: one machine was slower, or differs")
                )
    if problems:
        raise BadInput(problems)
    ordered = tuple(rows[key][0] for key in first.header["worlds"] if key in rows)
    return Sweep(first.file, {**first.header, "shard": _WHOLE}, ordered)


def _shard(header: Header) -> str:
    return "/".join(map(str, header["shard"]))


def _is_header(header: Row) -> bool:
    kinds = {"version": str, "job": str, "about": dict, "shard": list, "worlds_sha256": str, "worlds": list}
    return all(isinstance(header.get(name), kind) for name, kind in kinds.items()) and all(
        isinstance(key, int | str) for key in header["worlds"]
    )


def _parsed(line: bytes, path: Path, number: int) -> Row:
    try:
        found = json.loads(line.decode())
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise BadInput([_none(path, number)])
    return found


def _none(path: Path, line: int) -> Diagnostic:
    message = "this file has no sweep" if line == 1 else "this line of a sweep is damaged"
    return error("C030", message, Span(str(path), line), "planlang sweep RECIPE --out FILE writes one")


def _line(value: Mapping[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False)
