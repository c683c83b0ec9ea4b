"""Whether a thing that is moved in a map has room there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from executive.maps.supports import FLOOR
from planlang.geometry import Array, Pose
from planlang.geometry.shapes import corners, footprint, inside
from sim import Scene
from sim.scene import BodyShape

GRAZING = 5e-3
"""Overlap that does not count [m]: what stands on something grazes it."""


def is_free(scene: Scene, poses: Mapping[str, Pose], name: str, support: str | None) -> bool:
    """Check whether a body has room at another pose, with what moves along, and stays over what it stands on.

    ``poses`` are the new ones. It may overlap what it overlaps already, such as the furniture that it is in.
    """
    body, at = scene.body(name), poses[name]
    before, after = _Prism(body.pose, body.size), _Prism(at, body.size)
    if support is not None and support != FLOOR and support not in poses:
        below = scene.body(support)
        if not inside(footprint(below.pose, below.size), at.position):
            return False
    for other in scene.bodies:
        if other.name in poses or other.shape in (BodyShape.ROOM, BodyShape.MARKER):
            continue
        prism = _Prism(other.pose, other.size)
        if after.meets(prism) and not before.meets(prism):
            return False
    return True


class _Prism:
    """Upright prism around a box."""

    def __init__(self, pose: Pose, size: tuple[float, float, float]) -> None:
        heights = corners(pose, size)[:, 2]
        self.low, self.high = float(heights.min()), float(heights.max())
        self.outline = footprint(pose, size)

    def meets(self, other: _Prism) -> bool:
        """Check whether two prisms overlap by more than :data:`GRAZING`."""
        if min(self.high, other.high) - max(self.low, other.low) <= GRAZING:
            return False
        return not (_parted(self.outline, other.outline) or _parted(other.outline, self.outline))


def _parted(polygon: Array, other: Array) -> bool:
    """Check whether an edge of a convex polygon (n, 2) parts it from another (separating axis)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0] / lengths[lengths > 0, None]
    own, others = polygon @ normals.T, other @ normals.T
    overlap = np.minimum(own.max(axis=0), others.max(axis=0)) - np.maximum(own.min(axis=0), others.min(axis=0))
    return bool((overlap <= GRAZING).any())
