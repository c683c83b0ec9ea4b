"""Places between those of the maps: candidates are moved by centimetres to where the base has room.

Places of one way and heading are as far apart as the cells of a map. Where the room of the base is narrower than that,
the best of them lie beside it, although the arm would reach from a few centimetres further as well.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from executive.belief.free_floor import CELL, HAIR, Floor
from executive.locations.candidates import Candidates
from executive.locations.reachability import YAWS
from planlang.geometry import Array

FINER = 2
"""Places on the side of a cell, and headings for each of a map: what is moved by less than the distance of a map's
places can mostly be reached from its postures.
"""
HALF = 1 << 12
"""More cells than a place is away in any direction."""


def between(found: Candidates, floor: Floor, middle: Array, yaw: float, most: int) -> Candidates:
    """Candidates, each at the nearest place with room of a lattice around ``middle`` (2,) that is turned by ``yaw``.

    Of each way the best are moved, no more than ``most`` in all. Those near to which there is no room are left out, of
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


def _distinct(found: Candidates, place: Array) -> Candidates:
    """Of candidates with the same arm, way, place (m,) and torso the best one, ranked anew."""
    order = np.lexsort((-found.scores.round(9), found.torsos, place, found.ways, found.arms))
    keys = np.column_stack([found.arms, found.ways, place, found.torsos])[order]
    first = np.append(True, (np.diff(keys, axis=0) != 0).any(axis=1))[: len(keys)]
    found = found.chosen(order[first])
    found = found.chosen(np.lexsort((-found.scores.round(9), found.ways, found.arms)))
    ways = np.column_stack([found.arms, found.ways])
    begins = np.append(True, (np.diff(ways, axis=0) != 0).any(axis=1))[: len(ways)]
    rows = np.arange(len(ways))
    return replace(found, ranks=rows - np.maximum.accumulate(np.where(begins, rows, 0)))
