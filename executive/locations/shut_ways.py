"""Doors between rooms that keep the base from a place as long as they are shut.

Asked of the world as it would be with them open: which of them are needed, and which of those the base gets to first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from executive.belief.planning_scene import PlanningScene
from planlang.geometry import Array
from sim.joints import Articulation

BEFORE = (0.5, 0.7, 0.9, 1.1)
"""Distances from a shut leaf at which a base stands that opens it [m]."""
AROUND = 8
"""Headings of the base to try there."""


def shut_on_the_way(scene: PlanningScene, is_possible: Callable[[PlanningScene], bool]) -> str | None:
    """Find the door between rooms to open first so that something becomes possible; None if no door keeps it from that.

    ``is_possible`` tells of a scene whether it is; in this one it is not.
    """
    doors = [one for one in scene.belief.joints.values() if one.frame and not one.is_open(scene.belief.joint(one.leaf))]
    if not doors or not is_possible(_opened(scene, doors)):
        return None
    needed = doors
    for door in doors if len(doors) > 1 else ():
        others = [one for one in needed if one is not door]
        if is_possible(_opened(scene, others)):
            needed = others
    drivable = scene.collisions.drivable()
    return next((one.leaf for one in needed if drivable(np.array(list(_before(scene, one)))).any()), None)


def _opened(scene: PlanningScene, doors: Iterable[Articulation]) -> PlanningScene:
    """Suppose that doors are open as far as they go."""
    for door in doors:
        scene = scene.supposing(scene.belief.with_leaf(door.leaf, door.upper))
    return scene


def _before(scene: PlanningScene, door: Articulation) -> Iterator[Array]:
    """Yield base poses (3,) on both sides of a door."""
    block = scene.bodies.block(door.leaf)
    normal = block.yaw + (math.pi / 2 if block.half_x > block.half_y else 0.0)
    for away in (sign * distance for distance in BEFORE for sign in (1.0, -1.0)):
        x, y = block.x + away * math.cos(normal), block.y + away * math.sin(normal)
        yield from (np.array([x, y, 2 * math.pi * turn / AROUND]) for turn in range(AROUND))
