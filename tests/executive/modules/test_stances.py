"""Stances: places of the base before a row of points, as a stroke goes through."""

import math

import numpy as np
import pytest

from executive.modules.stances import BEST, SHARES, stances
from tests.executive.conftest import BED, MakeStage


@pytest.mark.parametrize("turned", [0.0, 0.5 * math.pi], ids=["along", "across"])
def test_a_row_of_points_is_best_reached_from_its_side(make_stage: MakeStage, turned: float) -> None:
    room = make_stage(BED)
    arm = room.platform.scene.arms.all[0]
    ahead = np.array([math.cos(turned), math.sin(turned)])
    middle = np.array(room.platform.base()[:2]) + BEST * arm.reach * np.array([1.0, 0.0])
    row = middle + 0.25 * np.linspace(-1.0, 1.0, 5)[:, None] * ahead
    _, _, heading = next(stances(room.platform, row, [arm]))
    assert abs(math.cos(heading - turned)) <= 0.5


def test_places_at_all_distances_are_offered_where_there_is_room_all_around(make_stage: MakeStage) -> None:
    room = make_stage(BED)
    arm = room.platform.scene.arms.all[0]
    point = np.array(room.platform.base()[:2]) + np.array([1.0, 0.0])
    shoulder = (arm.shoulder_low + arm.shoulder_high)[:2] / 2
    away = []
    for x, y, yaw in stances(room.platform, point, [arm]):
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        away.append(float(np.linalg.norm(point - (x, y) - turn @ shoulder)) / arm.reach)
    assert set(np.round(away, 3)) == set(SHARES)
