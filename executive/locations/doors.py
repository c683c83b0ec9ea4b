"""Keeping clear of things: not touching them, not standing where their doors swing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block, Door
from planlang.geometry import Array


@dataclass(frozen=True, slots=True)
class Clear:
    """Places from which a round outline neither touches a block nor the sweep of its doors."""

    words: str
    block: Block | None
    """None: what it is about is a door itself, which its sweep surrounds."""
    doors: tuple[Door, ...]
    radius: float
    """Of the outline [m]."""
    negated: bool = False

    def score(self, points: Array) -> Array:
        """1 where points (n, 2) are clear, else 0; a little less where they nearly are not, (n,)."""
        gap = self._gap(points)
        if self.negated:
            return np.asarray(gap <= 0, float)
        return np.where(gap > 0, 0.7 + 0.3 * np.clip(gap / 0.3, 0.0, 1.0), 0.0)

    def nearly(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Whether a place within so many metres of points (n, 2) may do; if not, there surely is none (n,)."""
        gap = self._gap(points)
        return np.asarray(gap <= within if self.negated else gap > -within)

    def _gap(self, points: Array) -> Array:
        """Distances (n,) of the outline from the block and the sweeps [m]."""
        gaps = [_from_sweep(door, points) for door in self.doors]
        if self.block is not None:
            gaps.append(self.block.distance(points))
        return np.min(gaps, axis=0) - self.radius if gaps else np.full(len(points), np.inf)


def _from_sweep(door: Door, points: Array) -> Array:
    """Distances (n,) of points from the half disc that the leaf sweeps on both sides, 0 inside."""
    c, s = math.cos(door.heading), math.sin(door.heading)
    dx, dy = points[:, 0] - door.x, points[:, 1] - door.y
    along, across = c * dx + s * dy, np.abs(c * dy - s * dx)
    before = np.hypot(along, np.maximum(across - door.width, 0.0))
    return np.asarray(np.where(along >= 0, np.maximum(np.hypot(along, across) - door.width, 0.0), before))
