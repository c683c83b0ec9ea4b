"""Base poses from which grasp candidates are reachable, by inverting reachability maps.

For a candidate whose tip heads for g at the point p, a row of the map with the tip at c and heading y (in the torso
frame) is used from the base at p - Rz(g) v with yaw g - y, where v = Rz(-y) c does not depend on the world: looking at
all rows of a candidate costs a rotation of constants and a look at the field of room (Vahrenkamp et al., Robot
placement based on reachability inversion, ICRA 2013).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import CELL, HAIR, Field, Floor
from executive.locations.grasp_candidates import CLASSES, GraspCandidates
from executive.locations.inverse_map import SQUARE_BITS, InverseMaps, Rows
from executive.locations.reachability import YAWS
from executive.robots.arms import ArmModel
from planlang.geometry import Array

TIE = 1e-9
"""Scores that differ by less count as equal: then the base pose of the better row comes first."""
AT_ONCE = 200_000
"""Base poses that are looked at in one go: more would not stay in the processor's memory."""
COUNTED = 48
"""Base poses without room, unwanted and unseen that are counted of each candidate, so that reasons can be compared."""

Indices = NDArray[np.intp]
Weigh = Callable[[Array], Array]
"""Bases (m, 3) -> weights (m,), 0 where a base pose will not do."""
Conjunct = tuple[str, Weigh]
"""The reason for which bases are refused, and the weights."""
Misses = Callable[[Array], NDArray[np.bool_]]
"""Bases (m, 3) -> whether something is surely not seen from there (m,)."""


@dataclass(slots=True)
class BaseCandidates:
    """m base poses, each for one arm and one of its grasp candidates."""

    bases: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """(m, 3)."""
    scores: Array = field(default_factory=lambda: np.zeros(0))
    arms: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    candidates: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    rows: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    """Rows of the map of the candidate's class."""
    torsos: Array = field(default_factory=lambda: np.zeros(0))
    ranks: Indices = field(default_factory=lambda: np.zeros(0, np.intp))
    """The number of better ones of the same candidate."""
    crowded: list[tuple[float, Array]] = field(default_factory=list)
    """Promising base poses without room, with their scores."""
    without_room: int = 0
    """Base poses without room, up to so many of each candidate."""
    unwanted: Counter[str] = field(default_factory=Counter)
    """Base poses with room of which another conjunct says that they will not do, counted likewise by its reason."""
    unseen: int = 0
    """Base poses that are left and from which the robot would not see what it has to, counted likewise."""

    def __len__(self) -> int:
        return len(self.scores)

    def chosen(self, index: Indices) -> BaseCandidates:
        """Return some of them."""
        return replace(
            self,
            bases=self.bases[index],
            scores=self.scores[index],
            arms=self.arms[index],
            candidates=self.candidates[index],
            rows=self.rows[index],
            torsos=self.torsos[index],
            ranks=self.ranks[index],
        )

    def order(self, weigh: Weigh, most: int) -> Indices:
        """Return indices round-robin over the candidates, the best of each first, at most ``most``."""
        whole = np.flatnonzero(np.cumsum(np.bincount(self.ranks, minlength=1)) >= most)
        some = np.flatnonzero(self.ranks <= whole[0]) if len(whole) else np.arange(len(self))
        worth = self.scores[some] * weigh(self.bases[some])
        return some[np.lexsort((-worth.round(6), self.ranks[some]))[:most]]


def invert(
    hands: Sequence[tuple[ArmModel, GraspCandidates]],
    inverse: InverseMaps,
    room: Field,
    conjuncts: Sequence[Conjunct],
    lifted: Callable[[ArmModel, Sequence[float]], tuple[float, ...]],
    *,
    misses: Misses | None = None,
    least: float,
    rows: int,
    each: int,
) -> BaseCandidates:
    """Return base poses for some arms and their candidates.

    Of each candidate those ``each`` with the best score are kept, well spread. ``conjuncts`` are the others.
    ``lifted`` tells where the torso may be with the rest of the robot as it is, ``misses`` from where the robot would
    not see what it has to. ``least`` and ``rows`` bound the rows of the maps by score, and by number for each torso
    position.
    """
    found = BaseCandidates()
    parts: list[_Part] = []
    for number, (arm, candidates) in enumerate(hands):
        alike: dict[tuple[float, int, int], list[int]] = {}
        heights = candidates.points[:, 2].round(6).tolist()
        for candidate, kind in enumerate(
            zip(heights, candidates.grasps.tolist(), candidates.rolls.tolist(), strict=True)
        ):
            alike.setdefault(kind, []).append(candidate)
        for (z, grasp, roll), mine in alike.items():
            chosen = inverse(arm, CLASSES[grasp]).rows(z, roll, least, rows)
            chosen = chosen.of(lifted(arm, chosen.torsos))
            if not len(chosen.row):
                continue
            for some in blocks(len(mine), max(1, AT_ONCE // len(chosen.row))):
                part = _Part.of(
                    candidates, np.array(mine[some], np.intp), chosen, room, conjuncts, misses, each, number
                )
                parts.append(part)
    found.without_room = sum(part.without_room for part in parts)
    for part in parts:
        found.unwanted.update(part.unwanted)
    found.unseen = sum(part.unseen for part in parts)
    crowded = [(part.number, *place) for part in parts for place in part.crowded]
    found.crowded = [(score, base) for _, _, score, base in sorted(crowded, key=lambda place: place[:2])]
    if not parts:
        return found
    arms = np.concatenate([np.full(len(part.candidates), part.number, np.intp) for part in parts])
    whole = np.concatenate([part.candidates for part in parts])
    order = np.lexsort((whole, arms))
    found.arms, found.candidates = arms[order], whole[order]
    found.bases = np.concatenate([part.bases for part in parts])[order]
    found.scores = np.concatenate([part.scores for part in parts])[order]
    found.rows = np.concatenate([part.rows for part in parts])[order]
    found.torsos = np.concatenate([part.torsos for part in parts])[order]
    found.ranks = np.concatenate([part.ranks for part in parts])[order]
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """The best base poses of candidates of one arm, class, roll and height: they use the same rows of a map."""

    number: int
    """The arm's number."""
    bases: Array
    scores: Array
    candidates: Indices
    rows: Indices
    torsos: Array
    ranks: Indices
    without_room: int
    unwanted: Counter[str]
    unseen: int
    crowded: list[tuple[int, float, Array]]
    """Candidates without any base pose that has room: their number, the score and base pose of the best row."""

    @staticmethod
    def of(
        candidates: GraspCandidates,
        index: Indices,
        chosen: Rows,
        room: Field,
        conjuncts: Sequence[Conjunct],
        misses: Misses | None,
        each: int,
        number: int,
    ) -> _Part:
        """Return all rows (n) for all candidates (w) at once, looked up in the field in its own cells."""
        factors = room.looked_up(candidates.points[index, :2], candidates.headings[index], chosen.v)
        free = np.count_nonzero(factors, axis=1)
        without_room = int(np.minimum(factors.shape[1] - free, COUNTED).sum())
        crowded = [
            (
                candidate,
                float(candidates.weights[candidate]) * float(chosen.score[0]),
                _bases(candidates, np.array([candidate]), chosen, np.zeros(1, int))[0],
            )
            for candidate in index[free == 0].tolist()
        ]
        if not free.all():
            index, factors = index[free > 0], factors[free > 0]
        scores = factors * chosen.score
        scores *= candidates.weights[index, None]
        unwanted = Counter[str]()
        if conjuncts and len(index):
            candidate, row = np.nonzero(factors)
            bases, weight, left = (
                _bases(candidates, index[candidate], chosen, row),
                np.ones(len(candidate)),
                np.ones(len(candidate), bool),
            )
            for reason, weigh in conjuncts:
                weight *= weigh(bases)
                refused = left & (weight <= 0)
                left ^= refused
                unwanted[reason] += _counted(candidate[refused])
            scores[candidate, row] *= weight
        unseen = 0
        if misses is not None and len(index):
            candidate, row = np.nonzero(scores)
            missed = misses(_bases(candidates, index[candidate], chosen, row))
            scores[candidate[missed], row[missed]] = 0.0
            unseen = _counted(candidate[missed])
        candidate, row, ranks = _best(scores, chosen.squares, each)
        return _Part(
            number,
            _bases(candidates, index[candidate], chosen, row),
            scores[candidate, row],
            index[candidate],
            chosen.row[row],
            chosen.torso[row],
            ranks,
            without_room,
            unwanted,
            unseen,
            crowded,
        )


def _counted(candidates: Indices) -> int:
    """Return how many base poses, of each of which (m,) tells the candidate, are counted."""
    return int(np.minimum(np.bincount(candidates), COUNTED).sum())


def _bases(candidates: GraspCandidates, index: Indices, chosen: Rows, row: Indices) -> Array:
    """Return bases (m, 3) from which candidates (m,) are reached by rows (m,)."""
    heading = candidates.headings[index]
    c, s = np.cos(heading), np.sin(heading)
    x, y = chosen.v[row, 0], chosen.v[row, 1]
    points = candidates.points[index]
    return np.stack([points[:, 0] - (c * x - s * y), points[:, 1] - (s * x + c * y), heading - chosen.yaw[row]], axis=1)


def _best(scores: Array, squares: Indices, each: int) -> tuple[Indices, Indices, Indices]:
    """Return, of each row of scores (w, n) those above 0 that are best, well spread: row, column, and rank in the row.

    ``squares`` (n,) number the squares of :data:`SPREAD` that the columns are in: the best of each come first.
    """
    if 8 * each < scores.shape[1]:
        worse = TIE * np.arange(scores.shape[1]) - scores
        top = np.argpartition(worse, 8 * each - 1, axis=1)[:, : 8 * each]
        candidate, place = np.nonzero(np.take_along_axis(scores, top, 1))
        row = top[candidate, place]
    else:
        candidate, row = np.nonzero(scores)
    # candidates are told apart by twice their number: scores are less than 1
    order = np.argsort(2.0 * candidate + (TIE * row - scores[candidate, row]))
    candidate, row = candidate[order], row[order]
    again = np.ones(len(candidate), np.intp)
    again[np.unique((candidate << SQUARE_BITS) + squares[row], return_index=True)[1]] = 0
    order = np.argsort(2 * candidate + again, kind="stable")
    candidate, row = candidate[order], row[order]
    rank = np.arange(len(candidate)) - np.searchsorted(candidate, candidate)
    kept = rank < each
    return candidate[kept], row[kept], rank[kept]


def blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of so many rows, one after another."""
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))


FINER = 2
"""Base poses on the side of a cell, and headings for each of a map: what is moved by less than the distance of a map's
base poses can mostly be reached from its postures.
"""
HALF = 1 << 12
"""More cells than a base pose is away in any direction."""


def moved_to_room(found: BaseCandidates, floor: Floor, middle: Array, yaw: float, most: int) -> BaseCandidates:
    """Return candidates moved to the nearest point with room of a lattice around ``middle`` (2,), turned by ``yaw``.

    Of each grasp candidate the best are moved, no more than ``most`` in all. Those without room nearby are left out, of
    those that become equal all but the best.
    """
    found = found.chosen(np.sort(np.lexsort((-found.scores.round(9), found.ranks))[:most]))
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, s], [-s, c]])
    angle = 2 * math.pi / (FINER * YAWS)
    local = (found.bases[:, :2] - middle) @ turn.T / CELL
    cells = np.rint(local + HAIR).astype(np.int64)
    headings = np.rint((found.bases[:, 2] - yaw) / angle + HAIR).astype(np.int64) % (FINER * YAWS)
    keys = ((cells[:, 0] + HALF) * 2 * HALF + cells[:, 1] + HALF) * FINER * YAWS + headings
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    inner = (np.arange(FINER) - (FINER - 1) / 2) / FINER
    corners = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    spots = (cells[first][:, None] + corners) * CELL @ turn + middle  # (k, FINER ** 2, 2)
    bases = np.concatenate(
        [spots, np.broadcast_to((headings[first] * angle + yaw)[:, None, None], (*spots.shape[:2], 1))], axis=2
    )
    free = floor.holds(bases.reshape(-1, 3)).reshape(bases.shape[:2])
    away = np.linalg.norm(local[:, None] - cells[:, None] - corners, axis=2).round(9)
    away = np.where(free[index], away, np.inf)
    rows, nearest = np.arange(len(found)), np.argmin(away, axis=1)
    kept = np.flatnonzero(np.isfinite(away[rows, nearest]))
    index, nearest = index[kept], nearest[kept]
    moved = replace(found.chosen(kept), bases=bases[index, nearest])
    return _distinct(moved, index * FINER**2 + nearest)


def _distinct(found: BaseCandidates, place: Array) -> BaseCandidates:
    """Return, of candidates with the same arm, candidate, base pose (m,) and torso the best one, ranked anew."""
    order = np.lexsort((-found.scores.round(9), found.torsos, place, found.candidates, found.arms))
    keys = np.column_stack([found.arms, found.candidates, place, found.torsos])[order]
    first = np.append(True, (np.diff(keys, axis=0) != 0).any(axis=1))[: len(keys)]
    found = found.chosen(order[first])
    found = found.chosen(np.lexsort((-found.scores.round(9), found.candidates, found.arms)))
    candidates = np.column_stack([found.arms, found.candidates])
    begins = np.append(True, (np.diff(candidates, axis=0) != 0).any(axis=1))[: len(candidates)]
    rows = np.arange(len(candidates))
    return replace(found, ranks=rows - np.maximum.accumulate(np.where(begins, rows, 0)))
