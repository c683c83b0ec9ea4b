"""Opening and closing: doors and drawers with a hand on their handle, and why some stay as they are."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from itertools import islice

import numpy as np
import pytest

from executive.locations.hand_solutions import base_matrices
from executive.locations.headroom import way_out
from executive.maps import MapObject
from executive.modules.furniture.hand_paths import LeafPath, draws_back
from executive.modules.furniture.leaf_grips import grips_of
from executive.modules.furniture.leaf_paths import LeafPaths
from executive.motion import MotionError, cartesian_path, clearance_at
from executive.robots.arms import ArmModel
from planlang import SimulationHost, explain, perform, run
from planlang.designators import Condition, a_location, action
from planlang.failures import ActionUnresolvable, BehindClosedDoor, HandleNotReachable
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, product
from planlang.protocols import Trajectory
from tests.benchmarks.doors import opened
from tests.executive.conftest import BOTTLE, Stage, hold_bottle
from tests.support.examples import some
from tests.support.leaves import START, Room, drawn, room, thing

OPEN, CLOSE = "OpeningAContainerArtifact", "ClosingAContainerArtifact"
DOOR, DRAWER = 0, 2
"""Seeds of a door and of a drawer."""


@pytest.mark.parametrize(
    ("robot", "seed"),
    some([("panda", DOOR), ("panda", DRAWER), ("amigo", DOOR), ("amigo", DRAWER)], every=4),
)
def test_a_leaf_is_opened_and_closed_again_by_its_handle(stack: ExitStack, robot: str, seed: int) -> None:
    stage = room(stack, drawn(seed), robot)
    leaf, joint = stage.designator("leaf"), stage.platform.belief.joints["leaf"]
    assert not stage.executive.holds(Condition("closed", (leaf,))), "only the map says so"
    stage.do(OPEN, "leaf")
    assert joint.is_open(stage.truth.joint("leaf"))
    assert stage.executive.holds(Condition("open", (leaf,)))
    assert stage.platform.belief.joint("leaf") == pytest.approx(stage.truth.joint("leaf"), abs=1e-6)
    assert stage.truth.led() == {}
    assert stage.truth.contacts() == ()
    stage.do(CLOSE, "case")
    assert stage.truth.joint("leaf") < np.radians(3.0)
    assert stage.executive.holds(Condition("closed", (stage.designator("case"),)))


def oven() -> tuple[MapObject, ...]:
    """An oven at the height of a counter, whose flap has its hinge at the bottom."""
    back = (0.0, 0.0, 1.0, 0.0)
    case = thing("case", "Oven", Pose((0.9, 0.0, 0.9), back), (0.6, 0.6, 0.5), "leaf")
    leaf = thing("leaf", "Door", Pose((0.59, 0.0, 0.85), back), (0.02, 0.56, 0.35), "grip")
    return (case, leaf, thing("grip", "Handle", Pose((0.54, 0.0, 0.985), back), (0.015, 0.4, 0.015)))


def box() -> tuple[MapObject, ...]:
    """A box on a table, with a knob in the middle of its lid, which has its hinge at the back."""
    back = (0.0, 0.0, 1.0, 0.0)
    table = thing("table", "KitchenTable", Pose((0.9, 0.0, 0.35), back), (0.6, 1.2, 0.7))
    case = thing("case", "Box-Container", Pose((0.8, 0.0, 0.77), back), (0.24, 0.24, 0.14), "leaf")
    lid = thing("leaf", "ContainerLid", Pose((0.8, 0.0, 0.845), back), (0.24, 0.24, 0.01), "grip")
    return (table, case, lid, thing("grip", "ControlKnob", Pose((0.8, 0.0, 0.865), back), (0.03, 0.03, 0.03)))


@pytest.mark.parametrize(("things", "up"), some([(oven, -1.0), (box, 1.0)], every=2))
def test_a_flap_and_a_lid_turn_about_a_level_hinge_and_are_closed_again(
    stack: ExitStack, things: Callable[[], tuple[MapObject, ...]], up: float
) -> None:
    stage = room(stack, things())
    joint = stage.platform.belief.joints["leaf"]
    assert joint.axis == pytest.approx((0.0, up, 0.0))
    closed = stage.truth.pose("leaf").position[2]
    stage.do(OPEN, "leaf")
    assert joint.is_open(stage.truth.joint("leaf"))
    assert up * (stage.truth.pose("leaf").position[2] - closed) > 0.05
    stage.do(CLOSE, "leaf")
    assert joint.is_shut(stage.truth.joint("leaf"))


@pytest.mark.long
def test_a_low_upright_handle_is_taken_from_above(stack: ExitStack) -> None:
    back = (0.0, 0.0, 1.0, 0.0)
    grip = thing("grip", "Handle", Pose((0.5425, 0.25, 0.43), back), (0.015, 0.015, 0.3))
    leaf = thing("leaf", "Door", Pose((0.59, 0.0, 0.43), back), (0.02, 0.6, 0.7), "grip")
    case = thing("case", "Refrigerator", Pose((0.85, 0.0, 0.43), back), (0.5, 0.62, 0.86), "leaf")
    stage = room(stack, (case, leaf, grip))
    stage.do(OPEN, "leaf")
    assert stage.platform.belief.joints["leaf"].is_open(stage.truth.joint("leaf"))


def beside_a_wall(face: float) -> tuple[MapObject, ...]:
    """A cabinet with its front at x = 0.6, hinge at y = -0.25, handle at 0.2, beside a wall with its face at some y."""
    back = (0.0, 0.0, 1.0, 0.0)
    grip = thing("grip", "Handle", Pose((0.54, 0.2, 0.8), back), (0.012, 0.012, 0.16))
    leaf = thing("leaf", "Door", Pose((0.59, 0.0, 0.8), back), (0.02, 0.5, 0.6), "grip")
    case = thing("case", "Cupboard", Pose((0.8, 0.0, 0.6), back), (0.4, 0.5, 1.2), "leaf")
    wall = thing("wall", "Cupboard", Pose((0.4, face + math.copysign(0.1, face), 1.0), back), (2.0, 0.2, 2.0))
    return (case, leaf, grip, wall)


def first_way(stage: Room, value: float, wanted: float) -> LeafPath:
    arms = stage.platform.scene.arms.all
    ways = LeafPaths(stage.platform.scene, stage.platform.belief.joints["leaf"]).towards(value, arms, wanted)
    return next(one for one in ways if one is not None)


def test_a_hand_takes_a_handle_beside_a_wall_at_an_angle_at_which_its_fingers_are_clear_of_the_leaf(
    stack: ExitStack,
) -> None:
    stage = room(stack, beside_a_wall(0.262), "panda")
    joint = stage.platform.belief.joints["leaf"]
    way = first_way(stage, joint.upper, joint.first_open)
    assert abs(math.atan2(way.poses[1][1, 2], way.poses[1][0, 2])) > 0.3


def test_an_arm_draws_its_hand_back_from_a_handle_unless_something_stands_close_behind_the_hand(
    stack: ExitStack,
) -> None:
    box = thing("box", "Box-Container", Pose((-1.5, 1.5, 0.1)), (0.2, 0.2, 0.2))
    stage = room(stack, (*beside_a_wall(0.8), box), "panda")
    scene, belief = stage.platform.scene, stage.platform.belief
    way = first_way(stage, belief.joints["leaf"].upper, belief.joints["leaf"].first_open)
    state = belief.with_leaf("leaf", float(way.values[-1]))
    assert draws_back(scene.supposing(state), way)
    elbow = (Pose.planar(*way.base).matrix() @ way.arm.chain.fk(way.joints[-1])[0])[:3, 3] - 0.12 * way.poses[-1][:3, 2]
    x, y, z = elbow.tolist()
    assert not draws_back(scene.supposing(state.placed({"box": Pose((x, y, z))})), way)


def test_a_leaf_beside_a_wall_is_opened_no_farther_than_a_hand_comes_to_its_handle_again(stack: ExitStack) -> None:
    stage = room(stack, beside_a_wall(-0.44), "panda")
    joint, truth = stage.platform.belief.joints["leaf"], stage.truth
    value = float(first_way(stage, joint.upper, joint.first_open).values[-1])
    assert joint.is_open(value)
    truth.set_joint("leaf", value)
    stage.platform.belief.moved("leaf", value)
    assert first_way(stage, 0.0, joint.last_shut).values[-1] == pytest.approx(0.0)


@pytest.mark.long
@pytest.mark.parametrize("seed", [DOOR, DRAWER])
def test_the_way_of_a_leaf_begins_as_the_arm_comes_straight_to_its_handle(stack: ExitStack, seed: int) -> None:
    stage = room(stack, drawn(seed))
    joint, arm = stage.platform.belief.joints["leaf"], stage.platform.scene.arms.all[0]
    ways = LeafPaths(stage.platform.scene, joint).towards(joint.upper, [arm], joint.first_open)
    for way in islice((one for one in ways if one is not None), 10):
        ends = product(inverse(base_matrices(np.array([way.base]))[0]), way.poses[:2])
        line = cartesian_path(arm.chain, way.before, ends[0], ends[1], lambda q: True)
        assert line.waypoints is not None
        assert line.waypoints[-1] == pytest.approx(way.joints[0], abs=0.01)


def test_the_hand_moves_a_leaf_that_is_ajar_from_where_it_is(stack: ExitStack) -> None:
    stage = room(stack, drawn(DRAWER))
    stage.truth.set_joint("leaf", 0.1)
    stage.do(OPEN, "leaf")
    assert stage.platform.belief.joints["leaf"].is_open(stage.truth.joint("leaf"))


@pytest.mark.long
def test_a_hand_that_cannot_go_back_all_its_way_goes_back_as_far_as_it_can(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = room(stack, drawn(DRAWER), "panda")
    arms, lengths = stage.platform.arms, list[float]()
    straight = arms.straight_path

    def short(arm: ArmModel, pose: Array, touches: str | None) -> Trajectory:
        if stage.truth.joint("leaf") > 0:
            tip = stage.platform.scene.arms.tip(arm)
            lengths.append(float(np.linalg.norm(pose[:3, 3] - tip[:3, 3])))
            if len(lengths) == 1:
                raise MotionError("farther than the arm reaches")
        return straight(arm, pose, touches)

    monkeypatch.setattr(arms, "straight_path", short)
    stage.do(OPEN, "leaf")
    assert lengths[1] == pytest.approx(lengths[0] / 2)


def test_the_way_of_an_arm_to_the_pose_before_a_handle_does_not_go_through_the_handle(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = room(stack, drawn(DRAWER), "panda")
    arms, touched = stage.platform.arms, list[str | None]()
    path = arms.path

    def seen(arm: ArmModel, goal: Array, touches: str | None = None, *rest: int, **more: int) -> Trajectory:
        touched.append(touches)
        return path(arm, goal, touches, *rest, **more)

    monkeypatch.setattr(arms, "path", seen)
    stage.do(OPEN, "leaf")
    assert touched
    assert set(touched) == {None}


def test_what_is_open_is_left_alone(stack: ExitStack) -> None:
    stage = room(stack, drawn(DOOR))
    stage.truth.set_joint("leaf", 1.5)
    stage.platform.belief.moved("leaf", 1.5)
    before = stage.truth.steps
    stage.do(OPEN, "leaf")
    assert stage.truth.steps <= before + 60, "it is looked at"
    assert stage.truth.configuration().base == pytest.approx(START)


def test_a_leaf_without_handle_is_out_of_reach_for_this_reason(stack: ExitStack) -> None:
    case, leaf, _ = drawn(DOOR)
    stage = room(stack, (case, replace(leaf, parts=())))
    with pytest.raises(HandleNotReachable, match=r"leaf has no handle; .*properPhysicalParts"):
        stage.do(OPEN, "leaf")


@pytest.mark.long
def test_a_handle_that_no_arm_reaches_is_named(stack: ExitStack) -> None:
    case, leaf, grip = drawn(DRAWER)
    up = Pose((0.0, 0.0, 1.5))
    high = tuple(replace(one, pose=up @ one.pose) for one in (leaf, grip) if one.pose is not None)
    stage = room(stack, (case, *high))
    with pytest.raises(HandleNotReachable, match="the handle of leaf is out of reach: no way was found") as caught:
        stage.do(OPEN, "leaf")
    assert stage.truth.joint("leaf") == 0.0
    told = r"out of reach.*; grip is at 2\.\d\d m, 0\.\d\d m too high; the right arm reaches up to 1\.\d\d m$"
    assert re.search(told, explain(caught.value).splitlines()[0])


@pytest.mark.long
def test_a_body_without_which_the_base_would_have_room_before_a_handle_is_named(stack: ExitStack) -> None:
    bed = thing("bed", "Bed-PieceOfFurniture", Pose((-0.1, 0.0, 0.2)), (1.3, 6.0, 0.4))
    stage = room(stack, (*drawn(DRAWER), bed))
    with pytest.raises(HandleNotReachable) as caught:
        stage.do(OPEN, "leaf")
    assert explain(caught.value).splitlines()[0].endswith("; without bed this would work")


def test_a_handle_at_which_the_hand_has_no_room_is_reported_with_what_is_there(stack: ExitStack) -> None:
    stage = room(stack, beside_a_wall(0.215), "panda")
    with pytest.raises(HandleNotReachable) as caught:
        stage.do(OPEN, "leaf")
    figures = r"; in each of the \d+ grips checked, the hand is in collision, mostly with wall$"
    assert re.search(figures, explain(caught.value).splitlines()[0])


def test_what_has_no_door_cannot_be_opened(stack: ExitStack) -> None:
    stage = room(stack, (*drawn(DOOR), thing("cup", "Cup", Pose((0.0, 2.0, 0.05)), (0.08, 0.08, 0.1))))
    with pytest.raises(ActionUnresolvable, match="cup has no door"):
        stage.do(OPEN, "cup")


@pytest.mark.parametrize(("robot", "is_opened"), [("panda", True), ("amigo", False)])
def test_a_hand_that_is_needed_for_a_door_does_not_take_what_goes_behind_it_before(
    stack: ExitStack, robot: str, is_opened: bool
) -> None:
    cup = thing("cup", "Cup", Pose((-0.4, -1.2, 0.78)), (0.06, 0.06, 0.1))
    table = thing("table", "KitchenTable", Pose((-0.4, -1.4, 0.365)), (0.8, 0.8, 0.73))
    stage = room(stack, (*drawn(DOOR), table, cup), robot)
    what, case = stage.designator("cup"), stage.designator("case")
    doors = list[str]()

    async def search() -> None:
        try:
            next(stage.platform.resolver.bases(a_location(in_reach_of=what)))
        except BehindClosedDoor as closed:
            doors.append(str(closed.door))

    put = action("TransportingAnObject", object_acted_on=what, to_location=a_location(in_=case))
    plan = partial(perform, put, otherwise=search)
    run(plan, host=SimulationHost(stage.truth), executive=stage.executive)
    assert doors == (["leaf"] if is_opened else [])


@pytest.mark.long
def test_a_thing_in_a_drawer_is_in_reach_once_the_drawer_is_open(stack: ExitStack) -> None:
    case, leaf, grip = drawn(DRAWER)
    assert leaf.pose is not None
    cup = thing("cup", "Cup", leaf.pose @ Pose((0.1, 0.0, -0.06)), (0.06, 0.06, 0.12))
    stage = room(stack, (case, leaf, grip, cup), "panda")
    where = a_location(in_reach_of=stage.designator("cup"))
    with pytest.raises(BehindClosedDoor) as caught:
        next(stage.platform.resolver.bases(where))
    assert (caught.value.what, str(caught.value.door)) == ("cup", "leaf")
    stage.do(OPEN, "leaf")
    assert stage.truth.pose("cup").position[0] < cup.pose.position[0] - 0.1  # type: ignore[union-attr]
    assert stage.platform.belief.pose("cup").distance(stage.truth.pose("cup")) < 1e-6
    next(stage.platform.resolver.bases(where))


@pytest.mark.long
def test_of_doors_and_drawers_drawn_by_seeds_nearly_all_are_opened_and_the_others_have_a_reason() -> None:
    """The short form of ``python -m tests.benchmarks.doors``."""
    results = [opened("panda", seed) for seed in range(8)]
    assert sum(is_open for is_open, _, _ in results) >= 7
    assert all(is_open or reason.startswith(("HandleNotReachable", "ContainerStuck")) for is_open, reason, _ in results)


@pytest.mark.long
def test_a_hand_that_opened_a_door_gets_away_from_its_handle(stack: ExitStack) -> None:
    faces = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    parts = (
        thing("cabinet", "Cabinet-PieceOfFurniture", Pose((1.7, 0.0, 0.65)) @ faces, (0.4, 0.9, 1.3), "leaf"),
        thing("leaf", "Door", Pose((1.491, 0.1, 0.995)) @ faces, (0.018, 0.45, 0.55), "handle"),
        thing("handle", "Handle", Pose((1.446, -0.08, 0.995)) @ faces, (0.012, 0.012, 0.16)),
    )
    stage = room(stack, parts, start=(-0.6, -0.8, 0.0))
    stage.do(OPEN, "cabinet")
    assert not stage.platform.arms.untucked()


@pytest.mark.pr2
def test_fingers_that_come_forward_as_they_close_on_a_flat_knob_stay_clear_of_what_is_behind_it(
    stack: ExitStack,
) -> None:
    back = (0.0, 0.0, 1.0, 0.0)
    oven = thing("oven", "Oven", Pose((0.9, 0.0, 0.7), back), (0.6, 0.6, 1.4), "leaf")
    knob = thing("leaf", "ControlKnob", Pose((0.5875, 0.0, 1.1), back), (0.025, 0.04, 0.04))
    stage = room(stack, (oven, knob), "pr2")
    scene, joint = stage.platform.scene, stage.platform.belief.joints["leaf"]
    arm = scene.arms.all[0]
    grips = grips_of(scene, arm, joint)
    for fingers in arm.openings.closing(grips.fingers, 0.04):
        assert set(scene.collisions.arm_check(arm, "leaf", fingers).hand_hit(grips.starts)) == {None}


def test_a_drawer_is_opened_all_its_way_from_a_place_of_the_base_that_allows_it(stack: ExitStack) -> None:
    back = (0.0, 0.0, 1.0, 0.0)
    case = thing("case", "Cabinet-PieceOfFurniture", Pose((0.9, 0.0, 0.75), back), (0.52, 0.5, 1.5), "leaf")
    leaf = thing("leaf", "Drawer", Pose((0.88, 0.0, 1.2), back), (0.493, 0.46, 0.197), "grip")
    grip = thing("grip", "Handle", Pose((0.6, 0.0, 1.2), back), (0.012, 0.15, 0.012))
    stage = room(stack, (case, leaf, grip), "panda")
    joint = stage.platform.belief.joints["leaf"]
    assert first_way(stage, joint.upper, joint.first_open).values[-1] == pytest.approx(joint.upper)


def with_a_spoon_at_the_back(stack: ExitStack, value: float, *things: MapObject) -> Room:
    """A drawer open by a value, in which a spoon lies that is under the furniture even if it is open all its way."""
    back = (0.0, 0.0, 1.0, 0.0)
    case = thing("case", "Cabinet-PieceOfFurniture", Pose((0.9, 0.0, 0.6), back), (0.52, 0.5, 1.2), "leaf")
    leaf = thing("leaf", "Drawer", Pose((0.88, 0.0, 0.9), back), (0.493, 0.46, 0.197), "grip")
    grip = thing("grip", "Handle", Pose((0.6, 0.0, 0.9), back), (0.012, 0.15, 0.012))
    spoon = thing("spoon", "SoupSpoon", Pose((1.0, 0.0, 0.824), back), (0.19, 0.038, 0.025))
    stage = room(stack, (case, leaf, grip, spoon, *things), "panda")
    stage.truth.set_joint("leaf", value)
    stage.platform.belief.moved("leaf", value)
    stage.platform.observe()
    return stage


def test_an_open_drawer_is_opened_to_its_end_when_it_covers_what_lies_in_it(stack: ExitStack) -> None:
    stage = with_a_spoon_at_the_back(stack, 0.29)
    joint = stage.platform.belief.joints["leaf"]
    assert joint.is_open(stage.truth.joint("leaf"))
    stage.do(OPEN, "leaf")
    assert stage.truth.joint("leaf") == pytest.approx(joint.upper, abs=0.01)


def test_an_open_drawer_counts_as_opened_where_no_hand_is_free_to_open_it_further(stack: ExitStack) -> None:
    bottle = thing("bottle", "DrinkingBottle", Pose((-0.5, 0.5, 0.1)), BOTTLE.size)
    stage = with_a_spoon_at_the_back(stack, 0.29, bottle)
    stage.platform.belief.touched("leaf", 0.29)
    (arm,) = stage.platform.scene.arms.all
    hold_bottle(Stage(stage.truth, stage.platform, stage.executive), arm.name)
    stage.do(OPEN, "leaf")
    assert stage.truth.joint("leaf") == pytest.approx(0.29)


def test_what_is_under_the_furniture_in_an_open_drawer_is_drawn_forward_before_it_is_lifted(stack: ExitStack) -> None:
    stage = with_a_spoon_at_the_back(stack, 0.39)
    platform = stage.platform
    front, rear = 0.64, platform.scene.bodies.pose("spoon").position[0] + 0.095
    drawn, lifted = way_out("spoon", platform.scene)
    assert rear + drawn[0] < front < rear
    assert lifted[:2] == pytest.approx(drawn[:2])
    assert lifted[2] >= platform.scene.bodies.below_rim("spoon")


def test_furniture_is_hollow_where_its_drawers_slide(stack: ExitStack) -> None:
    stage = with_a_spoon_at_the_back(stack, 0.39)
    boxes, _ = stage.platform.scene.collisions.boxes_but(())
    behind = np.array([[1.0, 0.0]])
    assert clearance_at(behind, boxes, ((0.85, 0.95, 0.0),))[0] > 0.0
    assert clearance_at(behind, boxes, ((1.05, 1.15, 0.0),))[0] < 0.0
