"""One world of the series: its run, and what is kept of it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import Any

from executive.runs.plan_run import run_plan_file
from executive.runs.prepared import Inputs
from executive.sweeps import Row
from tests.benchmarks.faults.senses import LONGEST_HELD, Senses
from tests.benchmarks.faults.tasks import TASKS

INPUTS = Inputs()
"""Inputs of all worlds in this process."""
LONGEST_MESSAGE = 700
"""Maximum length of a message in a row [characters]."""


def job(world: Mapping[str, Any]) -> Row:
    """Run a task in a world in which something goes wrong; return its row."""
    began, senses = time.process_time(), Senses()
    options = TASKS[world["task"]].run(
        world,
        around=senses.around,
        interface=senses.interface,
        listeners=(senses.heard,),
        watchers=(senses.watch,),
    )
    result = run_plan_file(options, INPUTS)
    cpu = time.process_time() - began
    in_vain = senses.believes_to_hold()
    return {
        "outcome": result.outcome.value,
        "claimed": result.claimed,
        "reached": result.reached,
        "failure": list(result.failures),
        "message": result.message[:LONGEST_MESSAGE],
        "faults": senses.row(result.trace, _without(world) if senses.happened else ()),
        "opportunities": 0 if result.faults is None else result.faults.opportunities,
        "in_vain": in_vain,
        "held_in_vain": round(senses.held_in_vain, 2) if senses.held_in_vain > LONGEST_HELD else 0.0,
        "duration": round(result.duration, 2),
        "cpu": round(cpu, 2),
    }


def _without(world: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """Records of a world without its stated fault; none for a world with faults by chance."""
    if world["kind"] is None:
        return ()
    return run_plan_file(TASKS[world["task"]].run({**world, "faults": []}), INPUTS).trace
