"""The option ``--graph``: a drawing of the task, in the format that the file's suffix names."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from executive.cli.outputs import write_text
from planlang.diagnostics import Diagnostic, error

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan


def check_graph(path: Path | None) -> list[Diagnostic]:
    """An error if the suffix of the file names no format; nothing when no graph is asked for."""
    from planlang.compiler.drawing import FORMATS

    if path is None or path.suffix.lower() in FORMATS:
        return []
    what = f"the suffix {path.suffix}" if path.suffix else "a name without suffix"
    known = ", ".join(str(path.with_suffix(suffix)) for suffix in FORMATS) if path.name else ", ".join(FORMATS)
    return [error("C014", f"--graph {path}: {what} tells no format of a graph", help=f"write one of {known}")]


def write_graph(path: Path, plan: CompiledPlan) -> None:
    """Draw what a plan was compiled from into a file, or leave the old file as it was."""
    from planlang.compiler.drawing import FORMATS, task_graph

    write_text(path, FORMATS[path.suffix.lower()](task_graph(plan.recipes, plan.added, plan.recoveries)))
