"""Where a robot starts when nobody says so."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.support import footprint
from planlang.geometry import Array
from planlang.geometry.box import corners
from sim import Scene
from sim.scene import BodyShape

GRIDS = ((10.0, 0.05), (50.0, 0.25), (1000.0, 5.0))
"""How far from the centre places are looked for, and how far apart they are [m]; coarser only when there is none."""

CLEARANCE = 0.1
"""Free distance around the robot's radius [m]."""

BLOCK = 500
"""Places that are looked at in one go."""

HEADROOM = 2.0
"""Bodies above this height are driven under [m]."""


def default_starts(scene: Scene, radius: float) -> Iterator[tuple[float, float, float]]:
    """Free poses (x, y, yaw 0), those nearest the centre of the room, or of all things without one, first.

    Free: a disc of ``radius`` and :data:`CLEARANCE` [m] touches no body and lies within the room. Of equally near
    places the one with the smallest x, then y is the first. A coarser grid is looked at only when a finer has none.
    """
    rooms = [body for body in scene.bodies if body.shape is BodyShape.ROOM]
    x_min, y_min, x_max, y_max = scene.bounds
    centre = np.array(rooms[0].pose.position[:2] if rooms else ((x_min + x_max) / 2, (y_min + y_max) / 2))
    inner = [footprint(room) for room in rooms]
    outer = [
        footprint(body)
        for body in scene.bodies
        if body.shape not in (BodyShape.MARKER, BodyShape.ROOM) and corners(body.pose, body.size)[:, 2].min() < HEADROOM
    ]
    found = False
    for reach, spacing in GRIDS:
        points = _grid(centre, min(reach, max(x_max - x_min, y_max - y_min)), spacing)
        points = points[np.all((points >= (x_min, y_min)) & (points <= (x_max, y_max)), axis=1)]
        for first in range(0, len(points), BLOCK):
            block = points[first : first + BLOCK]
            free = block[_free(block, inner, outer, radius + CLEARANCE)]
            found = found or len(free) > 0
            yield from ((x + 0.0, y + 0.0, 0.0) for x, y in free.tolist())
        if found:
            return


def _grid(centre: Array, reach: float, spacing: float) -> Array:
    """Points (n, 2) up to ``reach`` from the centre along each axis, the nearest first, then by x, then by y."""
    steps = int(np.ceil(reach / spacing))
    axis = spacing * np.arange(-steps, steps + 1)
    offsets = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    order = np.lexsort((offsets[:, 1], offsets[:, 0], np.hypot(*offsets.T).round(6)))
    points: Array = (offsets[order] + centre).round(6)
    return points


def _free(points: Array, rooms: Sequence[Array], bodies: Sequence[Array], keep: float) -> NDArray[np.bool_]:
    """Which of (m, 2) points keep a distance [m] from the outlines of all bodies and from the edges of a room, (m,)."""
    free = np.ones(len(points), bool)
    if rooms:
        free &= np.any([_signed_distance(room, points) <= -keep for room in rooms], axis=0)
    for body in bodies:
        free &= _signed_distance(body, points) >= keep
    return free


def _signed_distance(polygon: Array, points: Array) -> Array:
    """Distance of (m, 2) points to a counter-clockwise convex polygon (n, 2), negative inside, (m,)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    lengths = np.maximum(np.linalg.norm(edges, axis=1), 1e-12)
    arrows = points[:, None] - polygon[None]
    along = np.clip(np.einsum("mnk,nk->mn", arrows, edges) / lengths**2, 0.0, 1.0)
    away = np.linalg.norm(arrows - along[..., None] * edges, axis=2).min(axis=1)
    side = (edges[:, 0] * arrows[..., 1] - edges[:, 1] * arrows[..., 0]) / lengths
    signed: Array = np.where(np.all(side >= 0, axis=1), -away, away)
    return signed
