"""``planlang sweep-table``: the table of a recorded sweep, or a comparison of several."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from executive.cli.arguments import SweepTableArguments, Verdict
from executive.cli.console import Answer, ExitCode
from executive.runs.files import refuse
from executive.runs.options import Outcome
from executive.sweeps import Row
from executive.sweeps.comparison import Comparison, comparison_of, notes_on
from executive.sweeps.files import Sweep, read_sweep
from executive.sweeps.records import is_reached
from executive.sweeps.results import check_results, pages_of, write_results
from executive.sweeps.table import causes, shares, table
from planlang.diagnostics import Diagnostic, warning

MOST_NAMED = 10
"""Maximum number of missing worlds that are listed."""


def command(arguments: SweepTableArguments) -> Answer:
    """Print the table. Raises BadInput for a file that is not a sweep."""
    refuse(check_results(arguments, SweepTableArguments, {str(file): file for file in arguments.files}))
    sweeps = [read_sweep(file) for file in arguments.files]
    first = sweeps[0]
    is_one, comparison = len(sweeps) == 1, comparison_of(sweeps)
    rows = first.rows if is_one else comparison.rows
    title = ", ".join(sweep.file for sweep in sweeps)
    write_results(arguments, title, rows, comparison, _pages(arguments.reports or (), sweeps, comparison.rows))
    answer = answered(first) if is_one else _compared(sweeps, comparison)
    return answer if arguments.fail_if is None else replace(answer, exit_code=code_of(comparison, arguments.fail_if))


def _pages(reports: Sequence[Path], sweeps: Sequence[Sweep], rows: Sequence[Row]) -> dict[tuple[Any, Any], Path]:
    """Pages of worlds, of which the sweeps wrote some to the folders of the same numbers."""
    found, rest = dict[tuple[Any, Any], Path](), list(rows)
    for sweep, folder in zip(sweeps, reports, strict=False):
        own, rest = rest[: len(sweep.rows)], rest[len(sweep.rows) :]
        found |= pages_of(folder, sweep.rows, own, list(sweep.variants))
    return found


def _compared(sweeps: Sequence[Sweep], comparison: Comparison) -> Answer:
    """Answer with a comparison of sweeps, each a variant, or several if it has some."""
    problems = [*notes_on(sweeps), *(one for sweep in sweeps for one in _incomplete(sweep))]
    return Answer(ExitCode.DONE, tuple(problems), str(comparison), comparison.as_json())


def code_of(comparison: Comparison, fails: Verdict | None) -> ExitCode:
    """FAILED if the comparison shows what is asked for; else DONE, as a comparison is no test of its variants."""
    found = {Verdict.WORSE: comparison.worse, Verdict.DIFFERENT: comparison.different}
    return ExitCode.FAILED if fails is not None and found[fails] else ExitCode.DONE


def answered(sweep: Sweep) -> Answer:
    """Answer with the table of a sweep, and a warning if worlds are missing."""
    total = len(sweep.header["worlds"])
    code, variants = exit_code(sweep.rows, total), sweep.variants
    found = [*notes_on([sweep]), *_incomplete(sweep)]
    table = counted(sweep.rows, total, code, found, variants=list(variants))
    if len(variants) < 2:
        return table
    comparison = Comparison.of(sweep.rows, variants)
    text = f"{table.text}\n\n{comparison.text_of_pairs}"  # as the table has the causes
    return replace(table, text=text, data={**table.data, **comparison.as_json()})


def _incomplete(sweep: Sweep) -> list[Diagnostic]:
    missing = sweep.missing
    if not missing:
        return []
    named = ", ".join(map(str, missing[:MOST_NAMED])) + (", ..." if len(missing) > MOST_NAMED else "")
    message = f"{len(missing)} of {len(sweep.header['worlds'])} worlds are missing: {named}"
    return [warning("C033", message, help="planlang sweep runs them if --output names the file of their shard")]


def counted(
    rows: Sequence[Row],
    total: int,
    code: ExitCode,
    diagnostics: Sequence[Diagnostic] = (),
    *,
    variants: Sequence[str] = (),
) -> Answer:
    """Answer with the table of the rows, of ``total`` worlds; with ``variants`` with one for each of them."""
    if not variants:
        data = {"worlds": total, **_statistics(rows), "rows": list(rows)}
        return Answer(code, tuple(diagnostics), table(rows, total), data)
    own = {name: [row for row in rows if row["variant"] == name] for name in variants}
    each = total // len(variants)
    text = "\n\n".join(f"{name}: {table(some, each)}" for name, some in own.items())
    data = {"worlds": total, "variants": [{"name": name, **_statistics(some)} for name, some in own.items()]}
    return Answer(code, tuple(diagnostics), text, {**data, "rows": list(rows)})


def _statistics(rows: Sequence[Row]) -> dict[str, list[dict[str, Any]]]:
    return {
        "outcomes": [asdict(one) for one in shares(rows)],
        "causes": [asdict(one) for one in causes(rows)],
    }


def exit_code(rows: Sequence[Row], total: int) -> ExitCode:
    """DONE if all worlds reached their goal; MISSING_CAPABILITY if no run began; else FAILED."""
    if len(rows) == total and all(map(is_reached, rows)):
        return ExitCode.DONE
    refused = rows and all(row.get("outcome") == Outcome.LACKS_CAPABILITY.value for row in rows)
    return ExitCode.MISSING_CAPABILITY if refused else ExitCode.FAILED
