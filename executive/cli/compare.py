"""``planlang compare``: variants are run in the same worlds, and compared in pairs."""

from __future__ import annotations

from executive.cli.arguments import CompareArguments
from executive.cli.console import Answer, ExitCode
from executive.cli.sweep import watched
from executive.cli.sweep_table import code_of
from executive.commands.compare import compared_variants
from executive.sweeps.comparison import Comparison


def command(arguments: CompareArguments) -> Answer:
    """Run the variants, or the rest of their worlds, and compare them. Raises BadInput as the run of one world does."""
    variants = compared_variants(arguments)
    rows, _, is_done = watched(arguments, "compare")
    comparison = Comparison.of(rows, variants)
    code = code_of(comparison, arguments.fail_if) if is_done else ExitCode.INTERRUPTED
    return Answer(code, (), str(comparison), comparison.as_json())
