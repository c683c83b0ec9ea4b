"""Facts about footprints: where a robot that is not round stands depends on its heading."""

import math

import numpy as np
import pytest

from executive.motion.clearance import TOUCHING, Boxes, Outline, clearance_at, cores, outlines, stands_in_none
from planlang.geometry import Array, Pose

SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
WALL = Boxes.around([Pose.planar(1.0, 0.0, 0.0, 0.5)], [(0.2, 4.0, 1.0)])
"""A wall whose near side is at x = 0.9."""


def square() -> tuple[Outline, ...]:
    return outlines([(0.0, 0.4, SQUARE)])


def test_a_square_robot_stands_nearer_to_a_wall_with_a_side_ahead_than_with_a_corner() -> None:
    near = 0.9 - 0.3 - 0.01
    assert stands_in_none(np.array([[near, 0.0, 0.0], [near, 0.0, math.pi / 2]]), WALL, square()).all()
    assert not stands_in_none(np.array([[near, 0.0, math.pi / 4]]), WALL, square())[0]
    far = 0.9 - 0.3 * math.sqrt(2) - 0.01
    assert stands_in_none(np.array([[far, 0.0, math.pi / 4]]), WALL, square())[0]


def test_corners_of_a_box_count_as_those_of_the_robot_do() -> None:
    post = Boxes.around([Pose.planar(0.0, 0.0, math.pi / 4, 0.2)], [(0.2, 0.2, 0.4)])
    reach = 0.1 * math.sqrt(2)
    free = stands_in_none(np.array([[0.3 + reach + 0.01, 0.0, 0.0], [0.3 + reach - 0.01, 0.0, 0.0]]), post, square())
    assert free.tolist() == [True, False]


def test_boxes_above_and_below_a_link_are_no_obstacle_to_it() -> None:
    inside = np.array([[1.0, 0.0, 0.0]])
    over = Boxes.around([Pose.planar(1.0, 0.0, 0.0, 0.8)], [(0.2, 4.0, 0.8)])
    assert stands_in_none(inside, over, square())[0]
    assert not stands_in_none(inside, WALL, square())[0]


def test_outlines_agree_with_points_that_fill_them() -> None:
    rng = np.random.default_rng(0)
    poses = [Pose.planar(x, y, yaw, 0.5) for x, y, yaw in rng.uniform((-1.5, -1.5, -3.0), (1.5, 1.5, 3.0), (5, 3))]
    boxes = Boxes.around(poses, np.column_stack([rng.uniform(0.1, 0.8, (5, 2)), np.ones(5)]))
    shape = Outline.of(0.0, 1.0, np.array([[-0.2, -0.3], [0.5, -0.1], [0.3, 0.25], [-0.25, 0.2]]))
    bases = np.column_stack([rng.uniform(-2, 2, (300, 2)), rng.uniform(-4, 4, 300)])
    weights = rng.dirichlet(np.full(4, 0.3), 4000)
    points: Array = weights @ shape.corners
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
    turns = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=1)
    filled = points @ turns.transpose(0, 2, 1) + bases[:, None, :2]
    room = clearance_at(filled.reshape(-1, 2), boxes, [(0.0, 1.0, 0.0)]).reshape(len(bases), -1).min(axis=1)
    free = stands_in_none(bases, boxes, (shape,))
    assert not (free & (room < -2 * TOUCHING)).any(), "a base was called free with a point in a box"
    assert not (~free & (room > 0.05)).any(), "a base was refused far from all boxes"
    assert 0.2 < free.mean() < 0.9


def test_the_core_is_the_circle_that_every_heading_takes() -> None:
    (core,) = cores(square())
    assert core == pytest.approx((0.0, 0.4, 0.3))
    aside = outlines([(0.0, 0.4, SQUARE + np.array([1.0, 0.0]))])
    assert cores(aside) == ()


def test_links_inside_of_others_are_left_out() -> None:
    small = 0.5 * SQUARE
    assert len(outlines([(0.1, 0.3, small), (0.0, 0.4, SQUARE)])) == 1
    assert len(outlines([(0.1, 0.5, small), (0.0, 0.4, SQUARE)])) == 2
