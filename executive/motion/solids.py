"""Distances of spheres from the convex pieces of a room: what rules out most postures before PyBullet is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planlang.protocols import Array
from sim import Solid

ANY = 1e3
"""Half extent of a piece along an axis that does not count [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Solids:
    """k pieces; round ones are measured by their radius about the axis, spheres about the centre."""

    bodies: tuple[str, ...]
    centres: Array
    """(k, 3)."""
    axes: Array
    """(k, 3, 3), columns are the axes of each piece in the map."""
    half: Array
    """(k, 3); of a cylinder (radius, any, half height), of a sphere (radius, any, any)."""
    kinds: NDArray[np.intp]
    """Numbers of axes that are taken together: 1 of a box, 2 of a cylinder, 3 of a sphere."""
    reach: Array
    """Radius of a sphere around each piece (k,)."""
    limbs: NDArray[np.bool_]
    """Which are parts of a person's arms (k,)."""

    @staticmethod
    def of(pieces: Sequence[Solid]) -> Solids:
        """Pieces as a world tells them."""
        count = len(pieces)
        matrices = np.array([piece.pose.matrix() for piece in pieces]).reshape(count, 4, 4)
        half = np.array([piece.size for piece in pieces]).reshape(count, 3) / 2
        reach = np.linalg.norm(half, axis=1)
        kinds = np.array([{"box": 1, "cylinder": 2}.get(piece.kind, 3) for piece in pieces], np.intp)
        half[kinds >= 2, 1] = ANY
        half[kinds == 3, 2] = ANY
        names = tuple(piece.body for piece in pieces)
        limbs = np.array([piece.limb for piece in pieces], bool)
        return Solids(names, matrices[:, :3, 3], matrices[:, :3, :3], half, kinds, reach, limbs)

    def __len__(self) -> int:
        return len(self.bodies)

    @staticmethod
    def joined(several: Sequence[Solids]) -> Solids:
        """All pieces of several, one after another."""
        every = [Solids.of(()), *several]
        names = tuple(body for solids in every for body in solids.bodies)
        fields = ("centres", "axes", "half", "kinds", "reach", "limbs")
        return Solids(names, *(np.concatenate([getattr(solids, field) for solids in every]) for field in fields))

    def near(self, centre: Array, radius: float) -> Solids:
        """Those that a sphere meets."""
        return self.only(np.linalg.norm(self.centres - centre, axis=1) <= radius + self.reach)

    def only(self, kept: NDArray[np.bool_]) -> Solids:
        """Those of a mask (k,)."""
        names = tuple(body for body, keep in zip(self.bodies, kept, strict=True) if keep)
        arrays = (self.centres, self.axes, self.half, self.kinds, self.reach, self.limbs)
        return Solids(names, *(array[kept] for array in arrays))  # type: ignore[arg-type]

    def hits(
        self, points: Array, radii: Array, hand: NDArray[np.bool_], touches: str | None
    ) -> tuple[Array, NDArray[np.intp]]:
        """Smallest gap (n,) of n sets of spheres (n, m, 3), negative where one is inside something; and which piece.

        Spheres of the ``hand`` (m,) may be inside the body ``touches`` and inside limbs of people.
        """
        if not len(self) or not points.size:
            return np.full(len(points), np.inf), np.zeros(len(points), np.intp)
        gaps = self.gaps(points) - radii[:, None]
        allowed = self.limbs | np.array([body == touches for body in self.bodies], bool)
        if allowed.any() and hand.any():
            gaps[:, np.outer(hand, allowed)] = np.inf
        flat = gaps.reshape(len(points), -1)
        least = np.argmin(flat, axis=1)
        return flat[np.arange(len(points)), least], least % len(self)

    def gaps(self, points: Array) -> Array:
        """Distances (..., k) of points (..., 3) from the surfaces, negative inside [m]."""
        count = len(self)
        flat = points.reshape(-1, 3)
        # (p - c) R, all pieces at once
        local = flat @ self.axes.transpose(1, 0, 2).reshape(3, 3 * count) - np.einsum(
            "ki,kij->kj", self.centres, self.axes
        ).reshape(1, 3 * count)
        x, y, z = (np.abs(local[:, axis::3]) for axis in range(3))
        round_, balls = self.kinds >= 2, self.kinds == 3
        if round_.any():
            x[:, round_] = np.hypot(x[:, round_], y[:, round_])
            x[:, balls] = np.hypot(x[:, balls], z[:, balls])
            y[:, round_] = 0.0
            z[:, balls] = 0.0
        x -= self.half[:, 0]
        y -= self.half[:, 1]
        z -= self.half[:, 2]
        inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
        for axis in (x, y, z):
            np.maximum(axis, 0.0, out=axis)
        return np.asarray((np.sqrt(x * x + y * y + z * z) + inside).reshape(*points.shape[:-1], count))
