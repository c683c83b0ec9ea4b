"""Facts about timing: trajectories stay on the path, within limits, and end exactly."""

import ast
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import executive.motion
from executive.motion.trajectories import time_curve, time_path
from planlang.geometry import Array
from tests.support.examples import examples

V, A, J = np.array([0.07, 0.4, 1.0]), np.array([0.2, 2.0, 2.0]), np.array([2.0, 20.0, 40.0])
NAMES = ("lift", "shoulder", "wrist")
RATE = 30


def timed(waypoints: Array) -> Array:
    """Rows of the trajectory through waypoints (n, 3) with the limits above."""
    trajectory = time_path(NAMES, waypoints, velocity=V, acceleration=A, jerk=J, rate=RATE)
    assert trajectory.names == NAMES
    return trajectory.positions


def progress(rows: Array, waypoints: Array) -> Array:
    """For each row the place (n,) on the polyline, as segment number + share; fails if a row is off it."""
    places, at = [], 0.0
    for row in rows:
        best = None
        for i, (a, b) in enumerate(pairwise(waypoints)):
            share = float(np.clip((row - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1))
            if np.abs(a + share * (b - a) - row).max() < 1e-9 and i + share >= at - 1e-6:
                best = i + share
                break
        assert best is not None, f"row {row} is off the path"
        places.append(best)
        at = best
    return np.array(places)


coordinate = st.floats(-1.5, 1.5).map(lambda value: round(value, 3))
polylines = st.lists(st.tuples(coordinate, coordinate, coordinate), min_size=1, max_size=5).map(
    lambda rows: np.array(rows, float)
)


@settings(max_examples=examples(150), deadline=None)
@given(polylines)
def test_trajectory_follows_the_polyline_forwards_and_ends_exactly(waypoints: Array) -> None:
    rows = timed(waypoints)
    assert np.array_equal(rows[0], waypoints[0])
    assert np.array_equal(rows[-1], waypoints[-1])
    if len(rows) > 1:
        progress(rows, waypoints)


def assert_within_limits(rows: Array) -> None:
    """Differences of a trajectory that begins and ends at rest, first to third, against the limits above."""
    still = np.repeat(rows[:1], 3, axis=0), np.repeat(rows[-1:], 3, axis=0)
    found = np.concatenate([still[0], rows, still[1]])
    for limit in (V, A, J):
        found = np.diff(found, axis=0) * RATE
        assert (np.abs(found) <= limit * (1 + 1e-4) + 1e-6).all()


@settings(deadline=None)
@given(polylines)
def test_trajectory_keeps_limits_of_velocity_acceleration_and_jerk(waypoints: Array) -> None:
    assert_within_limits(timed(waypoints))


@settings(deadline=None)
@given(polylines)
def test_curve_keeps_limits_of_velocity_acceleration_and_jerk(waypoints: Array) -> None:
    assert_within_limits(curved(waypoints))


def test_single_segment_takes_the_time_of_its_slowest_joint() -> None:
    rows = timed(np.array([[0.0, 0.0, 0.0], [0.35, 0.1, 0.1]]))
    at_full_speed = 0.35 / 0.07
    speeding_up = 0.07 / 0.2 + 0.2 / 2.0
    assert (len(rows) - 1) / RATE == pytest.approx(at_full_speed + speeding_up, abs=1 / RATE)


def test_sharp_corner_is_a_row_of_its_own_and_a_stop() -> None:
    rows = timed(np.array([[0, 0, 0], [0, 0.5, 0], [0, 0.5, 0.5]], float))
    corner = np.flatnonzero((rows == [0, 0.5, 0]).all(axis=1))
    assert len(corner) == 1
    assert np.abs(rows[corner[0] + 1] - rows[corner[0]]).max() * RATE < 0.1


def bow(count: int, bend: float) -> Array:
    """A smooth way of the three joints."""
    t = np.linspace(0, 1, count)
    return np.stack([0.05 * t, 0.8 * t, 0.2 * np.sin(bend * t)], axis=1)


def curved(waypoints: Array) -> Array:
    """Rows of the trajectory along the curve through waypoints (n, 3) with the limits above."""
    return time_curve(NAMES, waypoints, velocity=V, acceleration=A, jerk=J, rate=RATE).positions


def test_straight_waypoints_are_passed_without_a_stop() -> None:
    ends = np.array([[0.0, 0.0, 0.0], [0.1, 0.5, 0.3]])
    between = ends[0] + np.linspace(0, 1, 7)[:, None] * (ends[1] - ends[0])
    np.testing.assert_allclose(timed(between), timed(ends), atol=1e-9)


def test_a_curve_is_passed_without_a_stop_and_goes_through_its_ends() -> None:
    rows = curved(bow(10, 1.5))
    assert np.array_equal(rows[[0, -1]], bow(10, 1.5)[[0, -1]])
    assert len(rows) < 2.0 * len(timed(bow(10, 1.5)[[0, -1]]))
    inner = np.abs(np.diff(rows, axis=0))[len(rows) // 4 : -len(rows) // 4, 1]
    assert inner.min() * RATE > 0.1


def test_a_curve_stays_near_to_the_way_that_its_waypoints_are_of() -> None:
    fine = bow(400, 1.5)
    away = np.linalg.norm(curved(bow(10, 1.5))[:, None] - fine, axis=2).min(axis=1)
    assert away.max() < 0.003


def test_a_curve_does_not_swing_out_where_a_slow_joint_comes_to_rest_before_the_others() -> None:
    steps = np.arange(10)
    lift = np.minimum(steps, 4.5) * 0.02
    rows = curved(np.stack([lift, 0 * lift, 0.005 * steps], axis=1))
    np.testing.assert_allclose(rows[:, 0], np.interp(rows[:, 2], 0.005 * steps, lift), atol=0.01)
    assert np.diff(rows, axis=0).min() > -2e-4, "a joint goes back"


@pytest.mark.parametrize("count", [3, 5, 10, 40, 200])
@pytest.mark.parametrize("bend", [0.05, 0.3, 1.0, 4.0])
def test_limits_are_kept_on_curves(count: int, bend: float) -> None:
    assert_within_limits(curved(bow(count, bend)))


def test_repeated_waypoints_cost_no_time() -> None:
    a, b = [0.0, 0.0, 0.0], [0.1, 0.2, 0.3]
    assert np.array_equal(timed(np.array([a, a, b, b, b])), timed(np.array([a, b])))


@pytest.mark.parametrize("count", [1, 3])
def test_path_without_motion_is_one_row(count: int) -> None:
    assert timed(np.full((count, 3), 0.5)).tolist() == [[0.5, 0.5, 0.5]]


def test_tiny_motion_is_one_step() -> None:
    rows = timed(np.array([[0, 0, 0], [0, 1e-9, 0]]))
    assert rows.tolist()[-1] == [0, 1e-9, 0]
    assert len(rows) <= 3


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"velocity": [0.1, 0.0, 0.1]}, "the velocity limit of 'shoulder' must be positive"),
        ({"jerk": [1.0, 2.0]}, "expected one jerk limit or one for each"),
        ({"waypoints": [[0.0, 0.0]]}, r"expected finite waypoints \(n, 3\)"),
        ({"waypoints": [[0.0, 0.0, np.nan]]}, "expected finite waypoints"),
        ({"rate": 0}, "rate must be positive"),
    ],
)
def test_wrong_arguments_are_refused_with_the_reason(changed: dict[str, object], said: str) -> None:
    arguments = {"waypoints": np.zeros((1, 3)), "velocity": V, "acceleration": A, "jerk": J, "rate": RATE, **changed}
    with pytest.raises(ValueError, match=said):
        time_path(NAMES, **arguments)  # type: ignore[arg-type]


@pytest.mark.long
def test_waypoints_are_never_handed_to_ruckig() -> None:
    # ruckig's intermediate_positions asks a service on the network
    folder = Path(executive.motion.__file__).parents[1]
    names = {
        node.attr if isinstance(node, ast.Attribute) else node.value
        for file in sorted(folder.rglob("*.py"))
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.Attribute) or (isinstance(node, ast.Constant) and isinstance(node.value, str))
    }
    assert "max_jerk" in names
    assert "intermediate_positions" not in names
