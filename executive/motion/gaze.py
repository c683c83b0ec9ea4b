"""Where the neck must be so that the camera looks at a point, by a table of forward kinematics."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from executive.motion.kinematics import Chain
from planlang.protocols import Array

STEPS = 61
"""Postures per neck joint in the table; about 3 degrees apart for a neck that turns half around."""


class Gaze:
    """Points a camera that sits on a chain of neck joints; all in the frame of the robot's base link."""

    def __init__(
        self,
        urdf: Path,
        base_link: str,
        camera_link: str,
        neck: tuple[str, ...],
        axis: tuple[float, float, float],
        *,
        still: dict[str, float],
    ) -> None:
        """``axis`` is the viewing direction in the camera link's frame, ``still`` the other joints of the chain."""
        self.joints = neck
        chain = Chain.from_urdf(urdf, base_link, camera_link, locked=still)
        grids = np.meshgrid(
            *(np.linspace(low, high, STEPS) for low, high in zip(chain.lower, chain.upper, strict=True)), indexing="ij"
        )
        order = [chain.names.index(name) for name in neck]
        q = np.stack([grid.ravel() for grid in grids], 1)
        self._look(q[:, order], chain.fk(q), axis)

    @classmethod
    def fixed(cls, pose: Array, axis: tuple[float, float, float]) -> Gaze:
        """That of a camera which no neck turns, at a pose (4, 4) in the base link's frame."""
        gaze = cls.__new__(cls)
        gaze.joints = ()
        gaze._look(np.zeros((1, 0)), pose[None], axis)
        return gaze

    def _look(self, q: Array, poses: Array, axis: tuple[float, float, float]) -> None:
        self._q = q
        self._origin = poses[:, :3, 3]
        self._axis = poses[:, :3, :3] @ np.asarray(axis, float)
        self._behind = np.einsum("ij,ij->i", self._origin, self._axis)
        self._square = np.einsum("ij,ij->i", self._origin, self._origin)

    def at(self, point: Array) -> tuple[Array, float, Array]:
        """Neck joint values (k,), by how much the view misses a point (3,) [rad], and the camera's place (3,)."""
        away = np.sqrt(np.maximum(point @ point - 2 * (self._origin @ point) + self._square, 1e-18))
        cosine = (self._axis @ point - self._behind) / away
        best = int(np.argmax(cosine))
        return self._q[best], math.acos(float(np.clip(cosine[best], -1.0, 1.0))), self._origin[best]
