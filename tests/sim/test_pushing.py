"""What a hand pushes: things slide and turn, carry what is on them, stop and fall; drawers and doors shut."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim import Body
from sim.joints import Articulation, JointKind
from tests.sim.conftest import CLOSED, LEVEL_HAND, ROOM, AskableWorld, MakeWorld, play

TABLE = Body("table", Pose((-1.1, 2.15, 0.4)), (0.8, 0.5, 0.8))
BOX = Body("box", Pose((-1.1, 2.05, 0.88)), (0.2, 0.12, 0.16), movable=True)
CUP = Body("cup", Pose((-1.1, 2.05, 1.01)), (0.06, 0.06, 0.1), "cylinder", movable=True)
TIP = 0.43
"""How far the right tip is ahead of the base [m]."""


def pushing(make_world: MakeWorld, *bodies: Body, aside: float = 0.0, **fields: object) -> AskableWorld:
    """Return a world of some bodies, with the closed right hand before them, so far to its right."""
    there = [body for body in ROOM.bodies if body.name in ("room", "bed")]
    world = make_world(bodies=(*there, *bodies), **fields)
    world.set_configuration(Configuration((-1.32 + aside, 1.4, math.pi / 2), LEVEL_HAND))
    play(world, "right_gripper", CLOSED)
    return world


def ahead(world: AskableWorld, way: float, pushes: str | None = "grippoint_right") -> str | None:
    """Drive so far ahead, pushing with the hand at a link if there is one; return what stopped the robot."""
    return play(world, "base", {"y": world.configuration().base[1] + way}, 90, pushes=pushes)


def heading(pose: Pose) -> float:
    """Return the heading of a pose [rad]."""
    return math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])


SHELF = replace(TABLE, pose=Pose((-1.1, 2.15, 0.79)), size=(0.8, 0.5, 0.02))
"""A table without legs: the arm goes over and under it."""


def test_a_hand_that_does_not_push_is_stopped(make_world: MakeWorld) -> None:
    world = pushing(make_world, SHELF, BOX)
    assert ahead(world, 0.3, pushes=None) == "box"
    assert world.pose("box") == BOX.pose


def test_a_hand_pushes_as_long_as_the_motion_that_does(make_world: MakeWorld) -> None:
    world = pushing(make_world, SHELF, BOX)
    assert ahead(world, 0.15) is None
    there = world.pose("box")
    assert ahead(world, 0.1, pushes=None) == "box"
    assert world.pose("box") == there


def test_a_thing_that_is_pushed_goes_with_what_stands_on_it(make_world: MakeWorld) -> None:
    world = pushing(make_world, SHELF, BOX, CUP)
    assert ahead(world, 0.25) is None
    moved = np.array(world.pose("box").position) - BOX.pose.position
    beyond = 1.4 + 0.25 + TIP - (BOX.pose.position[1] - BOX.size[1] / 2)
    assert beyond < moved[1] < beyond + 0.06
    assert np.abs(moved[[0, 2]]).max() < 0.02
    assert np.allclose(np.array(world.pose("cup").position) - CUP.pose.position, moved, atol=0.01)


def test_a_thing_that_is_pushed_beside_its_middle_turns(make_world: MakeWorld) -> None:
    turned = []
    for aside in (0.06, -0.06):
        world = pushing(make_world, SHELF, BOX, aside=aside)
        assert ahead(world, 0.2) is None
        turned.append(heading(world.pose("box")))
    assert turned[0] > 0.1
    assert turned[1] < -0.1


def test_what_stops_the_thing_stops_the_hand(make_world: MakeWorld) -> None:
    wall = Body("wall", Pose((-1.1, 2.25, 1.0)), (0.8, 0.1, 0.4))
    world = pushing(make_world, SHELF, BOX, wall)
    assert ahead(world, 0.3) == "box"
    front = 2.2 - BOX.size[1] / 2
    assert world.pose("box").position[1] == pytest.approx(front, abs=0.01)


def test_a_thing_that_is_pushed_over_an_edge_falls_with_what_is_on_it(make_world: MakeWorld) -> None:
    narrow = replace(SHELF, pose=Pose((-1.1, 2.05, 0.79)), size=(0.8, 0.2, 0.02))
    world = pushing(make_world, narrow, BOX, CUP)
    ahead(world, 0.4)
    for _ in range(60):
        world.step()
    assert world.pose("box").position[2] == pytest.approx(BOX.size[2] / 2, abs=1e-3)
    assert world.pose("cup").position[2] == pytest.approx(BOX.size[2] + CUP.size[2] / 2, abs=1e-3)


LEAF = Body("leaf", Pose((-1.1, 2.1, 0.9)), (0.4, 0.02, 0.3))
SLIDE = Articulation("leaf", JointKind.PRISMATIC, (-1.1, 2.1, 0.9), (0.0, -1.0, 0.0), 0.0, 0.4)
TURN = Articulation("leaf", JointKind.HINGED, (-0.9, 2.1, 0.9), (0.0, 0.0, 1.0), 0.0, 1.57)


@pytest.mark.parametrize(("joint", "value"), [(SLIDE, 0.15), (TURN, 0.75)])
def test_a_leaf_is_pushed_shut_and_stops_the_hand_then(
    make_world: MakeWorld, joint: Articulation, value: float
) -> None:
    world = pushing(make_world, LEAF, joints=(joint,))
    world.set_joint("leaf", value)
    assert ahead(world, 0.1) is None
    assert 0.0 < world.joint("leaf") < value
    assert ahead(world, 0.3) == "leaf"
    assert world.joint("leaf") == pytest.approx(0.0, abs=1e-3)


def test_what_cannot_move_stops_a_hand_that_pushes(make_world: MakeWorld) -> None:
    world = pushing(make_world, replace(BOX, movable=False))
    assert ahead(world, 0.3) == "box"
