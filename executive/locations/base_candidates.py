"""Base poses from which grasp candidates are reachable, by inverting reachability maps.

For a candidate whose tip heads for g at the point p, a row of the map with the tip at c and heading y (in the torso
frame) is used from the base at p - Rz(g) v with yaw g - y, where v = Rz(-y) c does not depend on the world: maps are
prepared once for each height, and looking at all rows of a candidate costs a rotation of constants and a look at the
field of room (Vahrenkamp et al., Robot placement based on reachability inversion, ICRA 2013).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from executive.belief.floor import CELL as FLOOR_CELL
from executive.belief.floor import HAIR, Field, Floor
from executive.locations.columns import Columns
from executive.locations.grasp_candidates import CLASSES, GraspCandidates, Hand
from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap, carried, exact_places, is_bound
from executive.locations.reachability_maps import reachability_map
from executive.locations.rejections import NO_ROOM
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.progress import Report
from planlang.records import dataclass

SPREAD = 0.1
"""Side of a square in which the best place of one candidate comes first [m]."""
MOST_CELLS = 1 << 17
"""More cells than a map has to either side, twice."""
SQUARE_BITS = 22
"""Numbers of squares have no more bits."""
MOST_MAPS = 24
"""Maps that are kept prepared."""

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Rows(Columns):
    """Rows of a map that grasp candidates of one height and roll can use, best first."""

    v: Array
    """(n, 2) [m]."""
    yaw: Array
    score: Array
    row: Indices
    torso: Array
    squares: Indices
    """Number of the square of side :data:`SPREAD` that v is in."""
    spots: Indices
    """Number of v: rows for other torso positions often have the same."""
    torsos: tuple[float, ...] = ()
    """Torso positions, lowest first."""

    def of(self, torsos: tuple[float, ...]) -> Rows:
        """Return the rows for some torso positions."""
        return self if torsos == self.torsos else replace(self.chosen(np.isin(self.torso, torsos)), torsos=torsos)

    @cached_property
    def places(self) -> Places:
        """Return the places of rows."""
        _, first, same = np.unique(self.spots, return_index=True, return_inverse=True)
        different, squares = np.unique(self.squares, return_inverse=True)
        away = np.hypot(*self.v[first].T)
        return Places(
            first,
            same,
            np.bincount(same),
            np.argsort(same, kind="stable"),
            (squares, len(different)),
            (float(away.min(initial=np.inf)), float(away.max(initial=0.0))),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The u different v of rows (n,): what holds of a base pose holds of it with the torso at any height."""

    first: Indices
    """A row with each v (u,)."""
    same: Indices
    """The number of the v of each row (n,)."""
    sizes: Indices
    """The number of rows with each v (u,)."""
    order: Indices
    """Rows in the order of their v (n,)."""
    squares: tuple[Indices, int]
    """The number of the square of side :data:`SPREAD` that each row is in (n,), and how many there are."""
    away: tuple[float, float]
    """Least and greatest distance of base poses from what is reached [m]."""

    def rows_at(self, places: Indices) -> tuple[Indices, Indices]:
        """Return the rows with the v of each of some places (k,): the numbers of these among them, and the rows."""
        sizes = self.sizes[places]
        entry = np.repeat(np.arange(len(places)), sizes)
        begins = np.cumsum(self.sizes) - self.sizes
        shift = np.repeat(begins[places] - (np.cumsum(sizes) - sizes), sizes)
        return entry, self.order[np.arange(len(entry)) + shift]


class InverseMap:
    """A reachability map prepared for inversion, level by level as they are asked for."""

    def __init__(self, forward: ReachabilityMap, exact: Array | None = None) -> None:
        """Prepare a map; ``exact`` has x, y [m] and heading [rad] of rows (n, 3) that are not those of the lattice."""
        self.forward, self._exact = forward, exact
        rows = forward.rows
        away = np.hypot(*exact.T[:2]) if exact is not None else CELL * np.hypot(rows["x"], rows["y"], dtype=np.float64)
        self.reach = float(away.max()) if len(rows) else 0.0
        """Farthest that a base is from a point that it reaches, horizontally [m]."""
        self._levels: dict[tuple[int, int], Rows] = {}
        self._known: dict[tuple[float, int, float, int], Rows] = {}

    def rows(self, z: float, roll: int, least: float, most: int) -> Rows:
        """Return rows for a height [m] and roll, of at least a score, no more than ``most`` for each torso position."""
        key = (round(z, 6), roll, least, most)
        if key not in self._known:
            if len(self._known) > 64:
                self._known.clear()
            self._known[key] = self._find(z, roll, least, most)
        return self._known[key]

    def _find(self, z: float, roll: int, least: float, most: int) -> Rows:
        forward = self.forward
        parts = [self._level(forward.lowest_level - 1, roll)]  # which has no rows: there is always a part
        for torso in forward.heights(z):
            rise = float(forward.lift.rise(torso)) if forward.lift is not None else 0.0
            level = self._level(round((z - rise) / CELL), roll)
            count = min(int(np.searchsorted(-level.score, -least, side="right")), most)
            parts.append(replace(level.chosen(np.arange(count)), torso=np.full(count, torso)))
        found = Rows.joined(parts)
        found = found.chosen(np.argsort(-found.score, kind="stable"))
        return replace(found, torsos=tuple(np.unique(found.torso).tolist()))

    def _level(self, level: int, roll: int) -> Rows:
        """Return the rows of a level that a roll can use, at no torso position, best first."""
        if (level, roll) in self._levels:
            return self._levels[level, roll]
        forward = self.forward
        flipped = forward.grasp is GraspClass.TOP and roll == -1
        number = level - forward.lowest_level
        inside = 0 <= number < len(forward.starts) - 1
        first, last = forward.starts[number : number + 2].tolist() if inside else (0, 0)
        rows = forward.rows[first:last]
        index = np.flatnonzero(rows["roll"] == (1 if flipped else roll))
        score = rows["score"][index].astype(float).round(6)
        order = np.argsort(-score, kind="stable")
        index, score = index[order], score[order]
        if self._exact is None:
            yaw = rows["yaw"][index].astype(float) * (2 * math.pi / YAWS)
            x, y = CELL * rows["x"][index].astype(float), CELL * rows["y"][index].astype(float)
        else:
            x, y, yaw = self._exact[first + index].T
        c, s = np.cos(yaw), np.sin(yaw)
        v = np.stack([c * x + s * y, c * y - s * x], axis=1)
        if flipped:  # a turned hand is the same as another heading
            v, yaw = -v, yaw - math.pi
        spots = first + index
        if self._exact is None:
            spots = (rows["x"][index].astype(np.intp) * MOST_CELLS + rows["y"][index]) * YAWS + rows["yaw"][index]
        cells = np.rint(v / SPREAD).astype(np.intp)
        half = 1 << (SQUARE_BITS // 2 - 1)
        squares = (cells[:, 0] + half) * 2 * half + cells[:, 1] + half
        self._levels[level, roll] = Rows(v, yaw, score, first + index, np.zeros(len(index)), squares, spots)
        return self._levels[level, roll]


_prepared: dict[tuple[object, ...], InverseMap] = {}


def inverse_map(facts: tuple[object, ...], prepared: Callable[[], InverseMap]) -> InverseMap:
    """Return a map prepared for inversion, once in a process for all arms of the same ``facts``."""
    if facts not in _prepared:
        while len(_prepared) >= MOST_MAPS:
            del _prepared[next(iter(_prepared))]
        _prepared[facts] = prepared()
    return _prepared[facts]


class InverseMaps:
    """The maps of the arms of one robot, prepared when they are first asked for."""

    def __init__(self, robot: str, report: Report) -> None:
        """Prepare none yet; ``report`` gets the progress of maps of the ``robot`` that have to be built."""
        self._robot, self._report = robot, report
        self._known: dict[tuple[str, GraspClass], InverseMap] = {}

    def __call__(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        """Return the map of an arm and class of grasp."""
        key = (arm.name, grasp)
        if key not in self._known:
            facts = (arm.solver.chain.digest, arm.lift, arm.frame, arm.seeds.tobytes(), grasp)
            self._known[key] = inverse_map(facts, partial(self._prepare, arm, grasp))
        return self._known[key]

    def _prepare(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        forward = reachability_map(arm, grasp, self._robot, self._report)
        if not is_bound(arm):
            return InverseMap(forward)
        q, roll = forward.postures[forward.rows["posture"]], forward.rows["roll"].astype(int)
        return InverseMap(forward, exact_places(carried(arm), q, grasp, arm.frame, roll)[0])


TIE = 1e-9
"""Scores that differ by less count as equal: then the base pose of the better row comes first."""
AT_ONCE = 200_000
"""Base poses that are looked at in one go: more would not stay in the processor's memory."""
COUNTED = 48
"""Base poses without room, unwanted and unseen that are counted of each candidate, so that reasons can be compared."""
SHOWN = 150
"""Base poses that are shown in a picture of those that are refused at once."""

Weigh = Callable[[Array], Array]
"""Bases (m, 3) -> weights (m,), 0 where a base pose will not do."""
Conjunct = tuple[str, Weigh]
"""The reason for which bases are refused, and the weights."""
Misses = Callable[[Array], NDArray[np.bool_]]
"""Bases (m, 3) -> whether something is surely not seen from there (m,)."""


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
    """The number of better ones of the same candidate."""

    def __len__(self) -> int:
        return len(self.scores)

    def order(self, weigh: Weigh, most: int) -> Indices:
        """Return indices round-robin over the candidates, the best of each first, at most ``most``."""
        some = np.flatnonzero(self.ranks <= last_rank(np.bincount(self.ranks, minlength=1), most))
        worth = self.scores[some] * weigh(self.bases[some])
        return some[np.lexsort((-worth.round(6), self.ranks[some]))[:most]]


def last_rank(numbers: Indices, most: int) -> int:
    """Return the rank up to which there are ``most`` candidates, or all, where so many have each rank (r,)."""
    return int(np.searchsorted(np.cumsum(numbers), most))


@dataclass(slots=True, eq=False)
class Inversion:
    """The inversion of maps for some hands, whatever has to be seen, and what it refused on the way."""

    room: Field
    conjuncts: Sequence[Conjunct]
    """Conjuncts of a location about the base, without the reach."""
    refused: Counter[str] = field(default_factory=Counter)
    """Base poses that will not do, by reason: up to :data:`COUNTED` for each reason and grasp candidate."""
    without_room: int = 0
    """Base poses without room, counted likewise."""
    show: Callable[[str, Array], object] | None = None
    """Given a reason and some of the bases (m, 3) that are refused for it, for a picture."""
    _parts: list[_Part] = field(default_factory=list)
    _known: dict[tuple[int, int], BaseCandidates] = field(default_factory=dict)
    """Results of :meth:`best` where nothing that has to be seen is missed."""
    _crowded: list[tuple[int, int, float, Array]] = field(default_factory=list)

    def crowded(self) -> list[tuple[float, Array]]:
        """Return the score and the base pose of the best row of each grasp candidate without any that has room."""
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
        """Look at base poses for arms and their grasp candidates.

        ``lifted`` tells where the torso may be with the rest of the robot as it is. ``least`` and ``rows`` bound the
        rows of the maps by score, and by number for each torso position.
        """
        for number, (arm, candidates, _) in enumerate(hands):
            # those of one class, roll and height use the same rows of a map
            alike: dict[tuple[float, int, int], list[int]] = {}
            heights = candidates.points[:, 2].round(6).tolist()
            kinds = zip(heights, candidates.grasps.tolist(), candidates.rolls.tolist(), strict=True)
            for candidate, kind in enumerate(kinds):
                alike.setdefault(kind, []).append(candidate)
            for (z, grasp, roll), mine in alike.items():
                chosen = inverse(arm, CLASSES[grasp]).rows(z, roll, least, rows)
                chosen = chosen.of(lifted(arm, chosen.torsos))
                for some in blocks(len(mine), max(1, AT_ONCE // max(len(chosen.row), 1))) if len(chosen.row) else ():
                    index = np.array(mine[some], np.intp)
                    self._look_up(number, candidates, index, chosen)

    def best(self, each: int, most: int, misses: Misses | None) -> tuple[BaseCandidates, int]:
        """Return base poses in the order of arms and grasp candidates, and how many were refused as ``misses`` tells.

        Of a grasp candidate ``each`` are kept, those with the best score, well spread. ``most`` are wanted in all: more
        are kept only of the rank of the last, among those of its candidate.
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
        """Look up at once how good all rows (n) are for some candidates, and keep those that have room."""
        places = chosen.places
        v = chosen.v[places.first]
        near = self.room.has_room(candidates.points[index, :2], *places.away)
        some = index[near]
        looked = self.room.looked_up(candidates.points[some, :2], candidates.headings[some], v)
        free = np.zeros(len(index), np.intp)
        free[near] = (looked > 0).astype(np.float64) @ places.sizes
        self.without_room += int(np.minimum(len(chosen.row) - free, COUNTED).sum())
        if self.show is not None:
            taken = np.ones((len(index), len(v)), bool)
            taken[near] = looked <= 0
            entry, place = (one[:: 1 + int(taken.sum()) // SHOWN] for one in _entries(taken))
            self.show(NO_ROOM, _bases(candidates, index[entry], chosen, places.first[place]))
        for candidate in index[free == 0].tolist():
            score = float(candidates.weights[candidate]) * float(chosen.score[0])
            base = _bases(candidates, np.array([candidate]), chosen, np.zeros(1, int))[0]
            self._crowded.append((number, candidate, score, base))
        if free.any():
            part = _Part(number, candidates, index[free > 0], chosen, looked[free[near] > 0])
            for reason, weigh in self.conjuncts:
                self.refused[reason] += part.weigh(weigh, None if self.show is None else partial(self.show, reason))
            self._parts.append(part)


def _bases(candidates: GraspCandidates, index: Indices, chosen: Rows, row: Indices) -> Array:
    """Return bases (m, 3) from which candidates (m,) are reached by rows (m,)."""
    c, s = np.cos(candidates.headings)[index], np.sin(candidates.headings)[index]
    x, y = chosen.v[row, 0], chosen.v[row, 1]
    points = candidates.points[index]
    return np.stack(
        [points[:, 0] - (c * x - s * y), points[:, 1] - (s * x + c * y), candidates.headings[index] - chosen.yaw[row]],
        axis=1,
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """Base poses for some grasp candidates of an arm, given by what is the same with the torso at any height."""

    arm: int
    candidates: GraspCandidates
    index: Indices
    """Numbers of the candidates (w,)."""
    rows: Rows
    factors: Array
    """How good the places of the rows are for each, (w, u): 0 for those that will not do."""

    def sizes(self) -> Indices:
        """Return how many base poses each candidate has (w,)."""
        return ((self.factors > 0).astype(np.float64) @ self.rows.places.sizes).astype(np.intp)

    def weigh(self, weigh: Weigh, show: Callable[[Array], object] | None = None) -> int:
        """Multiply factors by what is said of bases, return how many are refused, as counted, and show some."""
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
        """Return those of the best of ``each`` candidate, well spread, that are no worse than the ``last`` rank."""
        candidate, row, scores = self._scored(8 * each)
        # candidates are told apart by twice their number: scores are less than 1
        order = np.argsort(2.0 * candidate + (TIE * row - scores))
        candidate, row, scores = candidate[order], row[order], scores[order]
        number, starts = np.arange(len(candidate)), np.searchsorted(candidate, np.arange(len(self.index) + 1))
        square, several = self.rows.places.squares
        squared = candidate * several + square[row]
        best = np.zeros(len(self.index) * several, np.intp)
        best[squared[::-1]] = number[::-1]
        first = best[squared] == number
        # of each candidate first the best of the squares, then the others
        before = np.append(0, np.cumsum(first))
        better, bests = before[:-1] - before[starts[candidate]], np.diff(before[starts])[candidate]
        rank = np.where(first, better, bests + number - starts[candidate] - better)
        kept = np.flatnonzero(rank <= min(each - 1, last))
        kept = kept[np.argsort(starts[candidate[kept]] + rank[kept])]
        which, row = self.index[candidate[kept]], row[kept]
        bases = _bases(self.candidates, which, self.rows, row)
        arms = np.full(len(row), self.arm, np.intp)
        return BaseCandidates(
            bases, scores[kept], arms, which, self.rows.row[row], self.rows.torso[row], rank[kept].astype(np.intp)
        )

    def _scored(self, most: int) -> tuple[Indices, Indices, Array]:
        """Return base poses by number of the candidate, row and score; of each candidate the best ``most``, or all."""
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
    """Return the best base poses of some parts, as :meth:`Inversion.best` does."""
    if not parts:
        return BaseCandidates()
    sizes = np.minimum(np.concatenate([part.sizes() for part in parts]), each)
    last = last_rank(len(sizes) - np.cumsum(np.bincount(sizes, minlength=1)), most)
    found = BaseCandidates.joined([part.best(each, last) for part in parts])
    return found.chosen(np.lexsort((found.candidates, found.arms)))


def _entries(scores: Array) -> tuple[Indices, Indices]:
    """Return rows and columns of scores (w, n) that are not 0; numpy finds them faster in one row."""
    candidate, row = np.divmod(np.flatnonzero(scores.ravel() != 0.0), scores.shape[1])
    return candidate, row


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
    local = (found.bases[:, :2] - middle) @ turn.T / FLOOR_CELL
    cells = np.rint(local + HAIR).astype(np.int64)
    headings = np.rint((found.bases[:, 2] - yaw) / angle + HAIR).astype(np.int64) % (FINER * YAWS)
    keys = ((cells[:, 0] + HALF) * 2 * HALF + cells[:, 1] + HALF) * FINER * YAWS + headings
    _, first, index = np.unique(keys, return_index=True, return_inverse=True)
    inner = (np.arange(FINER) - (FINER - 1) / 2) / FINER
    corners = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    spots = (cells[first][:, None] + corners) * FLOOR_CELL @ turn + middle  # (k, FINER ** 2, 2)
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
