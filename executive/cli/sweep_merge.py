"""``planlang sweep-merge``: the shards of a sweep become one file."""

from __future__ import annotations

from executive.cli.arguments import SweepMergeArguments
from executive.cli.console import Answer
from executive.cli.sweep_table import answered
from executive.options.declaring import check_written
from executive.runs.files import refuse
from executive.sweeps.files import merged, read_sweep, write_sweep
from executive.sweeps.results import write_csv


def command(arguments: SweepMergeArguments) -> Answer:
    """Merge shards, and print the table of the whole sweep. Raises BadInput for shards of different sweeps."""
    refuse(check_written(arguments, SweepMergeArguments, {str(file): file for file in arguments.files}))
    whole = merged([read_sweep(file) for file in arguments.files])
    write_sweep(arguments.output, whole.header, whole.rows)
    if arguments.csv is not None:
        write_csv(arguments.csv, whole.rows)
    return answered(whole)
