"""Base poses before a row of points, as a stroke goes through; those without room are counted, with what takes it."""

import math

import numpy as np
import pytest

from executive.locations.base_poses import BasePoses
from executive.locations.rejections import NO_ROOM
from executive.locations.standing import BEST, SHARES
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BED, MakeStage

WALLS = [Body(f"wall{x:+d}", Pose((0.5 * x, 0.0, 0.75)), (0.1, 8.0, 1.5)) for x in (1, -1)]
"""Of a corridor across the way that the robot faces, 0.9 m wide."""


@pytest.mark.parametrize("turned", [0.0, 0.5 * math.pi], ids=["along", "across"])
def test_a_row_of_points_is_best_reached_from_its_side(make_stage: MakeStage, turned: float) -> None:
    room = make_stage(BED)
    arm = room.platform.scene.arms.all[0]
    ahead = np.array([math.cos(turned), math.sin(turned)])
    middle = np.array(room.platform.base()[:2]) + BEST * arm.reach * np.array([1.0, 0.0])
    row = middle + 0.25 * np.linspace(-1.0, 1.0, 5)[:, None] * ahead
    _, _, heading = next(room.platform.standing().before(row, [arm]))
    assert abs(math.cos(heading - turned)) <= 0.5


def test_places_at_all_distances_are_offered_where_there_is_room_all_around(make_stage: MakeStage) -> None:
    room = make_stage(BED)
    arm = room.platform.scene.arms.all[0]
    point = np.array(room.platform.base()[:2]) + np.array([1.0, 0.0])
    shoulder = (arm.shoulder_low + arm.shoulder_high)[:2] / 2
    away = []
    for x, y, yaw in room.platform.standing().before(point, [arm]):
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        away.append(float(np.linalg.norm(point - (x, y) - turn @ shoulder)) / arm.reach)
    assert set(np.round(away, 3)) == set(SHARES)


def test_what_takes_the_room_of_base_poses_is_named_when_it_is_asked_for(make_stage: MakeStage) -> None:
    stage = make_stage(BED)
    stage.platform.observe()
    poses = BasePoses(stage.platform.scene)
    on_the_bed, beside = (*BED.pose.position[:2], 0.0), stage.platform.base()
    assert poses.free(np.array([on_the_bed, beside]), np.ones(2)).tolist() == [False, True]
    assert (dict(poses.log.counts), dict(poses.log.blocking)) == ({NO_ROOM: 1}, {})
    poses.name_crowding()
    assert dict(poses.log.blocking) == {BED.name: 1}


def test_the_base_backs_off_straight_at_first(make_stage: MakeStage) -> None:
    x, y, yaw = (stage := make_stage(BED)).platform.base()
    first = next(stage.platform.standing().beside(yaw, [0.2]))
    assert first == pytest.approx((x - 0.2 * math.cos(yaw), y - 0.2 * math.sin(yaw), yaw))


def test_where_no_step_aside_gives_an_arm_its_room_the_base_turns(make_stage: MakeStage) -> None:
    stage = make_stage(BED, *WALLS)
    stage.platform.observe()
    scene, here = stage.platform.scene, stage.platform.base()
    arm = scene.arms.all[0]
    ahead = arm.seeds[np.argmax(arm.chain.fk(arm.seeds)[:, 0, 3])]
    assert scene.collisions.contacts(here, arm, ahead)
    assert not scene.collisions.contacts(here)
    room = stage.platform.standing().with_room_for([(arm, ahead)])
    assert room is not None
    assert abs(math.sin(room[2] - here[2])) > 0.7
    assert not scene.collisions.contacts(room, arm, ahead)
