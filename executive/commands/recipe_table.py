"""A folder of recipes as a table: whether each task in each file compiles, with its warnings or its first error."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

from executive.commands.checked import CheckResult
from executive.commands.map_check import contents_in_words
from planlang.compiler import compile_ontology
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, error
from planlang.files import ONTOLOGIES, printable
from planlang.ontology import load
from planlang.progress import Report
from planlang.recipe import Actions
from planlang.recipe.reading import top_tasks
from planlang.records import dataclass

MOST_FILES = 2_000
"""Maximum number of files: a larger folder is not a collection of recipes."""


@dataclass(frozen=True, slots=True)
class Row:
    """A task of a file: number of ``steps``, of those that nothing performs, and codes of warnings.

    ``refused`` is the first error, None if the task compiles; ``task`` is None for a file without one.
    """

    file: str
    task: str | None
    steps: int = 0
    unperformed: int = 0
    warnings: str = ""
    refused: str | None = None
    map: str | None = None
    """Contents of the file in words, if it is a map."""


def check_folder(folder: Path, folders: Sequence[Path], report: Report) -> CheckResult:
    """Compile every task of every file, reporting progress. Raises BadInput for a folder without ontologies."""
    files = list(_files(folder))
    if not files:
        advice = f"recipes have one of the suffixes {', '.join(ONTOLOGIES)}"
        raise BadInput([error("C001", f"no recipes in the folder {folder}", help=advice)])
    if len(files) > MOST_FILES:
        raise BadInput(
            [error("C001", f"more than {MOST_FILES} files in the folder {folder}", help="check one of its subfolders")]
        )
    rows: list[Row] = []
    for number, file in enumerate(files):
        report(f"checking file {number + 1} of {len(files)}", number / len(files))
        rows += _rows(file, folder, folders)
    maps = sum(row.map is not None for row in rows)
    compiled = sum(row.refused is None for row in rows) - maps
    lines = ["| file | task | steps | nothing performs | warnings | refused for |", "|---|---|---|---|---|---|"]
    lines += [f"| {' | '.join(_cells(row))} |" for row in rows]
    last = f"{compiled} of {len(rows) - maps} compile"
    if maps:
        last += f"; {maps} {'is a map' if maps == 1 else 'are maps'}"
    text = "\n".join((*lines, "", last))
    is_ok = compiled + maps == len(rows)
    return CheckResult(is_ok, "folder", text, (), {"recipes": [asdict(row) for row in rows]})


def _files(folder: Path) -> Iterator[Path]:
    """Yield the recipe files below a folder, by name; links to folders are not followed."""
    for here, below, names in os.walk(folder):
        below.sort()
        yield from (Path(here, name) for name in sorted(names) if name.endswith(ONTOLOGIES))


def _rows(file: Path, folder: Path, folders: Sequence[Path]) -> Iterator[Row]:
    name = printable(str(file.relative_to(folder)))
    try:
        ontology = load(file, folders=folders)
    except BadInput as problem:
        yield Row(name, None, refused=_reason(problem.diagnostics))
        return
    for task in top_tasks(Actions(ontology)) or (None,):
        short = local_name(task) if task is not None else None
        try:
            plan = compile_ontology(ontology, task=task)
        except BadInput as problem:
            contents = contents_in_words(ontology) if task is None else None
            yield Row(name, short, refused=_reason(problem.diagnostics) if contents is None else None, map=contents)
            continue
        steps = sum(len(recipe.steps) for recipe in plan.recipes.recipes.values())
        codes = Counter(one.code for one in plan.diagnostics if one.severity is Severity.WARNING)
        unperformed = codes.pop("R021", 0)
        warnings = ", ".join(f"{number} {code}" for code, number in sorted(codes.items()))
        yield Row(name, plan.task, steps, unperformed, warnings)


def _reason(diagnostics: Sequence[Diagnostic]) -> str:
    first = next(one for one in diagnostics if one.severity is Severity.ERROR)
    line = f", line {first.span.line}" if first.span is not None and first.span.line else ""
    return f"{first.code}{line}: {first.message}"


def _cells(row: Row) -> tuple[str, ...]:
    if row.map is not None:
        return row.file, f"a map of {row.map}", "", "", "", ""
    numbers = ("", "") if row.refused else (str(row.steps), str(row.unperformed))
    return row.file, row.task or "", *numbers, row.warnings, (row.refused or "").replace("|", "\\|")
