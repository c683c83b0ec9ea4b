"""What inverse kinematics takes for a pose."""

from __future__ import annotations

import numpy as np

from planlang.geometry import Array

IMPROPER = 0.01
"""How far elements of R R^T may be from those of 1 for a matrix R to be meant as a rotation: the nearest one.

Quaternions whose length is off by 0.001 give as much; solutions have the rotation that is nearest to such an R.
"""


def check_targets(poses: Array) -> None:
    """Raise ValueError for the first of poses (m, 4, 4) that is none."""
    rotations = poses[:, :3, :3]
    with np.errstate(invalid="ignore", over="ignore"):
        off = _off(rotations)
        proper = (off <= IMPROPER) & (np.linalg.det(rotations) > 0) & np.isfinite(poses[:, :3, 3]).all(axis=1)
    if not proper.all():
        number = int(np.argmin(proper))
        raise no_pose(poses[number], number)


def no_pose(pose: Array, number: int) -> ValueError:
    """What is wrong with a target (4, 4), one that is no pose."""
    with np.errstate(invalid="ignore", over="ignore"):
        off = float(_off(pose[:3, :3]))
    if not np.isfinite(pose[:3]).all():
        wrong = "it has numbers that are not finite"
    elif off > IMPROPER:
        wrong = f"R R^T of its rotation R differs from 1 by {off:.3g}"
    else:
        wrong = "its rotation is a reflection, of determinant -1"
    return ValueError(f"target {number} is no pose: {wrong}")


def _off(rotations: Array) -> Array:
    """How far R R^T is from 1, (...) for matrices R (..., 3, 3)."""
    return np.asarray(np.abs(rotations @ np.swapaxes(rotations, -1, -2) - np.eye(3)).max(axis=(-1, -2)))
