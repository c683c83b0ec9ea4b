"""The joint space of an arm, and what lies between two configurations: joints may turn without end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planlang.geometry import Array


@dataclass(frozen=True, slots=True, eq=False)
class JointSpace:
    """The joint space of an arm: limits (d,), which joints turn without end (d,), and ``resolution`` (d,) of checks."""

    lower: Array
    upper: Array
    continuous: NDArray[np.bool_]
    resolution: Array

    @staticmethod
    def of(
        lower: ArrayLike, upper: ArrayLike, *, continuous: ArrayLike = False, resolution: ArrayLike = 0.08
    ) -> JointSpace:
        """Return the space of limits (d,); raise ValueError for a resolution not positive or limits not finite."""
        low, high = np.asarray(lower, float), np.asarray(upper, float)
        turning = np.array(np.broadcast_to(np.asarray(continuous, bool), low.shape))
        steps = np.array(np.broadcast_to(np.asarray(resolution, float), low.shape))
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"expected limits (d,), got shapes {low.shape}, {high.shape}")
        if not (steps > 0).all() or not (np.isfinite(low) & np.isfinite(high) | turning).all():
            raise ValueError("the resolution must be positive and the limits finite")
        return JointSpace(np.where(turning, -np.pi, low), np.where(turning, np.pi, high), turning, steps)

    def move(self, start: Array, end: Array) -> Array:
        """Return the difference from one configuration (..., d) to another, the shorter way around."""
        move = end - start
        return np.asarray(move - np.where(self.continuous, 2 * np.pi * np.rint(move / (2 * np.pi)), 0.0))

    def unwound(self, path: Sequence[Array]) -> list[Array]:
        """Return the same waypoints, each the shorter way around from the one before."""
        found = [path[0]]
        for q in path[1:]:
            move = q - found[-1]
            found.append(q if (np.abs(move[self.continuous]) <= np.pi).all() else found[-1] + self.move(found[-1], q))
        return found

    def pieces(self, start: Array, end: Array) -> int:
        """Into how many pieces a way is divided to be checked."""
        return max(1, int(np.ceil((np.abs(end - start) / self.resolution).max() - 1e-9)))

    def length(self, path: Sequence[Array]) -> float:
        """Return the length of a path, in units of the resolution."""
        return sum(float(np.linalg.norm((b - a) / self.resolution)) for a, b in pairwise(path))

    def points(self, path: Array) -> Array:
        """Return configurations (m, d) along waypoints (n, d), at most the resolution apart, without the start."""
        parts = []
        for a, b in pairwise(path):
            count = self.pieces(a, b)
            parts.append(a + (b - a) * (np.arange(1, count + 1) / count)[:, None])
        return np.concatenate(parts) if parts else path[:0]
