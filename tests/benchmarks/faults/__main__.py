"""Measure how plans end when things go wrong: at several rates, in several tasks, and each kind of fault by name.

    python -m tests.benchmarks.faults                              a world of each cell, with a development seed
    python -m tests.benchmarks.faults --worlds 10 --only kinds     ten worlds of each kind
    python -m tests.benchmarks.faults acceptance --docs            the whole, at most 4 hours on two cores
    python -m tests.benchmarks.faults acceptance --share 0.1       a tenth of it
    python -m tests.benchmarks.faults --only door:stuck,arm:stalls --worlds 2

Development seeds may be looked into. Acceptance seeds follow from the commit, whose files have kinds, tasks and
settings, so that nobody has seen their worlds; a series that was looked into is burnt, and stands in ``burnt.json``.
Rows are kept in a file, and the same command goes on with it; if it has all, only the tables are written again.

A run is *reached* if the plan is done and its goals hold in the true world; a *false success* if they do not hold. It
has *recovered* if it is reached and the fault happened. ``senses.py`` says what *carries* a fault first, and what shows
that it was *noticed*. A failure *names* a fault if a class that the table of kinds declares for it is in its chain. A
thing is *held in vain* if the robot believes for more than a second, or at the end, that it holds what it does not. A
run is *mute* if it ended neither as done nor with a failure. The exit code is 1 if there is a false success with
recoveries, and 2 if the series cannot begin.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from executive.processes.workers import Limits
from executive.sweeps import Row
from executive.sweeps import run as sweep
from planlang.diagnostics import BadInput
from tests.benchmarks.faults.cameras import MADE, TOP
from tests.benchmarks.faults.series import BURNT, MEASURED, PARTS, WHAT, cells_of, worlds_of
from tests.benchmarks.faults.table import BEGIN, END, is_false, tables
from tests.benchmarks.homes.progress import Progress
from tests.benchmarks.homes.series import SPAN, NotAccepted, acceptance_series, commit_measured
from tests.benchmarks.homes.table import documented

JOB = "tests.benchmarks.faults.trial:job"
LIMITS = Limits(seconds=300, memory=3_000_000_000, wall=1800.0)
PAGE = TOP / "docs" / "reference" / "faults.md"


def main(words: Sequence[str] | None = None) -> int:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.benchmarks.faults", description=(__doc__ or "").split("\n")[0]
    )
    parser.add_argument("series", nargs="?", default="development", choices=("development", "acceptance"))
    parser.add_argument("--only", default="", metavar="PART,...", help=f"{', '.join(PARTS)}, tasks or kinds")
    parser.add_argument("--worlds", type=int, default=None, help="of each cell at most; 1 for a development series")
    parser.add_argument("--share", type=float, default=1.0, help="share of the worlds of each cell, from 0 to 1")
    parser.add_argument("--first", type=int, default=1, help="first development seed")
    parser.add_argument("--jobs", type=int, default=None, help="processes; as many as cores by default")
    parser.add_argument("--commit", default=None, help="the commit whose rows there are, if it is not checked out")
    parser.add_argument("--out", type=Path, help="file of rows, which is gone on with; default: one in .venv/faults")
    parser.add_argument("--docs", action="store_true", help="write the tables to docs/reference/faults.md")
    given = parser.parse_args(words)
    try:
        rows, about = _rows(given)
    except (NotAccepted, BadInput, ValueError) as problem:
        print(problem, file=sys.stderr)
        return 2
    text = "\n".join((about, "", *tables(rows)))
    print(text)
    if given.docs:
        PAGE.write_text(documented(PAGE.read_text(encoding="utf-8"), text, BEGIN, END), encoding="utf-8")
    return int(any(is_false(row) for row in rows if not row.get("bare")))


def _rows(given: argparse.Namespace) -> tuple[list[Row], str]:
    """Run what is missing of a series; return its rows, and a sentence on what they are of."""
    is_accepted = given.series == "acceptance"
    commit = given.commit or commit_measured(allow_changes=not is_accepted, measured=MEASURED)
    first = acceptance_series(commit, SPAN, BURNT, WHAT)[0] if is_accepted else given.first
    most = given.worlds or (None if is_accepted or given.share < 1.0 else 1)
    only = [one for one in given.only.split(",") if one]
    worlds = worlds_of(cells_of(only), first, most=most, share=given.share)
    name = "-".join((given.series, commit[:12], *only, f"{len(worlds)}")).replace(":", "_")
    out = given.out or MADE / f"{name}.jsonl"
    out.parent.mkdir(parents=True, exist_ok=True)
    told = Progress(len(worlds), 48)
    about = {"series": given.series, "commit": commit}
    rows = sweep(
        worlds, JOB, processes=given.jobs, limits=LIMITS, out=out, about=about, told=told, resumed=told.resumed
    )
    seeds = f"the {given.series} series of commit `{commit[:12]}`, seeds from {first} on"
    return rows, f"{len(rows)} worlds of {seeds}. Shares have Wilson's 95 % intervals."


if __name__ == "__main__":
    sys.exit(main())
