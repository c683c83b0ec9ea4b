"""Straight lines of the tip: an approach, a lift, a retreat."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from executive.motion.kinematics import InverseKinematics
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, product, rotated

UNTURNED = 1e-12
"""Poses turned against each other by no more than half of this have the same rotation [rad]."""
HALF_TURN = 1e-3
"""Nearer to half a turn than half of this the antisymmetric part of a rotation is too small to give its axis [rad]."""


AHEAD = 9
"""Poses whose inverse kinematics starts from the same configuration: at 0.1 m in all it converges in 3 to 5 steps."""
UNMOVED = 1e-18
"""Squared lengths up to this are no way [m^2]."""
LARGEST_STRAY = 1e-3
"""Largest distance of the tip from a straight line [m]."""
LARGEST_TILT = 1e-2
"""Largest rotation of the tip from the even one between the first rotation and the last [rad]."""
REFINED = 3
"""So many times the steps of a line are halved if the tip leaves it between them."""


@dataclass(frozen=True, slots=True, eq=False)
class TipLine:
    """A straight line of the tip: its ``waypoints`` (n, d), or None and the ``reason`` why it cannot be followed."""

    waypoints: Array | None
    reason: str = ""


def cartesian_path(
    ik: InverseKinematics,
    start_q: ArrayLike,
    start_pose: ArrayLike,
    goal_pose: ArrayLike,
    is_free: Callable[[Array], bool],
    *,
    steps: int = 9,
    largest_step: float = 0.5,
) -> TipLine:
    """Move the tip straight from one pose (4, 4) to another in the chain's base frame, turning it evenly.

    No step may move a joint by more than ``largest_step`` [rad, m]; every
    configuration but ``start_q`` (d,) is checked. The line between two waypoints is straight in joint space; where the
    tip would leave its own line by more than :func:`keeps_line` allows, steps are halved.
    """
    start, goal = np.asarray(start_pose, float), np.asarray(goal_pose, float)
    counts = [steps * 2**halved for halved in range(REFINED + 1)]
    for count in counts:
        line = _in_steps(ik, np.array(start_q, float), _between(start, goal, count), is_free, largest_step)
        if line.waypoints is None:
            return line
        middles = ik.chain.fk((line.waypoints[:-1] + line.waypoints[1:]) / 2)
        if keeps_line(middles, start, goal):
            return line
    return TipLine(None, f"the tip leaves the line between steps, even {counts[-1]} of them")


def keeps_line(poses: Array, start: Array, goal: Array) -> bool:
    """Return True if poses (n, 4, 4) are on the line between two poses (4, 4), within both LARGEST_*.

    Their positions along the line are not checked.
    """
    way = goal[:3, 3] - start[:3, 3]
    moved = poses[:, :3, 3] - start[:3, 3]
    along = np.clip(moved @ way / max(float(way @ way), UNMOVED), 0.0, 1.0)
    stray = np.linalg.norm(moved - along[:, None] * way, axis=1).max()
    turns = product(poses[:, :3, :3], start[:3, :3].T)
    axis, _ = _turn(start, goal)
    if axis is None:
        cosines = (np.trace(turns, axis1=1, axis2=2) - 1) / 2
    else:  # turned about it alone, an axis stays where it is
        cosines = rotated(turns, axis) @ axis
    return bool(stray <= LARGEST_STRAY and cosines.min() >= math.cos(LARGEST_TILT))


def _in_steps(
    ik: InverseKinematics, q: Array, poses: Array, is_free: Callable[[Array], bool], largest_step: float
) -> TipLine:
    """Go from a configuration (d,) through poses (n, 4, 4)."""
    waypoints, steps = [q], len(poses)
    for i in range(steps):
        if i % AHEAD == 0:  # the next few start from here: near enough, and one call for all
            ahead = poses[i : i + AHEAD]
            found, reached = ik.solve(ahead, np.broadcast_to(q, (len(ahead), 1, len(q))))
        if not reached[i % AHEAD]:
            return TipLine(None, f"the tip does not reach step {i + 1} of {steps}")
        jump = np.abs(found[i % AHEAD] - q)
        if jump.max() > largest_step:
            name = ik.chain.names[int(np.argmax(jump))]
            return TipLine(None, f"{name} would jump by {jump.max():.2f} at step {i + 1} of {steps}")
        q = found[i % AHEAD]
        if not is_free(q.copy()):
            return TipLine(None, f"in collision at step {i + 1} of {steps}")
        waypoints.append(q)
    return TipLine(np.array(waypoints))


def _between(start: Array, goal: Array, steps: int) -> Array:
    """Poses (steps, 4, 4) after the start up to the goal, evenly moved and turned."""
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
    """About which axis (3,) and how far [rad] one pose (4, 4) is turned against another; None where it is not."""
    turn = product(goal[:3, :3], start[:3, :3].T)
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    cosine, double_sine = (np.trace(turn) - 1) / 2, math.sqrt(twice @ twice)
    if cosine >= 0 and double_sine <= UNTURNED:
        return None, 0.0
    axis = twice / double_sine if cosine > 0 or double_sine > HALF_TURN else _axis(turn)
    return axis, math.atan2(axis @ twice / 2, cosine)


def _axis(turn: Array) -> Array:
    """Return a rotation's (3, 3) axis (3,), as its eigenvector: where the antisymmetric part all but vanishes."""
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, int(np.argmin(np.abs(values - 1)))])
    return np.asarray(axis / np.linalg.norm(axis))
