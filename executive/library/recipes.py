"""``planlang.compile`` and ``planlang.check``, which need neither world nor robot."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

from executive.commands.answers import Answer, ExitCode
from executive.commands.arguments import CheckArguments, CompileArguments
from executive.commands.check import check as checked_file
from executive.commands.check import find_checked
from executive.commands.compile import compiled
from executive.library.arguments import arguments_of, with_options_of
from executive.library.checked import CheckResult
from executive.library.sources import Source, file_of
from planlang.compiler import CompiledPlan
from planlang.diagnostics import BadInput, Severity


@with_options_of(CompileArguments)
def compile(recipe: Source, *, task: str | None = None, **options: Any) -> CompiledPlan:
    """Compile a recipe to a plan in Python, as ``planlang compile`` does.

    ``recipe`` is the name of a bundled recipe, a path, or the text of a recipe; ``task`` selects one of several. The
    plan has ``source``, ``graph``, ``diagnostics`` (warnings and notes) and ``save(path)``. Raises BadInput with all
    errors of the recipe.
    """
    with file_of(recipe) as file:
        plan, _ = compiled(arguments_of(CompileArguments, {"recipe": file.path, "task": task}, options))
    return replace(plan, diagnostics=file.located(plan.diagnostics))


@with_options_of(CheckArguments)
def check(file: Source, **options: Any) -> CheckResult:
    """Check a recipe, a plan, a map or a folder of recipes, as ``planlang check`` does; nothing is run.

    ``file`` is the name of a bundled recipe or map, a path, or a text. The result has all ``diagnostics``; ``ok`` is
    True without errors. Raises BadInput only if the file cannot be read, or an option is invalid.
    """
    with file_of(file) as named:
        path = named.path or ""
        arguments = arguments_of(CheckArguments, {"file": path}, options)
        if not os.path.isdir(path):
            find_checked(path)
        try:
            answer = checked_file(arguments)
        except BadInput as problem:
            if all(one.span is None for one in problem.diagnostics if one.severity is Severity.ERROR):
                raise
            answer = Answer(ExitCode.BAD_INPUT, problem.diagnostics, data={"kind": "recipe"})
    diagnostics = named.located(answer.diagnostics)
    return CheckResult(answer.exit_code is ExitCode.DONE, answer.data["kind"], answer.text, diagnostics, answer.data)
