"""What a world is for the layers above it, and the value types that cross the borders between layers.

What the language asks of an executive and its process modules is :mod:`planlang.language.executive`.

Frames: ``map`` is right-handed with z up and the floor at z = 0. Lengths in metres, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid pose: position [m] and unit quaternion (x, y, z, w)."""

    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    @staticmethod
    def planar(x: float, y: float, yaw: float = 0.0, z: float = 0.0) -> Pose:
        """A pose turned about z only."""
        return Pose((x, y, z), (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2)))

    @staticmethod
    def from_matrix(matrix: Array) -> Pose:
        """From a homogeneous (4, 4) matrix whose rotation part is orthonormal with determinant 1."""
        (xx, xy, xz, px), (yx, yy, yz, py), (zx, zy, zz, pz), _ = matrix.tolist()
        a, b, c = zy - yz, xz - zx, yx - xy
        d, e, f = xy + yx, xz + zx, yz + zy
        squares = (xx - yy - zz + 1.0, yy - xx - zz + 1.0, zz - (xx + yy) + 1.0, xx + yy + zz + 1.0)
        rows = ((squares[0], d, e, a), (d, squares[1], f, b), (e, f, squares[2], c), (a, b, c, squares[3]))
        row = rows[squares.index(max(squares))]  # 4 times the quaternion's outer product has four such rows
        largest = np.array(row)
        norm = math.sqrt(largest.dot(largest)) if row[3] >= 0 else -math.sqrt(largest.dot(largest))
        return Pose((float(px), float(py), float(pz)), (row[0] / norm, row[1] / norm, row[2] / norm, row[3] / norm))

    def matrix(self) -> Array:
        """The homogeneous (4, 4) matrix of the pose."""
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
        """The matrices (n, 4, 4) of poses, to the last bit those that :meth:`matrix` gives one by one."""
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
        return Pose.from_matrix(self.matrix() @ other.matrix())

    def inverse(self) -> Pose:
        """The pose that undoes this one."""
        m = self.matrix()
        inverse = np.eye(4)
        inverse[:3, :3] = m[:3, :3].T
        inverse[:3, 3] = -m[:3, :3].T @ m[:3, 3]
        return Pose.from_matrix(inverse)

    @property
    def yaw(self) -> float:
        """Heading of the x axis about z, in (-pi, pi]."""
        x, y, z, w = self.orientation
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def distance(self, other: Pose) -> float:
        """Euclidean distance of the positions [m]."""
        return math.dist(self.position, other.position)


@dataclass(frozen=True, slots=True)
class Configuration:
    """Where a robot is: base (x, y, yaw) in the map and its actuated joints by name."""

    base: tuple[float, float, float]
    joints: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Contact:
    """A penetration: a link of the robot (or a held object, by name) and what it touches; ``depth`` > 0 [m]."""

    part: str
    body: str
    depth: float


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Positions sampled at the world's rate: row k is reached k world steps after the start, row 0 is the start.

    ``names`` are joint names, or ("x", "y", "yaw") for the base; ``positions`` is (n, len(names)).
    """

    names: tuple[str, ...]
    positions: Array


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a commanded motion: ``state`` is "moving", "done", "blocked" or "halted"; what blocks it by name."""

    state: str
    blocked_by: str | None = None


@dataclass(frozen=True, slots=True)
class Detection:
    """What the camera made of an object: its name, its pose and the visible share of its pixels (0..1)."""

    name: str
    pose: Pose
    visible: float


class World(Protocol):
    """Bodies, one robot, contact, camera, attachment, time: ``sim.PyBulletWorld``; a real robot can be another."""

    rate: int
    """World steps per second."""

    def step(self) -> None:
        """Advance by one step: motions, people, falling objects."""

    def names(self) -> tuple[str, ...]:
        """Names of all bodies, in the order of the scene."""

    def pose(self, name: str) -> Pose:
        """Pose of the body's box centre in the map."""

    def size(self, name: str) -> tuple[float, float, float]:
        """Extents of the body's box along its own axes [m]."""

    def configuration(self) -> Configuration:
        """Where the robot is."""

    def link_pose(self, link: str) -> Pose:
        """Pose of a link frame of the robot in the map."""

    def start(self, group: str, trajectory: Trajectory) -> None:
        """Begin a motion of a group ("base", an arm, ...); it ends by itself, at an obstacle, or by :meth:`halt`."""

    def motion(self, group: str) -> Motion:
        """State of the group's last motion."""

    def halt(self, group: str) -> None:
        """Stop the group where it is."""

    def contacts(self, configuration: Configuration | None = None) -> tuple[Contact, ...]:
        """Penetrations of the robot and what it holds, at its own or another configuration, allowed ones left out."""

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """What the camera sees, unoccluded and within its limits, in the order of the scene."""

    def between_fingers(self, fingers: str | Collection[str]) -> str | None:
        """The body that the fingers of a hand (its link, or the finger links) feel between them."""

    def attach(self, link: str, name: str) -> None:
        """Fix a body to a link of the robot."""

    def release(self, name: str) -> None:
        """Let a body go; it sinks to the first surface below."""

    def attached(self) -> Mapping[str, str]:
        """Body -> link of the robot that holds it."""

    def falling(self, name: str) -> bool:
        """Whether a body that was let go is still on its way down."""

    def taken(self, name: str) -> str | None:
        """The person who pulls at a body or has it, None if nobody does."""


@dataclass(frozen=True, slots=True)
class Solution:
    """One place for the base that satisfies a location: the planar pose and what was chosen with it."""

    base: tuple[float, float, float]
    revision: int
    """Revision of the belief it was computed from."""
    detail: Mapping[str, Any]
    """JSON-like: which arm, grasp, torso height; for the trace."""
