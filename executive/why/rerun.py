"""The job of a worker: the run again, with changes; and how far it got."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.options.declaring import made
from executive.options.running import RunSettings
from executive.runs.options import RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import Inputs
from executive.sweeps import Row
from executive.sweeps.records import LONGEST_MESSAGE
from executive.why.evidence import Evidence
from planlang.advice import Change
from planlang.diagnostics import BadInput
from planlang.words import COMMAND_LINE, said

JOB = "executive.why.rerun:ended"
REFUSED = "refused"
"""Outcome of a run that cannot begin with its changes."""
_INPUTS = Inputs()
"""Inputs that all reruns of this process have in common."""


def ended(world: Mapping[str, Any]) -> Row:
    """Run a plan with changes; return the row: outcome, message, and the evidence of its failure."""
    changes = tuple(map(Change.of, world["changes"]))
    options = RunOptions.of(made(RunSettings, world["options"]), changes=changes)
    try:
        result = run_plan_file(options, _INPUTS)
    except BadInput as problem:  # another start in collision, or another robot without its geometry
        return {"outcome": REFUSED, "message": str(problem.diagnostics[0].message)}
    message = said(result.message, COMMAND_LINE)[:LONGEST_MESSAGE]
    return {"outcome": result.outcome.value, "message": message, **reached(result)}


def reached(result: RunResult) -> dict[str, Any]:
    """Say how far a run got: its plan time, and the evidence of its failure."""
    evidence = None if result.failure is None else Evidence.of(result.trace).as_json()
    return {"duration": round(result.duration, 3), "evidence": evidence}
