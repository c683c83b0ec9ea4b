"""Joint ranges of one chain or several: limits, and whole turns of continuous joints."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planlang.geometry import Array


class JointRanges:
    """Ranges of n joints."""

    lower: Array
    """Lower limits (n,) [rad, m]; -pi, the start of its range, for a continuous joint."""
    upper: Array
    """Upper limits (n,)."""
    continuous: NDArray[np.bool_]
    """Mask of continuous joints (n,)."""

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,), infinite for continuous joints."""
        return np.where(self.continuous, -np.inf, self.lower), np.where(self.continuous, np.inf, self.upper)

    def within(self, q: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Check which configurations (m, n) respect all limits; continuous joints have none."""
        rows = np.atleast_2d(np.asarray(q, float))
        lower, upper = self.bounds
        return np.asarray(((rows >= lower - tolerance) & (rows <= upper + tolerance)).all(axis=1))

    def near(self, q: ArrayLike, reference: ArrayLike) -> Array:
        """Shift continuous joints of configurations (..., n) by whole turns to within half a turn of the reference."""
        configurations, target = np.asarray(q, float), np.asarray(reference, float)
        turns = np.where(self.continuous, np.round((target - configurations) / (2 * np.pi)), 0.0)
        return np.asarray(configurations + 2 * np.pi * turns)
