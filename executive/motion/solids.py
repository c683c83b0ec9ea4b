"""Convex pieces, of a room or of a robot: distances from them, and which lines they cut."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.solid import SolidKind
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
    """Mask of the parts of persons' arms that have left their rest, (k,)."""

    @staticmethod
    def of(pieces: Sequence[Solid]) -> Solids:
        """Return the pieces that a world reports."""
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
        kinds = np.array(
            [{SolidKind.BOX: 1, SolidKind.CYLINDER: 2}.get(SolidKind(kind), 3) for kind, _ in shapes], np.intp
        )
        reach = np.sqrt((half**2 * (np.arange(3) >= kinds[:, None] - 1)).sum(axis=1))
        half[kinds >= 2, 1] = ANY
        half[kinds == 3, 2] = ANY
        return Solids(bodies, matrices[:, :3, 3], matrices[:, :3, :3], half, kinds, reach, limbs)

    def __len__(self) -> int:
        return len(self.bodies)

    @property
    def extents(self) -> Array:
        """Half extents (k, 3) of the boxes along the axes of pieces [m]."""
        return np.where(self.half < ANY, self.half, self.half[:, :1])

    @staticmethod
    def joined(several: Sequence[Solids]) -> Solids:
        """Return all pieces of several, one after another."""
        every = several or [Solids.of(())]
        names = tuple(body for solids in every for body in solids.bodies)
        fields = ("centres", "axes", "half", "kinds", "reach", "limbs")
        return Solids(names, *(np.concatenate([getattr(solids, field) for solids in every]) for field in fields))

    def near(self, centre: Array, radius: float) -> Solids:
        """Return the pieces that a sphere meets."""
        return self.only(np.linalg.norm(self.centres - centre, axis=1) <= radius + self.reach)

    def only(self, kept: NDArray[np.bool_] | NDArray[np.intp]) -> Solids:
        """Return the pieces of a mask (k,), or of some numbers, in their order."""
        rows = np.flatnonzero(kept) if kept.dtype == bool else kept
        names = tuple(self.bodies[row] for row in rows.tolist())
        arrays = (self.centres, self.axes, self.half, self.kinds, self.reach, self.limbs)
        return Solids(names, *(array[rows] for array in arrays))  # type: ignore[arg-type]

    def moved(self, places: Array) -> Solids:
        """Return each piece in a frame that sees its present frame at a pose (k, 4, 4)."""
        turns = places[:, :3, :3]
        centres = np.einsum("kij,kj->ki", turns, self.centres) + places[:, :3, 3]
        return Solids(self.bodies, centres, turns @ self.axes, self.half, self.kinds, self.reach, self.limbs)

    def crossed(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Return which segments (n, 3) enter a piece (the box inside a round one), (n,); one begun inside does not."""
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

    def gaps(self, points: Array) -> Array:
        """Distances (..., k) of points (..., 3) from the surfaces of all pieces, negative inside [m]."""
        count = len(self)
        # (p - c) R, all pieces at once
        turned = self.axes.transpose(1, 0, 2).reshape(3, 3 * count)
        local = points @ turned - np.einsum("ki,kij->kj", self.centres, self.axes).reshape(3 * count)
        local = local.reshape(*points.shape[:-1], count, 3)
        return distances(local, self.half, self.kinds)


def distances(local: Array, half: Array, kinds: NDArray[np.intp]) -> Array:
    """Return distances (...) of points (..., 3), in the frames of pieces, from their surfaces, negative inside [m]."""
    x, y, z = (np.abs(local[..., axis]) for axis in range(3))
    if (kinds >= 2).any():
        x = np.where(kinds >= 2, np.hypot(x, np.where(kinds == 3, np.hypot(y, z), y)), x)
        y, z = np.where(kinds >= 2, 0.0, y), np.where(kinds == 3, 0.0, z)
    x, y, z = x - half[..., 0], y - half[..., 1], z - half[..., 2]
    inside = np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
    for axis in (x, y, z):
        np.maximum(axis, 0.0, out=axis)
    return np.asarray(np.sqrt(x * x + y * y + z * z) + inside)
