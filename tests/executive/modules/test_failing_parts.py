"""What fails is called by its name, and the robot goes on without it: a neck, a torso, a handle, a door."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from executive.modules.motion_failures import failure_of
from planlang import Recovery, look_by_moving_the_base, perform, step_back_and_repeat
from planlang.designators import action
from planlang.failures import (
    ContainerStuck,
    GraspSlipped,
    LookingFailure,
    ManipulationGoalNotReached,
    PlanFailure,
    TorsoGoalNotReached,
)
from planlang.protocols import Configuration, Group, MotionState, Trajectory
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, MakeStage, Stage
from tests.support.failing_robots import SlippingHandles, StuckNeck
from tests.support.leaves import Room, drawn, room

LOOK = action("LookingForSomething", object_acted_on=THE_BOTTLE)
OPEN = "OpeningAContainerArtifact"


def aside(make_stage: MakeStage, report: MotionState = MotionState.HALTED, times: int = 10**6) -> Stage:
    """A robot whose neck does not move, and which looks past the bottle."""
    stage = make_stage(CABINET, BOTTLE, start=(0.0, 0.0, 1.2))
    stage.platform.world = StuckNeck(stage.platform.world, report, times)  # type: ignore[assignment]
    return stage


@pytest.mark.parametrize("report", [MotionState.HALTED, MotionState.FAILED])
def test_a_neck_that_does_not_move_is_a_failure_of_looking_and_not_of_the_object(
    make_stage: MakeStage, report: MotionState
) -> None:
    stage = aside(make_stage, report)
    with pytest.raises(LookingFailure) as caught:
        stage.run(lambda: perform(LOOK))
    assert caught.value.what == "bottle"
    assert str(caught.value).startswith("the neck")


def test_a_neck_that_does_not_move_the_second_time_is_called_stuck(make_stage: MakeStage) -> None:
    stage = aside(make_stage)
    messages = []
    for _ in range(2):
        with pytest.raises(LookingFailure) as caught:
            stage.run(lambda: perform(LOOK))
        messages.append(str(caught.value))
    assert messages[1] == f"the neck is stuck: {messages[0]}"


def test_a_robot_with_a_stuck_neck_turns_the_base_until_the_camera_sees_the_object(make_stage: MakeStage) -> None:
    stage = aside(make_stage)
    turning = Recovery(LookingFailure, look_by_moving_the_base(THE_BOTTLE), retries=2)
    stage.run(lambda: perform(LOOK, recoveries=[turning]))
    assert stage.belief.remembers("bottle")
    assert stage.belief.memory.neck_given_up


def test_a_neck_that_moves_again_is_not_given_up(make_stage: MakeStage) -> None:
    stage = aside(make_stage, times=1)
    turning = Recovery(LookingFailure, look_by_moving_the_base(THE_BOTTLE), retries=2)
    stage.run(lambda: perform(LOOK, recoveries=[turning]))
    assert stage.belief.memory.neck == 0
    assert stage.truth.configuration().base == (0.0, 0.0, 1.2)


@pytest.mark.parametrize(
    ("ended", "kind"),
    [({"lift": 0.1, "elbow": 0.5}, TorsoGoalNotReached), ({"lift": 0.1, "elbow": 0.2}, ManipulationGoalNotReached)],
)
def test_if_all_of_an_arm_has_arrived_but_the_torso_the_failure_is_the_torsos(
    ended: dict[str, float], kind: type[PlanFailure]
) -> None:
    motion = Trajectory(("lift", "elbow"), np.array([[0.0, 0.0], [0.3, 0.5]]))
    failure = failure_of(Group.of("right"), "motor off", motion, Configuration((0.0, 0.0, 0.0), ended), "lift")
    assert type(failure) is kind
    assert isinstance(failure, ManipulationGoalNotReached), "what repeats the motion of an arm repeats it"


def slipping(stack: ExitStack, seed: int, *, moves: bool, after: float = 0.03, times: int = 10**6) -> Room:
    """A robot before a leaf off whose handle its hand slips."""
    stage = room(stack, drawn(seed))
    world = SlippingHandles(stage.platform.world, moves=moves, after=after, times=times)
    stage.platform.world = world  # type: ignore[assignment]
    return stage


DOOR, DRAWER = 0, 2
"""Seeds of a door, whose handle stops the hand, and of a drawer, off whose handle it slips."""


@pytest.mark.parametrize(("seed", "cause"), [(DOOR, type(None)), (DRAWER, GraspSlipped)])
def test_a_leaf_that_does_not_move_is_stuck_although_the_hand_slips_off_its_handle(
    stack: ExitStack, seed: int, cause: type[object]
) -> None:
    with pytest.raises(ContainerStuck) as caught:
        slipping(stack, seed, moves=False).do(OPEN, "leaf")
    assert caught.value.what == "leaf"
    assert isinstance(caught.value.__cause__, cause)


def test_a_hand_stops_as_soon_as_it_no_longer_feels_the_handle(stack: ExitStack) -> None:
    stage = slipping(stack, DRAWER, moves=True, after=0.05)
    with pytest.raises(GraspSlipped):
        stage.do(OPEN, "leaf")
    assert stage.truth.joint("leaf") == pytest.approx(0.05, abs=0.01)


@pytest.mark.parametrize("seed", [DOOR, DRAWER])
def test_a_handle_that_slips_once_is_taken_again(stack: ExitStack, seed: int) -> None:
    stage = slipping(stack, seed, moves=True, after=0.1, times=1)
    leaf = stage.designator("leaf")
    again = Recovery(GraspSlipped, step_back_and_repeat(leaf), retries=1)
    stage.run(lambda: perform(action(OPEN, object_acted_on=leaf), recoveries=[again]))
    assert stage.platform.belief.joints["leaf"].is_open(stage.truth.joint("leaf"))
