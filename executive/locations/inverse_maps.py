"""Reachability maps prepared for their inversion by :mod:`executive.locations.base_candidates`."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property

import numpy as np

from executive.locations.grasp_candidates import Columns, Indices
from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap, carried, exact_places, is_bound
from executive.locations.reachability_maps import reachability_map
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.kept import Latest
from planlang.progress import Report
from planlang.records import dataclass

SPREAD = 0.1
"""Side of the squares whose best base poses come first, per candidate [m]."""
MOST_CELLS = 1 << 17
"""More cells than a map has in either direction, twice."""
SQUARE_BITS = 22
"""Bits for the number of a square."""
MOST_MAPS = 24
"""Number of prepared maps to cache."""


@dataclass(frozen=True, eq=False)
class Rows(Columns):
    """Map rows for grasp candidates of one height and roll, best first."""

    v: Array
    """(n, 2) [m]."""
    yaw: Array
    score: Array
    row: Indices
    torso: Array
    squares: Indices
    """Number of the square of side :data:`SPREAD` that contains v."""
    spots: Indices
    """Number of v, which rows for different torso positions often share."""
    torsos: tuple[float, ...] = ()
    """Torso positions, lowest first."""

    def of(self, torsos: tuple[float, ...]) -> Rows:
        """Select the rows for some torso positions."""
        return self if torsos == self.torsos else replace(self.chosen(np.isin(self.torso, torsos)), torsos=torsos)

    @cached_property
    def places(self) -> Places:
        """Distinct positions of these rows."""
        _, first, spot_of_row = np.unique(self.spots, return_index=True, return_inverse=True)
        distinct, squares = np.unique(self.squares, return_inverse=True)
        distances = np.hypot(*self.v[first].T)
        return Places(
            first,
            spot_of_row,
            np.bincount(spot_of_row),
            np.argsort(spot_of_row, kind="stable"),
            (squares, len(distinct)),
            (float(distances.min(initial=np.inf)), float(distances.max(initial=0.0))),
        )


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """The u distinct v of rows (n,): clearance at a base pose does not depend on the torso's height."""

    first: Indices
    """A row with each v (u,)."""
    same: Indices
    """Number of the v of each row (n,)."""
    sizes: Indices
    """Number of rows with each v (u,)."""
    order: Indices
    """Rows, sorted by v (n,)."""
    squares: tuple[Indices, int]
    """Number of the square of side :data:`SPREAD` that contains each row (n,), and the number of squares."""
    away: tuple[float, float]
    """Smallest and greatest distance of base poses from the target [m]."""

    def rows_at(self, places: Indices) -> tuple[Indices, Indices]:
        """List the rows with the v of some places (k,): indices into these places, and rows."""
        sizes = self.sizes[places]
        entry = np.repeat(np.arange(len(places)), sizes)
        begins = np.cumsum(self.sizes) - self.sizes
        shift = np.repeat(begins[places] - (np.cumsum(sizes) - sizes), sizes)
        return entry, self.order[np.arange(len(entry)) + shift]


class InverseMap:
    """Reachability map prepared for inversion, level by level on demand."""

    def __init__(self, forward: ReachabilityMap) -> None:
        self.forward = forward
        self._exact: Array | None = None
        if is_bound(forward.arm):  # its rows are off the lattice: x, y [m] and heading [rad] of each
            q, roll = forward.postures[forward.rows["posture"]], forward.rows["roll"].astype(int)
            self._exact, _ = exact_places(carried(forward.arm), q, forward.grasp, forward.arm.frame, roll)
        exact = self._exact
        rows = forward.rows
        away = np.hypot(*exact.T[:2]) if exact is not None else CELL * np.hypot(rows["x"], rows["y"], dtype=np.float64)
        self.reach = float(away.max()) if len(rows) else 0.0
        """Greatest horizontal distance of a base from a point that it reaches [m]."""
        self._levels: dict[tuple[int, int, int], Rows] = {}
        self._known: dict[tuple[float, int, float, int], Rows] = {}

    def rows(self, z: float, roll: int, least: float, most: int) -> Rows:
        """Look up rows for a height [m] and roll, of at least a score, at most ``most`` per torso position."""
        key = (round(z, 6), roll, least, most)
        if key not in self._known:
            if len(self._known) > 64:
                self._known.clear()
            self._known[key] = self._find(z, roll, least, most)
        return self._known[key]

    def _find(self, z: float, roll: int, least: float, most: int) -> Rows:
        forward = self.forward
        parts = [self._level(forward.lowest_level - 1, 0, roll)]  # an empty level, so that there is always a part
        for torso, number, offset in forward.tiers(z):
            level = self._level(number, offset, roll)
            count = min(int(np.searchsorted(-level.score, -least, side="right")), most)
            parts.append(replace(level.chosen(np.arange(count)), torso=np.full(count, torso)))
        joined = Rows.joined(parts)
        joined = joined.chosen(np.argsort(-joined.score, kind="stable"))
        return replace(joined, torsos=tuple(np.unique(joined.torso).tolist()))

    def _level(self, level: int, offset: int, roll: int) -> Rows:
        """Select the rows at an offset of a level that a roll can use, without torso position, best first."""
        if (level, offset, roll) in self._levels:
            return self._levels[level, offset, roll]
        forward = self.forward
        flipped = forward.grasp is GraspClass.TOP and roll == -1
        those = forward.level(level)
        first, rows = those.start, forward.rows[those.start : those.stop]
        index = np.flatnonzero(rows["roll"] == (1 if flipped else roll))
        if forward.raised:
            index = index[forward.offsets[first + index] == offset]
        score = rows["score"][index].astype(float).round(6)
        order = np.argsort(-score, kind="stable")
        index, score = index[order], score[order]
        if self._exact is None:
            yaw = rows["yaw"][index].astype(float) * (2 * math.pi / YAWS)
            x, y = CELL * rows["x"][index].astype(float), CELL * rows["y"][index].astype(float)
        else:
            x, y, yaw = self._exact[first + index].T
        # A base at b with yaw t has the tip of this row at b + Rz(t) c, heading t + y. For a candidate at p with
        # heading g that means t = g - y and b = p - Rz(g) Rz(-y) c. Of this only Rz(g) and p depend on the world, so
        # that v = Rz(-y) c is computed here, once for all searches.
        c, s = np.cos(yaw), np.sin(yaw)
        v = np.stack([c * x + s * y, c * y - s * x], axis=1)
        if flipped:  # turning the hand by half a turn equals another heading
            v, yaw = -v, yaw - math.pi
        spots = first + index
        if self._exact is None:
            spots = (rows["x"][index].astype(np.intp) * MOST_CELLS + rows["y"][index]) * YAWS + rows["yaw"][index]
        cells = np.rint(v / SPREAD).astype(np.intp)
        half = 1 << (SQUARE_BITS // 2 - 1)
        squares = (cells[:, 0] + half) * 2 * half + cells[:, 1] + half
        self._levels[level, offset, roll] = Rows(v, yaw, score, first + index, np.zeros(len(index)), squares, spots)
        return self._levels[level, offset, roll]


_prepared: Latest[tuple[object, ...], InverseMap] = Latest(MOST_MAPS)
"""Maps that all arms of the process with the same kinematics share."""


class InverseMaps:
    """Inverse maps of the arms of one robot, prepared on demand."""

    def __init__(self, robot: str, report: Report) -> None:
        """Prepare none yet; ``report`` gets the progress of maps of the ``robot`` that have to be built."""
        self._robot, self._report = robot, report
        self._known: dict[tuple[str, GraspClass], InverseMap] = {}

    def __call__(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        """Get the map of an arm and grasp class."""
        key = (arm.name, grasp)
        if key not in self._known:
            facts = (arm.chain.digest, arm.lift, arm.frame, arm.seeds.tobytes(), grasp)
            self._known[key] = _prepared.of(
                facts, lambda: InverseMap(reachability_map(arm, grasp, self._robot, self._report))
            )
        return self._known[key]
