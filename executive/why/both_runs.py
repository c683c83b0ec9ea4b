"""The page of a failed run beside that of the run with the change, on one clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.outputs import write_text
from planlang.report.side_by_side import Side, side_by_side
from planlang.runs import RecordedRun
from planlang.temporary import temporary_folder


def write_both(
    path: Path, recorded: RecordedRun, failed: RunOptions, mended: RunOptions, told: tuple[str, str]
) -> None:
    """Write the page of both runs, which are run again for it; ``told`` are the sentence and the command.

    Raises BadInput if the file cannot be written, or the recorded run cannot be repeated.
    """
    sides = list[Side]()
    with temporary_folder() as folder:
        for name, options in (
            ("without the change", replace(failed, repeated=recorded)),
            ("with the change", replace(mended, repeated=None)),
        ):
            page = folder / f"{len(sides)}.html"
            run_plan_file(replace(options, report=page))
            sides.append(Side(name, page.read_text(encoding="utf-8")))
    end = recorded.last / int(recorded.header["rate"])
    write_text(path, side_by_side(*told, sides[0], sides[1], round(end, 4)))
