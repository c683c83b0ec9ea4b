"""Doors and drawers that are not as the map says: what the robot sees or feels counts, and no success is false."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import partial

import pytest

from executive.maps import MapObject
from planlang import SimulationHost, achieve, perform, run
from planlang.designators import Condition, action
from planlang.failures import HandleNotReachable, PlanFailure, StateUnknown
from planlang.geometry import Pose
from tests.support.leaves import Room, drawn, room, thing

OPEN, CLOSE, PUSH = "OpeningAContainerArtifact", "ClosingAContainerArtifact", "PushingMotion"
DOOR, DRAWER = 0, 2
"""Seeds of a door and of a drawer."""
BACK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""The x axis of furniture points to its front, which faces the robot."""


def cupboard() -> tuple[MapObject, ...]:
    """A cupboard with two doors."""
    parts = [thing("case", "Cupboard", Pose((0.9, 0.0, 0.6)) @ BACK, (0.5, 0.9, 1.2), "leaf", "leaf2")]
    for leaf, grip, side in (("leaf", "grip", 1.0), ("leaf2", "grip2", -1.0)):
        parts.append(thing(leaf, "Door", Pose((0.64, side * 0.225, 0.75)) @ BACK, (0.02, 0.44, 0.7), grip))
        parts.append(thing(grip, "Handle", Pose((0.6, side * 0.06, 0.8)) @ BACK, (0.012, 0.012, 0.16)))
    return tuple(parts)


def furnished(
    stack: ExitStack, things: tuple[MapObject, ...], robot: str, believed: float, true: float, leaf: str = "leaf"
) -> Room:
    """A room in which a leaf is open by shares of its range as the map says, and in truth."""
    stage = room(stack, things, robot)
    upper = stage.platform.belief.joints[leaf].upper
    stage.truth.set_joint(leaf, true * upper)
    stage.platform.belief.moved(leaf, believed * upper)
    return stage


def opening(stage: Room, leaf: str = "leaf") -> float:
    """How far a leaf is open in truth, as a share of its range."""
    return stage.truth.joint(leaf) / stage.platform.belief.joints[leaf].upper


@pytest.mark.parametrize("seed", [DOOR, DRAWER])
@pytest.mark.parametrize(("believed", "true"), [(0.0, 0.9), (0.0, 0.4), (0.9, 0.0)])
@pytest.mark.parametrize("kind", [OPEN, CLOSE])
def test_a_leaf_that_is_not_as_the_map_says_is_seen_and_ends_as_asked_for(
    stack: ExitStack, kind: str, believed: float, true: float, seed: int
) -> None:
    stage = furnished(stack, drawn(seed), "amigo", believed, true)
    stage.do(kind, "leaf")
    assert opening(stage) >= 0.7 if kind == OPEN else opening(stage) <= 0.03
    assert stage.platform.belief.joint("leaf") == pytest.approx(stage.truth.joint("leaf"), abs=0.01)


def chest() -> tuple[MapObject, ...]:
    """A box on a table, with a lid whose handle is at its front edge."""
    table = thing("table", "KitchenTable", Pose((0.9, 0.0, 0.25)) @ BACK, (0.6, 1.2, 0.5))
    case = thing("case", "Box-Container", Pose((0.8, 0.0, 0.6)) @ BACK, (0.3, 0.3, 0.2), "leaf")
    lid = thing("leaf", "ContainerLid", Pose((0.8, 0.0, 0.71)) @ BACK, (0.3, 0.3, 0.02), "grip")
    return table, case, lid, thing("grip", "Handle", Pose((0.68, 0.0, 0.74)) @ BACK, (0.012, 0.12, 0.02))


@pytest.mark.parametrize(("kind", "believed", "true"), [(OPEN, 0.8, 0.0), (CLOSE, 0.0, 0.5), (CLOSE, 0.0, 0.0)])
def test_a_lid_is_looked_at_like_a_door(stack: ExitStack, kind: str, believed: float, true: float) -> None:
    stage = furnished(stack, chest(), "amigo", believed, true)
    try:
        stage.do(kind, "case")
    except HandleNotReachable:
        assert opening(stage) == pytest.approx(true, abs=0.05)
    else:
        assert opening(stage) >= 0.5 if kind == OPEN else opening(stage) <= 0.03
    assert stage.platform.belief.joint("leaf") == pytest.approx(stage.truth.joint("leaf"), abs=0.01)


@pytest.mark.parametrize("seed", [DOOR, DRAWER])
@pytest.mark.parametrize("true", [0.9, 0.4, 0.05])
def test_a_robot_without_a_camera_feels_the_handle_of_what_it_is_to_leave_closed(
    stack: ExitStack, seed: int, true: float
) -> None:
    stage = furnished(stack, drawn(seed), "panda", 0.0, true)
    try:
        stage.do(CLOSE, "leaf")
    except StateUnknown:
        assert opening(stage) > 0.03
    else:
        assert opening(stage) <= 0.03


def test_a_robot_without_a_camera_is_sure_of_a_closed_door_once_it_has_felt_its_handle(stack: ExitStack) -> None:
    stage = furnished(stack, drawn(DOOR), "panda", 0.0, 0.0)
    closed = Condition("closed", (stage.designator("leaf"),))
    assert not stage.executive.holds(closed)
    stage.do(CLOSE, "leaf")
    assert stage.executive.holds(closed)
    before = stage.truth.steps
    stage.do(CLOSE, "leaf")
    assert stage.truth.steps <= before + 1, "what was felt is not felt again"


def test_furniture_is_closed_when_all_its_doors_are(stack: ExitStack) -> None:
    stage = furnished(stack, cupboard(), "amigo", 0.0, 0.8, leaf="leaf2")
    stage.do(CLOSE, "case")
    assert (opening(stage), opening(stage, "leaf2")) == (pytest.approx(0.0, abs=0.03), pytest.approx(0.0, abs=0.03))


def test_what_was_seen_and_not_moved_since_is_not_looked_at_again(stack: ExitStack) -> None:
    stage = furnished(stack, drawn(DOOR), "amigo", 0.0, 0.0)
    stage.do(CLOSE, "leaf")
    before = stage.truth.steps
    stage.do(CLOSE, "leaf")
    assert stage.truth.steps <= before + 1


def test_a_goal_about_a_door_does_not_hold_by_the_map_alone(stack: ExitStack) -> None:
    stage = furnished(stack, drawn(DOOR), "amigo", 0.0, 0.9)
    leaf = stage.designator("leaf")
    close = partial(perform, action(CLOSE, object_acted_on=leaf))
    plan = partial(achieve, Condition("closed", (leaf,)), close)
    run(plan, host=SimulationHost(stage.truth), executive=stage.executive)
    assert opening(stage) <= 0.03


@pytest.mark.parametrize(("robot", "true"), [("amigo", 0.5), ("amigo", 0.0), ("panda", 0.5)])
def test_a_door_to_push_shut_that_the_map_has_closed_is_looked_at(stack: ExitStack, robot: str, true: float) -> None:
    stage = furnished(stack, drawn(DOOR), robot, 0.0, true)
    try:
        stage.do(PUSH, "leaf")
    except PlanFailure:
        assert opening(stage) > 0.03
    else:
        assert opening(stage) <= 0.03


def test_a_door_that_does_not_move_is_not_reported_as_open(stack: ExitStack) -> None:
    stage = furnished(stack, drawn(DOOR), "amigo", 0.0, 0.0)
    joints = stage.truth._leaves.joints
    joints["leaf"] = replace(joints["leaf"], upper=1e-6)
    with pytest.raises(PlanFailure):
        stage.do(OPEN, "leaf")
    assert stage.truth.joint("leaf") <= 1e-6


def test_a_leaf_that_nobody_can_see_or_feel_is_no_success(stack: ExitStack) -> None:
    case, leaf, _ = drawn(DOOR)
    bare = thing("leaf", "Door", leaf.pose or Pose((0.0, 0.0, 0.0)), leaf.size or (0.02, 0.4, 0.4))
    stage = furnished(stack, (case, bare), "panda", 0.0, 0.5)
    with pytest.raises((StateUnknown, HandleNotReachable)):
        stage.do(CLOSE, "leaf")
