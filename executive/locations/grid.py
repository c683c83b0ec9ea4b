"""Places for the base that need not reach anything: a grid around what they are about, in its frame."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from executive.belief.free_floor import CELL
from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import Facing
from executive.locations.doors import Clear
from executive.locations.relations import BaseDemand
from planlang.geometry import Array

TURNS = (0.0, 0.5, -0.5)
"""Headings relative to facing what a place is about [rad]."""
AWAY = (math.pi, math.pi / 2, -math.pi / 2)
"""The same where it must not be faced."""
COARSE = 2 * CELL
"""Distance of neighbouring places [m]."""


def around_places(demand: BaseDemand, scene: PlanningScene) -> tuple[Array, Array, NDArray[np.intp]]:
    """Bases (n, 3) worth a look, the room around each (n,) [m], and the square of 30 cm that each is in (n,)."""
    middle, yaw, radius, looked_at = _anchor(demand, scene)
    half = math.ceil(radius / COARSE)
    steps = np.arange(-half, half + 1) * COARSE
    along, across = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    c, s = math.cos(yaw), math.sin(yaw)
    points = np.stack([middle[0] + c * along - s * across, middle[1] + s * along + c * across], axis=1)
    room = scene.collisions.floor().at(points).round(9)
    squares = np.add.outer(np.arange(2 * half + 1) // 3 * 100_000, np.arange(2 * half + 1) // 3).ravel()
    inside = room > -np.inf
    points, room, squares = points[inside], room[inside], squares[inside]
    bearing = np.arctan2(looked_at[1] - points[:, 1], looked_at[0] - points[:, 0])
    turned = [term.negated for term in demand.areas if isinstance(term, Facing)]
    turns = TURNS if not turned else AWAY if all(turned) else (0.0,)
    bases = np.concatenate([np.column_stack([points, bearing + turn]) for turn in turns])
    return bases, np.tile(room, len(turns)), np.tile(squares, len(turns))


def _anchor(demand: BaseDemand, scene: PlanningScene) -> tuple[tuple[float, float], float, float, tuple[float, float]]:
    """Middle, heading and radius [m] of where to look, and the point to face: of the conjunct that says most."""
    found: list[tuple[float, tuple[float, float], float, Block]] = []
    for name in demand.seen:
        block = scene.bodies.block(name)
        found.append((min(scene.visibility.camera_range()[1], 2.6), (block.x, block.y), block.yaw, block))
    for term in demand.areas:
        if isinstance(term, (Clear, Facing)) or term.negated or math.isinf(term.most):
            continue
        x, y, yaw, radius = term.anchor()
        found.append((radius, (x, y), yaw, term.block))
    facing = next((term.block for term in demand.areas if isinstance(term, Facing) and not term.negated), None)
    if found:
        radius, middle, yaw, block = min(found, key=lambda item: item[0])
        facing = facing or block
        return middle, yaw, radius, (facing.x, facing.y)
    x_min, y_min, x_max, y_max = scene.collisions.floor().bounds
    middle = ((x_min + x_max) / 2, (y_min + y_max) / 2)
    radius = max(x_max - x_min, y_max - y_min) / 2
    named = facing or next((term.block for term in demand.areas if term.block is not None), None)
    return middle, 0.0, min(radius, 10.0), middle if named is None else (named.x, named.y)
