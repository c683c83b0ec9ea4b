"""Facts about paths of the base: they are free, end exactly, prefer room, and failures say what was tried."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from executive.motion.base_path import Touching, plan_base_path
from executive.motion.clearance import Boxes, Grid, clearance_at, clearance_field
from executive.motion.errors import GoalInCollision, NoPath, OutsideLimits, StartInCollision
from planlang.geometry import Array, Pose

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
    """What touches where a check says that it is not free."""
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


@pytest.mark.parametrize("seed", range(25))
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
    with pytest.raises(StartInCollision, match=r"3\.000, 1\.000.*robot in bed") as stuck:
        plan(bed, (3.0, 1.0, 0.0), (5.0, 5.0, 0.0))
    with pytest.raises(GoalInCollision, match=r"3\.000, 1\.000.*robot in bed") as refused:
        plan(bed, (5.0, 5.0, 0.0), (3.0, 1.0, 0.0))
    assert stuck.value.pairs == refused.value.pairs == (("robot", "bed"),)
    with pytest.raises(OutsideLimits, match="the goal is outside"):
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
