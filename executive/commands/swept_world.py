"""The job of a sweep: one world, as :func:`executive.api.run` runs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from executive.options.declaring import made
from executive.options.running import RunSettings
from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import Inputs
from executive.sweeps.records import LONGEST_MESSAGE
from planlang.outputs import make_folder
from planlang.words import COMMAND_LINE, said

INPUTS = Inputs()
"""Inputs of all worlds in this process, read once: they are the same for the whole sweep."""


def ended(world: Mapping[str, Any]) -> dict[str, Any]:
    """Run a world by its options, and return its row. Raises BadInput."""
    options = RunOptions.of(made(RunSettings, world["options"]))
    result = run_plan_file(options, INPUTS)
    if result.outcome is Outcome.FAILED and (page := world.get("report")) is not None:
        make_folder(Path(page).parent)
        run_plan_file(replace(options, report=Path(page)), INPUTS)
    return {
        "outcome": result.outcome.value,
        "failure": list(result.failures),
        "message": said(result.message, COMMAND_LINE)[:LONGEST_MESSAGE],
        "duration": round(result.duration, 3),
        "final_state": list(result.final_state),
        "largest_tilts": result.tilts.degrees(),
    }
