"""``planlang check``: everything wrong with a recipe, plan or map; see :mod:`executive.commands.check`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from executive import api
from executive.cli.answers import Answer, answer_of
from executive.cli.arguments import CheckArguments
from executive.cli.console import progress_of, waiting


def command(arguments: CheckArguments) -> Answer:
    """Check a file or a folder of recipes, or fix a recipe. Raises BadInput."""
    options = replace(arguments, lists_contents=arguments.verbose)
    return answer_of(api.check(options, report=progress_of(arguments), waiting=partial(waiting, arguments)))
