"""Timing of waypoints: one-DoF ruckig along the path, so that a motion never leaves the line that was checked.

The path parameter s of a segment from a to b is measured in seconds at full speed, T = max_i |b_i - a_i| / v_i, so
that ds/dt <= 1 is the velocity limit everywhere, and acceleration and jerk along s are limited by
min_i limit_i T / |b_i - a_i|. Synchronising several degrees of freedom instead leaves the line when the limits are not
proportional to each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from planlang.protocols import Array, Trajectory

PASS = 0.3
"""A corner is passed without a stop if that is possible with at least this share of the full speed."""


def time_path(
    names: Sequence[str],
    waypoints: ArrayLike,
    *,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    rate: int,
) -> Trajectory:
    """The trajectory through waypoints (n, d), n >= 1, within limits (d,) or scalars, sampled ``rate`` times a second.

    Every row lies on the path; the first and the last row are the first and the last waypoint. The motion starts and
    ends at rest. It stops at corners, at a row of its own, except slight ones: where the jump of velocity takes at most
    half the acceleration limit during one sample it passes (as a straight line of the tip needs), and then half the
    acceleration is left for speeding up. Waypoints that repeat cost no time; n = 1 or no motion gives one row.
    """
    points = np.array(waypoints, float)
    if points.ndim != 2 or not len(points) or points.shape[1] != len(names) or not np.isfinite(points).all():
        raise ValueError(f"expected finite waypoints (n, {len(names)}) of {tuple(names)}, got shape {points.shape}")
    if rate <= 0:
        raise ValueError(f"the rate must be positive, got {rate}")
    v, a, j = (
        _limits(what, value, names)
        for what, value in (("velocity", velocity), ("acceleration", acceleration), ("jerk", jerk))
    )
    points = points[np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))]
    times = (np.abs(np.diff(points, axis=0)) / v).max(axis=1)
    directions = np.diff(points, axis=0) / times[:, None]
    passing = _passing_speeds(times, directions, a, rate)

    rows = [points[:1]]
    first = 0
    while first < len(times):
        last = first
        while last < len(passing) and passing[last] >= PASS:
            last += 1
        run = slice(first, last + 1)
        share = 1.0 if last == first else 0.5
        speed = min([1.0, *passing[first:last]])
        steepest = np.abs(directions[run]).max(axis=0)
        with np.errstate(divide="ignore"):
            along = _profile(times[run].sum(), speed, share * (a / steepest).min(), (j / steepest).min(), rate)
        marks = np.concatenate([[0.0], np.cumsum(times[run])])
        knots = points[first : last + 2]
        run_rows = np.stack([np.interp(along, marks, knots[:, k]) for k in range(len(names))], axis=1)
        run_rows[-1] = knots[-1]
        rows.append(run_rows)
        first = last + 1
    return Trajectory(tuple(names), np.concatenate(rows))


def _limits(what: str, value: ArrayLike, names: Sequence[str]) -> Array:
    limits = np.asarray(value, float)
    if limits.shape not in ((), (len(names),)):
        raise ValueError(f"expected one {what} limit or one for each of {tuple(names)}, got shape {limits.shape}")
    limits = np.broadcast_to(limits, (len(names),))
    for name, limit in zip(names, limits, strict=True):
        if not (limit > 0 and math.isfinite(limit)):
            raise ValueError(f"the {what} limit of {name!r} must be positive and finite, got {limit}")
    return limits


def _passing_speeds(times: Array, directions: Array, acceleration: Array, rate: int) -> Array:
    """Speed (n - 1,) at which each corner's jump of velocity stays within half the acceleration of one sample.

    Corners that can follow within a sample count together: their jumps fall into one difference of velocities.
    """
    marks = np.cumsum(times)[:-1]
    together = np.abs(marks[:, None] - marks) <= 1 / rate
    jumps = together @ np.abs(np.diff(directions, axis=0))
    with np.errstate(divide="ignore"):
        return np.asarray((0.5 * acceleration / rate / jumps).min(axis=1, initial=np.inf))


def _profile(length: float, velocity: float, acceleration: float, jerk: float, rate: int) -> Array:
    """Positions (n,) from 0 (left out) to length, at rest at both ends, slowed down to whole samples."""
    given = ruckig.InputParameter(1)
    given.max_velocity, given.max_acceleration, given.max_jerk = [velocity], [acceleration], [jerk]
    given.current_position, given.target_position = [0.0], [length]
    trajectory = ruckig.Trajectory(1)
    result = ruckig.Ruckig(1).calculate(given, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise RuntimeError(
            f"ruckig finds no profile of length {length} with limits {velocity}, {acceleration}, {jerk}: {result}"
        )
    count = max(1, math.ceil(trajectory.duration * rate - 1e-9))
    moments = np.arange(1, count + 1) * (trajectory.duration / count)
    along = np.array([trajectory.at_time(moment)[0][0] for moment in moments])
    return np.asarray(np.maximum.accumulate(np.clip(along, 0.0, length)))
