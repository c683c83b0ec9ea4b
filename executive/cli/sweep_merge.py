"""``planlang sweep-merge``: the shards of a sweep become one file."""

from __future__ import annotations

from executive.cli.arguments import SweepMergeArguments
from executive.cli.console import Answer
from executive.cli.sweep_table import answered, write_csv
from executive.runs.files import refuse
from executive.sweeps.files import merged, read_sweep, write_sweep
from planlang.outputs import check_outputs


def command(arguments: SweepMergeArguments) -> Answer:
    """Merge shards, and print the table of the whole sweep. Raises BadInput for shards of different sweeps."""
    inputs = {str(file): file for file in arguments.files}
    refuse(check_outputs({"--output": arguments.output, "--csv": arguments.csv}, inputs, force=arguments.force))
    whole = merged([read_sweep(file) for file in arguments.files])
    write_sweep(arguments.output, whole.header, whole.rows)
    if arguments.csv is not None:
        write_csv(arguments.csv, whole.rows)
    return answered(whole)
