"""Runs of plans whose results explain themselves."""

from __future__ import annotations

from typing import Any

from executive.options.running import RunSettings
from executive.runs.explanation import Explanation
from executive.runs.options import RunOptions, RunResult
from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import Inputs
from planlang.runs import RecordedRun


def run(options: RunSettings, inputs: Inputs | None = None) -> RunResult:
    """Run a plan or a recipe, as :func:`executive.runs.plan_run.run_plan_file` does; the result says why it failed."""
    result = run_plan_file(options, inputs)
    if result.ended is not None:
        result.ended.explain = _explained
    return result


def _explained(recorded: RecordedRun, options: RunOptions, **more: Any) -> Explanation:
    from executive.why.explaining import explained  # most runs are not explained, and it needs workers

    return explained(recorded, options, **more)
