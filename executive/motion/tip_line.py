"""Straight lines of the tip: an approach, a lift, a retreat."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from executive.motion.kinematics import InverseKinematics
from planlang.protocols import Array

UNTURNED = 1e-12
"""Of poses that are turned against each other by no more than half of this the rotation is the same [rad]."""
HALF_TURN = 1e-3
"""Nearer to half a turn than half of this the antisymmetric part of a rotation is too small to tell its axis [rad]."""


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

    Each step's solution starts from the last one and may move no joint by more than ``largest_step`` [rad, m]; every
    configuration but ``start_q`` (d,) is checked. The line between two waypoints is straight in joint space.
    """
    q = np.array(start_q, float)
    waypoints = [q]
    for i, pose in enumerate(_between(np.asarray(start_pose, float), np.asarray(goal_pose, float), steps), start=1):
        found = ik.solve_one(pose, q)
        if found is None:
            return TipLine(None, f"the tip does not reach step {i} of {steps}")
        jump = np.abs(found - q)
        if jump.max() > largest_step:
            name = ik.chain.names[int(np.argmax(jump))]
            return TipLine(None, f"{name} would jump by {jump.max():.2f} at step {i} of {steps}")
        if not is_free(found.copy()):
            return TipLine(None, f"in collision at step {i} of {steps}")
        waypoints.append(found)
        q = found
    return TipLine(np.array(waypoints))


def _between(start: Array, goal: Array, steps: int) -> Array:
    """Poses (steps, 4, 4) after the start up to the goal, evenly moved and turned."""
    shares = np.arange(1, steps + 1) / steps
    poses = np.repeat(start[None], steps, axis=0)
    poses[:, :3, 3] += shares[:, None] * (goal[:3, 3] - start[:3, 3])
    turn = goal[:3, :3] @ start[:3, :3].T
    twice = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    cosine, double_sine = (np.trace(turn) - 1) / 2, math.sqrt(twice @ twice)
    if cosine < 0 or double_sine > UNTURNED:
        axis = twice / double_sine if cosine > 0 or double_sine > HALF_TURN else _axis(turn)
        cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        parts = shares[:, None, None] * math.atan2(axis @ twice / 2, cosine)
        turns = np.eye(3) + np.sin(parts) * cross + (1 - np.cos(parts)) * (cross @ cross)
        poses[:, :3, :3] = turns @ start[:3, :3]
    poses[-1] = goal
    return poses


def _axis(turn: Array) -> Array:
    """The axis (3,) of a rotation (3, 3), as its eigenvector: where the antisymmetric part all but vanishes."""
    values, vectors = np.linalg.eig(turn)
    axis = np.real(vectors[:, int(np.argmin(np.abs(values - 1)))])
    return np.asarray(axis / np.linalg.norm(axis))
