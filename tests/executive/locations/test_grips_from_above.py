"""Tall things are gripped from above as high as the open fingers have room for them."""

from __future__ import annotations

from dataclasses import replace

import pytest

from planlang.designators import a_location
from planlang.geometry import Pose
from tests.executive.conftest import BOTTLE
from tests.support.locations.oracle import Oracle
from tests.support.locations.reach import judged
from tests.support.locations.rooms import THE_BOTTLE, Room, box
from tests.support.locations.stage import Stage, robot_of

TABLE = box("table", (0.8, 1.2, 0.6), (1.4, 0.0, 0.3))
ROOM = replace(BOTTLE, name="room", pose=Pose((0.0, 0.0, 1.3)), size=(6.0, 5.0, 2.6), shape="room", type="HospitalRoom")


@pytest.mark.parametrize(
    ("robot", "width", "shape", "grasp"),
    [
        pytest.param("pr2", 0.07, "cylinder", "top", marks=pytest.mark.pr2),
        pytest.param("pr2", 0.075, "box", "tilted", marks=pytest.mark.pr2),
        ("amigo", 0.1, "cylinder", "top"),
    ],
)
def test_a_wide_tall_thing_is_gripped_from_above(robot: str, width: float, shape: str, grasp: str) -> None:
    size = (width, width, 0.2)
    thing = replace(BOTTLE, pose=Pose((1.1, 0.0, 0.7)), size=size, shape=shape, iri=THE_BOTTLE.iri)
    room = Room("a table in an empty room", 0, (replace(ROOM, movable=False), TABLE, thing))
    location = a_location(in_reach_of=THE_BOTTLE, grasp=grasp)
    stage, oracle = Stage(room, robot_of(robot)), Oracle(room, robot_of(robot))
    answer = stage.ask(location)
    assert answer.solved, answer.failure
    assert judged(stage, oracle, answer, location) is None
    stage.close()
    oracle.close()


def test_a_jug_nearly_as_wide_as_the_hand_opens_is_gripped_near_its_side() -> None:
    jug = replace(
        BOTTLE, pose=Pose((1.1, 0.0, 0.7)), size=(0.1, 0.1, 0.22), shape="box", iri=THE_BOTTLE.iri, wall=0.008
    )
    room = Room("a table in an empty room", 0, (replace(ROOM, movable=False), TABLE, jug))
    location = a_location(in_reach_of=THE_BOTTLE, grasp="side")
    stage, oracle = Stage(room, robot_of("amigo")), Oracle(room, robot_of("amigo"))
    answer = stage.ask(location)
    assert answer.solved, answer.failure
    assert judged(stage, oracle, answer, location) is None
    stage.close()
    oracle.close()
