"""Trajectories: straight lines of the tip (approach, lift, retreat), and timing of waypoints.

Timing uses one-DoF ruckig along the path, so that a motion never leaves the line that was checked.

The path parameter s of a straight segment from a to b is measured in seconds at full speed, T = max_i |b_i - a_i| /
v_i, so that ds/dt <= 1 is the velocity limit everywhere, and acceleration and jerk along s are limited by min_i limit_i
T / |b_i - a_i|. Synchronising several degrees of freedom instead would leave the line if the limits are not
proportional to each other.

On a curve q(s), with derivatives q1, q2, q3 with respect to s and s1, s2, s3 of s with respect to time, joints have
velocity q1 s1, acceleration q1 s2 + q2 s1^2 and jerk q1 s3 + 3 q2 s1 s2 + q3 s1^3. Each term gets an equal share of its
limit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import ruckig
from numpy.typing import ArrayLike, NDArray

from executive.motion.kinematics import Chain
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, product, rotated
from planlang.protocols import Trajectory
from planlang.records import dataclass

Solve = Callable[[Array, Array], tuple[Array, NDArray[np.bool_]]]
"""Inverse kinematics, as :meth:`Chain.solve`."""
UNTURNED = 1e-12
"""Twice the angle up to which two rotations count as equal [rad]."""
HALF_TURN = 1e-3
"""Twice the distance from half a turn within which the antisymmetric part of a rotation gives no axis [rad]."""


AHEAD = 9
"""Poses solved from the same configuration: over 0.1 m in total, inverse kinematics converges in 3 to 5 steps."""
UNMOVED = 1e-18
"""Squared lengths up to this count as zero [m^2]."""
LARGEST_STRAY = 1e-3
"""Largest distance of the tip from a straight line [m]."""
LARGEST_TILT = 1e-2
"""Largest deviation of the tip from even rotation between the first and the last pose [rad]."""
REFINED = 3
"""Number of times that the steps of a line are halved if the tip leaves it in between."""


@dataclass(frozen=True, slots=True, eq=False)
class TipLine:
    """Straight line of the tip: ``waypoints`` (n, d), or None and the ``reason`` why it cannot be followed."""

    waypoints: Array | None
    reason: str = ""


def cartesian_path(
    chain: Chain,
    start_q: ArrayLike,
    start_pose: ArrayLike,
    goal_pose: ArrayLike,
    is_free: Callable[[Array], bool],
    *,
    steps: int = 9,
    largest_step: float = 0.5,
    solve: Solve | None = None,
) -> TipLine:
    """Move the tip straight from one pose (4, 4) to another in the chain's base frame, turning it evenly.

    No step may move a joint by more than ``largest_step`` [rad, m]; every configuration but ``start_q`` (d,) is
    checked. Between waypoints the motion is straight in joint space; if the tip then leaves its line by more than
    :func:`keeps_line` allows, steps are halved. ``solve`` stands for the chain's own inverse kinematics.
    """
    start, goal = np.asarray(start_pose, float), np.asarray(goal_pose, float)
    counts, begin = [steps * 2**halved for halved in range(REFINED + 1)], np.array(start_q, float)
    for count in counts:
        poses = _between(start, goal, count)
        line = _in_steps(chain.names, solve or chain.solve, begin, poses, is_free, largest_step)
        if line.waypoints is None:
            return line
        middles = chain.fk((line.waypoints[:-1] + line.waypoints[1:]) / 2)
        if keeps_line(middles, start, goal):
            return line
    return TipLine(None, f"the tip leaves the line between steps, even {counts[-1]} of them")


def keeps_line(poses: Array, start: Array, goal: Array) -> bool:
    """Check that poses (n, 4, 4) are on the line between two poses (4, 4), within both LARGEST_* tolerances.

    Their order along the line is not checked.
    """
    line = goal[:3, 3] - start[:3, 3]
    moved = poses[:, :3, 3] - start[:3, 3]
    along = np.clip(moved @ line / max(float(line @ line), UNMOVED), 0.0, 1.0)
    stray = np.linalg.norm(moved - along[:, None] * line, axis=1).max()
    turns = product(poses[:, :3, :3], start[:3, :3].T)
    axis, _ = _turn(start, goal)
    if axis is None:
        cosines = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    else:  # rotations about the axis alone leave it unchanged
        cosines = rotated(turns, axis) @ axis
    return bool(stray <= LARGEST_STRAY and cosines.min() >= math.cos(LARGEST_TILT))


def _in_steps(
    names: Sequence[str], solve: Solve, q: Array, poses: Array, is_free: Callable[[Array], bool], largest_step: float
) -> TipLine:
    """Follow poses (n, 4, 4) from a configuration (d,)."""
    waypoints, steps = [q], len(poses)
    for i in range(steps):
        if i % AHEAD == 0:  # solve the next few from here: close enough for a seed, and one call for all
            ahead = poses[i : i + AHEAD]
            solutions, reached = solve(ahead, np.broadcast_to(q, (len(ahead), 1, len(q))))
        if not reached[i % AHEAD]:
            return TipLine(None, f"the tip cannot reach step {i + 1} of {steps}")
        jump = np.abs(solutions[i % AHEAD] - q)
        if jump.max() > largest_step:
            name = names[int(np.argmax(jump))]
            return TipLine(None, f"{name} would jump by {jump.max():.2f} at step {i + 1} of {steps}")
        q = solutions[i % AHEAD]
        if not is_free(q.copy()):
            return TipLine(None, f"in collision at step {i + 1} of {steps}")
        waypoints.append(q)
    return TipLine(np.array(waypoints))


def _between(start: Array, goal: Array, steps: int) -> Array:
    """Interpolate poses (steps, 4, 4) after the start up to the goal, evenly moved and turned."""
    shares = np.arange(1, steps + 1) / steps
    poses = np.repeat(start[None], steps, axis=0)
    poses[:, :3, 3] += shares[:, None] * (goal[:3, 3] - start[:3, 3])
    axis, angle = _turn(start, goal)
    if axis is not None:
        cross = cross_matrix(axis)
        parts = shares[:, None, None] * angle
        turns = np.eye(3) + np.sin(parts) * cross + (1 - np.cos(parts)) * product(cross, cross)
        poses[:, :3, :3] = product(turns, start[:3, :3])
    poses[-1] = goal
    return poses


def _turn(start: Array, goal: Array) -> tuple[Array | None, float]:
    """Axis (3,) and angle [rad] of the rotation from one pose (4, 4) to another; None if there is none."""
    turn = product(goal[:3, :3], start[:3, :3].T)
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    cosine, double_sine = (np.trace(turn) - 1) / 2, math.sqrt(twice @ twice)
    if cosine >= 0 and double_sine <= UNTURNED:
        return None, 0.0
    axis = twice / double_sine if cosine > 0 or double_sine > HALF_TURN else _axis(turn)
    return axis, math.atan2(axis @ twice / 2, cosine)


def _axis(turn: Array) -> Array:
    """Axis (3,) of a rotation (3, 3) as its eigenvector, for angles whose antisymmetric part vanishes."""
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, int(np.argmin(np.abs(values - 1)))])
    return np.asarray(axis / np.linalg.norm(axis))


STRAIGHT = 1e-6
"""Difference of directions up to which segments are one, in shares of the velocity limits."""


def time_path(
    names: Sequence[str],
    waypoints: ArrayLike,
    *,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    rate: int,
) -> Trajectory:
    """Time waypoints (n, d), n >= 1, within limits (d,) or scalars, at ``rate`` rows/s.

    Every row lies on the path; the first and the last row are the first and the last waypoint. The motion starts and
    ends at rest, and stops at corners, at a row of its own. Repeated waypoints cost no time; n = 1 or no motion gives
    one row.
    """
    points, (v, a, j) = _checked(names, waypoints, (velocity, acceleration, jerk), rate)
    times = (np.abs(np.diff(points, axis=0)) / v).max(axis=1)
    directions = np.diff(points, axis=0) / times[:, None]
    goes_on = (np.abs(np.diff(directions, axis=0)) <= STRAIGHT * v).all(axis=1)
    rows = [points[:1]]
    first = 0
    while first < len(times):
        last = first
        while last < len(goes_on) and goes_on[last]:
            last += 1
        run = slice(first, last + 1)
        steepest = np.abs(directions[run]).max(axis=0)
        with np.errstate(divide="ignore"):
            along = _profile(times[run].sum(), 1.0, (a / steepest).min(), (j / steepest).min(), rate)
        marks = np.concatenate([[0.0], np.cumsum(times[run])])
        knots = points[first : last + 2]
        run_rows = np.stack([np.interp(along, marks, knots[:, k]) for k in range(len(names))], axis=1)
        run_rows[-1] = knots[-1]
        rows.append(run_rows)
        first = last + 1
    return Trajectory(tuple(names), np.concatenate(rows))


def time_curve(
    names: Sequence[str],
    waypoints: ArrayLike,
    *,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    rate: int,
) -> Trajectory:
    """Time waypoints as :func:`time_path`, along their natural cubic spline, without intermediate stops.

    Rows are on the spline, not on straight lines between the waypoints, and have to be checked for collisions again.
    The parameter is centripetal (E. T. Y. Lee, Choosing nodes in parametric curve interpolation, 1989): one measured in
    time at full speed swings out far where a slow joint comes to rest at its limit and the others take over.
    """
    points, (v, a, j) = _checked(names, waypoints, (velocity, acceleration, jerk), rate)
    if len(points) <= 2:
        return time_path(names, points, velocity=v, acceleration=a, jerk=j, rate=rate)
    lengths = np.sqrt((np.abs(np.diff(points, axis=0)) / v).max(axis=1))
    bends = _bends(points, lengths)
    first, second, third = _steepest(points, lengths, bends)
    with np.errstate(divide="ignore"):
        speed = min((v / first).min(), np.sqrt(a / 2 / second).min(), np.cbrt(j / 3 / third).min())
        push = min((a / 2 / first).min(), (j / 9 / second).min() / speed)
        along = _profile(lengths.sum(), speed, push, (j / 3 / first).min(), rate)
    rows = np.concatenate([points[:1], _on_spline(points, lengths, bends, along)])
    rows[-1] = points[-1]
    return Trajectory(tuple(names), rows)


def _checked(
    names: Sequence[str], waypoints: ArrayLike, limits: tuple[ArrayLike, ArrayLike, ArrayLike], rate: int
) -> tuple[Array, tuple[Array, Array, Array]]:
    """Drop repeated waypoints, and expand the limits (d,) of velocity, acceleration and jerk."""
    points = np.array(waypoints, float)
    if points.ndim != 2 or not len(points) or points.shape[1] != len(names) or not np.isfinite(points).all():
        raise ValueError(f"expected finite waypoints (n, {len(names)}) of {tuple(names)}, got shape {points.shape}")
    if rate <= 0:
        raise ValueError(f"the rate must be positive, got {rate}")
    v, a, j = (
        _limits(what, value, names) for what, value in zip(("velocity", "acceleration", "jerk"), limits, strict=True)
    )
    return points[np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))], (v, a, j)


def _bends(points: Array, lengths: Array) -> Array:
    """Compute second derivatives (n, d) of the natural cubic spline at its waypoints."""
    count = len(points)
    matrix, right = np.eye(count), np.zeros_like(points)
    slopes = np.diff(points, axis=0) / lengths[:, None]
    for k in range(1, count - 1):
        matrix[k, k - 1 : k + 2] = lengths[k - 1] / 6, (lengths[k - 1] + lengths[k]) / 3, lengths[k] / 6
        right[k] = slopes[k] - slopes[k - 1]
    return np.asarray(np.linalg.solve(matrix, right))


def _steepest(points: Array, lengths: Array, bends: Array) -> tuple[Array, Array, Array]:
    """Compute each joint's largest absolute first, second and third derivative (d,) anywhere on the spline."""
    slopes = np.diff(points, axis=0) / lengths[:, None]
    before, after, h = bends[:-1], bends[1:], lengths[:, None]
    begin, end = slopes - h * (2 * before + after) / 6, slopes + h * (before + 2 * after) / 6
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(before * after < 0, before / (before - after), 0.0)  # where the bend changes its sign
    between = begin + h * share * (before + share * (after - before) / 2)
    first = np.abs(np.concatenate([begin, end, between])).max(axis=0)
    return first, np.abs(bends).max(axis=0), np.abs((after - before) / h).max(axis=0)


def _on_spline(points: Array, lengths: Array, bends: Array, along: Array) -> Array:
    """Evaluate the spline (m, d) at parameters (m,)."""
    marks = np.concatenate([[0.0], np.cumsum(lengths)])
    k = np.clip(np.searchsorted(marks, along, side="right") - 1, 0, len(lengths) - 1)
    h, x = lengths[k][:, None], (along - marks[k])[:, None]
    y, step = points[k], np.diff(points, axis=0)[k]
    before, after = bends[k], bends[k + 1]
    slope = step / h - h * (2 * before + after) / 6
    return np.asarray(y + x * (slope + x * (before / 2 + x * (after - before) / (6 * h))))


def _limits(what: str, value: ArrayLike, names: Sequence[str]) -> Array:
    limits = np.asarray(value, float)
    if limits.shape not in ((), (len(names),)):
        raise ValueError(f"expected one {what} limit or one for each of {tuple(names)}, got shape {limits.shape}")
    limits = np.broadcast_to(limits, (len(names),))
    for name, limit in zip(names, limits, strict=True):
        if not (limit > 0 and math.isfinite(limit)):
            raise ValueError(f"the {what} limit of {name!r} must be positive and finite, got {limit}")
    return limits


def _profile(length: float, velocity: float, acceleration: float, jerk: float, rate: int) -> Array:
    """Compute positions (n,) from 0 (excluded) to length, at rest at both ends, slowed down to whole samples."""
    limits = ruckig.InputParameter(1)
    limits.max_velocity, limits.max_acceleration, limits.max_jerk = [velocity], [acceleration], [jerk]
    limits.current_position, limits.target_position = [0.0], [length]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(limits, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(
            f"ruckig finds no profile of length {length} with limits {velocity}, {acceleration}, {jerk}: {result}"
        )
    count = max(1, math.ceil(trajectory.duration * rate - 1e-9))
    moments = np.arange(1, count + 1) * (trajectory.duration / count)
    along = np.array([trajectory.at_time(moment)[0][0] for moment in moments])
    return np.asarray(np.maximum.accumulate(np.clip(along, 0.0, length)))
