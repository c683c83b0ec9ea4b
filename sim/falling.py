"""What is below bodies; released ones fall straight onto the first surface that bears their centre of mass."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, upright
from planlang.geometry.shapes import SolidKind, corners, footprint, half_extents, inside, outline_of
from sim.bodies import Bodies
from sim.camera import Rays
from sim.scene import BodyShape

GRAVITY = 9.81
"""[m/s^2]"""

REST = 0.005
"""Gap below which a body lies on what is below it [m]."""
_INTO = 0.002
"""Height above a body's lowest point from which to look for what it lies on [m]: it may sink in a little."""
_LEVEL = 0.01
"""Height difference within which points bear a body together [m]."""
_STEP = 0.01
"""Step by which a body slips off an edge [m]: fine compared with the things that are handled."""
_UP = 0.021
"""Height above a body's lowest point at which rays start [m]: a grasped body may penetrate its support by 2 cm."""
_NEAR = 0.03
"""Height above its support up to which a body stands on it [m]: maps are no more accurate."""
_SAME = 0.001
"""Difference up to which two heights count as equal [m]."""
_SKIN = 0.001
"""Depth below the top of a body at which rays start at the latest [m]."""
_DEPTH = 100.0
"""Length of the rays that look for a surface [m]: to below every floor, however far poured substance falls."""
Cast = Callable[[Array, Array], tuple[Sequence[str | None], Array]]
"""Starts (n, 3), ends (n, 3) -> names hit (or None) and heights z (n,) of the hits."""


class Falling:
    """Moves released bodies down to the first surface below; no others fall."""

    def __init__(self, bodies: Bodies, rays: Rays, rate: int) -> None:
        self.bodies, self.rays, self.rate = bodies, rays, rate
        self.on_the_way: dict[str, tuple[float, Pose]] = {}
        """Falling body -> speed [m/s] and final pose."""

    def rest(self, name: str) -> tuple[Pose, str | None]:
        """Find the pose where a body would come to rest if released here, and on what (None: nothing is below)."""
        body = self.bodies.bodies[name]
        with self.rays.without(name, *self._inside(name)):
            return resting(
                self.bodies.poses[name], body.size, self.rays.down, cylinder=body.shape is BodyShape.CYLINDER
            )

    def under(self, name: str, but: Iterable[str] = ()) -> str | None:
        """Find what a body lies on; the bodies in ``but`` count as absent."""
        pose = self.bodies.poses[name]
        x, y, z = pose.position
        low = z - float(half_extents(pose, self.bodies.bodies[name].size)[2])
        with self.rays.without(name, *but):
            return self.rays.down(np.array([[x, y, low + _INTO]]), np.array([[x, y, low - REST]]))[0][0]

    def below(self, point: Sequence[float], but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the body ``but`` counts as absent."""
        start = np.array([point])
        with self.rays.without(but):
            names, heights = self.rays.down(start, start - np.array([0.0, 0.0, _DEPTH]))
        return names[0], float(heights[0])

    def stands(self, name: str) -> bool:
        """Check whether a body surely stands within :data:`_NEAR` on one level box under all of it; False may be wrong.

        No rays are cast, so that the things of a large map need not be made in the physics client for that.
        """
        body, pose, bodies = self.bodies.bodies[name], self.bodies.poses[name], self.bodies
        points, (low, high) = corners(pose, body.size), bodies.box_of(name)
        lower, upper = low - (0.0, 0.0, _NEAR), np.array((high[0], high[1], low[2] + 2 * _UP))
        within = {name, *self._inside(name)}
        others = [k for k in bodies.within(lower, upper).tolist() if bodies.pieces[k].body not in within]
        top = max(others, key=lambda k: float(bodies.upper[k, 2]), default=None)
        if (
            top is None
            or abs(bodies.upper[top, 2] - low[2]) > _UP - _SKIN
            or bodies.pieces[top].part.kind != SolidKind.BOX
        ):
            return False
        place, size = bodies.pieces[top].pose, np.array(bodies.pieces[top].part.size)
        local = moved(place.inverse().matrix(), points)
        return place.rotation[2, 2] == 1.0 and bool((np.abs(local[:, :2]) < size[:2] / 2 - _SKIN).all())

    def _inside(self, name: str) -> Iterator[str]:
        """Yield bodies whose bottom is between bottom and top of one, as a cup's in a tray: they cannot bear it."""
        low, high = self.bodies.box_of(name)
        least, most = np.nextafter(low[2] + _SAME, np.inf), np.nextafter(high[2], -np.inf)
        yield from (other for other in self._over(low, high, least, most) if other != name)

    def _over(self, low: Array, high: Array, least: float, most: float) -> list[str]:
        """List the movable bodies with their bottoms between two heights and over a box, given by its corners (3,)."""
        names, lower, upper = self.bodies.boxes()
        over = ((lower[:, :2] <= high[:2]) & (upper[:, :2] >= low[:2])).all(axis=1)
        over &= (lower[:, 2] >= least) & (lower[:, 2] <= most)
        found = (names[index] for index in np.flatnonzero(over).tolist())
        return [one for one in found if self.bodies.bodies[one].movable and one not in self.bodies.removed]

    def begin(self, name: str, riders: Collection[str] = ()) -> None:
        """Release a body with what stands on it; with nothing below, it stays in the air."""
        rest, support = self.rest(name)
        if support is not None:
            motion = rest @ self.bodies.poses[name].inverse()
            self.on_the_way[name] = (0.0, rest)
            self.on_the_way |= {rider: (0.0, motion @ self.bodies.poses[rider]) for rider in riders}

    def standing_on(self, name: str, held: Collection[str]) -> list[str]:
        """List the movable bodies that stand on a body, directly or not; held ones stand on nothing."""
        standing, bodies = [name], self.bodies
        for support in standing:
            low, high = bodies.box_of(support)
            for other in self._over(low, high, low[2], high[2] + _NEAR):
                if other in standing or other in held:
                    continue
                rest, on = self.rest(other)
                if on == support and bodies.poses[other].position[2] - rest.position[2] <= _NEAR:
                    standing.append(other)
        return standing[1:]

    def stop(self, name: str) -> None:
        """Cancel the fall of a body that was grasped or placed."""
        self.on_the_way.pop(name, None)

    def step(self) -> None:
        """Advance every falling body by one step; it takes its final orientation in the first."""
        for name, (speed, rest) in list(self.on_the_way.items()):
            x, y, floor = rest.position
            height, speed = fall(self.bodies.poses[name].position[2], speed, self.rate)
            if height <= floor:
                self.bodies.place(name, rest)
                del self.on_the_way[name]
            else:
                self.bodies.place(name, Pose((x, y, height), rest.orientation))
                self.on_the_way[name] = (speed, rest)


def resting(pose: Pose, size: Sequence[float], rays: Cast, *, cylinder: bool = False) -> tuple[Pose, str | None]:
    """Find where a body comes to rest below ``pose`` and on what (None: nothing is below).

    A surface bears the body if the body's centre lies in the convex hull of the footprint's points on that surface.
    Otherwise the body slips off, away from those points, just far enough.
    """
    pose = upright(pose)
    half = float(half_extents(pose, size)[2])
    for _ in range(50):
        outline = footprint(pose, size, cylinder=cylinder)
        centre = np.asarray(pose.position[:2])
        points = np.vstack([centre] + [centre + (outline - centre) * share for share in (0.33, 0.66, 0.98)])
        up = min(_UP, 2 * half - _SKIN)  # below the top of a thin body, so that nothing on it is taken as its support
        top = np.column_stack([points, np.full(len(points), pose.position[2] - half + up)])
        names, heights = rays(top, top - np.array([0.0, 0.0, _DEPTH]))
        hits = np.array([name is not None for name in names])
        if not hits.any():
            return pose, None
        level = float(heights[hits].max())
        bearing = points[hits & (heights > level - _LEVEL)]
        if inside(outline_of(bearing), centre):
            best = int(np.argmax(np.where(hits, heights, -np.inf)))
            return Pose((pose.position[0], pose.position[1], level + half), pose.orientation), names[best]
        offset = centre - bearing.mean(axis=0)
        length = float(np.linalg.norm(offset))
        direction = offset / length if length > 1e-6 else np.array([1.0, 0.0])
        x, y = (centre + direction * _STEP).tolist()
        pose = Pose((x, y, pose.position[2]), pose.orientation)
    return pose, None


def falling_time(height: float) -> float:
    """Compute the time to fall from a height [s]; 0 for negative heights."""
    return math.sqrt(2 * max(height, 0.0) / GRAVITY)


def fall(height: float, speed: float, rate: int) -> tuple[float, float]:
    """Compute the height [m] and speed [m/s] after one step of free fall."""
    speed += GRAVITY / rate
    return height - speed / rate, speed
