"""What the bodies of a map stand on: the highest top below them, or the floor inside a hollow one, as a tray is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from executive.maps.in_hand import STOWED
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import corners, footprint, inside
from sim import Body, Scene
from sim.scene import BodyShape

UPRIGHT = 0.999
"""Least cosine of the tilt of a hollow body in which things stand on the floor."""

PENETRATION = 0.02
"""Greatest penetration of an object into its support [m]."""

ROUNDING = 1e-6
"""Tolerance for rounding errors [m]."""

GAP = 0.03
"""Greatest gap between an object and its support [m]: the accuracy of the cameras that made real maps."""

FLOOR = "floor"
"""Support of a body that stands on the ground."""


class Standing:
    """Finds what the bodies of a scene stand on."""

    def __init__(self, scene: Scene, poses: Mapping[str, Pose] | None = None) -> None:
        """Index the bodies by their bounding boxes; ``poses``, by name, override those of the scene."""
        self._poses = {body.name: (poses or {}).get(body.name, body.pose) for body in scene.bodies}
        self._scene = scene
        solid = [body for body in scene.bodies if body.shape not in (BodyShape.MARKER, BodyShape.ROOM)]
        self._names = [body.name for body in solid]
        matrices = Pose.matrices(self._poses[name] for name in self._names)
        half = np.array([body.size for body in solid]).reshape(-1, 3) / 2
        self._centres, reach = matrices[:, :3, 3], rotated(np.abs(matrices[:, :3, :3]), half)
        self._low, self._high = self._centres - reach, self._centres + reach
        walls = np.array([body.wall for body in solid])
        self._floors = np.where(walls > 0, self._low[:, 2] + walls, self._high[:, 2])

    def support(self, name: str) -> str | None:
        """Find the name of the body that a body stands on, or :data:`FLOOR`; None if it stands on nothing.

        The support is the body with the highest top that is below the centre of the body, and from :data:`GAP` below
        its lowest point to :data:`PENETRATION` above it. In a hollow body it may be as low as the floor.
        """
        pose = self._poses[name]
        low, place = float(corners(pose, self._scene.body(name).size)[:, 2].min()), np.array(pose.position[:2])
        best: tuple[float, str] | None = (0.0, FLOOR) if -PENETRATION <= low <= GAP else None
        tops = self._high[:, 2]
        near = (self._floors - PENETRATION - ROUNDING <= low) & (low <= tops + GAP + ROUNDING)
        near &= ((self._low[:, :2] - ROUNDING <= place) & (place <= self._high[:, :2] + ROUNDING)).all(axis=1)
        for index in np.flatnonzero(near).tolist():
            other = self._names[index]
            at, body = self._poses[other], self._scene.body(other)
            top = float(corners(at, body.size)[:, 2].max())
            floor = float(self._floors[index]) if body.wall else top
            fits = other != name and floor - PENETRATION <= low <= top + GAP
            if fits and inside(footprint(at, body.size), pose.position):
                best = max(best, (top, other)) if best else (top, other)
        return best[1] if best else None


def support_of(scene: Scene, name: str, poses: Mapping[str, Pose] | None = None) -> str | None:
    """Find the support of one body: see :meth:`Standing.support`."""
    return Standing(scene, poses).support(name)


def on_floors(bodies: Sequence[Body], report: Callable[[Body, Sequence[Body]], None]) -> list[Body]:
    """Put what stands as high as the rim of a hollow body, and fits inside, on its floor, with all that stands on it.

    Maps state the boxes of bodies, and a tray with cups as a box on which others stand. ``report`` receives a hollow
    body and the bodies put on its floor. Returns all bodies.
    """
    movable = [body for body in bodies if body.movable and body.pose != STOWED]
    outer = np.array([corners(body.pose, body.size)[:, 2] for body in movable]).reshape(-1, 8)
    low, high = outer.min(axis=1), outer.max(axis=1)
    places = np.array([body.pose.position for body in movable]).reshape(-1, 3)

    @cache
    def over(k: int) -> list[int]:
        """Find the bodies that stand on body ``k``, as the map states them."""
        near = (high[k] - PENETRATION <= low) & (low <= high[k] + GAP) & (low > low[k] + ROUNDING)
        ground = footprint(movable[k].pose, movable[k].size)
        return [one for one in np.flatnonzero(near).tolist() if one != k and inside(ground, places[one])]

    def is_inside(one: int, k: int) -> bool:
        """Check whether a body over the hollow body ``k`` fits inside, and no other one in there bears it."""
        vessel = movable[k]
        if not vessel.wall or vessel.pose.rotation[2, 2] < UPRIGHT or any(one in over(other) for other in over(k)):
            return False
        rim = _outline(vessel)
        return all(inside(rim, point, vessel.wall) for point in _outline(movable[one]))

    lowered = dict[int, float]()
    for k in np.argsort(low, kind="stable").tolist():  # what a body stands on is lower, and comes before it
        if not movable[k].wall and k not in lowered:
            continue
        put = list[Body]()
        for one in over(k):
            depth = float(low[one] - low[k]) - movable[k].wall if is_inside(one, k) else 0.0
            if depth > ROUNDING:
                put.append(movable[one])
            if depth > ROUNDING or k in lowered:
                lowered[one] = max(depth, 0.0) + lowered.get(k, 0.0)
        if put:
            report(movable[k], put)
    depths = {movable[k].name: depth for k, depth in lowered.items()}
    return [_lower(body, depths[body.name]) if body.name in depths else body for body in bodies]


def _outline(body: Body) -> Array:
    return footprint(body.pose, body.size, cylinder=body.shape is BodyShape.CYLINDER)


def _lower(body: Body, depth: float) -> Body:
    x, y, z = body.pose.position
    return replace(body, pose=Pose((x, y, z - depth), body.pose.orientation))
