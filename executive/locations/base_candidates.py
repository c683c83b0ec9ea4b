"""Base poses from which grasp candidates are reachable, by inverting reachability maps.

For a candidate with its tip at the point p and heading g, a map row with the tip at c and heading y (in the torso
frame) is used from the base at p - Rz(g) v with yaw g - y, where v = Rz(-y) c does not depend on the world. Maps are
prepared once per height; testing all rows of a candidate then costs a rotation of constants and a look-up in the
clearance field (Vahrenkamp et al., Robot placement based on reachability inversion, ICRA 2013).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.belief.floor import CELL as FLOOR_CELL
from executive.belief.floor import HAIR, Field, Floor
from executive.locations.grasp_candidates import CLASSES, Columns, GraspCandidates, Hand, Indices
from executive.locations.inverse_maps import InverseMaps, Rows
from executive.locations.reachability import YAWS
from executive.locations.rejections import NO_ROOM
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.records import dataclass

TIE = 1e-9
"""Difference below which scores count as equal; then the better map row wins."""
AT_ONCE = 200_000
"""Base poses tested at once: more would not fit into the processor's cache."""
COUNTED = 48
"""Base poses counted per candidate and reason, so that the counts of reasons are comparable."""
SHOWN = 150
"""Base poses kept for a picture of those rejected at once."""

Weigh = Callable[[Array], Array]
"""Bases (m, 3) -> weights (m,), 0 for base poses to reject."""
Conjunct = tuple[str, Weigh]
"""Reason to reject bases, and their weights."""
Misses = Callable[[Array], NDArray[np.bool_]]
"""Bases (m, 3) -> whether something is surely hidden from there (m,)."""


@dataclass(frozen=True, slots=True, eq=False)
class BaseCandidates(Columns):
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
    """Number of better base poses of the same candidate."""

    def __len__(self) -> int:
        return len(self.scores)

    def order(self, weigh: Weigh, most: int) -> Indices:
        """Order indices round-robin over the candidates, the best of each first, at most ``most``."""
        index = np.flatnonzero(self.ranks <= last_rank(np.bincount(self.ranks, minlength=1), most))
        worth = self.scores[index] * weigh(self.bases[index])
        return index[np.lexsort((-worth.round(6), self.ranks[index]))[:most]]


def last_rank(numbers: Indices, most: int) -> int:
    """Find the rank up to which there are ``most`` candidates, given the number with each rank (r,)."""
    return int(np.searchsorted(np.cumsum(numbers), most))


@dataclass(slots=True, eq=False)
class Inversion:
    """Inversion of maps for some hands, independent of what has to be visible, with what it rejected."""

    room: Field
    conjuncts: Sequence[Conjunct]
    """Conjuncts of a location about the base, apart from the reach."""
    refused: Counter[str] = field(default_factory=Counter)
    """Base poses rejected, by reason: up to :data:`COUNTED` per reason and grasp candidate."""
    without_room: int = 0
    """Base poses without room, counted likewise."""
    show: Callable[[str, Array], object] | None = None
    """Receives a reason and some of the bases (m, 3) rejected for it, for a picture."""
    _parts: list[_Part] = field(default_factory=list)
    _known: dict[tuple[int, int], BaseCandidates] = field(default_factory=dict)
    """Results of :meth:`best` if visibility rejects nothing."""
    _crowded: list[tuple[int, int, float, Array]] = field(default_factory=list)

    def crowded(self) -> list[tuple[float, Array]]:
        """List score and base pose of the best row of each grasp candidate that has no room anywhere."""
        return [(score, base) for *_, score, base in sorted(self._crowded, key=lambda place: place[:2])]

    def invert(
        self,
        hands: Sequence[Hand],
        inverse: InverseMaps,
        lifted: Callable[[ArmModel, Sequence[float]], tuple[float, ...]],
        *,
        least: float,
        rows: int,
    ) -> None:
        """Find base poses for arms and their grasp candidates.

        ``lifted`` selects the torso positions possible with the rest of the robot as it is. ``least`` and ``rows``
        bound the map rows by score, and by number per torso position.
        """
        for number, (arm, candidates, _) in enumerate(hands):
            # candidates of one class, roll and height use the same map rows
            groups: dict[tuple[float, int, int], list[int]] = {}
            heights = candidates.points[:, 2].round(6).tolist()
            kinds = zip(heights, candidates.grasps.tolist(), candidates.rolls.tolist(), strict=True)
            for candidate, kind in enumerate(kinds):
                groups.setdefault(kind, []).append(candidate)
            for (z, grasp, roll), mine in groups.items():
                chosen = inverse(arm, CLASSES[grasp]).rows(z, roll, least, rows)
                chosen = chosen.of(lifted(arm, chosen.torsos))
                for part in blocks(len(mine), max(1, AT_ONCE // max(len(chosen.row), 1))) if len(chosen.row) else ():
                    index = np.array(mine[part], np.intp)
                    self._look_up(number, candidates, index, chosen)

    def best(self, each: int, most: int, misses: Misses | None) -> tuple[BaseCandidates, int]:
        """Select base poses in the order of arms and grasp candidates, and count those that ``misses`` rejects.

        Of each candidate the ``each`` best are kept, well spread; of all, about ``most``: up to the rank that completes
        that number.
        """
        if misses is not None:
            parts = [replace(part, factors=part.factors.copy()) for part in self._parts]
            unseen = sum(part.weigh(lambda bases: (~misses(bases)).astype(float)) for part in parts)
            if unseen:
                return _best(parts, each, most), unseen
        if (each, most) not in self._known:
            self._known[each, most] = _best(self._parts, each, most)
        return self._known[each, most], 0

    def _look_up(self, number: int, candidates: GraspCandidates, index: Indices, chosen: Rows) -> None:
        """Rate all rows (n) for some candidates at once, and keep those with room."""
        places = chosen.places
        v = chosen.v[places.first]
        near = self.room.has_room(candidates.points[index, :2], *places.away)
        roomy = index[near]
        clearance_score = self.room.looked_up(candidates.points[roomy, :2], candidates.headings[roomy], v)
        free = np.zeros(len(index), np.intp)
        free[near] = (clearance_score > 0).astype(np.float64) @ places.sizes
        self.without_room += int(np.minimum(len(chosen.row) - free, COUNTED).sum())
        if self.show is not None:
            blocked = np.ones((len(index), len(v)), bool)
            blocked[near] = clearance_score <= 0
            entry, place = (one[:: 1 + int(blocked.sum()) // SHOWN] for one in _entries(blocked))
            self.show(NO_ROOM, _bases(candidates, index[entry], chosen, places.first[place]))
        for candidate in index[free == 0].tolist():
            score = float(candidates.weights[candidate]) * float(chosen.score[0])
            base = _bases(candidates, np.array([candidate]), chosen, np.zeros(1, int))[0]
            self._crowded.append((number, candidate, score, base))
        if free.any():
            part = _Part(number, candidates, index[free > 0], chosen, clearance_score[free[near] > 0])
            for reason, weigh in self.conjuncts:
                self.refused[reason] += part.weigh(weigh, None if self.show is None else partial(self.show, reason))
            self._parts.append(part)


def _bases(candidates: GraspCandidates, index: Indices, chosen: Rows, row: Indices) -> Array:
    """Compute bases (m, 3) from which candidates (m,) are reached by rows (m,)."""
    c, s = np.cos(candidates.headings)[index], np.sin(candidates.headings)[index]
    x, y = chosen.v[row, 0], chosen.v[row, 1]
    points = candidates.points[index]
    return np.stack(
        [points[:, 0] - (c * x - s * y), points[:, 1] - (s * x + c * y), candidates.headings[index] - chosen.yaw[row]],
        axis=1,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Base poses for some grasp candidates of an arm, in terms that do not depend on the torso's height."""

    arm: int
    candidates: GraspCandidates
    index: Indices
    """Indices of the candidates (w,)."""
    rows: Rows
    factors: Array
    """Weights of the rows' places for each candidate, (w, u): 0 for rejected ones."""

    def sizes(self) -> Indices:
        """Count the base poses of each candidate (w,)."""
        return ((self.factors > 0).astype(np.float64) @ self.rows.places.sizes).astype(np.intp)

    def weigh(self, weigh: Weigh, show: Callable[[Array], object] | None = None) -> int:
        """Multiply factors by weights of bases; return the (bounded) number of rejected ones, and show some."""
        places = self.rows.places
        candidate, place = _entries(self.factors)
        bases = _bases(self.candidates, self.index[candidate], self.rows, places.first[place])
        weight = weigh(bases)
        self.factors[candidate, place] *= weight
        refused = weight <= 0
        if show is not None:
            show(bases[refused][:: 1 + int(refused.sum()) // SHOWN])
        return int(np.minimum(np.bincount(candidate[refused], places.sizes[place[refused]]), COUNTED).sum())

    def best(self, each: int, last: int) -> BaseCandidates:
        """Select the best base poses of each candidate, well spread: at most ``each``, none below the ``last`` rank."""
        candidate, row, scores = self._scored(8 * each)
        # sort by candidate, then score, in one key: scores are less than 1
        order = np.argsort(2.0 * candidate + (TIE * row - scores))
        candidate, row, scores = candidate[order], row[order], scores[order]
        number, starts = np.arange(len(candidate)), np.searchsorted(candidate, np.arange(len(self.index) + 1))
        square, count = self.rows.places.squares
        key = candidate * count + square[row]
        best_of_square = np.zeros(len(self.index) * count, np.intp)
        best_of_square[key[::-1]] = number[::-1]
        is_best = best_of_square[key] == number
        # A good row has good neighbours, a lattice step away, which fail for the same obstacle. So the best of each
        # square of SPREAD come first, and only then the others: the first base poses are as far apart as possible.
        before = np.append(0, np.cumsum(is_best))
        better, bests = before[:-1] - before[starts[candidate]], np.diff(before[starts])[candidate]
        rank = np.where(is_best, better, bests + number - starts[candidate] - better)
        kept = np.flatnonzero(rank <= min(each - 1, last))
        kept = kept[np.argsort(starts[candidate[kept]] + rank[kept])]
        which, row = self.index[candidate[kept]], row[kept]
        bases = _bases(self.candidates, which, self.rows, row)
        arms = np.full(len(row), self.arm, np.intp)
        return BaseCandidates(
            bases, scores[kept], arms, which, self.rows.row[row], self.rows.torso[row], rank[kept].astype(np.intp)
        )

    def _scored(self, most: int) -> tuple[Indices, Indices, Array]:
        """List base poses by candidate, row and score; of each candidate the best ``most``, or all."""
        weights, places = self.candidates.weights[self.index], self.rows.places
        if most < len(self.rows.row):
            scores = self.factors[:, places.same] * self.rows.score
            scores *= weights[:, None]
            worse = TIE * np.arange(scores.shape[1]) - scores
            top = np.argpartition(worse, most - 1, axis=1)[:, :most]
            candidate, place = np.nonzero(np.take_along_axis(scores, top, 1))
            row = top[candidate, place]
            return candidate, row, scores[candidate, row]
        candidate, place = _entries(self.factors)
        entry, row = places.rows_at(place)
        factors, candidate = self.factors[candidate, place][entry], candidate[entry]
        return candidate, row, factors * self.rows.score[row] * weights[candidate]


def _best(parts: Sequence[_Part], each: int, most: int) -> BaseCandidates:
    """Select the best base poses of all parts (see :meth:`Inversion.best`)."""
    if not parts:
        return BaseCandidates()
    sizes = np.minimum(np.concatenate([part.sizes() for part in parts]), each)
    last = last_rank(len(sizes) - np.cumsum(np.bincount(sizes, minlength=1)), most)
    joined = BaseCandidates.joined([part.best(each, last) for part in parts])
    return joined.chosen(np.lexsort((joined.candidates, joined.arms)))


def _entries(scores: Array) -> tuple[Indices, Indices]:
    """Find rows and columns of nonzero scores (w, n); numpy is faster on flat arrays."""
    candidate, row = np.divmod(np.flatnonzero(scores.ravel() != 0.0), scores.shape[1])
    return candidate, row


def blocks(count: int, size: int) -> Iterator[slice]:
    """Yield slices of ``size`` rows, one after another."""
    for first in range(0, count, size):
        yield slice(first, min(first + size, count))


FINER = 2
"""Divisions of a cell's side and of the angle between headings. Base poses moved by less than the lattice spacing are
mostly reachable with the map's postures."""
HALF = 1 << 12
"""More cells than a base pose is away in any direction."""


def moved_to_room(found: BaseCandidates, floor: Floor, middle: Array, yaw: float, most: int) -> BaseCandidates:
    """Move candidates to the nearest free point of a lattice around ``middle`` (2,), turned by ``yaw``.

    The best of each grasp candidate are moved, at most ``most`` in all. Those without room nearby are dropped, and of
    those that coincide only the best is kept.
    """
    # The lattice of a map, seen from the candidate, is turned by its heading, and so may miss a gap between pieces of
    # furniture although the gap is wider than its step. A lattice that is parallel to the furniture does not.
    best = found.chosen(np.sort(np.lexsort((-found.scores.round(9), found.ranks))[:most]))
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, s], [-s, c]])
    angle = 2 * math.pi / (FINER * YAWS)
    local = (best.bases[:, :2] - middle) @ turn.T / FLOOR_CELL
    cells = np.rint(local + HAIR).astype(np.int64)
    headings = np.rint((best.bases[:, 2] - yaw) / angle + HAIR).astype(np.int64) % (FINER * YAWS)
    keys = ((cells[:, 0] + HALF) * 2 * HALF + cells[:, 1] + HALF) * FINER * YAWS + headings
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    inner = (np.arange(FINER) - (FINER - 1) / 2) / FINER
    corners = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    spots = (cells[first][:, None] + corners) * FLOOR_CELL @ turn + middle  # (k, FINER ** 2, 2)
    bases = np.concatenate(
        [spots, np.broadcast_to((headings[first] * angle + yaw)[:, None, None], (*spots.shape[:2], 1))], axis=2
    )
    free = floor.holds(bases.reshape(-1, 3)).reshape(bases.shape[:2])
    distances = np.linalg.norm(local[:, None] - cells[:, None] - corners, axis=2).round(9)
    distances = np.where(free[index], distances, np.inf)
    rows, nearest = np.arange(len(best)), np.argmin(distances, axis=1)
    kept = np.flatnonzero(np.isfinite(distances[rows, nearest]))
    index, nearest = index[kept], nearest[kept]
    moved = replace(best.chosen(kept), bases=bases[index, nearest])
    return _distinct(moved, index * FINER**2 + nearest)


def _distinct(found: BaseCandidates, place: Array) -> BaseCandidates:
    """Keep the best of candidates with equal arm, candidate, base pose (m,) and torso, and rank them anew."""
    order = np.lexsort((-found.scores.round(9), found.torsos, place, found.candidates, found.arms))
    keys = np.column_stack([found.arms, found.candidates, place, found.torsos])[order]
    first = np.append(True, (np.diff(keys, axis=0) != 0).any(axis=1))[: len(keys)]
    found = found.chosen(order[first])
    found = found.chosen(np.lexsort((-found.scores.round(9), found.candidates, found.arms)))
    candidates = np.column_stack([found.arms, found.candidates])
    begins = np.append(True, (np.diff(candidates, axis=0) != 0).any(axis=1))[: len(candidates)]
    rows = np.arange(len(candidates))
    return replace(found, ranks=rows - np.maximum.accumulate(np.where(begins, rows, 0)))
