"""Distances of spheres from the convex pieces of a room: what rules out most postures before PyBullet is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planlang.protocols import Array, Pose
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
    """Which are parts of persons' arms that have left their rest, (k,)."""

    @staticmethod
    def of(pieces: Sequence[Solid]) -> Solids:
        """Pieces as a world tells them."""
        matrices = Pose.matrices(piece.pose for piece in pieces)
        shapes = [(piece.kind, piece.size) for piece in pieces]
        limbs = np.array([piece.limb for piece in pieces], bool)
        return Solids.placed(tuple(piece.body for piece in pieces), matrices, shapes, limbs)

    @staticmethod
    def placed(
        bodies: tuple[str, ...],
        matrices: Array,
        shapes: Sequence[tuple[str, tuple[float, float, float]]],
        limbs: NDArray[np.bool_],
    ) -> Solids:
        """Pieces by their poses (k, 4, 4), kinds and extents [m]."""
        half = np.array([size for _, size in shapes]).reshape(-1, 3) / 2
        reach = np.linalg.norm(half, axis=1)
        kinds = np.array([{"box": 1, "cylinder": 2}.get(kind, 3) for kind, _ in shapes], np.intp)
        half[kinds >= 2, 1] = ANY
        half[kinds == 3, 2] = ANY
        return Solids(bodies, matrices[:, :3, 3], matrices[:, :3, :3], half, kinds, reach, limbs)

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

        Spheres of the ``hand`` (m,) may be inside the body ``touches`` and inside limbs of people that left their rest.
        """
        allowed = self.limbs | np.array([body == touches for body in self.bodies], bool)
        return self.closest(points, radii, np.outer(allowed, hand) if allowed.any() and hand.any() else None)

    def closest(
        self, points: Array, radii: Array, apart: NDArray[np.bool_] | None = None, raised: Array | None = None
    ) -> tuple[Array, NDArray[np.intp]]:
        """Smallest gap (n,) of n sets of spheres (n, m, 3) and which piece that is to; inf where none is near.

        ``apart`` (k, m): what is not compared. ``raised`` (n, k): how much higher each piece is for each set [m].
        """
        gap, piece = np.full(len(points), np.inf), np.zeros(len(points), np.intp)
        if not len(self) or not points.size:
            return gap, piece
        # a sphere around each set tells which pieces it has to be compared with
        lower, upper = (points - radii[:, None]).min(axis=1), (points + radii[:, None]).max(axis=1)
        around = np.linalg.norm(upper - lower, axis=1) / 2
        compared = self.gaps((lower + upper) / 2, raised) < around[:, None]
        if apart is not None:
            compared &= ~apart.all(axis=1)
        rows, columns = np.nonzero(compared)
        if not len(rows):
            return gap, piece
        offsets = points[rows] - self.centres[columns][:, None]
        if raised is not None:
            offsets[..., 2] -= raised[rows, columns][:, None]
        local = offsets @ self.axes[columns]
        gaps = _outside(local, self.half[columns][:, None], self.kinds[columns][:, None]) - radii
        if apart is not None:
            gaps[apart[columns]] = np.inf
        least = gaps.min(axis=1)
        # of each set the pair with the smallest gap, the first piece among equals
        order = np.lexsort((columns, least, rows))
        first = order[np.unique(rows[order], return_index=True)[1]]
        gap[rows[first]], piece[rows[first]] = least[first], columns[first]
        return gap, piece

    def crossed(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Which segments (n, 3) enter a piece, of a round one the box inside it, (n,); one begun inside does not."""
        boxes = self.half.copy()
        round_, balls = self.kinds >= 2, self.kinds == 3
        boxes[round_, 1] = boxes[round_, 0] = self.half[round_, 0] / np.sqrt(self.kinds[round_])
        boxes[balls, 2] = boxes[balls, 0]
        begin = np.einsum("nki,kij->nkj", starts[:, None] - self.centres, self.axes)
        way = np.einsum("ni,kij->nkj", ends - starts, self.axes)
        way = np.where(np.abs(way) < 1e-9, 1e-9, way)
        one, other = (-boxes - begin) / way, (boxes - begin) / way
        first, last = np.minimum(one, other).max(axis=2), np.maximum(one, other).min(axis=2)
        return np.asarray(((first <= last) & (first > 0.0) & (first <= 1.0)).any(axis=1))

    def gaps(self, points: Array, raised: Array | None = None) -> Array:
        """Distances (..., k) of points (..., 3) from the surfaces of all pieces, negative inside [m].

        ``raised`` (..., k): how much higher each piece is for each point [m].
        """
        count = len(self)
        # (p - c) R, all pieces at once
        turned = self.axes.transpose(1, 0, 2).reshape(3, 3 * count)
        local = points @ turned - np.einsum("ki,kij->kj", self.centres, self.axes).reshape(3 * count)
        local = local.reshape(*points.shape[:-1], count, 3)
        if raised is not None:
            local -= raised[..., None] * self.axes[:, 2]
        return _outside(local, self.half, self.kinds)


def _outside(local: Array, half: Array, kinds: NDArray[np.intp]) -> Array:
    """Distances (...) of points (..., 3), in the frames of pieces, from their surfaces, negative inside [m]."""
    x, y, z = (np.abs(local[..., axis]) for axis in range(3))
    if (kinds >= 2).any():
        x = np.where(kinds >= 2, np.hypot(x, np.where(kinds == 3, np.hypot(y, z), y)), x)
        y, z = np.where(kinds >= 2, 0.0, y), np.where(kinds == 3, 0.0, z)
    x, y, z = x - half[..., 0], y - half[..., 1], z - half[..., 2]
    inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
    for axis in (x, y, z):
        np.maximum(axis, 0.0, out=axis)
    return np.asarray(np.sqrt(x * x + y * y + z * z) + inside)
