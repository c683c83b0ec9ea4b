"""``planlang check``: everything wrong with a recipe, plan or map; see :mod:`executive.commands.check`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from executive import api
from executive.cli.authoring_arguments import CheckArguments
from executive.cli.console import Answer, ExitCode, progress_of, waiting
from executive.commands.checked import CheckResult


def command(arguments: CheckArguments) -> Answer:
    """Check a file or a folder of recipes, or fix a recipe. Raises BadInput."""
    options = replace(arguments, lists_contents=arguments.verbose)
    return answer_of(api.check(options, report=progress_of(arguments), waiting=partial(waiting, arguments)))


def answer_of(checked: CheckResult) -> Answer:
    """The answer of a command that checks a file."""
    code = ExitCode.DONE if checked.ok else ExitCode.BAD_INPUT
    code = ExitCode.MISSING_CAPABILITY if checked.lacks_reasoner else code
    return Answer(code, checked.diagnostics, checked.verdict, {"kind": checked.kind, **checked.data})
