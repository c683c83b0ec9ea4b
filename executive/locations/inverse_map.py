"""Reachability maps prepared for inversion: rows for a height, as displacements that do not depend on the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.locations.columns import Columns
from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap, carried, is_bound
from executive.locations.reachability_building import exact_places
from executive.locations.reachability_files import reachability_map
from executive.robots.arms import ArmModel
from planlang.geometry import Array

SPREAD = 0.1
"""Side of a square in which the best place of one candidate comes first [m]."""
SQUARE_BITS = 22
"""Numbers of squares have no more bits."""
MOST_MAPS = 24
"""Maps that are kept prepared."""

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
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
    torsos: tuple[float, ...] = ()
    """Torso positions, lowest first."""

    def of(self, torsos: tuple[float, ...]) -> Rows:
        """Return the rows for some torso positions."""
        return self if torsos == self.torsos else replace(self.chosen(np.isin(self.torso, torsos)), torsos=torsos)


class InverseMap:
    """A reachability map prepared for inversion, level by level as they are asked for."""

    def __init__(self, forward: ReachabilityMap, exact: Array | None = None) -> None:
        """``exact``: x, y [m] and heading [rad] of the rows (n, 3), where they are not those of the lattice."""
        self.forward, self._exact = forward, exact
        rows = forward.rows
        away = np.hypot(*exact.T[:2]) if exact is not None else CELL * np.hypot(rows["x"], rows["y"], dtype=np.float64)
        self.reach = float(away.max()) if len(rows) else 0.0
        """Farthest that a base is from a point that it reaches, horizontally [m]."""
        self._levels: dict[tuple[int, int], Rows] = {}
        self._known: dict[tuple[float, int, float, int], Rows] = {}

    def rows(self, z: float, roll: int, least: float, most: int) -> Rows:
        """Rows for a height [m] and roll, of at least a score, no more than ``most`` for each torso position."""
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
        cells = np.rint(v / SPREAD).astype(np.intp)
        half = 1 << (SQUARE_BITS // 2 - 1)
        squares = (cells[:, 0] + half) * 2 * half + cells[:, 1] + half
        self._levels[level, roll] = Rows(v, yaw, score, first + index, np.zeros(len(index)), squares)
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

    def __init__(self, robot: str, say: Callable[[str], None]) -> None:
        """``robot``: its name. ``say`` is told of maps that have to be built, which takes seconds."""
        self._robot, self._say = robot, say
        self._known: dict[tuple[str, GraspClass], InverseMap] = {}

    def __call__(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        """Return the map of an arm and class of grasp."""
        key = (arm.name, grasp)
        if key not in self._known:
            facts = (arm.solver.chain.digest, arm.lift, arm.frame, arm.seeds.tobytes(), grasp)
            self._known[key] = inverse_map(facts, partial(self._prepare, arm, grasp))
        return self._known[key]

    def _prepare(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        forward = reachability_map(arm, grasp, self._robot, self._say)
        if not is_bound(arm):
            return InverseMap(forward)
        q, roll = forward.postures[forward.rows["posture"]], forward.rows["roll"].astype(int)
        return InverseMap(forward, exact_places(carried(arm), q, grasp, arm.frame, roll)[0])
