"""``planlang sweep-merge``: the shards of a sweep become one file."""

from __future__ import annotations

from executive.cli.console import Answer
from executive.cli.inputs import refuse
from executive.cli.sweep_arguments import SweepMergeArguments
from executive.cli.sweep_results import counted, exit_code, write_csv
from executive.sweeps.files import Sweep, merged, read_sweep, write_sweep
from planlang.diagnostics import Diagnostic, warning
from planlang.outputs import check_outputs

MOST_NAMED = 10
"""Missing worlds that are named."""


def command(arguments: SweepMergeArguments) -> Answer:
    """Merge sweeps, and print the table of the whole; raises BadInput for different ones."""
    inputs = {str(file): file for file in arguments.files}
    refuse(check_outputs({"--out": arguments.out, "--csv": arguments.csv}, inputs, force=arguments.force))
    whole = merged([read_sweep(file) for file in arguments.files])
    write_sweep(arguments.out, whole.header, whole.rows)
    if arguments.csv is not None:
        write_csv(arguments.csv, whole.rows)
    return counted(whole.rows, len(whole.header["worlds"]), exit_code(whole.rows), incomplete(whole))


def incomplete(sweep: Sweep) -> list[Diagnostic]:
    """Return a warning if worlds are missing."""
    missing = sweep.missing
    if not missing:
        return []
    named = ", ".join(map(str, missing[:MOST_NAMED])) + (", ..." if len(missing) > MOST_NAMED else "")
    message = f"{len(missing)} of {len(sweep.header['worlds'])} worlds are missing: {named}"
    return [warning("C033", message, help="planlang sweep does them: name the file of their shard as --out")]
