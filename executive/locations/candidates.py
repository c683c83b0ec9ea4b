"""Places for the base from which ways of a hand are reachable, by inverting reachability maps.

For a way whose tip heads for g at the point p, a row of the map with the tip at c and heading y (in the torso frame)
is used from the base at p - Rz(g) v with yaw g - y, where v = Rz(-y) c does not depend on the world: looking at all
rows of a way costs a rotation of constants and a look at the field of room.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from executive.locations.field import Field
from executive.locations.inverse_map import InverseMaps, Rows
from executive.locations.surroundings import ArmModel
from executive.locations.ways import CLASSES, Ways
from planlang.protocols import Array

SLACK = 0.03
"""Room that may be missing in the field, whose cells are 5 cm wide: places are judged exactly later [m]."""
ROOMY = 0.3
"""More room than this is not better [m]."""
SPREAD = 0.1
"""Of places of one way in a square of this side only the best is kept [m]."""

Indices = NDArray[np.intp]
Weigh = Callable[[Array], Array]
"""Bases (m, 3) -> weights (m,), 0 where a place will not do."""


@dataclass(slots=True)
class Candidates:
    """m places, each for one arm and one of its ways."""

    bases: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """(m, 3)."""
    scores: Array = field(default_factory=lambda: np.zeros(0))
    arms: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    ways: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    rows: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    """Rows of the map of the way's class."""
    torsos: Array = field(default_factory=lambda: np.zeros(0))
    ranks: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    """How many of the same way are better."""
    crowded: list[tuple[float, Array]] = field(default_factory=list)
    """Promising places without room, with their scores."""
    without_room: int = 0
    """Places without room, counted up to as many of a way as would be looked at."""
    unwanted: int = 0
    """Places with room of which the other conjuncts say that they will not do, counted likewise."""

    def __len__(self) -> int:
        return len(self.scores)

    def order(self, weights: Array) -> Indices:
        """Round-robin over the ways, the best of each first; ``weights`` (m,) are an opinion about the bases."""
        return np.lexsort((-(self.scores * weights).round(6), self.ranks))


def invert(
    hands: Sequence[tuple[ArmModel, Ways]],
    inverse: InverseMaps,
    room: Field,
    weigh: Weigh | None,
    lifts: Callable[[ArmModel, float], bool],
    *,
    least: float,
    rows: int,
    each: int,
) -> Candidates:
    """Places for some arms and their ways.

    Of each way those ``each`` with the best score are kept, well spread. ``weigh`` is the other conjuncts' opinion.
    ``lifts`` tells whether the torso may be somewhere with the rest of the robot as it is. ``least`` and ``rows`` bound
    the rows of the maps by score, and by number for each torso position.
    """
    parts: list[tuple[Array, Array, int, int, Indices, Array]] = []
    found = Candidates()
    for number, (arm, ways) in enumerate(hands):
        for way in range(len(ways)):
            chosen = inverse(arm, CLASSES[int(ways.grasps[way])]).rows(
                float(ways.points[way, 2]), int(ways.rolls[way]), least, rows
            )
            chosen = chosen.of([torso for torso in np.unique(chosen.torso).tolist() if lifts(arm, torso)])
            if not len(chosen.row):
                continue
            part = _one(ways, way, chosen, room, weigh, each, found)
            if part is not None:
                bases, scores, index = part
                parts.append((bases, scores, number, way, chosen.row[index], chosen.torso[index]))
    if not parts:
        return found
    found.bases = np.concatenate([part[0] for part in parts])
    found.scores = np.concatenate([part[1] for part in parts])
    sizes = [len(scores) for _, scores, *_ in parts]
    found.arms = np.repeat([part[2] for part in parts], sizes)
    found.ways = np.repeat([part[3] for part in parts], sizes)
    found.rows = np.concatenate([part[4] for part in parts])
    found.torsos = np.concatenate([part[5] for part in parts])
    found.ranks = np.concatenate([np.arange(len(scores)) for _, scores, *_ in parts])
    return found


def _one(
    ways: Ways, way: int, chosen: Rows, room: Field, weigh: Weigh | None, each: int, found: Candidates
) -> tuple[Array, Array, Indices] | None:
    """The best places of one way: bases, scores, and which rows they come from."""
    heading = float(ways.headings[way])
    c, s = math.cos(heading), math.sin(heading)
    x = ways.points[way, 0] - (c * chosen.v[:, 0] - s * chosen.v[:, 1])
    y = ways.points[way, 1] - (s * chosen.v[:, 0] + c * chosen.v[:, 1])
    free = room.at(np.stack([x, y], axis=1))
    index = np.flatnonzero(free > -SLACK)
    found.without_room += min(len(free) - len(index), each)
    weight = float(ways.weights[way])
    if not len(index):
        best = int(np.argmax(chosen.score))
        found.crowded.append(
            (weight * float(chosen.score[best]), np.array([x[best], y[best], heading - chosen.yaw[best]]))
        )
        return None
    scores = weight * chosen.score[index] * (0.3 + np.clip(free[index], 0.0, ROOMY))
    if weigh is not None:
        liked = weigh(np.stack([x[index], y[index], heading - chosen.yaw[index]], axis=1))
        found.unwanted += min(int((liked <= 0).sum()), each)
        index, scores = index[liked > 0], (scores * liked)[liked > 0]
        if not len(index):
            return None
    few = min(len(index), 8 * each)
    top = np.argpartition(-scores, few - 1)[:few] if few < len(index) else np.arange(len(index))
    top = top[np.lexsort((top, -scores[top].round(6)))]
    cells = np.rint(chosen.v[index[top]] / SPREAD).astype(np.int64)
    _, first = np.unique(cells[:, 0] * 1024 + cells[:, 1], return_index=True)
    kept = np.sort(first)[:each]
    # places of the same cell come after all others
    rest = np.setdiff1d(np.arange(len(top)), kept, assume_unique=True)[: max(each - len(kept), 0)]
    top = top[np.concatenate([kept, rest])]
    index = index[top]
    bases = np.stack([x[index], y[index], heading - chosen.yaw[index]], axis=1)
    return bases, scores[top], index


def blocks(count: int, size: int) -> Iterator[slice]:
    """Slices of so many rows, one after another."""
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))
