"""Rows of a measurement: one line of JSON a task, appended when it has ended, so that a killed series goes on."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tests.benchmarks.homes.series import Case

Row = Mapping[str, Any]


def case_of(row: Row) -> Case:
    """Return the case that a row is of."""
    return Case(row["template"], row["seed"], row["robot"], bool(row.get("displaced")))


def read(*files: Path) -> list[Row]:
    """Return the rows of files, the first of each case; a last line that was cut off by a kill does not count."""
    found: dict[tuple[object, ...], Row] = {}
    for file in files:
        for line in file.read_text(encoding="utf-8").splitlines(keepends=True) if file.exists() else ():
            if line.endswith("\n"):
                row = json.loads(line)
                found.setdefault(case_of(row).key, row)
    return list(found.values())


def left(cases: Iterable[Case], done: Collection[Row]) -> Iterator[Case]:
    """Yield the cases of which there is no row yet."""
    known = {case_of(row).key for row in done}
    return (case for case in cases if case.key not in known)


def append(row: Row, file: Path) -> None:
    """Append a row in one write; a line that a kill has cut off is taken away first."""
    with file.open("ab+") as out:
        size = out.seek(0, 2)
        if size:
            out.seek(size - 1)
            if out.read(1) != b"\n":
                out.seek(0)
                out.truncate(out.read().rfind(b"\n") + 1)
        out.write(json.dumps(row, separators=(",", ":")).encode() + b"\n")
