"""Hands in the simulator hold what is between their fingers, feel that something is there, and that somebody pulls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body
from sim.truth import at_rest_on
from tests.sim.conftest import CLOSED, GRASPING, ROOM, AskableWorld, MakeWorld, grasp, play

RIGHT, LEFT = "grippoint_right", "grippoint_left"
OPEN = {"finger1_joint_right": 0.4, "finger2_joint_right": -0.4}
ASIDE = Pose((2.0, -1.0, 0.1))
"""A place on the floor far from the hands."""


def test_a_hand_grips_what_is_between_its_closed_fingers_and_feels_it_until_it_is_loosened(world: AskableWorld) -> None:
    grasp(world)
    assert world.attached() == {"bottle": RIGHT}
    assert world.feels(RIGHT)
    assert not world.feels(LEFT)
    assert not world.pulled(RIGHT)
    play(world, "base", {"y": 1.4})
    assert world.feels(RIGHT)
    world.loosen(RIGHT)
    assert not world.feels(RIGHT)
    assert world.falling("bottle")


def test_fingers_that_open_hold_what_they_are_on_until_they_are_off_it(world: AskableWorld) -> None:
    grasp(world)
    now = world.configuration().joints
    play(world, "right_gripper", {name: now[name] + 0.01 * np.sign(value) for name, value in OPEN.items()})
    assert world.feels(RIGHT)
    play(world, "right_gripper", OPEN)
    assert not world.feels(RIGHT)
    assert at_rest_on(world, "bottle") == "cabinet"


def test_open_fingers_grip_nothing(world: AskableWorld) -> None:
    world.set_configuration(GRASPING)
    world.grip(RIGHT)
    assert world.attached() == {}
    assert not world.feels(RIGHT)


def test_what_only_one_finger_touches_is_not_gripped(make_world: MakeWorld) -> None:
    beside = Body("beside", Pose((-1.03, 2.11, 0.9)), (0.05, 0.05, 0.2), movable=True)
    world = make_world(extra=(beside,))
    grasp(world)
    assert world.attached() == {"bottle": RIGHT}


def test_things_that_are_pressed_together_between_two_fingers_are_both_gripped(make_world: MakeWorld) -> None:
    halves = [
        Body(f"half{k}", Pose((-1.1 + x, 2.11, 0.9)), (0.029, 0.06, 0.2), movable=True)
        for k, x in ((1, -0.015), (2, 0.015))
    ]
    world = make_world(extra=tuple(halves))
    world.set_pose("bottle", ASIDE)
    grasp(world)
    assert world.attached() == {"half1": RIGHT, "half2": RIGHT}


def test_what_cannot_move_is_not_gripped(make_world: MakeWorld) -> None:
    post = Body("post", Pose((-1.1, 2.11, 0.9)), (0.06, 0.06, 0.2))
    world = make_world(extra=(post,))
    world.set_pose("bottle", ASIDE)
    grasp(world)
    assert world.attached() == {}
    assert not world.feels(RIGHT)


def test_what_takes_two_hands_slips_off_when_one_is_loosened(make_world: MakeWorld) -> None:
    world = make_world(bodies=tuple(replace(one, hands=2) if one.name == "bottle" else one for one in ROOM.bodies))
    for link in (RIGHT, LEFT):
        world.attach(link, "bottle")
    world.loosen(RIGHT)
    assert world.attached() == {}
    assert not world.feels(LEFT)


def test_what_one_hand_holds_stays_in_it_when_another_is_loosened(world: AskableWorld) -> None:
    for link in (RIGHT, LEFT):
        world.attach(link, "bottle")
    offset = world.link_pose(LEFT).inverse() @ world.pose("bottle")
    world.loosen(RIGHT)
    assert world.holders("bottle") == (LEFT,)
    x, y, yaw = world.configuration().base
    world.set_configuration(Configuration((x, y - 0.3, yaw), {}))
    assert world.pose("bottle").distance(world.link_pose(LEFT) @ offset) < 1e-6


@pytest.mark.parametrize("closes", [True, False])
def test_a_grip_follows_from_the_fingers_not_from_what_was_gripped_before(world: AskableWorld, closes: bool) -> None:
    grasp(world)
    world.loosen(RIGHT)
    play(world, "right_gripper", OPEN)
    if closes:
        play(world, "right_gripper", CLOSED)
    world.grip(RIGHT)
    assert world.feels(RIGHT) is closes
