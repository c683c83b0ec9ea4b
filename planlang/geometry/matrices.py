"""Rigid poses, and products of rotations (3, 3) and rigid motions (4, 4) that are bit-identical on every processor.

NumPy's ``@`` calls the BLAS, whose kernels differ between processors in the order of additions and in fused
multiplications, so traces would differ in their last digits (OpenBLAS for Nehalem and for Haswell: by up to 1.4e-14).
``einsum`` without ``optimize`` adds the products one after another in C that is compiled once per architecture. For a
pair of matrices it takes about twice as long, which is negligible in a run.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.records import dataclass

Array = NDArray[np.float64]


def product(first: Array, *others: Array) -> Array:
    """Return the matrix product of arrays (..., n, m) and (..., m, k), from left to right; leading axes broadcast."""
    for other in others:
        first = np.einsum("...ij,...jk->...ik", first, other)
    return first


STEPS = 20
"""Maximum number of Newton iterations: each doubles the digits, and the worst nonsingular matrix needs 9."""


def orthonormal(matrix: Array) -> Array:
    """Compute the nearest orthonormal matrix (3, 3) by Newton's iteration (N. J. Higham, 1986).

    An SVD by LAPACK would differ in the last digits between processors.
    """
    for _ in range(STEPS):
        a, b, c = before = matrix
        inverse = np.array(
            [np.cross(b, c), np.cross(c, a), np.cross(a, b)]
        )  # transposed, not yet divided by the determinant
        matrix = (matrix + inverse / np.sum(a * inverse[0])) / 2
        if np.array_equal(matrix, before):
            break
    return matrix


def rotated(rotation: Array, vectors: Array) -> Array:
    """Rotate vectors (..., 3) by rotations (..., 3, 3); leading axes broadcast, so one rotation applies to (n, 3)."""
    return np.asarray(np.einsum("...ij,...j->...i", rotation, vectors))


def moved(matrix: Array, points: Array) -> Array:
    """Transform points (..., 3) by rigid motions (..., 4, 4); leading axes broadcast, as in :func:`rotated`."""
    return rotated(matrix[..., :3, :3], points) + matrix[..., :3, 3]


def inverse(matrix: Array) -> Array:
    """Invert rigid motions (..., 4, 4): transpose the rotation, and rotate the translation back."""
    back = np.swapaxes(matrix[..., :3, :3], -1, -2)
    found = np.zeros_like(matrix)
    found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = back, -rotated(back, matrix[..., :3, 3]), 1.0
    return found


def rigid(rotation: Array, position: Array) -> Array:
    """Combine rotations (..., 3, 3) and positions (..., 3) to rigid motions (..., 4, 4)."""
    found = np.zeros((*rotation.shape[:-2], 4, 4))
    found[..., :3, :3], found[..., :3, 3], found[..., 3, 3] = rotation, position, 1.0
    return found


# Entry k of a rotation matrix, by rows, is a sum of two products of quaternion components i and j, index 4 i + j.
_FIRST, _SECOND = np.array([5, 1, 2, 1, 0, 6, 2, 6, 0]), np.array([10, 11, 7, 11, 10, 3, 7, 3, 5])
_SIGN = np.array([[1.0], [-1.0], [1.0], [1.0], [1.0], [-1.0], [-1.0], [1.0], [1.0]])


def rotations(quaternions: Array) -> Array:
    """Convert unit quaternions (n, 4) to rotations (n, 3, 3)."""
    parts = quaternions.T
    products = (2 * (parts[:, None] * parts)).reshape(16, -1)
    entries = products[_FIRST] + _SIGN * products[_SECOND]
    entries[::4] = 1 - entries[::4]
    return np.ascontiguousarray(entries.T).reshape(-1, 3, 3)


def rotation_of(roll: float, pitch: float, yaw: float) -> Array:
    """Convert URDF's roll, pitch and yaw to a rotation (3, 3): about the fixed axes x, then y, then z."""
    cr, sr, cp, sp, cy, sy = (f(angle) for angle in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def angles_of(rotation: Array) -> tuple[float, float, float]:
    """Convert a rotation (3, 3) to URDF's roll, pitch and yaw; in gimbal lock roll is 0."""
    pitch = float(np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0])))
    if abs(abs(pitch) - np.pi / 2) < 1e-9:
        return 0.0, pitch, float(np.arctan2(-rotation[0, 1], rotation[1, 1]))
    roll = float(np.arctan2(rotation[2, 1], rotation[2, 2]))
    return roll, pitch, float(np.arctan2(rotation[1, 0], rotation[0, 0]))


def cross_matrix(axis: Array) -> Array:
    """Return the skew-symmetric matrix (3, 3) whose product with v is ``axis`` x v."""
    x, y, z = axis.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid pose: position [m] and unit quaternion (x, y, z, w)."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    @staticmethod
    def planar(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Pose:
        """Make a pose that is rotated about z only."""
        return Pose((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))

    @staticmethod
    def from_matrix(matrix: Array) -> Pose:
        """Convert a homogeneous matrix (4, 4), whose rotation part is orthonormal with determinant 1, to a pose."""
        (xx, xy, xz, px), (yx, yy, yz, py), (zx, zy, zz, pz), _ = matrix.tolist()
        a, b, c = zy - yz, xz - zx, yx - xy
        d, e, f = xy + yx, xz + zx, yz + zy
        squares = (xx - yy - zz + 1.0, yy - xx - zz + 1.0, zz - (xx + yy) + 1.0, xx + yy + zz + 1.0)
        rows = ((squares[0], d, e, a), (d, squares[1], f, b), (e, f, squares[2], c), (a, b, c, squares[3]))
        row = rows[
            squares.index(max(squares))
        ]  # a row of 4 times the quaternion's outer product, the numerically best one
        length = math.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3])
        norm = length if row[3] >= 0 else -length
        return Pose((float(px), float(py), float(pz)), (row[0] / norm, row[1] / norm, row[2] / norm, row[3] / norm))

    @staticmethod
    def from_matrices(matrices: Array) -> list[Pose]:
        """Convert matrices (n, 4, 4) to poses, bit-identical to those of :meth:`from_matrix`."""
        if not len(matrices):
            return []
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (matrices[:, k, :3].T for k in range(3))
        a, b, c = zy - yz, xz - zx, yx - xy
        d, e, f = xy + yx, xz + zx, yz + zy
        p, q, r, s = xx - yy - zz + 1.0, yy - xx - zz + 1.0, zz - (xx + yy) + 1.0, xx + yy + zz + 1.0
        rows = np.array([(p, d, e, a), (d, q, f, b), (e, f, r, c), (a, b, c, s)])
        row = rows[np.argmax([p, q, r, s], axis=0), :, np.arange(len(matrices))].T
        length = np.sqrt(row[0] * row[0] + row[1] * row[1] + row[2] * row[2] + row[3] * row[3])
        turns = (row / np.where(row[3] >= 0, length, -length)).T.tolist()
        places = matrices[:, :3, 3].tolist()
        return [Pose((x, y, z), (i, j, k, w)) for (x, y, z), (i, j, k, w) in zip(places, turns, strict=True)]

    def matrix(self) -> Array:
        """Convert to a homogeneous matrix (4, 4)."""
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
        """Convert poses to matrices (n, 4, 4), bit-identical to those of :meth:`matrix`."""
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
        """The inverse transform."""
        return Pose.from_matrix(inverse(self.matrix()))

    def seen_from(self, frame: Pose) -> Pose:
        """Express the pose in another frame: ``frame.inverse() @ self``, but ten times as fast."""
        (x, y, z), (a, b, c, w) = (p - f for p, f in zip(self.position, frame.position, strict=True)), frame.orientation
        # rotation of a vector by the conjugate quaternion, as two nested cross products
        u, v, t = w * x - (b * z - c * y), w * y - (c * x - a * z), w * z - (a * y - b * x)
        position = (x - 2 * (b * t - c * v), y - 2 * (c * u - a * t), z - 2 * (a * v - b * u))
        d, e, f, g = self.orientation
        orientation = (
            w * d - a * g - b * f + c * e,
            w * e - b * g - c * d + a * f,
            w * f - c * g - a * e + b * d,
            w * g + a * d + b * e + c * f,
        )
        return Pose(position, orientation)

    @property
    def rotation(self) -> Array:
        """The rotation (3, 3) of the pose."""
        return self.matrix()[:3, :3]

    @property
    def yaw(self) -> float:
        """Heading of the x axis about z, in (-pi, pi]."""
        x, y, z, w = self.orientation
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def turn(self, other: Pose) -> float:
        """Angle between the two orientations [rad]."""
        dot = abs(sum(a * b for a, b in zip(self.orientation, other.orientation, strict=True)))
        return 2 * math.acos(min(1.0, dot))

    def distance(self, other: Pose) -> float:
        """Euclidean distance between the positions [m]."""
        return math.dist(self.position, other.position)


IDENTITY = Pose((0.0, 0.0, 0.0))
"""The pose of a frame in itself."""


def apart(base: Sequence[float], other: Sequence[float]) -> tuple[float, float]:
    """Compute the distance [m] of two base poses (x, y, yaw) and the angle between their headings [rad]."""
    return math.dist(base[:2], other[:2]), abs(math.remainder(base[2] - other[2], 2 * math.pi))


def facing(origin: Sequence[float], forward: Array, up: Array) -> Pose:
    """Make the pose at ``origin`` with its x axis along ``forward`` and its z axis as close to ``up`` as possible."""
    x = forward / np.linalg.norm(forward)
    y = np.cross(up, x)
    if (
        float(np.linalg.norm(y)) < 1e-9
    ):  # up is parallel to forward: any perpendicular direction will do, but always the same
        y = np.cross(np.array([1.0, 0.0, 0.0]) if abs(x[0]) < 0.9 else np.array([0.0, 1.0, 0.0]), x)
    y = y / np.linalg.norm(y)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x, y, np.cross(x, y), np.asarray(origin, dtype=float)
    return Pose.from_matrix(matrix)


def upright(pose: Pose) -> Pose:
    """Turn a pose so that its most vertical axis becomes exactly vertical."""
    axes = pose.rotation
    k = int(np.argmax(np.abs(axes[2])))
    return turned_up(pose, k, math.copysign(1.0, axes[2, k]))


def turned_up(pose: Pose, k: int, sign: float) -> Pose:
    """Turn a pose so that its axis of number k points up, or down if the sign is negative."""
    axis, goal = pose.rotation[:, k], np.array([0.0, 0.0, sign])
    cross = np.cross(axis, goal)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ goal)
    if sine < 1e-9:
        return pose
    half = math.atan2(sine, cosine) / 2
    x, y, z = (cross / sine * math.sin(half)).tolist()
    turn = Pose((0.0, 0.0, 0.0), (x, y, z, math.cos(half)))
    turned = turn @ Pose((0.0, 0.0, 0.0), pose.orientation)
    return Pose(pose.position, turned.orientation)
