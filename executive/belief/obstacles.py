"""Obstacles known only by touch: small boxes from a pool that each planning world has in reserve."""

from __future__ import annotations

import math
from dataclasses import replace

from planlang.geometry import Pose
from planlang.protocols import Touch
from sim import Body, Scene

EDGE = 0.1
"""Side of the box assumed where something unknown was touched [m]."""
MOST = 12
"""Size of the pool; if it is used up, a new obstacle replaces the oldest."""
STORE = tuple(Body(f"obstacle {number}", Pose((0.0, 0.0, -1.0)), (EDGE, EDGE, EDGE)) for number in range(1, MOST + 1))
NAMES = tuple(body.name for body in STORE)


def with_store(scene: Scene) -> Scene:
    """Add the pool of boxes to a scene for planning; they are at no place until they are needed."""
    known = {body.name for body in scene.bodies}
    return replace(scene, bodies=(*scene.bodies, *(body for body in STORE if body.name not in known)))


def behind(touch: Touch) -> Pose:
    """Compute the map pose of a box one side of which is at the touched point."""
    x, y, z = (point - EDGE / 2 * normal for point, normal in zip(touch.point, touch.normal, strict=True))
    return Pose.planar(x, y, math.atan2(touch.normal[1], touch.normal[0]), z)
