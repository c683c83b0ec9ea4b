"""What a run leaves behind: devices that are on, and things where a door or drawer cannot pass."""

from __future__ import annotations

import pytest

from planlang.changes import Switched
from planlang.geometry import Pose
from planlang.state.matter import ON
from sim import Body
from sim.joints import Articulation, JointKind
from sim.left_behind import left_in_the_way, left_on
from tests.sim.conftest import MakeWorld

DOWN = (0.0, 0.0, -1.0)
OVEN = Body("oven", Pose((2.3, 0.0, 0.5)), (0.5, 0.6, 1.0))
LEAF = Body("leaf", Pose((2.0, 0.0, 0.5)), (0.02, 0.6, 1.0))
DOOR = Articulation("leaf", JointKind.HINGED, (2.0, 0.3, 0.5), DOWN, 0.0, 1.57, "oven")
DRAWER = Articulation("leaf", JointKind.PRISMATIC, (2.0, 0.0, 0.5), (-1.0, 0.0, 0.0), 0.0, 0.4, "oven")
BOX = Body("box", Pose((0.0, -2.0, 0.1)), (0.1, 0.1, 0.2), movable=True)


@pytest.mark.parametrize("joint", [DOOR, DRAWER])
@pytest.mark.parametrize(("x", "y", "is_told"), [(1.85, 0.0, True), (1.0, 0.0, False), (1.85, 0.9, False)])
def test_a_thing_is_in_the_way_where_the_leaf_passes(
    make_world: MakeWorld, joint: Articulation, x: float, y: float, is_told: bool
) -> None:
    world = make_world(bodies=(OVEN, LEAF, BOX), joints=(joint,))
    world.set_pose("box", Pose((x, y, 0.1)))
    assert list(left_in_the_way(world)) == ([("box", "leaf")] if is_told else [])


def test_a_thing_that_was_there_before_is_not_left(make_world: MakeWorld) -> None:
    world = make_world(bodies=(OVEN, LEAF, Body("box", Pose((1.85, 0.0, 0.1)), BOX.size, movable=True)), joints=(DOOR,))
    assert list(left_in_the_way(world)) == []


def test_a_device_that_was_off_at_first_is_left_on(make_world: MakeWorld) -> None:
    world = make_world(bodies=(OVEN, LEAF, BOX), joints=(DOOR,))
    assert list(left_on(world)) == []
    world.bring_about(Switched("oven", ON))
    assert list(left_on(world)) == ["oven"]
