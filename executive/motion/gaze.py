"""Neck joint values with which the camera looks at a point, by a table of forward kinematics."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from executive.motion.kinematics import Chain
from planlang.geometry import Array

STEPS = 61
"""Postures per neck joint in the table; about 3 degrees apart for a neck that turns half around."""
COARSE = 4
"""Stride of the postures that are tried first when there are many points."""


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
        """Return the gaze of a camera which no neck turns, at a pose (4, 4) in the base link's frame."""
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

    def at_all(self, points: Array) -> tuple[Array, Array]:
        """Return by how much the view misses points (n, 3) [rad], (n,), and the camera's places (n, 3); as :meth:`at`.

        The best of every fourth posture of each joint first, then the best around it.
        """
        every = np.arange(len(self._q)).reshape((STEPS,) * len(self.joints))
        coarse = every[(slice(None, None, COARSE),) * len(self.joints)].ravel()
        best = coarse[self._cosines(points, np.broadcast_to(coarse, (len(points), len(coarse)))).argmax(axis=1)]
        if self.joints:
            steps = np.arange(1 - COARSE, COARSE)
            window = np.stack(np.meshgrid(*[steps] * len(self.joints), indexing="ij"), -1).reshape(-1, len(self.joints))
            middle = np.stack(np.unravel_index(best, every.shape), axis=-1)
            around = np.clip(middle[:, None] + window, 0, STEPS - 1)
            choice = np.ravel_multi_index(tuple(np.moveaxis(around, -1, 0)), every.shape)
            best = choice[np.arange(len(points)), self._cosines(points, choice).argmax(axis=1)]
        cosine = self._cosines(points, best[:, None])[:, 0]
        return np.arccos(np.clip(cosine, -1.0, 1.0)), self._origin[best]

    def _cosines(self, points: Array, postures: Array) -> Array:
        """Return cosines between view and points (n, 3) in postures (n, k) of the table, (n, k)."""
        arrows = points[:, None] - self._origin[postures]
        return np.asarray(
            np.einsum("nki,nki->nk", arrows, self._axis[postures]) / np.maximum(np.linalg.norm(arrows, axis=2), 1e-9)
        )

    def at(self, point: Array) -> tuple[Array, float, Array]:
        """Neck joint values (k,), by how much the view misses a point (3,) [rad], and the camera's place (3,)."""
        away = np.sqrt(np.maximum(point @ point - 2 * (self._origin @ point) + self._square, 1e-18))
        cosine = (self._axis @ point - self._behind) / away
        best = int(np.argmax(cosine))
        return self._q[best], math.acos(float(np.clip(cosine[best], -1.0, 1.0))), self._origin[best]
