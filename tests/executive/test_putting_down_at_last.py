"""A plan that fails in the simulator leaves nothing in the robot's hand, and says where the thing is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.protocols import RobotInterface
from tests.support.failing_robots import Refusing, StuckNeck
from tests.support.scenarios import parsed

WORDS = ("serve_a_drink", "--environment", "hospital_room", "--robot", "amigo", "--json")


def options(interface: Callable[[RobotInterface], object]) -> RunOptions:
    """The bundled task with a decorated robot interface."""
    return replace(RunOptions.of(parsed([*WORDS])), interface=interface)


@pytest.mark.long
def test_what_a_person_refuses_is_put_down_near_by_before_the_plan_fails_with_the_refusal() -> None:
    result = run_plan_file(options(Refusing))
    assert result.outcome is Outcome.FAILED
    assert result.failures[0] == "HandoverNotTaken"
    assert "bottle1 was put down on bedside_table1" in result.message
    assert result.final_state == ("bottle1: at rest on bedside_table1",)


@pytest.mark.long
def test_a_drink_is_served_by_a_robot_whose_neck_never_moves() -> None:
    result = run_plan_file(options(StuckNeck))
    assert result.final_state == ("bottle1: held by patient1",), result.message
