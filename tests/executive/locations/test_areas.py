"""Areas that relations mean, where outlines overlap and where distances are extreme."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from executive.belief.believed_bodies import Block
from executive.locations.areas import area_of
from planlang.designators import a_location, an_object, located
from planlang.geometry import Pose
from planlang.relations import RELATIONS
from tests.executive.conftest import BED, BOTTLE, THE_BOTTLE, MakeStage, stand

THE_BED = an_object("Bed-PieceOfFurniture")


def test_what_lies_on_a_bed_is_near_it(make_stage: MakeStage) -> None:
    stage = make_stage(BED, replace(BOTTLE, pose=Pose((-2.5, 0.0, 0.65))))
    near = a_location(near=THE_BED)
    assert stage.resolver.holds(near, THE_BOTTLE)
    assert not stage.resolver.holds(a_location(not_=near), THE_BOTTLE)
    poses = list(islice(stage.resolver.things(a_location(on=THE_BED) & near, THE_BOTTLE), 3))
    assert len(poses) == 3


def test_a_base_on_a_marker_is_near_it(make_stage: MakeStage) -> None:
    stage = make_stage(replace(BED, shape="marker", size=(0.0, 0.0, 0.0), pose=Pose((0.5, 0.0, 0.0))))
    stand(stage, (0.5, 0.0, 0.0))
    assert stage.executive.holds(located(a_location(near=THE_BED)))
    assert not stage.executive.holds(located(a_location(not_=a_location(near=THE_BED))))


def test_everything_in_a_room_is_near_the_room() -> None:
    room = Block(0.0, 0.0, 0.0, 4.0, 4.0, 0.0, 3.0)
    area = area_of("near room", "room", room, (), front=None, viewer=(0.0, 0.0), radius=0.333, bounds=(0.0, 1.0))
    assert area.holds((0.0, 0.0))
    assert area.holds((3.9, -3.9))


@pytest.mark.parametrize("relation", [*(name for name, one in RELATIONS.items() if one.directions), "far_from"])
@pytest.mark.parametrize("away", [1.0, 30.0, 1e3, 1e6])
def test_a_place_is_as_far_away_as_is_asked_for_and_nothing_overflows(relation: str, away: float) -> None:
    table = Block(0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.7)
    directions = RELATIONS[relation].directions
    turn = (*directions, 0.0)[0]
    points = np.outer([0.0, away + 0.5, 2 * away + 1.0], [math.cos(turn), math.sin(turn)])
    limits = (away, math.inf)
    beyond = area_of("", "table", table, directions, front=0.0, viewer=(0.0, 0.0), radius=0.0, bounds=limits)
    with np.errstate(over="raise"):
        assert (beyond.score(points) > 0).tolist() == [False, True, True]


def test_a_distance_that_is_given_exactly_is_kept_within_a_millimetre() -> None:
    table = Block(0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.7)
    area = area_of("", "table", table, (), front=0.0, viewer=(0.0, 0.0), radius=0.0, bounds=(1.0, 1.0))
    held = [area.holds((0.4 + away, 0.0)) for away in (0.998, 0.9995, 1.0, 1.0005, 1.002)]
    assert held == [False, True, True, True, False]
