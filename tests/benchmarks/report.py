"""What the page of a run costs: CPU time of looking on and of writing, beside that of the run without it.

``python tests/benchmarks/report.py [RECIPE] [PAIRS]``
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any

from executive.report.watching import Watching
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file

SPENT: Counter[str] = Counter()
"""CPU seconds of the parts of a page."""


def timed(name: str) -> Callable[..., Any]:
    """Return a method of what looks on that adds up its CPU time."""
    method = getattr(Watching, name)

    def called(self: Watching, *arguments: Any) -> Any:
        begun = time.process_time()
        try:
            return method(self, *arguments)
        finally:
            SPENT[name] += time.process_time() - begun

    return called


def main(recipe: str = "wipe_table", pairs: str = "3") -> None:
    """Print pairs of runs without and with a page, in one process, and the medians."""
    for name in ("listen", "look", "save"):
        setattr(Watching, name, timed(name))
    options = RunOptions(recipe=recipe)
    shares = []
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "run.html"
        run_plan_file(replace(options, report=page))  # everything is imported, caches are filled
        for _ in range(int(pairs)):
            SPENT.clear()
            begun = time.process_time()
            alone = run_plan_file(options)
            between = time.process_time()
            run_plan_file(replace(options, report=page))
            without, with_page = between - begun, time.process_time() - between
            looking = SPENT["look"] + SPENT["listen"]
            shares.append(looking / without)
            print(
                f"{recipe}, {alone.duration:.0f} s of plan time: {without:.2f} s CPU, {with_page:.2f} s with a page; "
                f"looking on {looking:.2f} s, writing {SPENT['save']:.2f} s, {page.stat().st_size / 1e6:.2f} MB"
            )
    print(f"looking on takes {100 * median(shares):.1f} %, median of {pairs} pairs")


if __name__ == "__main__":
    main(*sys.argv[1:])
