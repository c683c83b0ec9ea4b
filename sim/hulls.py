"""Convex shapes of the robot and of bodies as points that span them, as PyBullet takes them for contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from planlang.geometry import Array, Pose
from sim.engine import bullet

AROUND = 16
"""Points on a circle that stands for a round shape; a multiple of four."""

Size = tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Hulled:
    """A convex shape: "box", "cylinder", "sphere", "capsule" or "mesh", its extents, those of a mesh zero, its pose.

    ``points`` (n, 3) [m] span it in its own frame; of a sphere it is the middle. ``beyond`` [m]: how far it goes beyond
    what they span.
    """

    kind: str
    size: Size
    pose: Pose
    points: Array
    radius: float = 0.0
    beyond: float = 0.0


def hull_of(kind: str, size: Size, pose: Pose) -> Hulled:
    """A primitive of some extents at a pose; the height of a capsule is without its caps."""
    x, y, z = size
    if kind == "box":
        points = np.array([np.where(side, size, np.negative(size)) / 2 for side in np.ndindex(2, 2, 2)])
    elif kind == "sphere":
        points = np.zeros((1, 3))
    else:
        points = _round(max(x, y) / 2, z, capped=kind == "capsule")
    if kind == "sphere":
        return Hulled(kind, size, pose, points, radius=max(x, y) / 2)
    share = {"box": 0.0, "cylinder": 1.0 - np.cos(np.pi / AROUND)}.get(kind, 1.0 - np.cos(np.pi / AROUND) ** 2)
    return Hulled(kind, size, pose, points, beyond=float(share) * max(x, y) / 2)


def _round(radius: float, height: float, *, capped: bool) -> Array:
    """Points on the rims of a cylinder along z, and on half balls at its ends."""
    turns = np.arange(AROUND) * 2 * np.pi / AROUND
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    tilts = np.arange(AROUND // 4 + 1 if capped else 1) * 2 * np.pi / AROUND
    levels = [(height / 2 + radius * np.sin(tilt), radius * np.cos(tilt)) for tilt in tilts]
    rows = [np.column_stack([wide * ring, np.full(AROUND, side * z)]) for z, wide in levels for side in (-1, 1)]
    return np.concatenate(rows)


def hulls_of(client: int, uid: int, index: int, at: Pose) -> list[Hulled]:
    """The shapes of a link whose frame of mass is at a pose."""
    shapes = bullet.getCollisionShapeData(uid, index, physicsClientId=client)
    found = []
    for shape in shapes:
        a, b, c = shape[3]
        pose = at @ Pose(shape[5], shape[6])
        match shape[2]:
            case bullet.GEOM_BOX:
                found.append(hull_of("box", (a, b, c), pose))
            case bullet.GEOM_SPHERE:
                found.append(hull_of("sphere", (2 * a, 2 * a, 2 * a), pose))
            case bullet.GEOM_CYLINDER:
                found.append(hull_of("cylinder", (2 * b, 2 * b, a), pose))
            case bullet.GEOM_CAPSULE:
                found.append(hull_of("capsule", (2 * b, 2 * b, a), pose))
    if any(shape[2] == bullet.GEOM_MESH for shape in shapes):  # the vertices of all meshes of a link come at once
        points = np.array(bullet.getMeshData(uid, index, physicsClientId=client)[1]).reshape(-1, 3)
        found.append(Hulled("mesh", (0.0, 0.0, 0.0), at, points))
    return found
