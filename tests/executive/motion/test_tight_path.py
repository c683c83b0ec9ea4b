"""Where a base gets to over places and headings, and its paths there."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.motion.base_path import Touching, plan_base_path, plan_tight_path
from executive.motion.clearance import Band, Boxes, Grid, clearance_at, clearance_field
from executive.motion.errors import GoalInCollision, NoPath, StartInCollision
from executive.motion.floods import LACKING, SPARE, Drivable, drivable, free_poses
from executive.motion.outlines import Outline, outlines, stands_in_none
from planlang.geometry import Pose

GRID = Grid.over((0.0, 0.0), (6.0, 6.0))
RADIUS = 0.35
Planar = tuple[float, float, float]


def room(*boxes: tuple[float, float, float, float]) -> Boxes:
    """Boxes as (x, y, width along x, width along y), 1 m high."""
    return Boxes.around([Pose.planar(x, y, 0, 0.5) for x, y, _, _ in boxes], [(w, d, 1.0) for _, _, w, d in boxes])


def rectangle(ahead: float, aside: float) -> tuple[Outline, ...]:
    """The outline of a base that is so far from its middle to its front and to its side [m]."""
    return outlines([(0.0, 1.0, np.array([[-ahead, -aside], [ahead, -aside], [ahead, aside], [-ahead, aside]]))])


def disc() -> tuple[Outline, ...]:
    """The outline of a round base."""
    turns = np.linspace(0.0, 2 * math.pi, 32, endpoint=False)
    return outlines([(0.0, 1.0, RADIUS * np.stack([np.cos(turns), np.sin(turns)], axis=1))])


def bands(shapes: tuple[Outline, ...]) -> list[Band]:
    return [(one.low, one.high, one.radius) for one in shapes]


def reached(start: Planar, boxes: Boxes, shapes: tuple[Outline, ...], slack: float = LACKING) -> Drivable:
    return drivable(start, GRID, free_poses(GRID, boxes, bands(shapes), shapes, slack))


def touching(boxes: Boxes, shapes: tuple[Outline, ...]) -> Touching:
    """The exact check of a base."""

    def check(x: float, y: float, yaw: float) -> list[tuple[str, str]]:
        return [] if stands_in_none(np.array([[x, y, yaw]]), boxes, shapes)[0] else [("base", "wall")]

    return check


def tight(start: Planar, goal: Planar, boxes: Boxes, shapes: tuple[Outline, ...]) -> list[Planar]:
    """The poses every centimetre of a path among boxes."""
    free = free_poses(GRID, boxes, bands(shapes), shapes)
    path = plan_tight_path(start, goal, GRID, free, touching(boxes, shapes), 0.02)
    assert path[0] == pytest.approx(start)
    assert path[-1][:2] == pytest.approx(goal[:2])
    assert math.remainder(path[-1][2] - goal[2], 2 * math.pi) == pytest.approx(0.0)
    poses = [a + (b - a) * share for a, b in pairwise(path) for share in np.linspace(0.0, 1.0, 60)]
    return [(float(x), float(y), float(yaw)) for x, y, yaw in poses]


places = st.tuples(st.floats(0.2, 5.8), st.floats(0.2, 5.8))
sizes = st.tuples(st.floats(0.05, 4.0), st.floats(0.05, 0.6))


@given(
    st.lists(st.builds(lambda at, size, turn: (*at, *size[:: 1 - 2 * turn]), places, sizes, st.booleans()), max_size=9),
    places,
    places,
)
def test_round_base_that_has_a_path_can_drive_there(
    walls: list[tuple[float, float, float, float]], start: tuple[float, float], goal: tuple[float, float]
) -> None:
    boxes, silhouette = room(*walls), [(0.0, 1.0, RADIUS)]

    def check(x: float, y: float, yaw: float) -> list[tuple[str, str]]:
        return [] if clearance_at([[x, y]], boxes, silhouette)[0] > 0 else [("base", "wall")]

    try:
        plan_base_path((*start, 0.0), (*goal, 1.0), GRID, clearance_field(GRID, boxes, silhouette), check)
    except (NoPath, StartInCollision, GoalInCollision):
        return
    assert reached((*start, 0.0), boxes, disc())(np.array([[*goal, 1.0]])).all()


def test_base_can_drive_to_no_place_behind_a_wall_nor_off_the_grid() -> None:
    places = reached((1.0, 1.0, 0.0), room((3.0, 3.0, 0.1, 6.0)), disc())
    bases = np.array([[2.0, 5.0, 0.0], [4.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    assert places(bases).tolist() == [True, False, False]
    assert places.comes_near(np.array([3.3, 1.0]), 0.9)
    assert not places.comes_near(np.array([5.0, 1.0]), 0.9)


def test_long_base_drives_along_a_corridor_in_which_it_cannot_turn() -> None:
    corridor, base = room((3.0, 1.2, 4.0, 2.7), (3.0, 4.8, 4.0, 2.7)), rectangle(0.6, 0.3)
    there = reached((0.6, 3.0, math.pi / 2), corridor, base, slack=-SPARE)
    assert there(np.array([[3.0, 3.0, 0.0], [3.0, 3.0, math.pi / 2]])).tolist() == [True, False]


def test_long_base_turns_before_it_drives_into_a_corridor() -> None:
    corridor, base = room((3.0, 1.2, 4.0, 2.7), (3.0, 4.8, 4.0, 2.7)), rectangle(0.6, 0.3)
    start, goal, check = (0.5, 3.0, math.pi / 2), (3.1, 2.96, 0.05), touching(corridor, base)
    with pytest.raises(NoPath):
        plan_base_path(start, goal, GRID, clearance_field(GRID, corridor, bands(base)), check)
    assert not any(check(*pose) for pose in tight(start, goal, corridor, base))


def test_base_has_no_way_through_a_gap_in_which_it_fits_with_no_heading() -> None:
    wall = room((3.0, 1.2, 0.2, 3.0), (3.0, 4.8, 0.2, 3.0))
    with pytest.raises(NoPath, match="attempts 1"):
        tight((1.0, 3.0, 0.0), (5.0, 3.0, 0.0), wall, rectangle(0.6, 0.35))


def test_base_that_stands_between_two_things_gets_out_as_it_came() -> None:
    sides, base = room((3.0, 2.5, 1.2, 0.2), (3.0, 3.5, 1.2, 0.2), (3.8, 3.0, 0.2, 1.4)), rectangle(0.4, 0.33)
    start, goal = (3.12, 3.0, 0.0), (1.0, 5.0, math.pi)
    check = touching(sides, base)
    assert not any(check(*pose) for pose in tight(start, goal, sides, base))


def test_a_lintel_over_a_doorway_takes_no_room() -> None:
    sides = [Pose((3.0, y, 1.0)) for y in (1.25, 4.75)]
    lintel = Pose((3.0, 3.0, 2.5))
    boxes = Boxes.around([*sides, lintel], [(0.1, 2.5, 2.0), (0.1, 2.5, 2.0), (0.1, 1.0, 1.0)])
    there = np.array([[5.0, 3.0, 0.0]])
    assert reached((1.0, 3.0, 0.0), boxes, disc(), -SPARE)(there)[0]
    lower = Boxes.around([*sides, Pose((3.0, 3.0, 1.0))], [(0.1, 2.5, 2.0), (0.1, 2.5, 2.0), (0.1, 1.0, 1.0)])
    assert not reached((1.0, 3.0, 0.0), lower, disc(), -SPARE)(there)[0]


def test_the_cells_between_are_centred_on_the_corners_of_cells() -> None:
    between = GRID.between()
    assert (between.rows, between.columns, between.resolution) == (GRID.rows - 1, GRID.columns - 1, GRID.resolution)
    assert between.centres()[3, 5] == pytest.approx(GRID.centres()[3:5, 5:7].mean(axis=(0, 1)))
