"""Facts about the field of room: what it promises, what it leaves open, what surely has no room."""

import math

import numpy as np
import pytest

from executive.belief.scene_collisions import DOUBTFUL, Floor
from executive.locations.base_candidates import BaseCandidates
from executive.motion.clearance import Boxes, outlines
from planlang.geometry import Array, Pose

HALF = 0.3
SQUARE = HALF * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@pytest.fixture
def floor() -> Floor:
    """Of a square robot in front of a wall whose near side is at x = 1."""
    wall = Boxes.around([Pose.planar(1.1, 0.0, 0.0, 0.5)], [(0.2, 6.0, 1.0)])
    silhouette = ((0.0, 0.5, HALF * math.sqrt(2)),)
    return Floor(wall, silhouette, outlines([(0.0, 0.5, SQUARE)]), (-2.0, -2.0, 2.0, 2.0))


def factors(floor: Floor, points: Array) -> list[float]:
    field = floor.field((0.0, 0.0), 0.0, 1.5)
    found = field.looked_up(points, np.zeros(len(points)), np.zeros((1, 2)))
    return [float(factor) for factor in found[:, 0]]


def test_a_square_robot_stands_at_a_wall_with_a_side_ahead_and_not_with_a_corner(floor: Floor) -> None:
    near = 1.0 - HALF - 0.02
    bases = np.array([[near, 0.0, 0.0], [near, 0.0, math.pi / 4], [near, 0.0, -math.pi / 2], [0.0, 0.0, 0.3]])
    assert floor.holds(bases).tolist() == [True, False, True, True]


def test_nowhere_off_the_map_is_there_room(floor: Floor) -> None:
    assert floor.holds(np.array([[-2.1, 0.0, 0.0], [0.0, 2.5, 0.0]])).tolist() == [False, False]


def test_the_field_leaves_open_where_the_heading_decides(floor: Floor) -> None:
    roomy, open_, none = factors(floor, np.array([[0.4, 0.0], [0.65, 0.0], [0.8, 0.0]]))
    assert roomy > DOUBTFUL
    assert open_ == DOUBTFUL
    assert none == 0.0


def test_candidates_come_in_turn_over_the_ways_and_no_more_than_are_asked_for() -> None:
    scores = np.array([0.9, 0.8, 0.7, 0.2, 0.1])
    ranks = np.array([0, 1, 2, 0, 1], np.intp)
    found = BaseCandidates(np.zeros((5, 3)), scores, *(np.zeros(5, np.intp) for _ in range(3)), np.zeros(5), ranks)

    def alike(bases: Array) -> Array:
        return np.ones(len(bases))

    assert found.order(alike, 10).tolist() == [0, 3, 1, 4, 2]
    assert found.order(alike, 3).tolist() == [0, 3, 1]
    assert found.chosen(found.order(alike, 2)).scores.tolist() == [0.9, 0.2]
    assert BaseCandidates().order(alike, 3).tolist() == []
