"""``planlang sweep``: a plan or recipe is run in many worlds, and its outcomes are counted."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from executive import api
from executive.cli.arguments import CompareArguments, SweepArguments
from executive.cli.console import Answer, ExitCode, printer_of, progress_of, say, show, silent
from executive.cli.progress import PROGRESS
from executive.cli.sweep_table import counted, exit_code
from executive.sweeps import Row
from executive.sweeps.records import CRASHED, Done, is_reached
from executive.sweeps.variants import variants_of
from planlang.progress import Report


def command(arguments: SweepArguments) -> Answer:
    """Run the sweep, or the rest of it. Raises BadInput as the run of one world does."""
    rows, total, is_done = watched(arguments)
    code = exit_code(rows, total) if is_done else ExitCode.INTERRUPTED
    return counted(rows, total, code, variants=[one.name for one in variants_of(arguments)])


def watched(arguments: SweepArguments | CompareArguments, command: str = "sweep") -> tuple[list[Row], int, bool]:
    """Run a sweep with its progress; returns its rows, the number of worlds in all, and False if it was interrupted.

    The rows are then those that were done. Advice names the ``command``. Raises BadInput as the run of one world does.
    """
    rows: dict[Any, Row] = {}
    part, parts = arguments.shard or (1, 1)
    variants = [one.name for one in variants_of(arguments)]
    seeds = len(range(arguments.first + part - 1, arguments.first + arguments.worlds, parts))
    total = seeds * max(1, len(variants))
    tell = printer_of(arguments)
    progress = Counts(total, tell, progress_of(arguments))

    def finished(done: Done) -> None:
        rows[done.row["world"]] = done.row
        progress.count(done)

    def resumed(all_rows: Sequence[Row]) -> None:
        rows.update((row["world"], row) for row in all_rows)
        progress.resumed(all_rows)

    announce = silent if arguments.json else partial(show, detail=arguments.detail)
    try:
        all_rows = api.sweep(
            arguments, announce=announce, finished=finished, resumed=resumed, say=tell, command=command
        )
    except KeyboardInterrupt:
        PROGRESS.close()
        done = sorted(rows.values(), key=lambda row: _place(row, variants))
        say(_how_to_go_on(arguments, len(done), total))
        return done, total, False
    return all_rows, total, True


def _place(row: Row, variants: Sequence[str]) -> tuple[int, int]:
    """Where the row of a world comes: its seed, then its variant."""
    return (row["seed"], variants.index(row["variant"])) if variants else (row["world"], 0)


def _how_to_go_on(arguments: SweepArguments | CompareArguments, done: int, total: int) -> str:
    if arguments.output is None:
        return f"interrupted after {done} of {total} worlds; --output FILE would have kept them"
    return (
        f"interrupted after {done} of {total} worlds, which {arguments.output} has: repeat the command to run the rest"
    )


class Counts:
    """Counts worlds, and reports how fast they are done."""

    def __init__(self, total: int, say: Callable[[str], None], report: Report) -> None:
        """Start the clock; ``say`` prints a line, ``report`` shows progress."""
        self._total, self._say, self._report = total, say, report
        self._before = self._done = self._reached = self._crashed = 0
        self._began, self._seconds = time.monotonic(), 0.0
        self._workers: Counter[str] = Counter()
        """Worlds by worker of a cluster."""

    def resumed(self, rows: Sequence[Row]) -> None:
        """Count worlds of an earlier call, which do not count for the rate."""
        self._before = len(rows)
        for row in rows:
            self._count(row)
        if rows:
            self._say(f"{len(rows)} of {self._total} worlds were done before")
        self._began = time.monotonic()
        self._report(f"{self._done} of {self._total} worlds", self._done / self._total)

    def count(self, done: Done) -> None:
        """Count a world."""
        self._count(done.row)
        self._seconds += done.seconds
        self._workers[done.worker] += 1
        self._report(self._line(time.monotonic() - self._began), self._done / self._total)

    def _count(self, row: Row) -> None:
        self._done += 1
        self._reached += is_reached(row)
        self._crashed += row.get("outcome") == CRASHED

    def _line(self, seconds: float) -> str:
        new = self._done - self._before
        rate = new / max(seconds, 1e-6)
        counts = f"{self._reached} reached" + (f", {self._crashed} crashed" if self._crashed else "")
        each = f"{60 * rate:.0f} a minute{self._of_workers(seconds)}, {self._seconds / new:.2f} s of CPU each"
        return f"{self._done} of {self._total} worlds, {counts}; {each}"

    def _of_workers(self, seconds: float) -> str:
        """Say how many worlds a worker of a cluster does in a minute."""
        rates = sorted(60 * count / max(seconds, 1e-6) for name, count in self._workers.items() if name)
        if not rates:
            return ""
        if len(rates) == 1:
            return " on one worker"
        return f" on {len(rates)} workers, {rates[0]:.0f} to {rates[-1]:.0f} each"
