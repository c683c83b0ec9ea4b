"""Many convex polyhedra as arrays: what :class:`executive.motion.spheres.Faceted` is one of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.motion.spheres import Faceted
from planlang.geometry import Array

Spans = NDArray[np.int32]
"""Whose rows are which: number i has those from [i] to [i + 1] - 1, (n + 1,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """n polyhedra; one that is not known has neither corners nor planes."""

    corner_first: Spans
    corners: Array
    """(c, 3)."""
    plane_first: Spans
    planes: Array
    """Outward normals and offsets (f, 4), as of :class:`Faceted`."""
    beyond: Array
    """How far what is meant goes beyond each (n,) [m]."""

    @staticmethod
    def of(several: Sequence[Faceted | None]) -> Facets:
        """From those that are known."""
        known = [one for one in several if one is not None]
        return Facets(
            _spans([0 if one is None else len(one.corners) for one in several]),
            np.concatenate([np.zeros((0, 3)), *(one.corners for one in known)]),
            _spans([0 if one is None else len(one.planes) for one in several]),
            np.concatenate([np.zeros((0, 4)), *(one.planes for one in known)]),
            np.array([0.0 if one is None else one.beyond for one in several], float),
        )

    @staticmethod
    def unknown(count: int) -> Facets:
        """So many of which none is known."""
        spans = np.zeros(count + 1, np.int32)
        return Facets(spans, np.zeros((0, 3)), spans, np.zeros((0, 4)), np.zeros(count))

    def __len__(self) -> int:
        return len(self.beyond)

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which are known (n,)."""
        return sizes_of(self.plane_first) > 0

    def only(self, kept: NDArray[np.bool_]) -> Facets:
        """Those of a mask (n,)."""
        if not len(self.planes):
            return Facets.unknown(int(np.count_nonzero(kept)))
        corners, planes = sizes_of(self.corner_first), sizes_of(self.plane_first)
        return Facets(
            _spans(corners[kept]),
            self.corners[np.repeat(kept, corners)],
            _spans(planes[kept]),
            self.planes[np.repeat(kept, planes)],
            self.beyond[kept],
        )

    def moved(self, places: Array) -> Facets:
        """Each from the frame in which it is told to one that sees that frame at a place (n, 4, 4)."""
        if not len(self.planes):
            return self
        turns, shifts = places[:, :3, :3], places[:, :3, 3]
        of_corner = np.repeat(np.arange(len(self)), sizes_of(self.corner_first))
        of_plane = np.repeat(np.arange(len(self)), sizes_of(self.plane_first))
        corners = np.einsum("cij,cj->ci", turns[of_corner], self.corners) + shifts[of_corner]
        normals = np.einsum("fij,fj->fi", turns[of_plane], self.planes[:, :3])
        offsets = self.planes[:, 3] + np.einsum("fi,fi->f", normals, shifts[of_plane])
        return Facets(self.corner_first, corners, self.plane_first, np.column_stack([normals, offsets]), self.beyond)

    @staticmethod
    def joined(several: Sequence[Facets]) -> Facets:
        """All of several, one after another."""
        if not any(len(one.planes) for one in several):
            return Facets.unknown(sum(map(len, several)))
        return Facets(
            _spans(np.concatenate([sizes_of(one.corner_first) for one in several])),
            np.concatenate([one.corners for one in several]),
            _spans(np.concatenate([sizes_of(one.plane_first) for one in several])),
            np.concatenate([one.planes for one in several]),
            np.concatenate([one.beyond for one in several]),
        )


def sizes_of(spans: NDArray[np.integer]) -> NDArray[np.integer]:
    """How many each has, where the i-th has those from [i] to [i + 1] - 1."""
    return spans[1:] - spans[:-1]


def _spans(sizes: Sequence[int] | NDArray[np.integer]) -> Spans:
    return np.append(0, np.cumsum(sizes)).astype(np.int32)
