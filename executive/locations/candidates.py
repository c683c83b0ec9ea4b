"""Places for the base from which ways of a hand are reachable, by inverting reachability maps.

For a way whose tip heads for g at the point p, a row of the map with the tip at c and heading y (in the torso frame)
is used from the base at p - Rz(g) v with yaw g - y, where v = Rz(-y) c does not depend on the world: looking at all
rows of a way costs a rotation of constants and a look at the field of room.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.free_floor import Field
from executive.locations.inverse_map import SQUARE_BITS, InverseMaps, Rows
from executive.locations.ways import CLASSES, Ways
from executive.robots.arms import ArmModel
from planlang.geometry import Array

TIE = 1e-9
"""Of places whose scores differ by less than this the one of the better row comes first."""
AT_ONCE = 200_000
"""Places that are looked at in one go: more would not stay in the processor's memory."""
COUNTED = 48
"""Of each way so many places without room, unwanted and unseen are counted: reasons are told beside one another."""

Indices = NDArray[np.intp]
Weigh = Callable[[Array], Array]
"""Bases (m, 3) -> weights (m,), 0 where a place will not do."""
Conjunct = tuple[str, Weigh]
"""What is said of bases that will not do, and the weights."""
Misses = Callable[[Array], NDArray[np.bool_]]
"""Bases (m, 3) -> whether something is surely not seen from there (m,)."""


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
    """Places without room, up to so many of each way."""
    unwanted: Counter[str] = field(default_factory=Counter)
    """Places with room of which another conjunct says that they will not do, counted likewise by its reason."""
    unseen: int = 0
    """Places that are left and from which the robot would not see what it has to, counted likewise."""

    def __len__(self) -> int:
        return len(self.scores)

    def chosen(self, index: Indices) -> Candidates:
        """Some of them."""
        return replace(
            self,
            bases=self.bases[index],
            scores=self.scores[index],
            arms=self.arms[index],
            ways=self.ways[index],
            rows=self.rows[index],
            torsos=self.torsos[index],
            ranks=self.ranks[index],
        )

    def order(self, weigh: Weigh, most: int) -> Indices:
        """Round-robin over the ways, the best of each first, no more than ``most``; ``weigh`` has an opinion."""
        whole = np.flatnonzero(np.cumsum(np.bincount(self.ranks, minlength=1)) >= most)
        some = np.flatnonzero(self.ranks <= whole[0]) if len(whole) else np.arange(len(self))
        worth = self.scores[some] * weigh(self.bases[some])
        return some[np.lexsort((-worth.round(6), self.ranks[some]))[:most]]


def invert(
    hands: Sequence[tuple[ArmModel, Ways]],
    inverse: InverseMaps,
    room: Field,
    conjuncts: Sequence[Conjunct],
    lifted: Callable[[ArmModel, Sequence[float]], tuple[float, ...]],
    *,
    misses: Misses | None = None,
    least: float,
    rows: int,
    each: int,
) -> Candidates:
    """Places for some arms and their ways.

    Of each way those ``each`` with the best score are kept, well spread. ``conjuncts`` are the others.
    ``lifted`` tells where the torso may be with the rest of the robot as it is, ``misses`` from where the robot would
    not see what it has to. ``least`` and ``rows`` bound the rows of the maps by score, and by number for each torso
    position.
    """
    found = Candidates()
    parts: list[_Part] = []
    for number, (arm, ways) in enumerate(hands):
        alike: dict[tuple[float, int, int], list[int]] = {}
        heights = ways.points[:, 2].round(6).tolist()
        for way, kind in enumerate(zip(heights, ways.grasps.tolist(), ways.rolls.tolist(), strict=True)):
            alike.setdefault(kind, []).append(way)
        for (z, grasp, roll), mine in alike.items():
            chosen = inverse(arm, CLASSES[grasp]).rows(z, roll, least, rows)
            chosen = chosen.of(lifted(arm, chosen.torsos))
            if not len(chosen.row):
                continue
            for some in blocks(len(mine), max(1, AT_ONCE // len(chosen.row))):
                part = _Part.of(ways, np.array(mine[some], np.intp), chosen, room, conjuncts, misses, each, number)
                parts.append(part)
    found.without_room = sum(part.without_room for part in parts)
    for part in parts:
        found.unwanted.update(part.unwanted)
    found.unseen = sum(part.unseen for part in parts)
    crowded = [(part.number, *place) for part in parts for place in part.crowded]
    found.crowded = [(score, base) for _, _, score, base in sorted(crowded, key=lambda place: place[:2])]
    if not parts:
        return found
    arms = np.concatenate([np.full(len(part.ways), part.number, np.intp) for part in parts])
    whole = np.concatenate([part.ways for part in parts])
    order = np.lexsort((whole, arms))
    found.arms, found.ways = arms[order], whole[order]
    found.bases = np.concatenate([part.bases for part in parts])[order]
    found.scores = np.concatenate([part.scores for part in parts])[order]
    found.rows = np.concatenate([part.rows for part in parts])[order]
    found.torsos = np.concatenate([part.torsos for part in parts])[order]
    found.ranks = np.concatenate([part.ranks for part in parts])[order]
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The best places of some ways of one arm, of one class, roll and height: they use the same rows of a map."""

    number: int
    """Of the arm."""
    bases: Array
    scores: Array
    ways: Indices
    rows: Indices
    torsos: Array
    ranks: Indices
    without_room: int
    unwanted: Counter[str]
    unseen: int
    crowded: list[tuple[int, float, Array]]
    """Ways without any place that has room: their number, the score and place of the best row."""

    @staticmethod
    def of(
        ways: Ways,
        index: Indices,
        chosen: Rows,
        room: Field,
        conjuncts: Sequence[Conjunct],
        misses: Misses | None,
        each: int,
        number: int,
    ) -> _Part:
        """All rows (n) for all ways (w) at once, looked up in the field in its own cells."""
        factors = room.looked_up(ways.points[index, :2], ways.headings[index], chosen.v)
        free = np.count_nonzero(factors, axis=1)
        without_room = int(np.minimum(factors.shape[1] - free, COUNTED).sum())
        crowded = [
            (
                way,
                float(ways.weights[way]) * float(chosen.score[0]),
                _bases(ways, np.array([way]), chosen, np.zeros(1, int))[0],
            )
            for way in index[free == 0].tolist()
        ]
        if not free.all():
            index, factors = index[free > 0], factors[free > 0]
        scores = factors * chosen.score
        scores *= ways.weights[index, None]
        unwanted = Counter[str]()
        if conjuncts and len(index):
            way, row = np.nonzero(factors)
            bases, weight, left = _bases(ways, index[way], chosen, row), np.ones(len(way)), np.ones(len(way), bool)
            for reason, weigh in conjuncts:
                weight *= weigh(bases)
                refused = left & (weight <= 0)
                left ^= refused
                unwanted[reason] += _counted(way[refused])
            scores[way, row] *= weight
        unseen = 0
        if misses is not None and len(index):
            way, row = np.nonzero(scores)
            missed = misses(_bases(ways, index[way], chosen, row))
            scores[way[missed], row[missed]] = 0.0
            unseen = _counted(way[missed])
        way, row, ranks = _best(scores, chosen.squares, each)
        return _Part(
            number,
            _bases(ways, index[way], chosen, row),
            scores[way, row],
            index[way],
            chosen.row[row],
            chosen.torso[row],
            ranks,
            without_room,
            unwanted,
            unseen,
            crowded,
        )


def _counted(ways: Indices) -> int:
    """How many places, of each of which (m,) tells the way, are counted."""
    return int(np.minimum(np.bincount(ways), COUNTED).sum())


def _bases(ways: Ways, index: Indices, chosen: Rows, row: Indices) -> Array:
    """Bases (m, 3) from which ways (m,) are reached by rows (m,)."""
    heading = ways.headings[index]
    c, s = np.cos(heading), np.sin(heading)
    x, y = chosen.v[row, 0], chosen.v[row, 1]
    points = ways.points[index]
    return np.stack([points[:, 0] - (c * x - s * y), points[:, 1] - (s * x + c * y), heading - chosen.yaw[row]], axis=1)


def _best(scores: Array, squares: Indices, each: int) -> tuple[Indices, Indices, Indices]:
    """Of each row of scores (w, n) those above 0 that are best, well spread: row, column, and rank in the row.

    ``squares`` (n,) number the squares of :data:`SPREAD` that the columns are in: the best of each come first.
    """
    if 8 * each < scores.shape[1]:
        worse = TIE * np.arange(scores.shape[1]) - scores
        top = np.argpartition(worse, 8 * each - 1, axis=1)[:, : 8 * each]
        way, place = np.nonzero(np.take_along_axis(scores, top, 1))
        row = top[way, place]
    else:
        way, row = np.nonzero(scores)
    # ways are told apart by twice their number: scores are less than 1
    order = np.argsort(2.0 * way + (TIE * row - scores[way, row]))
    way, row = way[order], row[order]
    again = np.ones(len(way), np.intp)
    again[np.unique((way << SQUARE_BITS) + squares[row], return_index=True)[1]] = 0
    order = np.argsort(2 * way + again, kind="stable")
    way, row = way[order], row[order]
    rank = np.arange(len(way)) - np.searchsorted(way, way)
    kept = rank < each
    return way[kept], row[kept], rank[kept]


def blocks(count: int, size: int) -> Iterator[slice]:
    """Slices of so many rows, one after another."""
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))
