"""Options for the files with which a sweep shows its results: tables, figures, a page, results of tests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from executive.options.declaring import written
from planlang.outputs import PNG_OR_SVG
from planlang.records import dataclass


@dataclass(frozen=True, kw_only=True)
class ResultFiles:
    """Files that are written once all worlds are done."""

    csv: Annotated[Path | None, written("Also write the rows as CSV.")] = None
    parquet: Annotated[Path | None, written("Also write the rows as Parquet (needs the extra parquet).")] = None
    plot: Annotated[
        Path | None,
        written(
            "Draw goals reached with intervals, worlds not yet reached over plan time, and causes, as PNG or SVG.",
            PNG_OR_SVG,
        ),
    ] = None
    report: Annotated[
        Path | None, written("Write an HTML page with tables, figures, and the worlds in which variants differ.")
    ] = None
    junit: Annotated[
        Path | None, written("Write a JUnit file for CI: a test for each world, failed if the goal was not reached.")
    ] = None
