"""Obstacles that nothing but touch tells of: small boxes that a planning world has in store for them."""

from __future__ import annotations

import math
from dataclasses import replace

from planlang.geometry import Pose
from planlang.protocols import Touch
from sim import Body, Scene

EDGE = 0.1
"""Side of the box that is believed to be where something unknown was touched [m]."""
MOST = 12
"""Obstacles that are remembered; the oldest one is forgotten for another."""
STORE = tuple(Body(f"obstacle {number}", Pose((0.0, 0.0, -1.0)), (EDGE, EDGE, EDGE)) for number in range(1, MOST + 1))
NAMES = tuple(body.name for body in STORE)


def with_store(scene: Scene) -> Scene:
    """Return a scene for planning: with boxes in store, which are nowhere until they are needed."""
    known = {body.name for body in scene.bodies}
    return replace(scene, bodies=(*scene.bodies, *(body for body in STORE if body.name not in known)))


def behind(touch: Touch) -> Pose:
    """Return the pose of a box whose side is where the robot was touched."""
    x, y, z = (at - EDGE / 2 * along for at, along in zip(touch.point, touch.normal, strict=True))
    return Pose.planar(x, y, math.atan2(touch.normal[1], touch.normal[0]), z)
