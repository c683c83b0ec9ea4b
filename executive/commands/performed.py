"""Action classes that process modules perform, for checking recipes for steps that nothing performs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from executive.runs.files import check_files, check_trusted, refuse
from planlang.diagnostics import BadInput, Diagnostic
from planlang.recipe.actions import Performed
from planlang.registry import ModuleRegistry


def performed_by_modules(files: Sequence[Path] | None, diagnostics: list[Diagnostic], *, trust: bool) -> Performed:
    """Make a function that lists the classes performed by the user's files and by installed packages.

    Files are imported, and so executed, at once; packages at the first call, with problems appended to ``diagnostics``.
    Raises BadInput for a file that cannot be used, or was pulled from a server and is not trusted.
    """
    problems: list[Diagnostic] = []
    check_files(problems, modules=files)
    check_trusted(problems, files or (), trust=trust)
    refuse(problems)
    registry = ModuleRegistry()
    for file in files or ():
        registry.add_file(file)

    @cache
    def performed() -> frozenset[str]:
        try:
            registry.add_installed()
        except BadInput as problem:
            diagnostics.extend(problem.diagnostics)
        return registry.actions

    return performed
