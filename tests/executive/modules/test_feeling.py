"""A robot without a camera feels for a thing that its hand has missed: with strokes, until a contact stops it."""

from __future__ import annotations

import math
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest

from executive.belief.memory import Source
from executive.belief.obstacles import NAMES
from executive.maps import MapObject
from planlang import perform
from planlang.designators import action
from planlang.failures import GraspMissed, ObjectNowhereToBeFound
from planlang.geometry import Pose
from planlang.geometry.matrices import rigid
from planlang.protocols import Configuration
from tests.support import leaves
from tests.support.leaves import Room, room, thing

TABLE = thing("table", "KitchenTable", Pose((0.8, 0.0, 0.37)), (0.5, 1.2, 0.74))
ROOM = thing("room", "RoomInAConstruction", Pose((0.0, 0.0, 1.3)), (7.0, 6.0, 2.6))
AT = (0.65, -0.15)
"""Where the map has the thing."""


def bottle(x: float, y: float) -> MapObject:
    return thing("bottle", "DrinkingBottle", Pose((x, y, 0.84)), (0.065, 0.065, 0.2))


def box(x: float, y: float) -> MapObject:
    return thing("bottle", "Milk", Pose((x, y, 0.82)), (0.06, 0.14, 0.16))


def missed(stack: ExitStack, here: MapObject, *there: MapObject) -> Room:
    """A Panda at a table that has missed a thing, of which ``there`` is what is there."""
    believed, true = (ROOM, TABLE, here), (ROOM, TABLE, *there)
    stage = room(stack, believed, "panda", truth=true, start=(0.0, 0.0, 0.0), trusts_map=True)
    stage.platform.belief.missed("bottle", "arm", stage.platform.base())
    return stage


def around(stage: Room, x: float, y: float) -> None:
    """Put the open hand around a point at the middle of the thing, level, from the robot's side."""
    platform = stage.platform
    (arm,) = platform.scene.arms.all
    ahead, across = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    q, good = arm.solve(rigid(arm.frame.rotation(ahead, across), np.array([x, y, 0.84]))[None], arm.seeds[None])
    assert good[0]
    now, joints = stage.truth.configuration(), dict(zip(arm.joints, q[0].tolist(), strict=True))
    assert arm.gripper is not None
    stage.truth.set_configuration(Configuration(now.base, {**now.joints, **joints, **arm.gripper.opened}))
    platform.observe()


def close(stage: Room) -> None:
    what = stage.designator("bottle")
    stage.run(lambda: perform(action("ClosingAGripper", object_acted_on=what)))


def feel(stage: Room) -> None:
    what = stage.designator("bottle")
    stage.run(lambda: perform(action("LookingForSomething", object_acted_on=what)))


@pytest.mark.parametrize("by", [(0.1, 0.05), (-0.05, 0.25), (0.2, -0.1)])
def test_a_round_thing_is_felt_to_within_some_millimetres(stack: ExitStack, by: tuple[float, float]) -> None:
    at = (AT[0] + by[0], AT[1] + by[1])
    stage = missed(stack, bottle(*AT), bottle(*at))
    feel(stage)
    belief = stage.platform.belief
    assert math.dist(belief.pose("bottle").position, (*at, 0.84)) < 0.005
    assert belief.knowledge("bottle").source is Source.FELT
    assert belief.seen_from_here("bottle"), "it need not be looked at again"
    assert stage.truth.pose("bottle").position == (*at, 0.84), "the hand has not pushed it"


def test_a_thing_that_is_not_round_is_felt_from_two_sides(stack: ExitStack) -> None:
    stage = missed(stack, box(*AT), box(AT[0] + 0.1, AT[1] + 0.15))
    feel(stage)
    assert math.dist(stage.platform.belief.pose("bottle").position[:2], (AT[0] + 0.1, AT[1] + 0.15)) < 0.01


def test_what_the_hand_has_run_into_near_by_is_felt_first(stack: ExitStack) -> None:
    at = (AT[0] + 0.2, AT[1] + 0.2)
    stage = missed(stack, bottle(*AT), bottle(*at))
    belief = stage.platform.belief
    belief.obstacle(Pose((at[0] + 0.02, at[1] - 0.02, 0.86)))
    feel(stage)
    assert math.dist(belief.pose("bottle").position, (*at, 0.84)) < 0.005
    assert not set(belief.names()) & set(NAMES), "the thing explains what was met"


def test_what_is_not_there_is_nowhere_to_be_found(stack: ExitStack) -> None:
    stage = missed(stack, bottle(*AT))
    with pytest.raises(ObjectNowhereToBeFound, match="bottle was not felt within 50 cm of where the map has it"):
        feel(stage)


def test_an_arm_that_cannot_drive_says_how_much_was_out_of_its_reach(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    panda = leaves.robot_of("panda")
    monkeypatch.setattr(leaves, "robot_of", lambda name: replace(panda, base=replace(panda.base, fixed=True)))
    stage = missed(stack, bottle(*AT))
    before = stage.truth.configuration().base
    with pytest.raises(ObjectNowhereToBeFound, match=r"in \d strokes; \d\d% of that was out of reach of the hand"):
        feel(stage)
    assert stage.truth.configuration().base == before


def test_a_robot_with_a_camera_does_not_feel(stack: ExitStack) -> None:
    stage = room(stack, (TABLE, bottle(*AT)), "amigo", truth=(TABLE, bottle(0.7, 0.0)), start=(-0.2, 0.0, 0.0))
    stage.platform.belief.missed("bottle", "right", stage.platform.base())
    feel(stage)
    assert stage.platform.belief.knowledge("bottle").source is Source.SEEN


def test_a_finger_that_touches_first_tells_where_the_thing_is(stack: ExitStack) -> None:
    """The fingers of this hand are coupled, so that both stop: the next grasp is at the right place."""
    there = bottle(AT[0], AT[1] + 0.006)
    stage = room(stack, (TABLE, bottle(*AT)), "panda", truth=(TABLE, there), start=(0.0, 0.0, 0.0), trusts_map=True)
    around(stage, *AT)
    with pytest.raises(GraspMissed):
        close(stage)
    assert stage.platform.belief.pose("bottle").distance(stage.truth.pose("bottle")) < 0.002
    around(stage, *stage.platform.belief.pose("bottle").position[:2])
    close(stage)
    assert list(stage.truth.attached()) == ["bottle"]


def test_fingers_that_close_farther_than_the_thing_lets_them_hold_something_else(stack: ExitStack) -> None:
    thin = thing("bottle", "DrinkingBottle", Pose((*AT, 0.84)), (0.02, 0.02, 0.2))
    stage = room(stack, (TABLE, bottle(*AT)), "panda", truth=(TABLE, thin), start=(0.0, 0.0, 0.0), trusts_map=True)
    around(stage, *AT)
    with pytest.raises(GraspMissed, match=r"the gripper closed to 2\d mm: bottle is wider"):
        close(stage)
    assert not stage.platform.belief.held
    assert not stage.truth.attached()
