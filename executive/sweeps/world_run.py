"""The job of sweeps of plans: one world, as :func:`executive.api.run` runs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

from executive.options.declaring import made
from executive.options.running import RunSettings
from executive.runs.options import Outcome, RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import Inputs
from executive.sweeps.records import LONGEST_MESSAGE, REFUSED, Row
from planlang.advice import Change
from planlang.diagnostics import BadInput
from planlang.outputs import make_folder
from planlang.words import COMMAND_LINE, said

INPUTS = Inputs()
"""Inputs of all worlds in this process, read once: they are the same for the whole sweep."""


def ended(world: Mapping[str, Any]) -> Row:
    """Run a world by its options, and return its row. Raises BadInput.

    A world may also have ``changes`` of its map and options, as JSON: if the run cannot begin with them, this is its
    row. ``report`` is the file for the page of a run that failed, or missed its goal; ``also`` names a function
    (``module:function``) of the result that makes further entries of the row.
    """
    changes = tuple(map(Change.of, world.get("changes", ())))
    options = RunOptions.of(made(RunSettings, world["options"]), changes=changes)
    try:
        result = run_plan_file(options, INPUTS)
    except BadInput as problem:
        if not changes:
            raise
        return {"outcome": REFUSED, "message": str(problem.diagnostics[0].message)}
    is_missed = result.outcome is Outcome.FAILED or (result.claimed and not result.reached)
    if is_missed and (page := world.get("report")) is not None:
        make_folder(Path(page).parent)
        run_plan_file(replace(options, report=Path(page)), INPUTS)
    also = resolve_name(world["also"])(result) if "also" in world else {}
    return {**_row(result), **also}


def _row(result: RunResult) -> Row:
    return {
        "outcome": result.outcome.value,
        "failure": list(result.failures),
        "message": said(result.message, COMMAND_LINE)[:LONGEST_MESSAGE],
        **result.goal_columns,
        "duration": round(result.duration, 3),
        "final_state": list(result.final_state),
        "largest_tilts": result.tilts.degrees(),
        **({} if result.faults is None else {"faults": result.faults.as_json()}),
    }
