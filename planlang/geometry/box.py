"""Boxes: oriented ones by pose and extents, ones along the map's axes by their lower and upper corners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.geometry.matrices import Array, moved, rotated
from planlang.geometry.pose import Pose

Size = tuple[float, float, float]
"""Extents along a box's own axes [m]."""

_SIGNS = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)


def corners(pose: Pose, size: Sequence[float] | Array) -> Array:
    """Return the corners (8, 3) of the box of that size whose centre is at the pose."""
    return moved(pose.matrix(), _SIGNS * (np.asarray(size, dtype=float) / 2))


def half_extents(pose: Pose, size: Sequence[float] | Array) -> Array:
    """Return half the extents (3,) along the map's axes of the box of that size at the pose."""
    return rotated(np.abs(pose.rotation), np.asarray(size, dtype=float) / 2)


def overlaps(lower: Array, upper: Array, other_lower: Array, other_upper: Array) -> NDArray[np.bool_]:
    """Return which of n boxes along the map's axes, given by corners (n, 3), overlap which of m others, (n, m)."""
    found = lower[:, 0, None] <= other_upper[:, 0]
    found &= upper[:, 0, None] >= other_lower[:, 0]
    for axis in (1, 2):
        found &= lower[:, axis, None] <= other_upper[:, axis]
        found &= upper[:, axis, None] >= other_lower[:, axis]
    return np.asarray(found)
