"""Places for the base: each keeps what its relations promise, judged by a physics client of its own; none is missed."""

from __future__ import annotations

import math
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from itertools import islice, pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from executive.belief.scene_collisions import BasePose
from executive.locations.demands import base_demand
from executive.locations.floor_search import HEADINGS, MOST_CELLS, FloorSamples
from planlang.designators import Location, Relation, a_device, a_location, a_person, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array, Pose
from planlang.protocols import Solution
from sim import Body
from tests.executive.conftest import (
    BED,
    BOTTLE,
    CABINET,
    PATIENT,
    PLACE,
    THE_BOTTLE,
    WARD,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)
from tests.executive.locations.conftest import MakeJudge
from tests.support.detections import recognise
from tests.support.examples import examples, some

THE_PATIENT, THE_BED = a_person("Patient"), an_object("Bed-PieceOfFurniture")
GRASPED, BEFORE = a_location(in_center_of=THE_BOTTLE), a_location(in_front_of=THE_BOTTLE)
OVER_THE_BED = a_location(above=THE_BED)
OFFERED = a_location(in_reach_of=THE_PATIENT)
MANY = 5
"""Places that are judged of each resolution."""


def places(stage: Stage, location: Location, number: int = MANY) -> list[Solution]:
    """The first places of a location, fewer if there are not so many."""
    found: list[Solution] = []
    with suppress(LocationUnresolvable):
        found.extend(islice(stage.resolver.bases(location), number))
    return found


def assert_stands_free(stage: Stage, judge_of: MakeJudge, solutions: list[Solution]) -> None:
    """At no place does the robot, in its present posture, touch anything."""
    judge = judge_of(stage)
    for solution in solutions:
        judge.place(solution.base, stage.planning.configuration().joints)
        assert not judge.touched(), f"at {solution.base} the robot touches {judge.touched()}"


def assert_reaches(stage: Stage, judge_of: MakeJudge, solutions: list[Solution], hand: Location) -> list[Array]:
    """From each place the arm that was chosen has a way to ``hand`` that is possible; the tip poses (k, 4, 4)."""
    judge, poses = judge_of(stage), []
    for solution in solutions:
        stand(stage, solution.base)
        arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == solution.detail["arm"])
        way = next(stage.resolver.hands(hand, arm, stage.platform.arm_joints(arm)))
        judge.assert_possible(way, solution.base, stage)
        poses.append(way.plan.poses)
    return poses


@pytest.mark.parametrize(
    "location",
    some(
        [
            a_location(in_reach_of=THE_BOTTLE),
            a_location(in_reach_of=(THE_BOTTLE, BEFORE, GRASPED)),
            a_location(in_reach_of=THE_PATIENT),
            a_location(in_reach_of=THE_BED),
            a_location(visible_from=THE_BOTTLE),
            a_location(in_front_of=an_object("Cabinet-PieceOfFurniture")),
        ],
        every=6,
    ),
    ids=str,
)
def test_a_place_has_room_for_the_robot_and_the_next_is_elsewhere(
    location: Location, ward: Stage, judge_of: MakeJudge
) -> None:
    found = places(ward, location, 20)
    assert len(found) >= 5, f"only {len(found)} places in a room that is nearly empty"
    assert_stands_free(ward, judge_of, found)
    for before, after in pairwise(found):
        assert math.dist(before.base[:2], after.base[:2]) > 0.05, "two places in succession are the same one"


def test_from_a_place_in_reach_of_a_bottle_it_is_seen_and_grasped(ward: Stage, judge_of: MakeJudge) -> None:
    found = places(ward, a_location(in_reach_of=(THE_BOTTLE, BEFORE, GRASPED)))
    judge = judge_of(ward)
    for solution in found:
        joints = ward.planning.configuration().joints
        assert judge.sees("bottle", solution.base, joints), f"the bottle cannot be seen from {solution.base}"
    assert_reaches(ward, judge_of, found, GRASPED)
    assert_reaches(ward, judge_of, found, BEFORE)


def test_a_grasp_comes_from_8_cm_away_closes_around_the_centre_and_lifts(ward: Stage, judge_of: MakeJudge) -> None:
    found = places(ward, a_location(in_reach_of=(THE_BOTTLE, GRASPED)))
    centre = np.array(ward.belief.pose("bottle").position)
    for before, grasp, lifted, away in assert_reaches(ward, judge_of, found, GRASPED):
        assert np.linalg.norm(grasp[:3, 3] - centre) < 0.01, "the fingers close beside the bottle"
        approach, closing = grasp[:3, 0], grasp[:3, 1]  # of Amigo's grip points
        assert abs(closing[2]) < 1e-6, "the fingers close horizontally"
        assert np.allclose(grasp[:3, 3] - before[:3, 3], 0.08 * approach)
        assert np.allclose(lifted[:3, 3] - grasp[:3, 3], [0.0, 0.0, 0.05])
        assert np.allclose(lifted[:3, 3] - away[:3, 3], 0.08 * approach)


def test_over_a_bed_an_empty_hand_is_2_to_15_cm_over_its_top(ward: Stage, judge_of: MakeJudge) -> None:
    found = places(ward, a_location(in_reach_of=OVER_THE_BED))
    judge = judge_of(ward)
    top = BED.pose.position[2] + BED.size[2] / 2
    for solution in found:
        stand(ward, solution.base)
        arm = next(arm for arm in ward.platform.scene.arms.all if arm.name == solution.detail["arm"])
        way = next(ward.resolver.hands(OVER_THE_BED, arm, ward.platform.arm_joints(arm)))
        judge.assert_possible(way, solution.base, ward)
        judge.place(
            solution.base,
            {**ward.planning.configuration().joints, **dict(zip(arm.joints, way.joints[0], strict=True))},
        )
        assert 0.02 <= judge.lowest(arm.hand_links) - top <= 0.15
        assert_over(BED, way.plan.poses[0][:2, 3], 0.0)


def assert_over(body: Body, point: Array, radius: float) -> None:
    """A disc lies inside the footprint of a body whose axes are those of the map."""
    away = np.abs(point - np.array(body.pose.position[:2]))
    assert (away + radius <= np.array(body.size[:2]) / 2 + 1e-9).all(), f"{point} is not over {body.name}"


@pytest.mark.parametrize("arm", ["right", "left"])
def test_over_a_bed_a_held_bottle_would_come_down_whole_on_it(
    arm: str, make_stage: MakeStage, judge_of: MakeJudge
) -> None:
    stage = make_stage(CABINET, BOTTLE, BED)
    hold_bottle(stage, arm, turned=0.4)
    found = places(stage, a_location(in_reach_of=OVER_THE_BED))
    assert {solution.detail["arm"] for solution in found} == {arm}, "only the arm that holds the bottle counts"
    top, half = BED.pose.position[2] + BED.size[2] / 2, BOTTLE.size[2] / 2
    offset = stage.belief.held["bottle"].offset.matrix()
    for (tip,) in assert_reaches(stage, judge_of, found, OVER_THE_BED):
        held = tip @ offset
        assert held[2, 2] > 1 - 1e-6, "the bottle stands upright"
        assert 0.02 <= held[2, 3] - half - top <= 0.15
        assert_over(BED, held[:2, 3], BOTTLE.size[0] / 2)


@pytest.mark.parametrize("arm", ["right", "left"])
def test_in_reach_of_a_patient_what_is_held_comes_into_their_comfort_zone(
    arm: str, ward: Stage, judge_of: MakeJudge
) -> None:
    hold_bottle(ward, arm)
    found = places(ward, a_location(in_reach_of=(THE_PATIENT, OFFERED)))
    assert_stands_free(ward, judge_of, found)
    person = ward.truth.person("patient")
    offset = ward.belief.held["bottle"].offset.matrix()
    for (tip,) in assert_reaches(ward, judge_of, found, OFFERED):
        held = (tip @ offset)[:3, 3]
        arrows = [held - np.array(shoulder) for shoulder in person.shoulders]
        assert any(
            0.25 * person.arm_length <= np.linalg.norm(arrow) <= person.arm_length
            and arrow @ person.facing >= 0.5 * np.linalg.norm(arrow)
            for arrow in arrows
        ), f"nobody would take something at {held}"


def test_where_something_is_visible_from_the_camera_sees_it(make_stage: MakeStage, judge_of: MakeJudge) -> None:
    wardrobe = Body("wardrobe", Pose.planar(0.6, 0.5, 0.3, 1.0), (0.5, 0.6, 2.0), type="Cupboard")
    stage = make_stage(CABINET, BOTTLE, wardrobe, start=(-1.5, 0.0, 0.0))
    judge = judge_of(stage)
    found = places(stage, a_location(visible_from=THE_BOTTLE), 12)
    assert len(found) == 12
    for solution in found:
        joints = stage.planning.configuration().joints
        assert judge.sees("bottle", solution.base, joints), f"the bottle cannot be seen from {solution.base}"


def test_in_front_of_furniture_is_on_the_side_of_its_x_axis(make_stage: MakeStage) -> None:
    facing_y = Body("cabinet", Pose.planar(1.6, 0.0, math.pi / 2, 0.4), CABINET.size, type=CABINET.type)
    stage = make_stage(facing_y)
    for solution in places(stage, a_location(in_front_of=an_object("Cabinet-PieceOfFurniture"))):
        x, y, _ = solution.base
        assert 0.4 <= y - CABINET.size[0] / 2 <= 1.5
        assert abs(x - 1.6) <= y - CABINET.size[0] / 2 + 2e-3, "within 45 degrees of the front"


def test_a_device_narrows_what_reaches(ward: Stage) -> None:
    for side in ("left", "right"):
        gripper = a_device("HolderGripper", f"http://example.org/amigo.owl#{side}Gripper")
        found = places(ward, a_location(in_reach_of=THE_BOTTLE, using=gripper))
        assert {solution.detail["arm"] for solution in found} == {side}


def test_one_place_serves_all_relations_of_a_conjunction(make_stage: MakeStage, judge_of: MakeJudge) -> None:
    beside = replace(CABINET, pose=Pose((-1.7, 0.9, 0.4)), size=(0.3, 0.3, 0.8))
    bottle = replace(BOTTLE, pose=Pose((-1.7, 0.9, 0.9)))
    stage = make_stage(beside, bottle, BED, PATIENT)
    found = places(stage, a_location(in_reach_of=(GRASPED, OFFERED)), 1)
    assert found
    assert_reaches(stage, judge_of, found, GRASPED)
    assert_reaches(stage, judge_of, found, OFFERED)


def test_where_the_robot_stands_comes_first_if_it_will_do(ward: Stage) -> None:
    good = places(ward, a_location(in_reach_of=THE_BOTTLE), 3)[2].base
    stand(ward, good)
    assert places(ward, a_location(in_reach_of=THE_BOTTLE), 1)[0].base == good


def test_the_same_room_gives_the_same_places(make_stage: MakeStage) -> None:
    location = a_location(in_reach_of=THE_BOTTLE)
    first, second = (places(make_stage(*WARD), location) for _ in range(2))
    assert first == second


BODIES = (BED, CABINET, replace(CABINET, name="post", size=(0.3, 0.3, 1.2), shape="cylinder"))
"""A bed, a cabinet with a front, and a post."""
NAMES = ("near", "far_from", "facing", "in_front_of", "behind", "left_of", "right_of", "next_to", "clear_of")
UNMEASURED = ("facing", "clear_of")
START = (-5.0, -5.0, 0.3)
"""Where the robot is: away from the middle, where everything else is."""
AROUND = ((0.0, 0.0, 0.0), (0.08, 0.0, 0.05), (0.0, 0.08, -0.05), (-0.08, 0.0, -0.05), (0.0, -0.08, 0.05))
"""What a place is moved and turned by: the search knows some points of the floor only [m, rad]."""

coordinates, yaws = st.floats(-4.0, 4.0), st.floats(-math.pi, math.pi)
points = st.tuples(coordinates, coordinates, yaws)
asked = st.tuples(st.sampled_from(NAMES), st.sampled_from(BODIES), st.none() | st.floats(0.2, 2.0))
"""A relation, to what, and how wide the band of distances is that it asks for; or its default one [m]."""


def about(stage: Stage, place: BasePose, name: str, body: Body, width: float | None) -> Relation:
    """A relation to a body that holds at a place: with a band of distances if one is asked for, else negated."""
    what = an_object(body.type, PLACE + body.name)
    plain = Relation(name, (what,))
    bands = [plain]
    if width is not None and name not in UNMEASURED:
        bands = [Relation(name, (what,), (n + 2) * width / 2, n * width / 2) for n in range(math.ceil(16.0 / width))]
    return next((band for band in bands if stage.resolver.satisfies(Location((band,)), place) is not None), ~bands[0])


def moved(stage: Stage, poses: Iterable[BasePose]) -> None:
    """Let the robot believe that the bodies are elsewhere."""
    there = [Pose.planar(x, y, yaw, body.pose.position[2]) for body, (x, y, yaw) in zip(BODIES, poses, strict=True)]
    for body, pose in zip(BODIES, there, strict=True):
        recognise(stage.belief, body.name, pose)
    stage.platform.observe()


@settings(max_examples=examples(150), deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@given(st.tuples(points, points, points), points, st.lists(asked, min_size=1, max_size=3))
def test_where_a_place_satisfies_a_location_one_is_found(
    furnish: MakeStage,
    bodies: tuple[BasePose, BasePose, BasePose],
    place: BasePose,
    relations: list[tuple[str, Body, float | None]],
) -> None:
    stage = room(furnish)
    moved(stage, bodies)
    assume(not stage.platform.scene.collisions.contacts(place))
    location = Location(tuple(dict.fromkeys(about(stage, place, *relation) for relation in relations)))
    nearby = [(place[0] + x, place[1] + y, place[2] + yaw) for x, y, yaw in AROUND]
    assume(all(stage.resolver.satisfies(location, there) for there in nearby))
    found = (s.base for s in stage.resolver.bases(location) if s.base != START)
    assert stage.resolver.satisfies(location, next(found))


ROOMS: list[Stage] = []


def room(furnish: MakeStage) -> Stage:
    """The same room for all examples."""
    if not ROOMS:
        ROOMS.append(furnish(*BODIES, start=START))
        stand(ROOMS[0], START)
    return ROOMS[0]


THE_CABINET = an_object("Cabinet-PieceOfFurniture")


@pytest.mark.parametrize(
    "location",
    [
        Location((Relation("in_front_of", (THE_CABINET,), 4.0, 3.2),)),
        a_location(facing=(THE_CABINET, an_object("Table")), near=THE_BED, within=0.3),
        a_location(facing=THE_BED, not_=a_location(facing=a_person("Patient"))),
    ],
    ids=str,
)
def test_what_is_far_away_and_headings_between_others_are_found(location: Location, make_stage: MakeStage) -> None:
    table = replace(CABINET, name="table", pose=Pose((-1.0, 3.0, 0.4)), type="Table")
    stage = make_stage(*WARD, table)
    for solution in list(islice(stage.resolver.bases(location), 3)):
        assert stage.resolver.satisfies(location, solution.base)
        assert not stage.platform.scene.collisions.contacts(solution.base)


@pytest.mark.parametrize(
    ("half", "least", "most"), [(15.0, 14.0, 30.0), (15.0, 14.0, 14.2), (1e3, 900.0, 900.2), (1e6, 1e3, 1e3 + 0.2)]
)
def test_a_place_in_a_large_room_is_found_with_work_that_does_not_grow_with_it(
    half: float, least: float, most: float, make_stage: MakeStage
) -> None:
    stage = make_stage(CABINET, BOTTLE, bounds=(-half, -half, half, half))
    location = Location((Relation("near", (THE_BOTTLE,), most, least),))
    x, y, _ = next(stage.resolver.bases(location)).base
    assert least - 2e-3 <= math.hypot(x - 1.5, y) - 0.0325 - 0.333 <= most + 2e-3
    bases, _, _ = FloorSamples(base_demand(location, stage.platform.scene, (0.0, 0.0)), stage.platform.scene).anywhere()
    assert 0 < len(bases) <= HEADINGS * MOST_CELLS
