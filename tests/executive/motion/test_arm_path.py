"""Facts about paths of an arm: exactly free though edges are checked by a coarse model, and failures say why."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from executive.motion.arm_path import CHECKS, JointSpace, plan_path
from executive.motion.errors import GoalInCollision, NoPath, OutsideLimits, StartInCollision
from planlang.geometry import Array
from tests.support.examples import some
from tests.support.refusals import failing

LOW, HIGH = np.zeros(2), np.ones(2) * 4
SQUARE = JointSpace.of(LOW, HIGH, resolution=0.02)
START, GOAL = np.array([0.5, 0.5]), np.array([3.5, 3.5])
IsFree = Callable[[Array], bool]
Pairs = Sequence[tuple[str, str]]


class Rough:
    """Quick answers that come from ``is_free``; any pair may always touch."""

    def __init__(self, is_free: IsFree = lambda q: True) -> None:
        self.is_free = is_free
        self.learnt: list[tuple[Array, Sequence[tuple[str, str]]]] = []

    def free(self, q: Array) -> NDArray[np.bool_]:
        if isinstance(self.is_free, Maze):
            return self.is_free.rows(q)
        return np.array([self.is_free(row) for row in q], bool)

    def doubtful(self, q: Array) -> Sequence[Pairs | None]:
        return [None] * len(q)

    def keep(self, distance: float, ends: Sequence[Array]) -> None:
        pass

    def learn(self, q: Array, pairs: Sequence[tuple[str, str]]) -> None:
        self.learnt.append((q, pairs))


class Asked(Rough):
    """A quick check with one answer about the pairs in doubt; as an exact check it notes what it is told of them."""

    def __init__(self, answer: Sequence[Pairs]) -> None:
        super().__init__()
        self.answer, self.calls = answer, 0
        self.among: list[Pairs | None] = []

    def doubtful(self, q: Array) -> Sequence[Pairs | None]:
        self.calls += 1
        return list(self.answer) * len(q)

    def __call__(self, q: Array, among: Pairs | None) -> Pairs:
        self.among.append(among)
        return ()


class Maze:
    """Three walls 0.3 thick across a square of side 4, each with a gap of 0.6 somewhere, shaved on all sides."""

    def __init__(self, seed: int, shaved: float = 0.0) -> None:
        gap = np.random.default_rng(seed).uniform(0.2, 3.2, 3)
        first = np.arange(3)
        self._left, self._right = 0.9 + first + shaved, 1.2 + first - shaved
        self._low, self._high = gap - shaved, gap + 0.6 + shaved

    def __call__(self, q: Array) -> bool:
        """Return whether a point (2,) is in no wall."""
        return bool(self.rows(q[None])[0])

    def rows(self, q: Array) -> NDArray[np.bool_]:
        """Return which points (n, 2) are in no wall."""
        x, y = q.T[:, :, None]
        outside = (x <= self._left) | (x >= self._right) | (y > self._low) & (y < self._high)
        return np.asarray(outside.all(axis=1))


def touching(is_free: IsFree) -> Callable[[Array, Pairs | None], Pairs]:
    """The exact check that goes with it."""
    return lambda q, among: [] if is_free(q) else [("point", "wall")]


def nothing_touches(q: Array, among: Pairs | None) -> Pairs:
    """An exact check where everything is free."""
    return ()


def crosses(path: Array, is_free: IsFree) -> bool:
    """Return whether any point of a polyline, looked at much finer than it was planned, is not free."""
    return not all(
        is_free(a + share * (b - a))
        for a, b in pairwise(path)
        for share in np.linspace(0, 1, max(2, int(np.abs(b - a).max() / 0.01)))
    )


@pytest.mark.parametrize("seed", some(range(10), every=10))
@pytest.mark.parametrize("shaved", [0.0, 0.1, -0.1])
def test_path_through_a_random_maze_never_crosses_a_wall_however_rough_the_quick_check_is(
    seed: int, shaved: float
) -> None:
    is_free = Maze(seed)
    quick = Rough(Maze(seed, shaved))
    path = plan_path(START, GOAL, SQUARE, quick, touching(is_free), np.random.default_rng(seed))
    assert np.array_equal(path[0], START)
    assert np.array_equal(path[-1], GOAL)
    # between two checks, 0.02 apart, a corner may be cut by half of that
    assert not crosses(path, Maze(seed, shaved=0.01))


def test_a_quick_check_that_sees_nothing_is_overruled_and_told_so() -> None:
    is_free = Maze(3)
    quick = Rough()
    path = plan_path(START, GOAL, SQUARE, quick, touching(is_free), np.random.default_rng(0))
    assert not crosses(path, Maze(3, shaved=0.01))
    assert quick.learnt
    assert all(not is_free(q) and pairs == (("point", "wall"),) for q, pairs in quick.learnt)


def test_a_quick_check_that_allows_nothing_is_overruled_at_last() -> None:
    far = Rough(lambda q: bool(np.abs(q - START).max() < 0.1 or np.abs(q - GOAL).max() < 0.1))
    path = plan_path(START, GOAL, SQUARE, far, nothing_touches, np.random.default_rng(0), iterations=50)
    assert path.tolist() == [START.tolist(), GOAL.tolist()]


def test_a_search_is_given_up_after_so_many_checks_and_says_so() -> None:
    with pytest.raises(NoPath) as failed:
        plan_path(START, GOAL, SQUARE, Rough(), touching(Maze(2)), np.random.default_rng(0), iterations=2)
    assert str(failed.value.__cause__) == f"the search was given up after {2 * CHECKS} checks"


def test_exact_checks_are_few_where_the_quick_check_is_right() -> None:
    asked: list[tuple[float, ...]] = []
    is_free = Maze(4)

    def exact(q: Array, among: Pairs | None) -> Pairs:
        asked.append(tuple(q))
        return touching(is_free)(q, among)

    path = plan_path(START, GOAL, SQUARE, Rough(is_free), exact, np.random.default_rng(0))
    assert len(asked) == len(set(asked)), "no configuration is asked for twice"
    assert len(asked) <= len(SQUARE.points(path)) + 2, "only start, goal and the path itself are looked at"


def test_what_is_sure_needs_no_exact_check() -> None:
    exact = Asked([()])
    plan_path(START, GOAL, SQUARE, exact, exact, np.random.default_rng(0))
    assert exact.among == [None, ()], "start and goal"


def test_the_exact_check_is_told_which_pairs_may_touch() -> None:
    exact = Asked([(("point", "wall"),)])
    plan_path(START, GOAL, SQUARE, exact, exact, np.random.default_rng(0))
    assert exact.among[0] is None, "at the start everything is looked at"
    assert set(exact.among[1:]) == {(("point", "wall"),)}


def test_the_quick_check_is_asked_about_a_whole_path_in_a_few_calls() -> None:
    exact = Asked([()])
    path = plan_path(START, GOAL, SQUARE, exact, exact, np.random.default_rng(0))
    assert len(SQUARE.points(path)) == 150
    assert exact.calls <= 7


def test_moments_that_are_added_are_looked_at() -> None:
    # an obstacle between two points of the resolution, which the arm passes at one of the instants given
    wall = lambda q: not 1.7049 < q[0] < 1.7051  # noqa: E731
    row = START + (GOAL - START) * ((1.705 - 0.5) / 3)
    with pytest.raises(NoPath):
        plan_path(
            START, GOAL, SQUARE, Rough(), touching(wall), np.random.default_rng(0),
            moments=lambda path: np.concatenate([path, [row]]), iterations=5,
        )  # fmt: skip


def test_straight_way_is_taken_when_it_is_free() -> None:
    path = plan_path(START, GOAL, SQUARE, Rough(), nothing_touches, np.random.default_rng(0))
    assert path.tolist() == [START.tolist(), GOAL.tolist()]


def test_equal_generators_give_equal_paths() -> None:
    is_free = Maze(3)
    paths = [
        plan_path(START, GOAL, SQUARE, Rough(is_free), touching(is_free), np.random.default_rng(9)) for _ in range(2)
    ]
    assert np.array_equal(paths[0], paths[1])


def test_search_ends_without_a_path_and_tells_what_it_did() -> None:
    wall = lambda q: not 1.5 < q[0] < 2.0  # noqa: E731
    with pytest.raises(NoPath, match=r"branches \d+, exact checks \d+") as ended:
        plan_path(START, GOAL, SQUARE, Rough(wall), touching(wall), np.random.default_rng(0), iterations=20)
    assert ended.value.counts["branches"] > 0


def test_start_or_goal_in_collision_is_refused_with_the_pair() -> None:
    for kind, wall in ((StartInCollision, lambda q: q[0] > 1), (GoalInCollision, lambda q: q[0] < 1)):
        with pytest.raises(kind, match="point in wall") as refused:
            plan_path(START, GOAL, SQUARE, Rough(), touching(wall), np.random.default_rng(0))
        assert refused.value.pairs == (("point", "wall"),)


def test_goal_outside_the_limits_is_refused() -> None:
    with failing(OutsideLimits, values=(4.1, 0.5)):
        plan_path(START, [4.1, 0.5], SQUARE, Rough(), nothing_touches, np.random.default_rng(0))


def test_start_outside_the_limits_is_no_obstacle() -> None:
    is_free = Maze(3)
    path = plan_path([-0.1, 0.5], GOAL, SQUARE, Rough(is_free), touching(is_free), np.random.default_rng(0))
    assert (path[1:] >= LOW).all()
    assert (path <= HIGH).all()


def test_wrong_arguments_are_refused() -> None:
    with pytest.raises(ValueError, match="got shapes"):
        plan_path([0.0], GOAL, SQUARE, Rough(), nothing_touches, np.random.default_rng(0))
    with pytest.raises(ValueError, match="finite"):
        JointSpace.of(-np.inf * HIGH, HIGH)
    with pytest.raises(ValueError, match="positive"):
        JointSpace.of(LOW, HIGH, resolution=0.0)


RING = JointSpace.of([-1.0, 0.0], [1.0, 4.0], continuous=[True, False], resolution=0.05)


def test_joint_that_turns_without_end_goes_the_shorter_way_around() -> None:
    path = plan_path([3.0, 1.0], [-3.0, 1.0], RING, Rough(), nothing_touches, np.random.default_rng(0))
    np.testing.assert_allclose(path, [[3.0, 1.0], [2 * np.pi - 3.0, 1.0]])
    path = plan_path([50.0, 1.0], [0.0, 1.0], RING, Rough(), nothing_touches, np.random.default_rng(0))
    assert abs(path[-1, 0] - 50.0) <= np.pi
    assert np.cos(path[-1, 0]) == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(6))
def test_joint_that_turns_without_end_goes_the_other_way_around_an_obstacle(seed: int) -> None:
    # the shorter way, through half a turn, is closed
    is_free = lambda q: bool(np.cos(q[0]) > -0.99)  # noqa: E731
    start, goal = np.array([2.6, 1.0]), np.array([-2.6, 3.0])
    path = plan_path(start, goal, RING, Rough(is_free), touching(is_free), np.random.default_rng(seed))
    assert not crosses(path, is_free)
    assert np.array_equal(path[0], start)
    turns = (path[-1] - goal) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    assert turns[1] == 0.0
    assert np.abs(np.diff(path[:, 0])).max() <= np.pi + 1e-9
