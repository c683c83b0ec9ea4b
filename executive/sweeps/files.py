"""Files of sweeps (JSON lines): a header that identifies the sweep, then one row for each finished world.

Rows are appended as worlds finish, and sorted by world at the end. An incomplete last line, left by a killed process,
is dropped. No row depends on time, on the number of processes or on shards: equal sweeps have equal files.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import stat
import time
from codecs import BOM_UTF8
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Any

from executive.sweeps.headers import Header, differences
from executive.sweeps.records import Row, World
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import read_file
from planlang.outputs import MARK, unwritable, write_text
from planlang.records import dataclass
from planlang.runs.schema import FLAG, NUMBER, TEXT, TEXTS, wrong_entry
from planlang.words import Blank, Text, calling

LARGEST = 1_000_000_000
"""Largest file that can be read [bytes]."""
SYNCED_EVERY = 5.0
"""Interval of fsync [s]: a crash of the machine loses at most this much work, a crash of planlang none."""
_WHOLE = [1, 1]
_ROW = {
    **dict.fromkeys(("outcome", "message", "repeat"), TEXT),
    **{"reached": FLAG, "claimed": FLAG, "failure": TEXTS, "duration": NUMBER},
}
"""What the entries of a row have to be, if they are there."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Content of a file: its header, and the rows of finished worlds in the order of the file."""

    file: str
    header: Header
    rows: tuple[Row, ...]
    torn: int = 0
    """Length of an incomplete last line [bytes]."""

    @property
    def variants(self) -> Mapping[str, Mapping[str, str]]:
        """Variants -> what varies in the sweep, in this variant; empty for a sweep without variants."""
        variants: Mapping[str, Mapping[str, str]] = self.header["about"].get("variants", {})
        return variants

    @property
    def missing(self) -> tuple[Any, ...]:
        """Keys of worlds without a row, including those of other shards."""
        done = {row["world"] for row in self.rows}
        return tuple(key for key in self.header["worlds"] if key not in done)


def header_of(job: str, about: Mapping[str, Any], worlds: Sequence[World], shard: tuple[int, int]) -> Header:
    """Build the header of a file; only equal sweeps have equal headers."""
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
    """Output file of a sweep, locked while it is open."""

    def __init__(self, path: Path, descriptor: int, sweep: Sweep) -> None:
        self.rows = sweep.rows
        self._path, self._descriptor, self._header = path, descriptor, sweep.header
        self._synced = time.monotonic()

    @classmethod
    @contextmanager
    def opened(cls, path: Path, header: Header) -> Iterator[SweepFile]:
        """Create a file, or open an existing one to resume its sweep.

        Raises BadInput if it is not the file of this sweep, if another process has locked it, or if it cannot be
        written.
        """
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NONBLOCK | os.O_NOFOLLOW, 0o666)
        except (OSError, ValueError) as problem:
            raise BadInput([unwritable(path, problem)]) from None
        try:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise BadInput([error("C004", f"{path} is not a regular file, which a sweep needs to resume")])
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                raise BadInput([error("C032", f"another process is writing {path}")]) from None
            yield cls(path, descriptor, _resume(path, descriptor, header))
        finally:
            os.close(descriptor)

    def append(self, row: Row) -> None:
        """Append a row."""
        os.write(self._descriptor, f"{_line(row)}\n".encode())
        if time.monotonic() - self._synced > SYNCED_EVERY:
            os.fsync(self._descriptor)
            self._synced = time.monotonic()

    def finish(self, rows: Sequence[Row]) -> None:
        """Rewrite the file atomically with all rows in their final order."""
        write_sweep(self._path, self._header, rows)


def write_sweep(path: Path, header: Header, rows: Sequence[Row]) -> None:
    """Write a whole file atomically. Raises BadInput."""
    write_text(path, "".join(f"{_line(one)}\n" for one in (header, *rows)))


def read_sweep(path: Path) -> Sweep:
    """Read the file of a sweep; an incomplete last line is ignored. Raises BadInput if it is invalid otherwise."""
    content = read_file(path, largest=LARGEST)
    *lines, rest = content.removeprefix(BOM_UTF8).split(b"\n")
    if not lines:
        raise BadInput([_invalid(path, 1)])
    header = _parse(lines[0], path, 1)
    if header.get("sweep") != MARK or not _is_header(header):
        raise BadInput([_invalid(path, 1)])
    known, variants, rows = set(header["worlds"]), header["about"].get("variants", {}), dict[Any, Row]()
    for number, line in enumerate(lines[1:], 2):
        row = _parse(line, path, number)
        key = row.get("world")
        if not isinstance(key, int | str) or key not in known or key in rows:
            message = f"world {str(key)[:100]} is not part of the sweep, or has two lines"
            raise BadInput([error("C030", message, Span(str(path), number))])
        wrong = wrong_entry(row, _ROW)
        if wrong is None and variants and not _is_of_variant(row, variants):
            wrong = "it has no variant of the header, or another seed"
        if wrong is not None:
            raise BadInput([error("C030", f"this line of a sweep is damaged: {wrong}", Span(str(path), number))])
        rows[key] = row
    return Sweep(str(path), header, tuple(rows.values()), len(rest))


def _resume(path: Path, descriptor: int, header: Header) -> Sweep:
    """Read the rows of a file and cut off an incomplete last line; write the header if the file is empty."""
    first = f"{_line(header)}\n".encode()
    if first.startswith(os.pread(descriptor, len(first), 0)) and os.fstat(descriptor).st_size < len(first):
        os.ftruncate(descriptor, 0)  # empty, or the header is incomplete
        os.write(descriptor, first)
        return Sweep(str(path), header, ())
    sweep = read_sweep(path)
    found = differences(sweep.header, header)
    if not found and sweep.header["shard"] != header["shard"]:
        found = [f"shard is {_shard(sweep.header)}, not {_shard(header)}"]
    if found:
        advice = "choose another file, or delete this one"
        message = f"{path} belongs to another sweep: {'; '.join(found)}"
        raise BadInput([error("C031", message, Span(str(path), 1), advice)])
    if sweep.torn:
        os.ftruncate(descriptor, os.fstat(descriptor).st_size - sweep.torn)
    return sweep


def merged(sweeps: Sequence[Sweep]) -> Sweep:
    """Merge the shards of a sweep. Raises BadInput if they belong to different sweeps or have contradictory rows."""
    first, problems = sweeps[0], list[Diagnostic]()
    rows: dict[Any, tuple[Row, str]] = {}
    for sweep in sweeps:
        if found := differences(sweep.header, first.header):
            message = f"{sweep.file} belongs to another sweep than {first.file}: {'; '.join(found)}"
            problems.append(error("C031", message, Span(sweep.file, 1)))
            continue
        for row in sweep.rows:
            earlier, file = rows.setdefault(row["world"], (row, sweep.file))
            if earlier != row:
                message = f"world {row['world']} ended differently from {file}"
                advice = "repeat this world: one machine was slower or has different software"
                problems.append(error("C031", message, Span(sweep.file), advice))
    if problems:
        raise BadInput(problems)
    ordered = tuple(rows[key][0] for key in first.header["worlds"] if key in rows)
    return Sweep(first.file, {**first.header, "shard": _WHOLE}, ordered)


def _shard(header: Header) -> str:
    return "/".join(map(str, header["shard"]))


def _is_header(header: Row) -> bool:
    kinds = {"version": str, "job": str, "about": dict, "shard": list, "worlds_sha256": str, "worlds": list}
    return (
        all(isinstance(header.get(name), kind) for name, kind in kinds.items())
        and all(isinstance(key, int | str) for key in header["worlds"])
        and _are_variants(header["about"].get("variants", {}))
    )


def _is_of_variant(row: Row, variants: Mapping[str, Any]) -> bool:
    name, seed = row.get("variant"), row.get("seed")
    is_known = isinstance(name, str) and name in variants and type(seed) is int
    return is_known and row["world"] == f"{name} {seed}"


def _are_variants(found: Any) -> bool:
    return isinstance(found, dict) and all(isinstance(columns, dict) for columns in found.values())


def _parse(line: bytes, path: Path, number: int) -> Row:
    try:
        row = json.loads(line.decode())
    except (ValueError, RecursionError):
        row = None
    if not isinstance(row, dict):
        raise BadInput([_invalid(path, number)])
    return row


WRITTEN = calling("sweep", Blank("RECIPE"), output=Blank("FILE"))
"""Writes the file of a sweep."""


def _invalid(path: Path, line: int) -> Diagnostic:
    message = "this is not the file of a sweep" if line == 1 else "this line of a sweep is damaged"
    return error("C030", message, Span(str(path), line), Text("write one with ", WRITTEN))


def _line(value: Mapping[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False)
