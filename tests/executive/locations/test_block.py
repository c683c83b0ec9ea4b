"""Upright prisms around bodies, hand poses about them and fingers that close, against brute force."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import replace
from itertools import islice, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.locations import HandSolution
from executive.locations.deliveries import Spots, held_above, offering, placing
from executive.locations.grasp_candidates import CLASSES, beside, grasping
from executive.locations.placement import UPRIGHT
from executive.locations.reachability import GraspClass
from executive.robots.arms import HandFrame, Held
from planlang.designators import a_device, a_location
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.protocols import Configuration
from sim import Body, ComfortZone
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, MakeStage, Stage
from tests.support.examples import some

angle, length, size = st.floats(-math.pi, math.pi), st.floats(-3.0, 3.0), st.floats(0.02, 2.0)
blocks = st.builds(
    lambda x, y, yaw, a, b, c: Block.of(Pose.planar(x, y, yaw, c / 2), (a, b, c)),
    length,
    length,
    angle,
    size,
    size,
    size,
)
quaternions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 4)
    .filter(lambda q: math.hypot(*q) > 0.1)
    .map(lambda q: tuple(value / math.hypot(*q) for value in q))
)
FRAME = HandFrame((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def corners(pose: Pose, size: tuple[float, float, float]) -> Array:
    """The eight corners (8, 3) of a box in the map."""
    local = np.array(list(product(*((-extent / 2, extent / 2) for extent in size))))
    return local @ pose.matrix()[:3, :3].T + np.array(pose.position)


@given(length, length, quaternions, st.tuples(size, size, size))
def test_a_block_encloses_its_box_however_it_is_turned(
    x: float, y: float, turn: tuple[float, float, float, float], extents: tuple[float, float, float]
) -> None:
    pose = Pose((x, y, 1.0), turn)
    block, points = Block.of(pose, extents), corners(pose, extents)
    assert points[:, 2].min() == pytest.approx(block.low, abs=1e-9)
    assert points[:, 2].max() == pytest.approx(block.high, abs=1e-9)
    inside = np.abs(block.to_local(points[:, :2])) - np.array([block.half_x, block.half_y])
    assert inside.max() <= 1e-9


@given(length, length, angle, st.tuples(size, size, size))
def test_the_block_of_an_upright_box_is_the_box(
    x: float, y: float, yaw: float, extents: tuple[float, float, float]
) -> None:
    block = Block.of(Pose.planar(x, y, yaw, 1.0), extents)
    assert (2 * block.half_x, 2 * block.half_y, block.high - block.low) == pytest.approx(extents)
    assert math.remainder(block.yaw - yaw, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


@given(blocks, st.lists(st.tuples(length, length), min_size=1, max_size=5))
def test_map_and_local_coordinates_undo_each_other(block: Block, points: list[tuple[float, float]]) -> None:
    there = np.array(points)
    assert np.allclose(block.to_map(block.to_local(there)), there, atol=1e-9)


@given(blocks, length, length)
def test_the_distance_is_that_of_the_nearest_point_of_the_rectangle(block: Block, x: float, y: float) -> None:
    point = np.array([[x, y]])
    bound = np.array([block.half_x, block.half_y])
    nearest = block.to_map(np.clip(block.to_local(point), -bound, bound))
    assert block.distance(point)[0] == pytest.approx(float(np.linalg.norm(point - nearest)), abs=1e-9)
    assert block.distance(nearest)[0] == pytest.approx(0.0, abs=1e-9)


@given(blocks, st.floats(0.05, 0.5), st.floats(0.0, 0.3))
def test_a_grid_lies_inside_the_inset_rectangle_and_has_its_centre_at_least(
    block: Block, spacing: float, inset: float
) -> None:
    grid = np.abs(block.to_local(block.grid(spacing, inset)))
    bound = np.maximum(np.array([block.half_x, block.half_y]) - inset, 0.0)
    assert (grid <= bound + 1e-9).all()
    assert len(grid) % 2 == 1


@given(blocks, angle)
def test_the_extent_of_a_block_is_the_width_of_its_shadow(block: Block, heading: float) -> None:
    direction = np.array([math.cos(heading), math.sin(heading), 0.0])
    box = Pose.planar(block.x, block.y, block.yaw, 0.0)
    along = corners(box, (2 * block.half_x, 2 * block.half_y, 0.0)) @ direction
    assert 2 * block.support(heading) == pytest.approx(float(np.ptp(along)), abs=1e-9)


def test_a_bottle_is_as_wide_from_everywhere() -> None:
    bottle = Block.of(Pose.planar(0.0, 0.0, 0.3, 0.1), (0.07, 0.07, 0.2), cylinder=True)
    for heading in np.linspace(0.0, math.pi, 7):
        assert 2 * bottle.support(heading) == pytest.approx(0.07)


@given(blocks, st.sampled_from([8, 16, 32]))
def test_fingers_never_close_across_more_than_they_open(block: Block, headings: int) -> None:
    ways = grasping("box", block, FRAME, 0.11, CLASSES, headings)
    for index in range(len(ways)):
        plan = ways.plan(index)
        closing = plan.poses[1][:3, 1]
        assert abs(closing[2]) < 1e-9, "the fingers close horizontally"
        assert 2 * block.support(math.atan2(closing[1], closing[0])) <= 0.11 + 1e-9
        assert plan.poses[1][:3, 3] == pytest.approx(block.centre)
        assert plan.poses[0][:3, 3] == pytest.approx(block.centre - 0.08 * plan.poses[1][:3, 0])


def zone_facing(heading: float) -> ComfortZone:
    """Return where a person with this heading takes things."""
    return ComfortZone(((0.0, -0.2, 1.2), (0.0, 0.2, 1.2)), 0.6, (math.cos(heading), math.sin(heading), 0.0))


@given(blocks, quaternions, angle)
def test_what_is_held_stays_upright_in_every_way_that_is_tried(
    block: Block, turn: tuple[float, float, float, float], facing: float
) -> None:
    held = Held("cup", Pose((0.02, 0.0, 0.05), turn), (0.07, 0.07, 0.1), largest_tilt=0.26)
    zone, spots = zone_facing(facing), np.array([[block.x, block.y, block.high, facing]])
    upright = held.pose.matrix()[:3, :3]
    for ways in (
        held_above("box", block, FRAME, held, held.lowest_of, (0.02, 0.15), inset=0.05, fine=False),
        offering("patient", zone, FRAME, held, fine=False),
        *(
            placing("box", Spots(UPRIGHT, spots, *np.ones((2, 1)), turns_freely), FRAME, held, fine=False)
            for turns_freely in (True, False)
        ),
    ):
        assert len(ways) == 0 or np.linalg.det(ways.rotations) == pytest.approx(1.0)
        assert (ways.rotations @ upright)[:, 2, 2] == pytest.approx(1.0)


@pytest.mark.long
@given(angle)
def test_what_is_offered_comes_to_where_the_person_takes_things(facing: float) -> None:
    held = Held("cup", Pose((0.05, 0.0, 0.0)), (0.07, 0.07, 0.1))
    zone = zone_facing(facing)
    ways = offering("patient", zone, FRAME, held, fine=True)
    assert len(ways) > 10
    for middle in ways.points + held.offsets(ways.rotations):
        assert zone.contains(middle)


def test_things_are_offered_at_the_height_of_the_belly_too_if_nothing_higher_is_in_reach() -> None:
    held, zone = Held("cup", Pose((0.05, 0.0, 0.0)), (0.07, 0.07, 0.1)), zone_facing(0.3)
    higher, all_of_them = (offering("patient", zone, FRAME, held, fine=True, low=low) for low in (False, True))
    lower = (all_of_them.points + held.offsets(all_of_them.rotations))[len(higher) :]
    assert higher.points[:, 2].min() > 1.0
    assert 0.7 < lower[:, 2].min() < 0.8
    assert all(zone.contains(middle) for middle in lower)


@settings(max_examples=30, deadline=None)
@given(blocks, st.tuples(size, size, size).map(lambda s: tuple(v / 10 for v in s)), angle)
def test_poses_above_keep_what_is_held_between_2_and_15_cm_over_the_top(
    block: Block, extents: tuple[float, float, float], turn: float
) -> None:
    held = Held("cup", Pose.planar(0.02, -0.01, turn, 0.03), extents)
    ways = held_above("box", block, FRAME, held, held.lowest_of, (0.02, 0.15), inset=0.05, fine=True)
    for index in range(0, len(ways), 7):
        pose = Pose.from_matrix(ways.plan(index).poses[0])
        lowest = corners(pose @ held.pose, extents)[:, 2].min()
        assert 0.02 <= lowest - block.high <= 0.15


GAPS = (0.05, 0.06, 0.065, 0.1)
"""From the bottle's middle to the wall behind it [m]; at some, open fingers have room and closing ones have none."""


def ways(stage: Stage, most: int) -> list[HandSolution]:
    """GraspCandidates to take the bottle with the left hand from where the robot stands."""
    arm = stage.platform.scene.arms.of(a_device("LeftGripper"))[0]
    found = stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, stage.platform.arm_joints(arm))
    taken = []
    with suppress(LocationUnresolvable):
        for way in islice(found, most):
            taken.append(way)
    return taken


def closed_on(stage: Stage, way: HandSolution) -> str | None:
    """Return what the hand has between its fingers when it closes them at the grasp of a way."""
    now = stage.truth.configuration()
    joints = dict(now.joints) | dict(way.plan.fingers) | dict(zip(way.arm.joints, way.joints[1].tolist(), strict=True))
    stage.truth.set_configuration(Configuration(now.base, joints))

    async def close() -> str | None:
        await stage.platform.hands.move(way.arm, closed=True)
        return stage.platform.hands.between_fingers(way.arm)

    held: str | None = stage.run(close)
    return held


@pytest.mark.parametrize("gap", some(GAPS, every=4))
def test_fingers_close_on_a_bottle_before_a_wall_by_every_way_that_is_offered(
    make_stage: MakeStage, gap: float
) -> None:
    wall = Body("wall", Pose((1.5 + gap + 0.025, 0.0, 1.1)), (0.05, 1.2, 0.6), type="Cupboard")
    stage = make_stage(CABINET, BOTTLE, wall, start=(0.827, 0.0, -0.35))
    offered = ways(stage, 6)
    assert {closed_on(stage, way) for way in offered} == {"bottle"}


@given(angle, angle, st.floats(0.1, 0.4), st.floats(0.02, 0.3), st.floats(0.02, 0.2), st.booleans())
def test_hands_at_a_handle_are_off_the_rest_of_the_thing(
    yaw: float, towards: float, width: float, out: float, rise: float, cylinder: bool
) -> None:
    block = Block.of(Pose.planar(0.0, 0.0, yaw, 0.1), (width, width, 0.2), cylinder=cylinder)
    away = block.support(towards) + out / 2
    place = Pose.planar(away * math.cos(towards), away * math.sin(towards), towards, rise)
    handle = Block.of(place, (out, 0.03, 0.02))
    grid = np.array(
        list(product(np.linspace(-0.15, 0.05, 9), np.linspace(-0.05, 0.05, 5), np.linspace(-0.02, 0.02, 3)))
    )
    found = beside(grasping("pan", handle, FRAME, 0.1, CLASSES, 16), block, handle, grid)
    points = (found.points[:, None] + grid @ found.rotations.transpose(0, 2, 1)).reshape(-1, 3)
    local = np.abs(block.to_local(points[:, :2]))
    beyond = np.hypot(*local.T) - width / 2 if cylinder else local.max(axis=1) - width / 2
    assert (np.maximum(beyond, np.abs(points[:, 2] - 0.1) - 0.1) >= -1e-9).all()


def test_a_level_hand_takes_a_long_box_at_its_end_where_its_palm_would_be_in_the_middle_of_it() -> None:
    palm = tuple((x, y, z) for x in (-0.15, -0.06) for y in (-0.05, 0.05) for z in (-0.05, 0.05))
    box = Block(1.0, 0.0, 0.0, 0.1, 0.03, 0.7, 0.85)
    found = grasping("box", box, FRAME, 0.1, (GraspClass.SIDE,), 4, palm)
    assert sorted(set(found.points[:, 0].round(6))) == [0.957, 1.043]
    assert found.points[:, 2] == pytest.approx(0.775)
    assert not len(grasping("box", replace(box, round=True), FRAME, 0.1, (GraspClass.SIDE,), 4, palm))
