"""Reachability maps prepared for inversion: rows for a height, as displacements that do not depend on the world."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap
from executive.locations.reachability_sampling import exact_places, is_bound
from executive.locations.surroundings import ArmModel, Surroundings
from planlang.protocols import Array

SPREAD = 0.1
"""Of places of one way in a square of this side the best comes first [m]."""
SQUARE_BITS = 22
"""Numbers of squares have no more bits."""
MOST_MAPS = 24
"""Maps that are kept prepared."""

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of a map that a way can use at its height, best first."""

    v: Array
    """(n, 2) [m]."""
    yaw: Array
    score: Array
    row: Indices
    torso: Array
    squares: Indices
    """Number of the square of side :data:`SPREAD` that v is in."""
    torsos: tuple[float, ...]
    """Torso positions, lowest first."""

    def of(self, torsos: tuple[float, ...]) -> Rows:
        """Those for some torso positions."""
        if torsos == self.torsos:
            return self
        kept = np.isin(self.torso, torsos)
        v, yaw, score = self.v[kept], self.yaw[kept], self.score[kept]
        return Rows(v, yaw, score, self.row[kept], self.torso[kept], self.squares[kept], torsos)


class InverseMap:
    """A reachability map prepared for inversion."""

    def __init__(self, forward: ReachabilityMap, exact: Array | None = None) -> None:
        """``exact``: x, y [m] and heading [rad] of the rows (n, 3), where they are not those of the lattice."""
        self.forward = forward
        rows = forward.rows
        if exact is None:
            yaw = rows["yaw"].astype(float) * (2 * math.pi / YAWS)
            x, y = CELL * rows["x"].astype(float), CELL * rows["y"].astype(float)
        else:
            x, y, yaw = exact.T
        c, s = np.cos(yaw), np.sin(yaw)
        self._v = np.stack([c * x + s * y, c * y - s * x], axis=1)
        self._yaw = yaw
        self._score = rows["score"].astype(float).round(6)
        self._roll = rows["roll"].astype(np.int64)
        self._level = rows["z"].astype(np.int64)
        self.reach = float(np.linalg.norm(self._v, axis=1).max()) if len(rows) else 0.0
        """Farthest that a base is from a point that it reaches, horizontally [m]."""
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
        flipped = forward.grasp is GraspClass.TOP and roll == -1
        chosen: list[Indices] = []
        torsos: list[Array] = []
        for torso in forward.heights(z):
            rise = float(forward.lift.rise(torso)) if forward.lift is not None else 0.0
            level = round((z - rise) / CELL)
            fitting = (self._level == level) & (self._score >= least) & (flipped | (self._roll == roll))
            index = np.flatnonzero(fitting)
            index = index[np.argsort(-self._score[index], kind="stable")][:most]
            chosen.append(index)
            torsos.append(np.full(len(index), torso))
        rows = np.concatenate(chosen) if chosen else np.zeros(0, np.intp)
        heights = np.concatenate(torsos) if torsos else np.zeros(0)
        order = np.argsort(-self._score[rows], kind="stable")
        rows, heights = rows[order], heights[order]
        v, yaw = self._v[rows], self._yaw[rows]
        if flipped:  # a turned hand is the same as another heading
            v, yaw = -v, yaw - math.pi
        cells = np.rint(v / SPREAD).astype(np.intp)
        half = 1 << (SQUARE_BITS // 2 - 1)
        squares = (cells[:, 0] + half) * 2 * half + cells[:, 1] + half
        return Rows(v, yaw, self._score[rows], rows, heights, squares, tuple(np.unique(heights).tolist()))


_prepared: dict[tuple[object, ...], InverseMap] = {}


def inverse_map(
    forward: ReachabilityMap, facts: tuple[object, ...], exact: Callable[[], Array | None] = lambda: None
) -> InverseMap:
    """The map of an arm prepared for inversion, once in a process for all maps of the same ``facts``."""
    if facts not in _prepared:
        while len(_prepared) >= MOST_MAPS:
            del _prepared[next(iter(_prepared))]
        _prepared[facts] = InverseMap(forward, exact())
    return _prepared[facts]


class InverseMaps:
    """The maps of the arms of one robot, prepared when they are first asked for."""

    def __init__(self, around: Surroundings) -> None:
        self._around = around
        self._known: dict[tuple[str, GraspClass], InverseMap] = {}

    def __call__(self, arm: ArmModel, grasp: GraspClass) -> InverseMap:
        """The map of an arm and class of grasp."""
        key = (arm.name, grasp)
        if key not in self._known:
            facts = (arm.solver.chain.digest, arm.lift, arm.frame, arm.seeds.tobytes(), grasp)
            forward = self._around.reachability(arm, grasp)
            self._known[key] = inverse_map(forward, facts, partial(_exact, arm, forward))
        return self._known[key]


def _exact(arm: ArmModel, forward: ReachabilityMap) -> Array | None:
    """Where the rows of an arm are that was mapped by sampling; None of one whose rows are at poses of the lattice."""
    chain = arm.solver.chain
    chain = chain if forward.lift is None else chain.locked({forward.lift.joint: forward.lift.lowest})
    if not is_bound(chain):
        return None
    roll = forward.rows["roll"].astype(int)
    return exact_places(chain, forward.rows["q"].astype(float), forward.grasp, forward.frame, roll)[0]
