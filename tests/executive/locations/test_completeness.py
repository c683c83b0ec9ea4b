"""Where a place satisfies a location that asks for no reach the search finds one: however far, narrow or turned."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import islice

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from executive.belief.scene_collisions import BasePose
from executive.locations.demands import base_demand
from executive.locations.floor_search import HEADINGS, MOST_CELLS, sample_anywhere
from planlang.designators import Location, Relation, a_location, a_person, an_object
from planlang.geometry import Pose
from planlang.protocols import Detection
from sim import Body
from tests.executive.conftest import BED, BOTTLE, CABINET, PLACE, THE_BOTTLE, WARD, MakeStage, Stage, stand

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
    plain = Relation(name, what)
    bands = [plain]
    if width is not None and name not in UNMEASURED:
        bands = [Relation(name, what, (n + 2) * width / 2, n * width / 2) for n in range(math.ceil(16.0 / width))]
    return next((band for band in bands if stage.resolver.satisfies(Location((band,)), place) is not None), ~bands[0])


def moved(stage: Stage, poses: Iterable[BasePose]) -> None:
    """Let the robot believe that the bodies are elsewhere."""
    there = [Pose.planar(x, y, yaw, body.pose.position[2]) for body, (x, y, yaw) in zip(BODIES, poses, strict=True)]
    stage.belief.see(Detection(body.name, pose, 1.0) for body, pose in zip(BODIES, there, strict=True))
    stage.platform.sync()


@settings(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
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


THE_CABINET, THE_BED = an_object("Cabinet-PieceOfFurniture"), an_object("Bed-PieceOfFurniture")


@pytest.mark.parametrize(
    "location",
    [
        Location((Relation("in_front_of", THE_CABINET, 4.0, 3.2),)),
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
    half: float, least: float, most: float, make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.executive.conftest.BOUNDS", (-half, -half, half, half))
    stage = make_stage(CABINET, BOTTLE)
    location = Location((Relation("near", THE_BOTTLE, most, least),))
    x, y, _ = next(stage.resolver.bases(location)).base
    assert least - 2e-3 <= math.hypot(x - 1.5, y) - 0.0325 - 0.333 <= most + 2e-3
    bases, _, _ = sample_anywhere(base_demand(location, stage.platform.scene, (0.0, 0.0)), stage.platform.scene)
    assert 0 < len(bases) <= HEADINGS * MOST_CELLS
