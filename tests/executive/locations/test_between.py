"""Facts about places between those of the maps: candidates are moved to where there is room, never far."""

from __future__ import annotations

import math

import numpy as np
import pytest

from executive.belief.scene_collisions import CELL, Floor
from executive.locations.base_candidates import FINER, BaseCandidates, moved_to_room
from executive.locations.reachability import YAWS
from executive.motion.clearance import Boxes, outlines
from planlang.geometry import Array, Pose
from tests.support.locations.oracle import Oracle
from tests.support.locations.reach import judged
from tests.support.locations.rooms import asked, room_of
from tests.support.locations.stage import Stage, robot_of

HALF = 0.3
ALL = 1_000
MIDDLE = np.array([0.1, -0.2])
TURN = 0.13


@pytest.fixture
def floor() -> Floor:
    """Of a square robot between two walls that leave it 3 cm."""
    walls = Boxes.around([Pose.planar(side * 0.415, 0.0, 0.0, 0.5) for side in (-1, 1)], [(0.2, 6.0, 1.0)] * 2)
    square = HALF * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    return Floor(walls, ((0.0, 0.5, HALF * math.sqrt(2)),), outlines([(0.0, 0.5, square)]), (-2.0, -2.0, 2.0, 2.0))


def candidates(bases: Array) -> BaseCandidates:
    """One way's, the first the best."""
    count = len(bases)
    numbers = np.arange(count)
    same = np.zeros(count, np.intp)
    return BaseCandidates(bases, 1.0 - numbers / (2 * count), same, same, numbers, np.zeros(count), numbers)


def drawn(count: int) -> BaseCandidates:
    rng = np.random.default_rng(5)
    return candidates(
        np.column_stack([rng.uniform(-0.1, 0.1, count), rng.uniform(-1, 1, count), rng.uniform(-4, 4, count)])
    )


def test_what_is_moved_has_room_and_is_moved_by_less_than_a_cell_and_half_a_heading_of_the_maps(floor: Floor) -> None:
    found = drawn(ALL)
    moved = moved_to_room(found, floor, MIDDLE, TURN, ALL)
    assert 0 < len(moved) < ALL
    assert floor.holds(moved.bases).all()
    before = found.bases[moved.rows]
    assert (np.abs((moved.bases - before)[:, :2] @ turned(TURN)) <= 0.75 * CELL + 1e-6).all()
    away = np.remainder(moved.bases[:, 2] - before[:, 2] + math.pi, 2 * math.pi) - math.pi
    assert np.abs(away).max() <= math.pi / (FINER * YAWS) + 1e-5


def test_more_candidates_have_room_where_they_are_moved_to_than_where_they_were(floor: Floor) -> None:
    found = candidates(np.column_stack([np.full(9, 0.02), np.linspace(-0.8, 0.8, 9), np.zeros(9)]))
    assert not floor.holds(found.bases).any()
    assert len(moved_to_room(found, floor, np.zeros(2), 0.0, ALL)) == 9


def test_of_those_that_come_to_the_same_place_the_best_is_left_and_ranks_are_without_gaps(floor: Floor) -> None:
    moved = moved_to_room(drawn(ALL), floor, MIDDLE, TURN, ALL)
    assert len(np.unique(moved.bases.round(6), axis=0)) == len(moved)
    assert moved.ranks.tolist() == list(range(len(moved)))
    assert (np.diff(moved.scores) <= 0).all()
    twice = moved_to_room(candidates(np.array([[0.004, 0.01, 0.0], [0.005, 0.01, 0.01]])), floor, np.zeros(2), 0.0, ALL)
    assert twice.rows.tolist() == [0]


def test_no_more_are_moved_than_are_asked_for_and_none_of_none(floor: Floor) -> None:
    assert set(moved_to_room(drawn(ALL), floor, MIDDLE, TURN, 50).rows.tolist()) <= set(range(50))
    assert len(moved_to_room(BaseCandidates(), floor, MIDDLE, TURN, 50)) == 0


def test_a_place_is_found_where_the_base_has_only_centimetres_and_the_maps_have_none() -> None:
    room, robot = room_of("hard", 31), robot_of("amigo")
    stage, oracle = Stage(room, robot), Oracle(room, robot)
    try:
        answer = stage.ask(asked(room))
        assert answer.solved, answer.failure
        assert judged(stage, oracle, answer, asked(room)) is None
    finally:
        stage.close()
        oracle.close()


def turned(yaw: float) -> Array:
    """Columns are the axes of a lattice that is turned by so much."""
    return np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
