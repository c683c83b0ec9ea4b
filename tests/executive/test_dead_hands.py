"""A hand that fails is given up: another one does its work, and it is tried again where the other cannot."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest

import planlang
from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang.designators import a_device, a_location
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from tests.executive.conftest import BOTTLE, BUNDLED, CABINET, PLACE, THE_BOTTLE, MakeStage, Stage, hold_bottle
from tests.support.dead_hands import RAISED, REPORTS, kill

GRIPPER = a_device("HolderGripper", PLACE + "gripper")
"""A device that either hand is."""


def gives_up(stage: Stage, arm: str) -> None:
    for _ in range(2):
        stage.belief.hand_failed(arm)


@pytest.mark.parametrize("how", [*REPORTS, RAISED])
def test_the_left_hand_serves_where_the_right_one_is_dead(how: str) -> None:
    ended = run_plan_file(replace(BUNDLED, around=partial(kill, side="right", how=how)))
    assert ended.outcome is Outcome.DONE, ended.message


def test_a_thing_that_one_hand_misses_again_and_again_is_taken_by_the_other() -> None:
    run = planlang.simulate("serve_a_drink", fault="gripper.right:misses@always")
    assert run.message == "done"
    given_up = [one["name"] for one in run.trace if one["event"] == "belief" and one["change"] == "given up"]
    assert given_up == ["hand of right"]


@pytest.mark.parametrize(
    ("robot", "fault", "said"),
    [
        ("panda", "gripper:stays_closed@always", "the robot has no other hand"),
        pytest.param("amigo", "gripper:breaks@always", "the other hands were given up as well", marks=pytest.mark.long),
    ],
)
def test_a_robot_without_a_hand_that_works_says_so(robot: str, fault: str, said: str) -> None:
    run = planlang.simulate("serve_a_drink", robot=robot, trust_map=True, fault=fault)
    assert run.failures == ("ObjectUnfetchable", "GripperGoalNotReached")
    assert said in run.message


def test_a_base_pose_is_for_the_hand_that_is_not_given_up(ward: Stage) -> None:
    place = a_location(in_reach_of=THE_BOTTLE, using=GRIPPER)
    assert next(ward.executive.solutions(place)).detail["arm"] == "right"
    gives_up(ward, "right")
    assert next(ward.executive.solutions(place)).detail["arm"] == "left"


def test_a_hand_that_failed_once_is_used_on(ward: Stage) -> None:
    ward.belief.hand_failed("right")
    assert "right" not in ward.belief.memory.given_up


def test_a_grasp_in_between_shows_that_the_hand_works(ward: Stage) -> None:
    ward.belief.hand_failed("right")
    hold_bottle(ward, "right")
    ward.belief.hand_failed("right")
    assert "right" not in ward.belief.memory.given_up


def test_a_hand_that_was_given_up_does_what_is_stated_for_it(ward: Stage) -> None:
    gives_up(ward, "right")
    mine = a_device("RightArm", ward.platform.robot.arm("right").iri)
    assert next(ward.executive.solutions(a_location(in_reach_of=THE_BOTTLE, using=mine))).detail["arm"] == "right"


def test_of_hands_that_were_all_given_up_each_may_be_tried(ward: Stage) -> None:
    gives_up(ward, "right")
    gives_up(ward, "left")
    arms = ward.platform.scene.arms
    assert [arm.name for arm in ward.platform.arms.free(arms.all)] == [arm.name for arm in arms.all]


def test_a_hand_is_tried_again_where_the_other_finds_no_place(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, replace(BOTTLE, pose=Pose((1.5, 0.0, 3.0))))
    gives_up(stage, "right")
    with pytest.raises(LocationUnresolvable):
        list(stage.executive.solutions(a_location(in_reach_of=THE_BOTTLE, using=GRIPPER)))
    assert "right" not in stage.belief.memory.given_up


def test_a_resumed_run_knows_which_hand_was_given_up(ward: Stage, make_stage: MakeStage) -> None:
    gives_up(ward, "right")
    ward.belief.hand_failed("left")
    later = make_stage(CABINET, BOTTLE, *ward.truth.scene.bodies[2:4])
    later.belief.restore(ward.belief.snapshot())
    assert (later.belief.memory.given_up, later.belief.memory.failing) == (("right",), {"right": 2, "left": 1})
