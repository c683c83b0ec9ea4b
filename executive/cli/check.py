"""``planlang check``: everything wrong with a recipe, plan or map; see :mod:`executive.commands.check`."""

from __future__ import annotations

from functools import partial

from executive.cli.console import progress_of, waiting
from executive.commands.answers import Answer
from executive.commands.arguments import CheckArguments
from executive.commands.check import check


def command(arguments: CheckArguments) -> Answer:
    """Check a file or a folder of recipes, or fix a recipe. Raises BadInput."""
    return check(arguments, report=progress_of(arguments), waiting=partial(waiting, arguments))
