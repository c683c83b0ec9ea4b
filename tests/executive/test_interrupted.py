"""What a run says that Ctrl-C interrupts."""

from __future__ import annotations

import signal

import pytest

from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from sim import PyBulletWorld
from tests.executive.conftest import BUNDLED


def test_an_interrupted_run_says_at_which_action_and_what_had_been_done(monkeypatch: pytest.MonkeyPatch) -> None:
    moves, move = iter(range(1, 10_000)), PyBulletWorld.step

    def stepping(world: PyBulletWorld) -> None:
        if next(moves) == 425:
            signal.raise_signal(signal.SIGINT)
        move(world)

    monkeypatch.setattr(PyBulletWorld, "step", stepping)
    result = run_plan_file(BUNDLED)
    assert result.outcome is Outcome.INTERRUPTED
    at = "interrupted at ReachForBottle(device_used=gripper, to_location=in_center_of(bottle1) with gripper), 14.2 s"
    assert result.message == f"{at}; done: MoveBaseToGraspPose, ApproachBottle, OpenGripper"
