"""Places for the base anywhere on the floor and with any heading: what is not found where it is looked for first.

The floor is divided into cells. Those in which some conjunct surely holds nowhere are left out, the others are divided
again, until they are small or too many. At a place, headings that are between the same borders of what must and must
not be faced are equally good: one of each such interval is all that is looked at.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from executive.belief.free_floor import CELL, Floor
from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import FACING, HAIR, Facing
from executive.locations.relations import BaseDemand
from planlang.geometry import Array

MOST_CELLS = 4096
"""Cells that are looked at in one go."""
FIRST = 32
"""Cells along the longer side of the map at first."""
FINEST = 0.02
"""Side of a cell that is not divided [m]."""
COARSE = 2 * CELL
"""Of cells that are larger some are left out when they are too many to be divided [m]."""
TURNS = 8
"""Headings that are looked at where nothing must or must not be faced."""
MOST_TIGHT = 1000
"""Bases that are looked at where there is no room to turn anywhere."""
FITS = 1e-3
"""Room that counts for a robot that fits as it is turned [m]."""
SQUARE = 0.3
"""Side of the squares by which places are spread [m]."""


def all_places(demand: BaseDemand, scene: PlanningScene) -> tuple[Array, Array, NDArray[np.intp]]:
    """Bases (n, 3) at which all that is asked of the floor holds; room around each and its square as in the grid."""
    floor = scene.collisions.floor()
    points = _points(demand, floor, scene)
    headings = _headings(demand, points, scene)
    bases = np.column_stack([np.repeat(points, headings.shape[1], axis=0), headings.ravel()])
    rows = np.repeat(np.arange(len(points)), headings.shape[1])
    for term in demand.areas:
        good = term.score(bases if isinstance(term, Facing) else bases[:, :2]) > 0
        bases, rows = bases[good], rows[good]
    room = floor.at(points).round(9)[rows]
    if len(room) and room.max() <= 0:
        tight = np.unique(np.linspace(0, len(room) - 1, min(MOST_TIGHT, len(room))).astype(np.intp))
        room[tight[floor.holds(bases[tight])]] = FITS
    x_min, y_min, *_ = floor.bounds
    cells = ((bases[:, :2] - (x_min, y_min)) // SQUARE).astype(np.intp)
    return bases, room, cells[:, 0] * (1 << 31) + cells[:, 1]


def _points(demand: BaseDemand, floor: Floor, scene: PlanningScene) -> Array:
    """Places (n, 2) of which each is the middle of a cell in which the demand may hold."""
    x_min, y_min, x_max, y_max = floor.bounds
    side = max(x_max - x_min, y_max - y_min, FINEST) / FIRST
    counts = [max(1, math.ceil(length / side)) for length in (x_max - x_min, y_max - y_min)]
    size = np.array([(x_max - x_min) / counts[0], (y_max - y_min) / counts[1]])
    steps = np.meshgrid(*(np.arange(count) + 0.5 for count in counts), indexing="ij")
    points: Array = np.stack(steps, axis=-1).reshape(-1, 2) * size + (x_min, y_min)
    while True:
        points = points[_may_hold(demand, points, float(np.hypot(*size)) / 2, floor, scene)]
        crowded = 4 * len(points) > MOST_CELLS
        if size.max() <= FINEST or (crowded and size.max() <= COARSE):
            return points
        if crowded:
            points = points[:: -(-4 * len(points) // MOST_CELLS)]
        size = size / 2
        quarters = np.array([(a, b) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]) * size
        points = np.asarray(points[:, None] + quarters).reshape(-1, 2)


def _may_hold(
    demand: BaseDemand, points: Array, within: float, floor: Floor, scene: PlanningScene
) -> NDArray[np.bool_]:
    """Whether the demand may hold within so many metres of points (n, 2), as far as can be told from distances (n,)."""
    good = np.ones(len(points), bool)
    for term in demand.areas:
        if not isinstance(term, Facing):
            good[good] = term.nearly(points[good], within)
    for name in demand.seen:
        block = scene.bodies.block(name)
        good &= np.hypot(points[:, 0] - block.x, points[:, 1] - block.y) <= scene.visibility.camera_range()[1] + within
    faced = [term for term in demand.areas if isinstance(term, Facing) and not term.negated]
    for one, other in itertools.combinations(faced, 2):
        apart = np.abs(np.angle(np.exp(1j * (one.bearing(points) - other.bearing(points)))))
        good &= apart <= 2 * FACING + _swing(one, points, within) + _swing(other, points, within)
    good[good] = floor.nearly(points[good], within)
    return good


def _swing(term: Facing, points: Array, within: float) -> Array:
    """How much bearings change at most within so many metres of points (n, 2), (n,) [rad]."""
    away = np.hypot(points[:, 0] - term.block.x, points[:, 1] - term.block.y)
    return np.where(away > within, np.arcsin(np.minimum(within / np.maximum(away, 1e-9), 1.0)), math.pi)


def _headings(demand: BaseDemand, points: Array, scene: PlanningScene) -> Array:
    """Headings (n, m) at points (n, 2), those towards what a place is about first.

    They are the middles between the borders of what is faced; some directions are borders as well, that there are more.
    """
    facing = [term for term in demand.areas if isinstance(term, Facing)]
    blocks = [*(term.block for term in facing), *(scene.bodies.block(name) for name in demand.seen)]
    blocks += [term.block for term in demand.areas if term.block is not None]
    bearing = np.zeros(len(points))
    if blocks:
        bearing = np.arctan2(blocks[0].y - points[:, 1], blocks[0].x - points[:, 0])
    borders = [bearing + (turn + 0.5) * 2 * math.pi / TURNS for turn in range(TURNS)]
    borders += [term.bearing(points) + side for term in facing for side in (-FACING - HAIR, FACING + HAIR)]
    ordered = np.sort((np.stack(borders, axis=1) - bearing[:, None]) % (2 * math.pi), axis=1)
    after = np.concatenate([ordered[:, 1:], ordered[:, :1] + 2 * math.pi], axis=1)
    turns = np.mod((ordered + after) / 2 + math.pi, 2 * math.pi) - math.pi
    ahead = np.argsort(np.abs(turns).round(9), axis=1, kind="stable")
    return np.asarray(bearing[:, None] + np.take_along_axis(turns, ahead, axis=1))
