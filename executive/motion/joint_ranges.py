"""Ranges of joints, of one chain or of several as one space: which configurations keep them, and whole turns."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planlang.geometry import Array


class JointRanges:
    """The ranges of n joints."""

    lower: Array
    """Lower limits (n,) [rad, m]; of a continuous joint -pi, the start of its range."""
    upper: Array
    """Upper limits (n,)."""
    continuous: NDArray[np.bool_]
    """Mask of the joints that turn without end (n,)."""

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,), infinite for joints that turn without end."""
        return np.where(self.continuous, -np.inf, self.lower), np.where(self.continuous, np.inf, self.upper)

    def within(self, q: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Return which configurations (m, n) keep all limits; continuous joints have none."""
        rows = np.atleast_2d(np.asarray(q, float))
        lower, upper = self.bounds
        return np.asarray(((rows >= lower - tolerance) & (rows <= upper + tolerance)).all(axis=1))

    def near(self, q: ArrayLike, reference: ArrayLike) -> Array:
        """Return the same configurations (..., n) with continuous joints within half a turn of the reference."""
        given, other = np.asarray(q, float), np.asarray(reference, float)
        turns = np.where(self.continuous, np.round((other - given) / (2 * np.pi)), 0.0)
        return np.asarray(given + 2 * np.pi * turns)
