"""What stands on what, and what lies inside what, by the boxes of bodies."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.box import corners
from planlang.geometry.outline import inside, outline_of
from sim import Body, Scene
from sim.scene import BodyShape

PENETRATION = 0.02
"""How far a thing may sink into what it stands on [m]."""

GAP = 0.03
"""How far it may hover above it [m]; the cameras that made real maps were not better."""

FLOOR = "floor"
"""What stands on no body but on the ground."""


def footprint(body: Body, pose: Pose | None = None) -> Array:
    """Convex outline of the body seen from above, counter-clockwise, (n, 2) [m]."""
    return outline_of(corners(pose or body.pose, body.size)[:, :2])


def support_of(scene: Scene, name: str, poses: Mapping[str, Pose] | None = None) -> str | None:
    """Name of the body that a body stands on, :data:`FLOOR`, or None when there is nothing below it.

    The support is the highest top within :data:`PENETRATION` above and :data:`GAP` below the body's lowest point, under
    the body's centre. ``poses`` replace those of the scene.
    """
    poses = poses or {}
    body = scene.body(name)
    pose = poses.get(name, body.pose)
    low = float(corners(pose, body.size)[:, 2].min())
    best: tuple[float, str] | None = (0.0, FLOOR) if -PENETRATION <= low <= GAP else None
    for other in scene.bodies:
        if other.name == name or other.shape in (BodyShape.MARKER, BodyShape.ROOM):
            continue
        place = poses.get(other.name, other.pose)
        top = float(corners(place, other.size)[:, 2].max())
        if top - PENETRATION <= low <= top + GAP and inside(footprint(other, place), pose.position):
            best = max(best, (top, other.name)) if best else (top, other.name)
    return best[1] if best else None


def holds(container: Body, body: Body) -> bool:
    """Whether the centre of a body lies inside the box of another, below its top."""
    if container.shape in (BodyShape.MARKER, BodyShape.ROOM, BodyShape.PERSON):
        return False
    local = container.pose.inverse() @ body.pose
    half = np.asarray(container.size) / 2
    return bool(np.all(np.abs(np.asarray(local.position)) < half))
