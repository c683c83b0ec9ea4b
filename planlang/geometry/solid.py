"""Convex solids as points that span them: boxes, cylinders, spheres, capsules and the hulls of meshes."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from planlang.geometry.box import Size
from planlang.geometry.matrices import Array
from planlang.geometry.outline import AROUND
from planlang.geometry.pose import Pose


class SolidKind(StrEnum):
    """What a convex solid is; round ones lie along z."""

    BOX = "box"
    CYLINDER = "cylinder"
    SPHERE = "sphere"
    CAPSULE = "capsule"
    MESH = "mesh"


@dataclass(frozen=True, slots=True, eq=False)
class ConvexSolid:
    """A convex solid: its kind, its extents (those of a mesh are zero) and its pose.

    ``points`` (n, 3) [m] span it in its own frame; of a sphere it is the middle. ``beyond`` [m]: how far it goes beyond
    what they span.
    """

    kind: SolidKind
    size: Size
    pose: Pose
    points: Array
    radius: float = 0.0
    beyond: float = 0.0


def convex_solid(kind: SolidKind, size: Size, pose: Pose) -> ConvexSolid:
    """Return a primitive of some extents at a pose; the height of a capsule is without its caps."""
    x, y, z = size
    if kind == SolidKind.BOX:
        points = np.array([np.where(side, size, np.negative(size)) / 2 for side in np.ndindex(2, 2, 2)])
    elif kind == SolidKind.SPHERE:
        points = np.zeros((1, 3))
    else:
        points = _round(max(x, y) / 2, z, capped=kind == SolidKind.CAPSULE)
    if kind == SolidKind.SPHERE:
        return ConvexSolid(kind, size, pose, points, radius=max(x, y) / 2)
    share = {SolidKind.BOX: 0.0, SolidKind.CYLINDER: 1.0 - np.cos(np.pi / AROUND)}.get(
        kind, 1.0 - np.cos(np.pi / AROUND) ** 2
    )
    return ConvexSolid(kind, size, pose, points, beyond=float(share) * max(x, y) / 2)


def _round(radius: float, height: float, *, capped: bool) -> Array:
    """Return points on the rims of a cylinder along z, and on half balls at its ends."""
    turns = np.arange(AROUND) * 2 * np.pi / AROUND
    ring = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    tilts = np.arange(AROUND // 4 + 1 if capped else 1) * 2 * np.pi / AROUND
    levels = [(height / 2 + radius * np.sin(tilt), radius * np.cos(tilt)) for tilt in tilts]
    rows = [np.column_stack([wide * ring, np.full(AROUND, side * z)]) for z, wide in levels for side in (-1, 1)]
    return np.concatenate(rows)
