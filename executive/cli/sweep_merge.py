"""``planlang sweep-merge``: the shards of a sweep become one file."""

from __future__ import annotations

from dataclasses import replace

from executive.cli.arguments import SweepMergeArguments
from executive.cli.console import Answer
from executive.cli.sweep_table import answered
from executive.runs.files import refuse
from executive.sweeps.comparison import comparison_of
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.results import check_results, write_results


def command(arguments: SweepMergeArguments) -> Answer:
    """Merge shards, and print the table of the whole sweep. Raises BadInput for shards of different sweeps."""
    refuse(check_results(arguments, SweepMergeArguments, {str(file): file for file in arguments.files}))
    whole = merged([read_sweep(file) for file in arguments.files])
    write_sweep(arguments.output, whole.header, whole.rows)
    whole = replace(whole, file=str(arguments.output))
    write_results(arguments, whole.file, whole.rows, comparison_of([whole]))
    return answered(whole)
