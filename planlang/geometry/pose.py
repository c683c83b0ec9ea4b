"""Rigid poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from planlang.geometry.matrices import Array, inverse, product


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid pose: position [m] and unit quaternion (x, y, z, w)."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    @staticmethod
    def planar(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Pose:
        """Return a pose turned about z only."""
        return Pose((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))

    @staticmethod
    def from_matrix(matrix: Array) -> Pose:
        """Return the pose of a homogeneous (4, 4) matrix whose rotation part is orthonormal with determinant 1."""
        (xx, xy, xz, px), (yx, yy, yz, py), (zx, zy, zz, pz), _ = matrix.tolist()
        a, b, c = zy - yz, xz - zx, yx - xy
        d, e, f = xy + yx, xz + zx, yz + zy
        squares = (xx - yy - zz + 1.0, yy - xx - zz + 1.0, zz - (xx + yy) + 1.0, xx + yy + zz + 1.0)
        rows = ((squares[0], d, e, a), (d, squares[1], f, b), (e, f, squares[2], c), (a, b, c, squares[3]))
        row = rows[squares.index(max(squares))]  # 4 times the quaternion's outer product has four such rows
        length = math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3])
        norm = length if row[3] >= 0 else -length
        return Pose((float(px), float(py), float(pz)), (row[0] / norm, row[1] / norm, row[2] / norm, row[3] / norm))

    def matrix(self) -> Array:
        """Return the homogeneous (4, 4) matrix of the pose."""
        x, y, z, w = self.orientation
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), self.position[0]],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), self.position[1]],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), self.position[2]],
                [0.0, 0.0, 0.0, 1.0],
            ]
        )

    @staticmethod
    def matrices(poses: Iterable[Pose]) -> Array:
        """Return the matrices (n, 4, 4) of poses, to the last bit those that :meth:`matrix` gives one by one."""
        numbers = np.array([(*pose.position, *pose.orientation) for pose in poses], float).reshape(-1, 7)
        x, y, z, w = numbers[:, 3:].T
        found = np.zeros((len(numbers), 4, 4))
        found[:, 0, 0], found[:, 1, 1] = 1 - 2 * (y * y + z * z), 1 - 2 * (x * x + z * z)
        found[:, 2, 2], found[:, 3, 3] = 1 - 2 * (x * x + y * y), 1.0
        found[:, 0, 1], found[:, 1, 0] = 2 * (x * y - z * w), 2 * (x * y + z * w)
        found[:, 0, 2], found[:, 2, 0] = 2 * (x * z + y * w), 2 * (x * z - y * w)
        found[:, 1, 2], found[:, 2, 1] = 2 * (y * z - x * w), 2 * (y * z + x * w)
        found[:, :3, 3] = numbers[:, :3]
        return found

    def __matmul__(self, other: Pose) -> Pose:
        """Compose: ``map_T_a @ a_T_b`` is ``map_T_b``."""
        return Pose.from_matrix(product(self.matrix(), other.matrix()))

    def inverse(self) -> Pose:
        """Return the pose that undoes this one."""
        return Pose.from_matrix(inverse(self.matrix()))

    @property
    def rotation(self) -> Array:
        """The rotation (3, 3) of the pose."""
        return self.matrix()[:3, :3]

    @property
    def yaw(self) -> float:
        """Heading of the x axis about z, in (-pi, pi]."""
        x, y, z, w = self.orientation
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def distance(self, other: Pose) -> float:
        """Return the Euclidean distance of the positions [m]."""
        return math.dist(self.position, other.position)


def facing(origin: Sequence[float], forward: Array, up: Array) -> Pose:
    """Return the pose at ``origin`` whose x axis points along ``forward``, its z axis as near to ``up`` as can be."""
    x = forward / np.linalg.norm(forward)
    y = np.cross(up, x)
    if float(np.linalg.norm(y)) < 1e-9:  # up is along forward: any direction across will do, but always the same
        y = np.cross(np.array([1.0, 0.0, 0.0]) if abs(x[0]) < 0.9 else np.array([0.0, 1.0, 0.0]), x)
    y = y / np.linalg.norm(y)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, np.cross(x, y), np.asarray(origin, dtype=float)
    return Pose.from_matrix(matrix)
