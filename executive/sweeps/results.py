"""The files that show the results of a sweep: tables, figures, a page, and tests for CI."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.options.declaring import check_written
from executive.options.results import ResultFiles
from executive.sweeps.comparison import Comparison
from executive.sweeps.exports import junit_text, save_parquet
from executive.sweeps.records import Row, is_reached
from executive.sweeps.table import csv_text
from planlang.diagnostics import Diagnostic
from planlang.extras import no_parquet
from planlang.outputs import Named, replace, write_text

if TYPE_CHECKING:
    from executive.sweeps.comparison_page import Pages  # of figures, which most sweeps do not draw


def check_results(options: Any, kind: type, inputs: Mapping[Named, Path | None]) -> list[Diagnostic]:
    """Find problems with the files that a command writes, and with packages for them, before the work starts."""
    return [*check_written(options, kind, inputs), *(no_parquet() if options.parquet is not None else ())]


def write_results(
    files: ResultFiles, title: str, rows: Sequence[Row], comparison: Comparison, pages: Pages | None = None
) -> None:
    """Write the files that are named: tables of the rows, the others of the comparison. Raises BadInput.

    ``title`` names what was run; ``pages`` are those of worlds, which the page links.
    """
    if files.csv is not None:
        write_csv(files.csv, rows)
    if files.parquet is not None:
        replace(files.parquet, partial(save_parquet, rows=rows))
    if files.plot is not None:
        comparison.plot(files.plot, force=True)  # checked before the work
    if files.report is not None:
        comparison.report(files.report, title=title, pages=pages, force=True)
    if files.junit is not None:
        write_text(files.junit, junit_text(title, comparison.by_variant))


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV, atomically. Raises BadInput."""
    write_text(path, csv_text(rows))


def page_file(reports: Path, seed: Any, variant: str | None = None, number: int = 0) -> Path:
    """File for the page of a world, in a folder for its variant, which is the ``number``-th."""
    folder = "" if variant is None else f"{number + 1}-{re.sub(r'[^A-Za-z0-9=.,_-]+', '_', variant)}"
    return reports / folder / f"world-{seed}.html"


def pages_of(
    reports: Path | None, rows: Sequence[Row], compared: Sequence[Row], variants: Sequence[str] = ()
) -> dict[tuple[Any, Any], Path]:
    """Pages that a sweep wrote of its worlds: variant and seed of a row of the comparison -> file.

    ``rows`` are those of the sweep with these ``variants``, ``compared`` the same ones in the comparison.
    """
    if reports is None:
        return {}
    numbers = {name: number for number, name in enumerate(variants)}
    found = dict[tuple[Any, Any], Path]()
    for row, shown in zip(rows, compared, strict=True):
        if is_reached(row):
            continue
        name = row["variant"] if variants else None
        seed, number = (row["seed"], numbers[row["variant"]]) if variants else (row["world"], 0)
        file = page_file(reports, seed, name, number)
        if file.is_file():
            found[shown["variant"], shown["seed"]] = file
    return found
