"""A robot that can do one of several alternatives runs the plan and is told which ones it cannot do."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from executive.runs.plan_run import Outcome, RunOptions, RunResult, run_plan_file
from planlang.files import bundled

ONTOLOGIES = bundled("ontologies")
PLAN = Path(__file__).parents[1] / "diagnostics" / "X008_without_gripper.plan"


@pytest.fixture
def options(tmp_path: Path) -> RunOptions:
    """A run of the plan in the bundled room with the bundled robot, its grippers taken off."""
    robots = ONTOLOGIES / "robots"
    urdf, robot = tmp_path / "handless.urdf", tmp_path / "handless.omn"
    shape = (robots / "amigo.urdf").read_text(encoding="utf-8")
    urdf.write_text(re.sub(r'(<joint name="finger[^"]*" type=")revolute"', r'\1fixed"', shape), encoding="utf-8")
    frames = (robots / "amigo.omn").read_text(encoding="utf-8").split("\n\n")
    robot.write_text("\n\n".join(f for f in frames if not re.match(r"Individual: \w+_gripper\b", f)), encoding="utf-8")
    room = ONTOLOGIES / "environments" / "hospital_room.omn"
    return RunOptions(plan=PLAN, robot=robot, urdf=urdf, environment=room, trace=tmp_path / "run.jsonl")


def told(result: RunResult) -> list[tuple[str, str, int]]:
    return [
        (found.severity.value, Path(found.span.file).name, found.span.line)
        for found in result.diagnostics
        if found.code == "X008" and found.span is not None
    ]


def test_an_alternative_that_the_robot_cannot_do_is_told_and_the_plan_runs(options: RunOptions) -> None:
    result = run_plan_file(options)
    assert told(result) == [("note", PLAN.name, 29)]
    assert (result.outcome, result.failure) == (Outcome.DONE, ())
    assert options.trace is not None
    header = json.loads(options.trace.read_text(encoding="utf-8").splitlines()[0])
    assert header["infeasible"] == ["grasp"]


def test_a_plan_of_such_alternatives_only_is_refused(options: RunOptions) -> None:
    result = run_plan_file(replace(options, task="grasp"))
    assert (result.outcome, result.failure) == (Outcome.LACKS_CAPABILITY, ("MissingCapability",))
    assert told(result) == []
