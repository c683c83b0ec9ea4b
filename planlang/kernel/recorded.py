"""A trace that was written, read back: its records with their lines and places in the tree, and how far it got."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planlang.kernel.trace import SCHEMA

LONGEST_LINE = 20_000_000
"""Bytes of one line of a trace that are read at most."""


class DamagedTrace(ValueError):
    """A file is no trace, or a line of it is damaged; ``line`` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(message)
        self.line = line


@dataclass(frozen=True, slots=True)
class Line:
    """One record: its line in the file, counted from 1, and the path of the node it is about, if it is about one."""

    number: int
    record: Mapping[str, Any]
    path: str | None

    @property
    def step(self) -> int:
        """Plan time in world steps."""
        return int(self.record["step"])

    @property
    def event(self) -> str:
        """What happened."""
        return str(self.record["event"])


@dataclass(slots=True)
class RecordedRun:
    """The records of a run, the header first. ``torn``: the last line was cut off and is left out."""

    lines: list[Line]
    torn: bool = False
    name: str = "the trace"
    header: Mapping[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        self.header = self.lines[0].record

    @property
    def last(self) -> int:
        """The step of the last record."""
        return self.lines[-1].step

    @property
    def outcome(self) -> str | None:
        """How the plan ended: "succeeded", "failed" or "evaporated"; None if the record ends before."""
        root = next((line.path for line in self.lines if line.event == "started"), None)
        for line in reversed(self.lines):
            if line.event == "ended" and line.path == root:
                return str(line.record.get("status"))
        return None

    @staticmethod
    def read(path: str | os.PathLike[str]) -> RecordedRun:
        """From a file; raises OSError, DamagedTrace."""
        place = Path(path)
        texts: list[bytes] = []
        with place.open("rb") as file:
            while text := file.readline(LONGEST_LINE + 1):
                if len(text) > LONGEST_LINE:
                    raise DamagedTrace(f"a line of more than {LONGEST_LINE // 1_000_000} MB", len(texts) + 1)
                texts.append(text)
        torn = bool(texts) and not texts[-1].endswith(b"\n")
        records: list[object] = []
        for number, text in enumerate(texts, 1):
            try:
                records.append(json.loads(text))
            except (ValueError, RecursionError) as problem:
                if torn and number == len(texts) and number > 1:
                    break
                raise DamagedTrace(f"this is no JSON: {_reason(problem)}", number) from None
        else:
            torn = False
        return RecordedRun(_lines(records), torn, str(path))

    @staticmethod
    def of(events: Sequence[Mapping[str, Any]]) -> RecordedRun:
        """From the records that a trace has kept; raises DamagedTrace."""
        return RecordedRun(_lines(events))


def _reason(problem: Exception) -> str:
    return getattr(problem, "msg", None) or ("too deeply nested" if isinstance(problem, RecursionError) else "no UTF-8")


def _lines(records: Iterable[object]) -> list[Line]:
    lines: list[Line] = []
    paths: dict[int, str] = {}
    step = 0
    for number, record in enumerate(records, 1):
        match record:
            case {"step": int(now), "event": str()} if not isinstance(now, bool) and now >= 0:
                pass
            case _:
                raise DamagedTrace("this is no record of a trace: it has no step and event", number)
        assert isinstance(record, Mapping)
        if number == 1:
            _check_header(record)
        if now < step:
            raise DamagedTrace(f"step {now} comes after step {step}", number)
        step = now
        lines.append(Line(number, record, _path(record, paths, number)))
    if not lines:
        raise DamagedTrace("the trace is empty", 1)
    return lines


def _check_header(record: Mapping[str, Any]) -> None:
    if record["event"] != "header":
        raise DamagedTrace("a trace begins with its header", 1)
    if record.get("schema") != SCHEMA:
        raise DamagedTrace(f"schema {record.get('schema')!r}; this version reads and writes schema {SCHEMA}", 1)


def _path(record: Mapping[str, Any], paths: dict[int, str], number: int) -> str | None:
    if "node" not in record:
        return None
    node = record["node"]
    if not isinstance(node, int):
        raise DamagedTrace("a node is told by its number", number)
    if node not in paths:
        match record:
            case {"node": int(), "parent": None, "name": str(name)}:
                paths[node] = name
            case {"node": int(), "parent": int(parent), "name": str(name)} if parent in paths:
                paths[node] = f"{paths[parent]}/{name}"
            case _:
                raise DamagedTrace("the record is about a node that has not started", number)
    return paths[node]
