"""Movers, as spheres that go with a chain, and obstacles for them, as convex pieces; frames are numbered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from executive.motion.solids import Solids
from planlang.geometry import Array

MAP, BASE, FIRST_JOINT = 0, 1, 2
"""Numbers of frames: the children of moving joints follow in their order."""


def counts(first: NDArray[np.integer]) -> NDArray[np.integer]:
    """Return how many members each group has (m,); group i has those from first[i] to first[i + 1] - 1 (m + 1,)."""
    return first[1:] - first[:-1]


@dataclass(frozen=True, slots=True, eq=False)
class Movers:
    """m links or held objects, or convex shapes of them, as spheres in the frames that they move with."""

    names: tuple[str, ...]
    frames: NDArray[np.intp]
    """(m,)."""
    first: NDArray[np.intp]
    """The owners of the spheres: mover i has those from [i] to [i + 1] - 1, (m + 1,)."""
    spheres: Array
    """Centres and radii (s, 4) [m]."""
    slack: Array
    """Distances by which the movers stick out of their spheres (m,) [m]."""

    @staticmethod
    def of(rows: Sequence[tuple[str, int, Array, float]]) -> Movers:
        """Return movers from name, frame, spheres (k, 4) and slack of each."""
        return Movers(
            tuple(name for name, *_ in rows),
            np.array([frame for _, frame, *_ in rows], np.intp),
            np.cumsum([0, *(len(spheres) for _, _, spheres, *_ in rows)]).astype(np.intp),
            np.concatenate([np.zeros((0, 4)), *(spheres for _, _, spheres, *_ in rows)]),
            np.array([slack for *_, slack in rows], float),
        )

    def __len__(self) -> int:
        return len(self.names)

    def only(self, kept: NDArray[np.bool_]) -> Movers:
        """Return the movers of a mask (m,)."""
        sizes = counts(self.first)
        return Movers(
            tuple(compress(self.names, kept.tolist())),
            self.frames[kept],
            np.append(0, np.cumsum(sizes[kept])).astype(np.intp),
            self.spheres[np.repeat(kept, sizes)],
            self.slack[kept],
        )

    def going_with(self, frame: int) -> Movers:
        """Return the same spheres in another frame."""
        return replace(self, frames=np.full(len(self), frame, np.intp))

    @staticmethod
    def joined(several: Sequence[Movers]) -> Movers:
        """Return the movers of all of several, one after another."""
        sizes = np.concatenate([counts(movers.first) for movers in several])
        return Movers(
            tuple(name for movers in several for name in movers.names),
            np.concatenate([movers.frames for movers in several]),
            np.append(0, np.cumsum(sizes)).astype(np.intp),
            np.concatenate([movers.spheres for movers in several]),
            np.concatenate([movers.slack for movers in several]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Obstacles:
    """o bodies as convex pieces in the frames that they move with."""

    names: tuple[str, ...]
    frames: NDArray[np.intp]
    """(o,)."""
    first: NDArray[np.intp]
    """The owners of the pieces: obstacle i has those from [i] to [i + 1] - 1, (o + 1,)."""
    solids: Solids
    slack: Array
    """Distances by which the real obstacles are larger than their pieces (o,) [m]."""

    @staticmethod
    def of(rows: Sequence[tuple[str, int, Solids, float]]) -> Obstacles:
        """Return obstacles from name, frame, pieces and slack of each."""
        return Obstacles(
            tuple(name for name, *_ in rows),
            np.array([frame for _, frame, *_ in rows], np.intp),
            np.cumsum([0, *(len(solids) for _, _, solids, *_ in rows)]).astype(np.intp),
            Solids.joined([solids for _, _, solids, *_ in rows]),
            np.array([slack for *_, slack in rows], float),
        )

    def __len__(self) -> int:
        return len(self.names)

    def only(self, kept: NDArray[np.bool_]) -> Obstacles:
        """Return the obstacles of a mask (o,)."""
        sizes = counts(self.first)
        return Obstacles(
            tuple(compress(self.names, kept.tolist())),
            self.frames[kept],
            np.append(0, np.cumsum(sizes[kept])).astype(np.intp),
            self.solids.only(np.repeat(kept, sizes)),
            self.slack[kept],
        )

    def followed_by(self, other: Obstacles) -> Obstacles:
        """Return these obstacles, then others."""
        if not len(other):
            return self
        return Obstacles(
            self.names + other.names,
            np.concatenate([self.frames, other.frames]),
            np.concatenate([self.first, self.first[-1] + other.first[1:]]),
            Solids.joined([self.solids, other.solids]),
            np.concatenate([self.slack, other.slack]),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Watched:
    """w pairs of a mover and an obstacle, by number, that must not be deeper in each other than ``allowed`` [m]."""

    movers: NDArray[np.intp]
    obstacles: NDArray[np.intp]
    allowed: Array

    @staticmethod
    def of(pairs: Sequence[tuple[int, int]]) -> Watched:
        """Pairs that must not touch at all."""
        rows = np.array(pairs, np.intp).reshape(-1, 2)
        return Watched(rows[:, 0], rows[:, 1], np.zeros(len(rows)))

    def followed_by(self, other: Watched) -> Watched:
        """Return these pairs, then others."""
        if not len(other.movers):
            return self
        return Watched(
            np.concatenate([self.movers, other.movers]),
            np.concatenate([self.obstacles, other.obstacles]),
            np.concatenate([self.allowed, other.allowed]),
        )
