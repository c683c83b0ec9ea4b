"""What the commands of sweeps print of their rows, and where else they write it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from executive.cli.console import Answer, ExitCode
from executive.runs.options import Outcome
from executive.sweeps import Row
from executive.sweeps.records import is_reached
from executive.sweeps.table import causes, csv_text, shares, table
from planlang.diagnostics import Diagnostic
from planlang.outputs import write_text


def counted(rows: Sequence[Row], total: int, code: ExitCode, found: Sequence[Diagnostic] = ()) -> Answer:
    """Return the table of the rows; ``total``: how many there should be."""
    data = {
        "worlds": total,
        "outcomes": [asdict(one) for one in shares(rows)],
        "causes": [asdict(one) for one in causes(rows)],
        "rows": list(rows),
    }
    return Answer(code, tuple(found), table(rows, total), data)


def exit_code(rows: Sequence[Row]) -> ExitCode:
    """Return DONE if all worlds were reached; MISSING_CAPABILITY if no run began; else FAILED."""
    if all(map(is_reached, rows)):
        return ExitCode.DONE
    refused = all(row.get("outcome") == Outcome.LACKS_CAPABILITY.value for row in rows)
    return ExitCode.MISSING_CAPABILITY if refused else ExitCode.FAILED


def write_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV, at once or not at all. Raises BadInput."""
    write_text(path, csv_text(rows))
