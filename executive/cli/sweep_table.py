"""``planlang sweep-table``: the table of a recorded sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from executive.cli.arguments import SweepTableArguments
from executive.cli.console import Answer, ExitCode
from executive.options.declaring import check_written
from executive.runs.files import refuse
from executive.runs.options import Outcome
from executive.sweeps import Row
from executive.sweeps.files import Sweep, read_sweep
from executive.sweeps.records import is_reached
from executive.sweeps.table import causes, csv_text, shares, table
from planlang.diagnostics import Diagnostic, warning
from planlang.outputs import write_text

MOST_NAMED = 10
"""Maximum number of missing worlds that are listed."""


def command(arguments: SweepTableArguments) -> Answer:
    """Print the table. Raises BadInput for a file that is not a sweep."""
    refuse(check_written(arguments, SweepTableArguments, {"the sweep": arguments.file}))
    sweep = read_sweep(arguments.file)
    if arguments.csv is not None:
        write_csv(arguments.csv, sweep.rows)
    return answered(sweep)


def answered(sweep: Sweep) -> Answer:
    """Answer with the table of a sweep, and a warning if worlds are missing."""
    total = len(sweep.header["worlds"])
    return counted(sweep.rows, total, exit_code(sweep.rows, total), _incomplete(sweep))


def _incomplete(sweep: Sweep) -> list[Diagnostic]:
    missing = sweep.missing
    if not missing:
        return []
    named = ", ".join(map(str, missing[:MOST_NAMED])) + (", ..." if len(missing) > MOST_NAMED else "")
    message = f"{len(missing)} of {len(sweep.header['worlds'])} worlds are missing: {named}"
    return [warning("C033", message, help="planlang sweep runs them if --output names the file of their shard")]


def counted(rows: Sequence[Row], total: int, code: ExitCode, diagnostics: Sequence[Diagnostic] = ()) -> Answer:
    """Answer with the table of the rows, of ``total`` worlds."""
    data = {
        "worlds": total,
        "outcomes": [asdict(one) for one in shares(rows)],
        "causes": [asdict(one) for one in causes(rows)],
        "rows": list(rows),
    }
    return Answer(code, tuple(diagnostics), table(rows, total), data)


def exit_code(rows: Sequence[Row], total: int) -> ExitCode:
    """DONE if all worlds reached their goal; MISSING_CAPABILITY if no run began; else FAILED."""
    if len(rows) == total and all(map(is_reached, rows)):
        return ExitCode.DONE
    refused = rows and all(row.get("outcome") == Outcome.LACKS_CAPABILITY.value for row in rows)
    return ExitCode.MISSING_CAPABILITY if refused else ExitCode.FAILED


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV, atomically. Raises BadInput."""
    write_text(path, csv_text(rows))
