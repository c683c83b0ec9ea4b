"""``planlang sweep-table``: the table of a sweep that was kept in a file."""

from __future__ import annotations

from executive.cli.console import Answer
from executive.cli.inputs import refuse
from executive.cli.sweep_arguments import SweepTableArguments
from executive.cli.sweep_merge import incomplete
from executive.cli.sweep_results import counted, exit_code, write_csv
from executive.sweeps.files import read_sweep
from planlang.outputs import check_outputs


def command(arguments: SweepTableArguments) -> Answer:
    """Print the table; raises BadInput for a file that is no sweep."""
    refuse(check_outputs({"--csv": arguments.csv}, {"the sweep": arguments.file}, force=arguments.force))
    sweep = read_sweep(arguments.file)
    if arguments.csv is not None:
        write_csv(arguments.csv, sweep.rows)
    return counted(sweep.rows, len(sweep.header["worlds"]), exit_code(sweep.rows), incomplete(sweep))
