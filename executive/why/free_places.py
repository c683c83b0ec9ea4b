"""Whether things that are moved in a map have room there, and are at rest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.maps.supports import FLOOR, GAP, PENETRATION, Standing
from planlang.advice import TRANSLATION, Change
from planlang.geometry import Array, Pose
from planlang.geometry.areas import HAIR
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import corners, footprint
from sim import Body, Scene
from sim.scene import BodyShape

GRAZING = 5e-3
"""Overlap that does not count [m]: what stands on something grazes it."""


def poses_after(changes: Iterable[Change], scene: Scene) -> dict[str, Pose]:
    """Things that changes move -> their new poses."""
    poses = dict[str, Pose]()
    for change in changes:
        if change.what == TRANSLATION and isinstance(change.value, tuple):
            x, y, z = map(float, change.value)
            poses[str(change.thing)] = replace(scene.body(str(change.thing)).pose, position=(x, y, z))
    return poses


def is_free(scene: Scene, poses: Mapping[str, Pose]) -> bool:
    """Check whether bodies, which move together, have room at their new ``poses`` in the map.

    They may overlap what they overlap already; but what is inside of something, such as a cabinet or a room, does not
    get into its walls.
    """
    for name, at in poses.items():
        body = scene.body(name)
        if body.shape in (BodyShape.ROOM, BodyShape.MARKER):
            continue
        before, after = _Prism(body.pose, body.size), _Prism(at, body.size)
        for other in scene.bodies:
            if other.name in poses or other.shape is BodyShape.MARKER:
                continue
            if other.shape is BodyShape.ROOM:
                if _is_over(other, body.pose.position) and not _stays_inside(body, at, other):
                    return False
                continue
            if not after.meets(prism := _Prism(other.pose, other.size)):
                continue
            holds = other.wall > 0 or is_in(body.pose, other)
            if not before.meets(prism) or (holds and not _stays_inside(body, at, other)):
                return False
    return True


def is_at_rest(scene: Scene, poses: Mapping[str, Pose], name: str, standing: Standing) -> bool:
    """Check whether a body is at rest at its new pose, where those of ``poses`` are moved.

    A thing rests on a support, on the floor of a compartment, or as high as before in the furniture that it is in.
    Furniture is as high as the map states it, unless it stands on other furniture. ``standing`` is that of the scene.
    """
    body, at = scene.body(name), poses[name]
    if not body.movable and standing.support(name) in (None, FLOOR):
        return True
    if Standing(scene, poses).support(name) is not None:
        return True
    low, rise = float(corners(at, body.size)[:, 2].min()), at.position[2] - body.pose.position[2]
    for other in scene.bodies:
        if other.name not in poses and is_in(at, other):
            floor = _inside_of(other, at.position)
            ground = float(corners(floor.pose, floor.size)[:, 2].min())
            lies = bool(other.cavities) and -PENETRATION <= low - ground <= GAP
            if lies or (abs(rise) <= HAIR and is_in(body.pose, other)):
                return True
    return False


def is_in(pose: Pose, other: Body) -> bool:
    """Check whether a point is inside the box of a body."""
    if other.shape is not BodyShape.BOX:
        return False
    local = (other.pose.inverse() @ pose).position
    return all(abs(at) <= extent / 2 for at, extent in zip(local, other.size, strict=True))


def _is_over(room: Body, position: Sequence[float]) -> bool:
    x, y, _ = (room.pose.inverse() @ Pose((position[0], position[1], position[2]))).position
    return abs(x) <= room.size[0] / 2 and abs(y) <= room.size[1] / 2


def _stays_inside(body: Body, at: Pose, other: Body) -> bool:
    """Check whether a body sticks out of the inside of another no further than before."""
    return _outside(body, at, other) <= max(_outside(body, body.pose, other), GRAZING)


def _outside(body: Body, at: Pose, other: Body) -> float:
    """How far a body at a pose sticks out of the inside of another, to the sides [m]; 0 if it does not."""
    inner = _inside_of(other, body.pose.position)
    ground = footprint(at, body.size)
    points = np.column_stack([ground, np.full(len(ground), inner.pose.position[2])])
    local = rotated(inner.pose.rotation.T, points - np.asarray(inner.pose.position))
    return max(float((np.abs(local[:, :2]) - np.asarray(inner.size[:2]) / 2).max()), 0.0)


def _inside_of(other: Body, position: Sequence[float]) -> Body:
    """The inside of a body around a point, as a box: its cavity there, as far as the body reaches, else all of it."""
    local = (other.pose.inverse() @ Pose((position[0], position[1], position[2]))).position
    half = np.asarray(other.size) / 2
    for cavity in () if other.shape is BodyShape.ROOM else other.cavities:  # those of a room are openings
        centre, reach = np.asarray(cavity.centre), np.asarray(cavity.size) / 2
        if (np.abs(local - centre) <= reach).all():
            low, high = np.maximum(centre - reach, -half), np.minimum(centre + reach, half)
            x, y, z = ((low + high) / 2).tolist()
            width, depth, height = (high - low).tolist()
            return Body(other.name, other.pose @ Pose((x, y, z)), (width, depth, height))
    x, y, z = other.size
    return Body(other.name, other.pose, (x - 2 * other.wall, y - 2 * other.wall, z))


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
