"""Paths of the base: free, with clearance and a footprint that depends on the heading; failures say what was tried."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from executive.motion.base_path import Touching, plan_base_path
from executive.motion.clearance import Boxes, Grid, clearance_at, clearance_field, clearances_at
from executive.motion.errors import GoalInCollision, NoPath, OutsideLimits, StartInCollision
from executive.motion.outlines import TOUCHING, Outline, cores, outlines, stands_in_none
from planlang.geometry import Array, Pose
from tests.support.examples import some
from tests.support.refusals import failing

GRID = Grid.over((0.0, 0.0), (6.0, 6.0))
RADIUS = 0.35
ROBOT = [(0.0, 1.4, RADIUS)]
Check = Callable[[float, float, float], bool]


def room(*boxes: tuple[float, float, float, float]) -> Boxes:
    """Boxes as (x, y, width along x, width along y), 1 m high."""
    return Boxes.around([Pose.planar(x, y, 0, 0.5) for x, y, _, _ in boxes], [(w, d, 1.0) for _, _, w, d in boxes])


def disc(boxes: Boxes, radius: float = RADIUS) -> Check:
    """The exact check of a round robot."""
    return lambda x, y, yaw: bool(clearance_at([[x, y]], boxes, [(0.0, 1.4, radius)])[0] > 0)


def square(boxes: Boxes, half: float) -> Check:
    """The exact check of a square robot, by points along its outline."""
    side = np.linspace(-half, half, 9)
    ends = np.full(9, half)
    outline = np.concatenate([np.stack(pair, 1) for pair in ((side, ends), (side, -ends), (ends, side), (-ends, side))])

    def is_free(x: float, y: float, yaw: float) -> bool:
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        return bool((clearance_at(outline @ turn.T + [x, y], boxes, [(0.0, 1.4, 0.0)]) > 0).all())

    return is_free


def plan(
    boxes: Boxes, start: tuple[float, float, float], goal: tuple[float, float, float], is_free: Check | None = None
) -> Array:
    """A path of the round robot among boxes."""
    return plan_base_path(start, goal, GRID, clearance_field(GRID, boxes, ROBOT), touching(is_free or disc(boxes)))


def touching(is_free: Check) -> Touching:
    """Return what touches where a check says that it is not free."""
    return lambda x, y, yaw: [] if is_free(x, y, yaw) else [("robot", "bed")]


def finely(path: Array) -> Array:
    """Poses (n, 3) every centimetre along a path."""
    parts = [a + (b - a) * np.linspace(0, 1, 2 + int(np.abs(b - a).max() / 0.01))[:, None] for a, b in pairwise(path)]
    return np.concatenate(parts)


def length(path: Array) -> float:
    """Metres of a path."""
    return float(np.hypot(*np.diff(path[:, :2], axis=0).T).sum())


def test_free_room_is_crossed_straight_while_turning() -> None:
    path = plan(room(), (1.0, 1.0, 0.0), (5.0, 4.0, 1.0))
    np.testing.assert_allclose(path, [[1, 1, 0], [5, 4, 1]])


@pytest.mark.parametrize("seed", some(range(25), every=4))
def test_path_through_a_random_maze_never_touches_a_wall(seed: int) -> None:
    rng = np.random.default_rng(seed)
    boxes = []
    for x, gap in zip((1.5, 3.0, 4.5), rng.uniform(0.3, 4.7, 3), strict=True):
        boxes += [(x, gap / 2, 0.1, gap), (x, (gap + 1.0 + 6) / 2, 0.1, 5 - gap)]
    walls = room(*boxes)
    start, goal = (0.7, 0.7, 3.0), (5.3, 5.2, -3.0)
    path = plan(walls, start, goal)
    assert path[0].tolist() == list(start)
    assert path[-1, :2].tolist() == list(goal[:2])
    assert (path[-1, 2] - goal[2]) % (2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert abs(path[-1, 2] - path[0, 2]) < math.pi
    assert clearance_at(finely(path)[:, :2], walls, ROBOT).min() > 0


def test_path_has_few_corners() -> None:
    path = plan(room((3.0, 2.0, 0.1, 4.0)), (1.0, 1.0, 0.0), (5.0, 1.0, 0.0))
    assert len(path) < 12
    assert length(path) < 1.1 * 2 * math.hypot(2.0, 3.5)


def test_wide_way_is_preferred_to_a_narrow_one_that_is_a_little_shorter() -> None:
    # straight ahead a gap with 3 cm to spare on either side, around the pillar all room
    pillars = room((3.0, 3.0 + 0.38 + 0.3, 0.6, 0.6), (3.0, 3.0 - 0.38 - 1.5, 0.6, 3.0))
    path = plan(pillars, (1.0, 3.0, 0.0), (5.0, 3.0, 0.0))
    assert path[:, 1].max() > 4.0


def test_start_without_room_by_the_silhouette_but_free_is_left() -> None:
    # a square robot of half width 0.25 stands 5 cm from a bed; its silhouette, 0.35 round, would be in it
    bed = room((3.0, 1.0, 2.0, 1.0))
    start = (3.0, 1.5 + 0.25 + 0.05, 0.0)
    exact = square(bed, 0.25)
    path = plan(bed, start, (5.0, 5.0, 1.5), exact)
    assert path[0].tolist() == list(start)
    assert all(exact(*pose) for pose in finely(path))


def test_goal_without_room_by_the_silhouette_is_reached_without_turning_there() -> None:
    bed = room((3.0, 1.0, 2.0, 1.0))
    goal = (3.0, 1.5 + 0.25 + 0.02, math.pi / 2)
    exact = square(bed, 0.25)
    path = plan(bed, (1.0, 5.0, 0.4), goal, exact)
    assert all(exact(*pose) for pose in finely(path))
    assert path[-1] == pytest.approx(goal)


def test_obstacle_that_only_the_exact_check_knows_is_gone_around() -> None:
    def is_free(x: float, y: float, yaw: float) -> bool:
        return math.hypot(x - 3.0, y - 3.0) > 0.4

    path = plan(room(), (1.0, 3.0, 0.0), (5.0, 3.0, 0.0), is_free)
    assert min(math.hypot(x - 3.0, y - 3.0) for x, y, _ in finely(path)) > 0.38


def test_robot_that_cannot_turn_on_its_way_turns_before_or_after() -> None:
    # a long robot in a corridor along x fits only lengthwise; at the end of the way it has room to turn
    def is_free(x: float, y: float, yaw: float) -> bool:
        return x > 4.5 or abs(math.sin(yaw)) < 0.1

    path = plan(room(), (1.0, 3.0, 0.0), (5.0, 3.0, math.pi / 2), is_free)
    assert all(is_free(*pose) for pose in finely(path))


def test_turning_on_the_spot_is_a_path() -> None:
    path = plan(room(), (1.0, 1.0, 0.0), (1.0, 1.0, 2.0))
    np.testing.assert_allclose(path, [[1, 1, 0], [1, 1, 2]])


def test_start_that_is_the_goal_is_one_pose() -> None:
    assert plan(room(), (1.0, 1.0, 0.5), (1.0, 1.0, 0.5)).tolist() == [[1.0, 1.0, 0.5]]


def test_closed_room_has_no_path_and_the_error_counts_the_work() -> None:
    with pytest.raises(NoPath, match=r"no path from \(1.000.*cells expanded \d+, exact checks 2, attempts 1") as caught:
        plan(room((3.0, 3.0, 0.1, 6.0)), (1.0, 1.0, 0.0), (5.0, 5.0, 0.0))
    assert caught.value.counts["cells expanded"] > 500


def test_search_gives_up_after_its_replans() -> None:
    field = clearance_field(GRID, room(), ROBOT)
    with pytest.raises(NoPath) as caught:
        plan_base_path(
            (1, 1, 0), (5, 5, 0), GRID, field, touching(lambda x, y, yaw: abs(x - y) > 9 or x in (1, 5)), replans=3
        )
    assert caught.value.counts["attempts"] <= 4


def test_start_and_goal_must_be_free_and_on_the_map() -> None:
    bed = room((3.0, 1.0, 2.0, 1.0))
    with failing(StartInCollision, place=(3.0, 1.0, 0.0)) as stuck:
        plan(bed, (3.0, 1.0, 0.0), (5.0, 5.0, 0.0))
    with failing(GoalInCollision, place=(3.0, 1.0, 0.0)) as refused:
        plan(bed, (5.0, 5.0, 0.0), (3.0, 1.0, 0.0))
    assert stuck.value.pairs == refused.value.pairs == (("robot", "bed"),)
    with failing(OutsideLimits, values=(7.0, 1.0)):
        plan(bed, (5.0, 5.0, 0.0), (7.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="expected a field"):
        plan_base_path((1, 1, 0), (5, 5, 0), GRID, np.zeros((3, 3)), touching(disc(bed)))


@pytest.mark.parametrize("column", range(3))
@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_place_that_is_none_is_outside_of_the_map(column: int, value: float) -> None:
    place = [1.0, 1.0, 0.0]
    place[column] = value
    with pytest.raises(OutsideLimits, match=f"the goal is outside its limits: .*{value}"):
        plan(room(), (1.0, 1.0, 0.0), (place[0], place[1], place[2]))
    with pytest.raises(OutsideLimits, match=f"the start is outside its limits: .*{value}"):
        plan(room(), (place[0], place[1], place[2]), (1.0, 1.0, 0.0))


def test_equal_questions_have_equal_answers() -> None:
    walls = room((3.0, 2.0, 0.1, 4.0), (4.0, 4.5, 0.4, 0.4))
    paths = [plan(walls, (1.0, 1.0, 0.0), (5.0, 1.0, 2.0)) for _ in range(2)]
    assert np.array_equal(*paths)


SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
WALL = Boxes.around([Pose.planar(1.0, 0.0, 0.0, 0.5)], [(0.2, 4.0, 1.0)])
"""A wall whose near side is at x = 0.9."""


def box_outline() -> tuple[Outline, ...]:
    return outlines([(0.0, 0.4, SQUARE)])


def test_a_square_robot_stands_nearer_to_a_wall_with_a_side_ahead_than_with_a_corner() -> None:
    near = 0.9 - 0.3 - 0.01
    assert stands_in_none(np.array([[near, 0.0, 0.0], [near, 0.0, math.pi / 2]]), WALL, box_outline()).all()
    assert not stands_in_none(np.array([[near, 0.0, math.pi / 4]]), WALL, box_outline())[0]
    far = 0.9 - 0.3 * math.sqrt(2) - 0.01
    assert stands_in_none(np.array([[far, 0.0, math.pi / 4]]), WALL, box_outline())[0]


def test_corners_of_a_box_count_as_those_of_the_robot_do() -> None:
    post = Boxes.around([Pose.planar(0.0, 0.0, math.pi / 4, 0.2)], [(0.2, 0.2, 0.4)])
    reach = 0.1 * math.sqrt(2)
    free = stands_in_none(
        np.array([[0.3 + reach + 0.01, 0.0, 0.0], [0.3 + reach - 0.01, 0.0, 0.0]]), post, box_outline()
    )
    assert free.tolist() == [True, False]


def test_boxes_above_and_below_a_link_are_no_obstacle_to_it() -> None:
    inside = np.array([[1.0, 0.0, 0.0]])
    over = Boxes.around([Pose.planar(1.0, 0.0, 0.0, 0.8)], [(0.2, 4.0, 0.8)])
    assert stands_in_none(inside, over, box_outline())[0]
    assert not stands_in_none(inside, WALL, box_outline())[0]


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
    (core,) = cores(box_outline())
    assert core == pytest.approx((0.0, 0.4, 0.3))
    aside = outlines([(0.0, 0.4, SQUARE + np.array([1.0, 0.0]))])
    assert cores(aside) == ()


def test_links_inside_of_others_are_left_out() -> None:
    small = 0.5 * SQUARE
    assert len(outlines([(0.1, 0.3, small), (0.0, 0.4, SQUARE)])) == 1
    assert len(outlines([(0.1, 0.5, small), (0.0, 0.4, SQUARE)])) == 2


PEAR = [(0.0, 0.4, 0.35), (0.4, 1.5, 0.2)]


def box(x: float, y: float, low: float, high: float, size: tuple[float, float] = (1.0, 0.5), yaw: float = 0.0) -> Boxes:
    """One box between two heights."""
    return Boxes.around([Pose.planar(x, y, yaw, (low + high) / 2)], [(*size, high - low)])


def test_clearance_is_the_distance_to_the_side_less_the_radius() -> None:
    wall = box(2.0, 0.0, 0.0, 1.0)
    assert clearance_at([[0.0, 0.0]], wall, PEAR)[0] == pytest.approx(1.5 - 0.35)
    assert clearance_at([[2.0, 1.0]], wall, PEAR)[0] == pytest.approx(0.75 - 0.35)
    assert clearance_at([[3.5, 1.25]], wall, PEAR)[0] == pytest.approx(math.hypot(1, 1) - 0.35)


def test_clearance_inside_a_box_is_negative_by_the_way_out() -> None:
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, 0.0, 1.0), PEAR)[0] == pytest.approx(-0.25 - 0.35)


def test_low_base_goes_under_a_high_box_as_far_as_its_column_lets_it() -> None:
    high, low = box(2.0, 0.0, 0.6, 1.0), box(2.0, 0.0, 0.2, 0.6)
    assert clearance_at([[1.2, 0.0]], high, PEAR)[0] == pytest.approx(0.3 - 0.2)
    assert clearance_at([[1.2, 0.0]], low, PEAR)[0] == pytest.approx(0.3 - 0.35)


def test_box_above_or_below_the_robot_is_no_obstacle() -> None:
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, 1.5, 2.0), PEAR)[0] == math.inf
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, -0.1, 0.0), PEAR)[0] == math.inf


def test_turned_box_is_measured_along_its_own_sides() -> None:
    turned = box(0.0, 0.0, 0.0, 1.0, size=(2.0, 0.2), yaw=math.pi / 2)
    assert clearance_at([[1.0, 0.5]], turned, PEAR)[0] == pytest.approx(0.9 - 0.35)


def test_clearance_agrees_with_the_nearest_of_many_points_of_the_boxes() -> None:
    rng = np.random.default_rng(0)
    poses = [Pose.planar(*rng.uniform(-2, 2, 2), rng.uniform(-3, 3), 0.5) for _ in range(6)]
    sizes = np.column_stack([rng.uniform(0.2, 1.5, (6, 2)), np.ones(6)])
    inside = rng.uniform(-0.5, 0.5, (20000, 3))
    places = rng.uniform(-3, 3, (40, 2))
    nearest = np.full(40, np.inf)
    for pose, size in zip(poses, sizes, strict=True):
        filled = (inside * size) @ pose.matrix()[:3, :3].T + pose.matrix()[:3, 3]
        away = np.linalg.norm(places[:, None] - filled[None, :, :2], axis=2).min(axis=1)
        nearest = np.minimum(nearest, away)
    room = clearance_at(places, Boxes.around(poses, sizes), PEAR) + 0.35
    np.testing.assert_allclose(np.maximum(room, 0), nearest, atol=0.03)


@pytest.mark.parametrize("most", [0.0, 0.3])
def test_room_up_to_what_is_asked_for_is_the_same_whatever_is_left_out(most: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(40):
        boxes = Boxes(rng.uniform(-2, 2, (12, 3)), rng.uniform(0.02, 0.6, (12, 3)), rng.uniform(-4, 4, 12))
        places = rng.uniform(-0.5, 0.5, (30, 2)) + rng.uniform(-1, 1, 2)
        whole = clearances_at(places, boxes, (PEAR, PEAR[1:]))
        found = clearances_at(places, boxes, (PEAR, PEAR[1:]), most)
        np.testing.assert_array_equal(np.minimum(found, most), np.minimum(whole, most))


def test_tilted_box_is_replaced_by_a_prism_that_holds_it() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        pose = Pose((1.0, 2.0, 3.0), tuple(quaternion.tolist()))
        size = rng.uniform(0.1, 1.0, 3)
        prism = Boxes.around([pose], [size])
        corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T * size / 2 @ pose.matrix()[:3, :3].T
        cosine, sine = np.cos(prism.yaws[0]), np.sin(prism.yaws[0])
        own = corners @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        np.testing.assert_allclose(np.abs(own).max(axis=0), prism.half_extents[0], atol=1e-9)


def test_box_that_lies_on_its_side_keeps_its_extents() -> None:
    lying = Boxes.around([Pose((0, 0, 0), (math.sqrt(0.5), 0, 0, math.sqrt(0.5)))], [(1.0, 0.2, 0.6)])
    np.testing.assert_allclose(lying.half_extents, [[0.5, 0.3, 0.1]], atol=1e-9)


def test_no_boxes_leave_all_room() -> None:
    assert (clearance_field(Grid.over((0, 0), (1, 1)), Boxes.around([], np.empty((0, 3))), PEAR) == math.inf).all()


def test_field_has_the_value_of_each_cell_centre() -> None:
    grid = Grid.over((-1.0, -2.0), (3.0, 1.0), 0.1)
    assert (grid.rows, grid.columns) == (30, 40)
    wall = box(2.0, 0.0, 0.0, 1.0)
    field = clearance_field(grid, wall, PEAR)
    cell = grid.cell(0.52, -0.31)
    assert cell is not None
    assert field[cell] == clearance_at([grid.centres()[cell]], wall, PEAR)[0]
    assert grid.cell(3.2, 0.0) is None


def test_sizes_must_go_with_poses() -> None:
    with pytest.raises(ValueError, match="1 poses do not go with 2 sizes"):
        Boxes.around([Pose.planar(0, 0)], np.ones((2, 3)))
    with pytest.raises(ValueError, match="no cell"):
        Grid.over((0, 0), (0.01, 1))
