"""Doors and drawers in the simulator: what moves with them, what follows a hand, and what is in their way."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.geometry import Pose
from planlang.geometry.matrices import moved
from sim import Body
from sim.bodies import plain
from sim.joints import Articulation, JointKind
from sim.scene import Cavity
from tests.sim.conftest import CLOSED, GRASPING, ROOM, AskableWorld, MakeWorld, play

ANGLES = st.floats(0.0, 1.57)
UNITS = st.tuples(*(3 * [st.floats(-1.0, 1.0)])).filter(lambda v: math.hypot(*v) > 0.1)

BAR = Body("bar", Pose((-1.1, 2.11, 0.9)), (0.02, 0.02, 0.2))
LEAF = Body("leaf", Pose((-0.95, 2.17, 0.9)), (0.4, 0.02, 0.3))
CUP = Body("box", Pose((-0.9, 2.17, 0.95)), (0.05, 0.005, 0.05), movable=True)
TURN = Articulation(
    "leaf", JointKind.HINGED, (-0.75, 2.17, 0.9), (0.0, 0.0, 1.0), 0.0, 1.57, "cabinet", ("bar",), "bar"
)
SLIDE = Articulation("leaf", JointKind.PRISMATIC, (-0.95, 2.17, 0.9), (0.0, -1.0, 0.0), 0.0, 0.4, None, ("bar",), "bar")


@given(UNITS, UNITS, ANGLES)
def test_a_joint_knows_its_value_by_the_place_of_a_point_and_by_the_pose(
    axis: tuple[float, float, float], point: tuple[float, float, float], value: float
) -> None:
    x, y, z = (np.array(axis) / np.linalg.norm(axis)).tolist()
    joint = Articulation("leaf", JointKind.HINGED, point, (x, y, z), 0.0, 1.57)
    closed = Pose((1.5, -2.0, 0.3))
    now = joint.motion(value) @ closed
    assert joint.value_of(closed, now) == pytest.approx(value, abs=1e-9)
    place = moved(closed.matrix(), np.array([0.3, 0.2, 0.1]))
    assert joint.value_at(place, moved(joint.motion(value).matrix(), place)) == pytest.approx(value, abs=1e-6)


@given(st.floats(-3.0, 3.0))
def test_a_slide_stays_within_its_limits(value: float) -> None:
    assert 0.0 <= SLIDE.value_at(np.zeros(3), np.array([0.2, -value, 0.1])) <= 0.4


def test_a_joint_without_a_way_to_open_is_refused() -> None:
    with pytest.raises(ValueError, match="must include 0"):
        replace(TURN, lower=0.5)


@given(
    st.lists(
        st.tuples(*(3 * [st.floats(-0.6, 0.6)]), *(3 * [st.floats(0.05, 0.8)])),
        min_size=1,
        max_size=4,
    )
)
def test_what_cavities_leave_of_a_box_is_filled_once(rooms: list[tuple[float, ...]]) -> None:
    cavities = tuple(Cavity((x, y, z), (a, b, c)) for x, y, z, a, b, c in rooms)
    parts = plain(Body("case", Pose((0.0, 0.0, 0.0)), (1.0, 0.8, 1.2), cavities=cavities))
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3)) * (1.0, 0.8, 1.2)

    def within(centre: tuple[float, ...], size: tuple[float, ...]) -> np.ndarray:
        return np.asarray(np.all(np.abs(points - centre) < np.asarray(size) / 2, axis=1))

    empty = np.any([within(cavity.centre, cavity.size) for cavity in cavities], axis=0)
    filled = sum((within(part.offset.position, part.size).astype(int) for part in parts), np.zeros(200, int))
    assert (filled == (~empty).astype(int)).all()


@pytest.fixture
def with_leaf(make_world: MakeWorld) -> Callable[..., AskableWorld]:
    """The furnished room with a leaf behind a bar, which is where the bottle was; the bottle is elsewhere."""

    def make(joint: Articulation, *extra: Body) -> AskableWorld:
        world = make_world(bodies=(*ROOM.bodies, BAR, LEAF, *extra), joints=(joint,))
        world.set_pose("bottle", Pose((-0.9, 2.3, 0.9)))
        return world

    return make


def lead(world: AskableWorld) -> None:
    """Close the right hand on the bar, and let the leaf follow it."""
    world.set_configuration(GRASPING)
    play(world, "right_gripper", CLOSED)
    fingers = ("finger1_right", "finger2_right")
    assert {touch.link for touch in world.touches(fingers)} == set(fingers)
    world.grip("grippoint_right")
    assert world.led() == {"leaf": "grippoint_right"}


def test_a_drawer_carries_what_is_inside_and_nothing_else(with_leaf: Callable[..., AskableWorld]) -> None:
    world = with_leaf(SLIDE, CUP)
    before = {name: np.array(world.pose(name).position) for name in world.names()}
    world.set_joint("leaf", 0.3)
    after = {name: np.array(world.pose(name).position) for name in world.names()}
    shifted = {name for name in before if np.linalg.norm(after[name] - before[name]) > 1e-9}
    assert shifted == {"leaf", "bar", "box"}
    assert np.allclose(after["box"] - before["box"], (0.0, -0.3, 0.0))
    with pytest.raises(ValueError, match="leaf"):
        world.set_joint("leaf", 0.5)


def test_a_drawer_follows_the_hand_that_holds_its_handle(with_leaf: Callable[..., AskableWorld]) -> None:
    world = with_leaf(SLIDE, CUP)
    lead(world)
    y = world.configuration().base[1]
    assert play(world, "base", {"y": y - 0.25}) is None
    assert world.joint("leaf") == pytest.approx(0.25, abs=1e-3)
    assert world.pose("box").position[1] == pytest.approx(CUP.pose.position[1] - 0.25, abs=1e-3)
    world.loosen("grippoint_right")
    play(world, "right_gripper", {name: -value for name, value in CLOSED.items()})
    assert play(world, "base", {"y": y - 0.45}) is None
    assert world.joint("leaf") == pytest.approx(0.25, abs=1e-3)


def test_a_hand_slips_off_a_handle_that_cannot_follow(with_leaf: Callable[..., AskableWorld]) -> None:
    world = with_leaf(SLIDE)
    lead(world)
    play(world, "base", {"y": world.configuration().base[1] - 0.5})
    assert not world.feels("grippoint_right")
    assert world.joint("leaf") == pytest.approx(0.4)


def test_what_stands_before_a_drawer_blocks_it(with_leaf: Callable[..., AskableWorld]) -> None:
    stool = Body("stool", Pose((-0.8, 1.9, 0.5)), (0.1, 0.1, 1.0))
    world = with_leaf(SLIDE, stool)
    lead(world)
    assert play(world, "base", {"y": world.configuration().base[1] - 0.3}) == "stool"
    assert world.joint("leaf") == pytest.approx(LEAF.pose.position[1] - 0.01 - 1.95, abs=0.02)


def test_a_question_about_another_place_leaves_the_leaf_where_it_is(with_leaf: Callable[..., AskableWorld]) -> None:
    world = with_leaf(SLIDE)
    lead(world)
    now = world.configuration()
    there = replace(now, base=(now.base[0], now.base[1] - 0.2, now.base[2]))
    assert world.contacts(there, ("base",)) == ()
    assert world.joint("leaf") == pytest.approx(0.0, abs=1e-6)


def test_a_door_turns_with_its_handle(with_leaf: Callable[..., AskableWorld]) -> None:
    world = with_leaf(TURN)
    world.set_joint("leaf", 1.0)
    for name, body in (("leaf", LEAF), ("bar", BAR)):
        assert world.pose(name).distance(TURN.motion(1.0) @ body.pose) < 1e-12
        arm = np.array(world.pose(name).position) - TURN.point
        assert np.linalg.norm(arm) == pytest.approx(np.linalg.norm(np.array(body.pose.position) - TURN.point))
