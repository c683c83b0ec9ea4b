"""Products of rotations (3, 3) and rigid motions (4, 4), the same to the last bit with every BLAS.

NumPy's ``@`` hands matrices to the BLAS, whose kernels differ between processors in the order of sums and in fused
multiplications, so that a trace would differ in its last digits (OpenBLAS for Nehalem and for Haswell: by up to
1.4e-14). ``einsum`` without ``optimize`` adds products one after another in C that is compiled once for all processors
of an architecture. It takes about twice as long for one pair of matrices, which no run notices.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def product(first: Array, *others: Array) -> Array:
    """Return the matrix product of arrays (..., n, m) and (..., m, k), from left to right; leading axes broadcast."""
    for other in others:
        first = np.einsum("...ij,...jk->...ik", first, other)
    return first


def rotated(rotation: Array, vectors: Array) -> Array:
    """Turn vectors (..., 3) by rotations (..., 3, 3); leading axes broadcast, so that one rotation turns (n, 3)."""
    return np.asarray(np.einsum("...ij,...j->...i", rotation, vectors))


def moved(matrix: Array, points: Array) -> Array:
    """Move points (..., 3) by rigid motions (..., 4, 4); leading axes broadcast, so that one motion moves (n, 3)."""
    return rotated(matrix[..., :3, :3], points) + matrix[..., :3, 3]


def inverse(matrix: Array) -> Array:
    """Return the inverses of rigid motions (..., 4, 4): the transposed rotation, the shift turned back."""
    back = np.swapaxes(matrix[..., :3, :3], -1, -2)
    found = np.zeros_like(matrix)
    found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = back, -rotated(back, matrix[..., :3, 3]), 1.0
    return found


def rigid(rotation: Array, position: Array) -> Array:
    """Return the rigid motion (..., 4, 4) of rotations (..., 3, 3) and positions (..., 3)."""
    found = np.zeros((*rotation.shape[:-2], 4, 4))
    found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = rotation, position, 1.0
    return found


# Entry k of a rotation matrix, by rows, is made of two products of parts i and j of a quaternion, number 4 i + j.
_FIRST, _SECOND = np.array([5, 1, 2, 1, 0, 6, 2, 6, 0]), np.array([10, 11, 7, 11, 10, 3, 7, 3, 5])
_SIGN = np.array([[1.0], [-1.0], [1.0], [1.0], [1.0], [-1.0], [-1.0], [1.0], [1.0]])


def rotations(quaternions: Array) -> Array:
    """Return the rotations (n, 3, 3) of unit quaternions (n, 4)."""
    parts = quaternions.T
    products = (2 * (parts[:, None] * parts)).reshape(16, -1)
    entries = products[_FIRST] + _SIGN * products[_SECOND]
    entries[::4] = 1 - entries[::4]
    return np.ascontiguousarray(entries.T).reshape(-1, 3, 3)


def rotation_of(roll: float, pitch: float, yaw: float) -> Array:
    """Return the rotation (3, 3) of URDF's angles: about the fixed axes x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(angle) for angle in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """Return URDF's roll, pitch and yaw of a rotation (3, 3); roll is 0 where only its sum with yaw is known."""
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if abs(abs(pitch) - np.pi / 2) < 1e-9:
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def cross_matrix(axis: Array) -> Array:
    """Return the matrix (3, 3) that takes the cross product with a vector (3,) from the left."""
    x, y, z = axis.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
