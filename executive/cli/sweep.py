"""``planlang sweep``: a plan or recipe is run in many worlds, and its outcomes are counted."""

from __future__ import annotations

import hashlib
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import typer

from executive.cli.arguments import SweepArguments
from executive.cli.command_lines import parsed, words_of
from executive.cli.console import Answer, ExitCode, say, show
from executive.cli.inputs import refuse
from executive.cli.progress import PROGRESS
from executive.cli.run import options_of
from executive.cli.sweep_table import counted, exit_code, write_csv
from executive.runs.options import RunOptions
from executive.sweeps import Row, World, run
from executive.sweeps.records import CRASHED, LIMITS, Done, is_reached
from planlang.outputs import check_outputs
from planlang.progress import Report

JOB = "executive.cli.swept_world:ended"
_WALL_PER_CPU = 5.0
"""Seconds of wall clock that a world has for each of CPU: other programs may use the cores, too."""


def command(arguments: SweepArguments) -> Answer:
    """Run the sweep, or the rest of it; raises BadInput as the run of one world does."""
    rows: dict[Any, Row] = {}
    total = len(_seeds(arguments, *_shard(arguments.shard)))
    progress = Counts(total, arguments.tell, arguments.progress)

    def resumed(found: Sequence[Row]) -> None:
        rows.update((row["world"], row) for row in found)
        progress.resumed(found)

    try:
        found = swept(arguments, progress, resumed, rows)
    except KeyboardInterrupt:
        PROGRESS.close()
        done = [rows[key] for key in sorted(rows)]
        say(_how_to_go_on(arguments, len(done), total))
        return counted(done, total, ExitCode.INTERRUPTED)
    if arguments.csv is not None:
        write_csv(arguments.csv, found)
    return counted(found, total, exit_code(found, total))


def swept(
    arguments: SweepArguments,
    progress: Counts | None = None,
    resumed: Callable[[Sequence[Row]], object] = lambda rows: None,
    rows: dict[Any, Row] | None = None,
) -> list[Row]:
    """Return the rows of a sweep, in the order of its worlds; ``rows`` gets them as they are done. Raises BadInput."""
    words = [arguments.recipe, *words_of(arguments)]
    seeds = range(arguments.first, arguments.first + arguments.worlds)
    pages = arguments.reports
    worlds: list[World] = [
        {
            "world": seed,
            "repeat": shlex.join(["planlang", "run", *words, "--seed", str(seed)]),
            **({} if pages is None else {"report": str(pages / f"world-{seed}.html")}),
        }
        for seed in seeds
    ]
    options = options_of(parsed([*words, "--json"]))  # what is wrong for all worlds is said before the first
    _check(arguments, options)
    if not arguments.json:
        show(options.notes, arguments.detail)
    kept: dict[Any, Row] = {} if rows is None else rows

    def told(done: Any) -> None:
        kept[done.row["world"]] = done.row
        if progress is not None:
            progress.told(done)

    return run(
        worlds,
        JOB,
        processes=arguments.processes,
        limits=replace(LIMITS, **_limits(arguments)),
        out=arguments.out,
        about=_about(arguments, words, options),
        shard=_shard(arguments.shard),
        told=told,
        resumed=resumed,
    )


def _limits(arguments: SweepArguments) -> dict[str, Any]:
    seconds = arguments.seconds
    return {"seconds": seconds, "memory": arguments.memory * 1_000_000, "wall": _WALL_PER_CPU * seconds}


def _check(arguments: SweepArguments, options: RunOptions) -> None:
    """Raise BadInput if a file cannot be written, or would overwrite an input."""
    outputs = {"--out": arguments.out, "--csv": arguments.csv}
    refuse(check_outputs(outputs, dict(_inputs(options)), force=arguments.force))


def _inputs(options: RunOptions) -> Iterator[tuple[str, Path]]:
    """Yield the files that the runs depend on, by what they are called."""
    named = {"recipe": options.recipe, "plan": options.plan, "robot": options.robot, "urdf": options.urdf}
    named["environment"] = options.environment
    yield from ((name, path) for name, path in named.items() if path is not None)
    for name, paths in (("environment", options.additions), ("modules", options.modules or ())):
        yield from ((f"{name} {number}", path) for number, path in enumerate(paths, 2))


def _about(arguments: SweepArguments, words: Sequence[str], options: RunOptions) -> Mapping[str, Any]:
    """Return what the rows depend on: the command and its settings, limits, and what is in the files."""
    digests = {f"content of {name}": hashlib.sha256(path.read_bytes()).hexdigest() for name, path in _inputs(options)}
    return {
        "arguments": shlex.join(words),
        "settings": dict(options.bindings or {}),
        "--seconds": arguments.seconds,
        "--memory": arguments.memory,
        **digests,
    }


def _shard(text: str | None) -> tuple[int, int]:
    """Return (k, n) of "k/n"; raises a usage error."""
    if text is None:
        return 1, 1
    try:
        part, parts = map(int, text.split("/"))
    except ValueError:
        part, parts = 0, 0
    if not 1 <= part <= parts:
        raise typer.BadParameter(f"--shard {text} is not K/N with K from 1 to N; write for example --shard 3/16")
    return part, parts


def _seeds(arguments: SweepArguments, part: int, parts: int) -> range:
    return range(arguments.first + part - 1, arguments.first + arguments.worlds, parts)


def _how_to_go_on(arguments: SweepArguments, done: int, total: int) -> str:
    if arguments.out is None:
        return f"interrupted after {done} of {total} worlds; --out FILE would keep them"
    return f"interrupted after {done} of {total} worlds, which {arguments.out} has: the same command does the rest"


class Counts:
    """Counts worlds, and reports how fast they are done."""

    def __init__(self, total: int, tell: Callable[[str], None], report: Report) -> None:
        """Begin now; ``tell`` prints a line, ``report`` shows the progress."""
        self._total, self._tell, self._report = total, tell, report
        self._before = self._done = self._reached = self._crashed = 0
        self._began, self._seconds = time.monotonic(), 0.0

    def resumed(self, rows: Sequence[Row]) -> None:
        """Count what was done before; it does not count for the rate."""
        self._before = len(rows)
        for row in rows:
            self._count(row)
        if rows:
            self._tell(f"{len(rows)} of {self._total} worlds were done before")
        self._began = time.monotonic()
        self._report(f"{self._done} of {self._total} worlds", self._done / self._total)

    def told(self, done: Done) -> None:
        """Count a world."""
        self._count(done.row)
        self._seconds += done.seconds
        self._report(self._line(time.monotonic() - self._began), self._done / self._total)

    def _count(self, row: Row) -> None:
        self._done += 1
        self._reached += is_reached(row)
        self._crashed += row.get("outcome") == CRASHED

    def _line(self, seconds: float) -> str:
        new = self._done - self._before
        rate = new / max(seconds, 1e-6)
        counts = f"{self._reached} reached" + (f", {self._crashed} crashed" if self._crashed else "")
        each = f"{60 * rate:.0f} a minute, {self._seconds / new:.2f} s of CPU each"
        return f"{self._done} of {self._total} worlds, {counts}; {each}"
