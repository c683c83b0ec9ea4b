"""Keeping a held object upright: a limit on the tilt of an axis of the tip, and projection onto it."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.motion.kinematics import Chain
from planlang.geometry import Array
from planlang.geometry.matrices import rotated
from planlang.records import dataclass

INSIDE = 0.5
"""Share of the limit to which a violating configuration is projected."""
STEPS = 8
"""Newton steps after which a projection is given up."""
LONGEST = 0.3
"""Longest step of a joint [rad, m]."""
DAMPING = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class Upright:
    """Limit of the tilt of an axis of a chain's tip: at most ``limit`` [rad] from upright; the base is level.

    Paths are planned on it as in D. Berenson et al., Manipulation planning on constraint manifolds (ICRA 2009): samples
    are projected.
    """

    chain: Chain
    axis: Array
    """Axis in the frame of the tip, (3,)."""
    limit: float

    def tilts(self, q: Array) -> Array:
        """Compute the angle (n,) [rad] of the axis from upright at configurations (n, d)."""
        return np.asarray(np.arccos(np.clip(self._axes(q)[:, 2], -1.0, 1.0)))

    def holds(self, q: Array) -> NDArray[np.bool_]:
        """Check which configurations (n, d) are within the limit."""
        return np.asarray(self._axes(q)[:, 2] >= math.cos(self.limit))

    def projected(self, q: Array) -> Array:
        """Project configurations (n, d) to nearby ones within the limit, where possible; valid ones stay."""
        rows, goal = q.copy(), INSIDE * self.limit
        violating = np.flatnonzero(~self.holds(rows))
        for _ in range(STEPS):
            if not len(violating):
                break
            axes = self._axes(rows[violating])
            tilts = np.arccos(np.clip(axes[:, 2], -1.0, 1.0))
            across = np.hypot(axes[:, 0], axes[:, 1])
            turns = ((tilts - goal) / np.maximum(across, 1e-9))[:, None] * np.stack([axes[:, 1], -axes[:, 0]], axis=1)
            jacobians = self.chain.jacobian(rows[violating])[:, 3:5]
            squares = jacobians @ jacobians.transpose(0, 2, 1) + DAMPING * np.eye(2)
            steps = (jacobians.transpose(0, 2, 1) @ np.linalg.solve(squares, turns[:, :, None]))[:, :, 0]
            steps /= np.maximum(np.abs(steps).max(axis=1, keepdims=True) / LONGEST, 1.0)
            moved = rows[violating] + steps
            within = np.clip(moved, self.chain.lower, self.chain.upper)
            rows[violating] = np.where(self.chain.continuous, moved, within)
            violating = violating[~self.holds(rows[violating])]
        return rows

    def _axes(self, q: Array) -> Array:
        """Compute the axis in the base (n, 3) at configurations (n, d)."""
        return rotated(self.chain.fk(q)[:, :3, :3], self.axis)
