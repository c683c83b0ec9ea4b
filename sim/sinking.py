"""Where a body that was let go comes to rest: straight down, on the first surface that bears its centre of mass."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from planlang.protocols import Array, Pose
from sim.geometry import corners, hull, inside, rotation

GRAVITY = 9.81
"""[m/s^2]"""

_LEVEL = 0.01
_STEP = 0.01
_UP = 0.021  # above the lowest point of the body: a support may be penetrated by 2 cm
_DEPTH = 100.0
Rays = Callable[[Array, Array], tuple[Sequence[str | None], Array]]
"""(n, 3) from, (n, 3) to -> names hit (or None) and heights z (n,) of the hits."""


def upright(pose: Pose) -> Pose:
    """The pose turned so that its axis nearest to the vertical is vertical."""
    axes = rotation(pose)
    k = int(np.argmax(np.abs(axes[2])))
    axis, goal = axes[:, k], np.array([0.0, 0.0, math.copysign(1.0, axes[2, k])])
    cross = np.cross(axis, goal)
    sine, cosine = float(np.linalg.norm(cross)), float(axis @ goal)
    if sine < 1e-9:
        return pose
    half = math.atan2(sine, cosine) / 2
    x, y, z = (cross / sine * math.sin(half)).tolist()
    turn = Pose((0.0, 0.0, 0.0), (x, y, z, math.cos(half)))
    turned = turn @ Pose((0.0, 0.0, 0.0), pose.orientation)
    return Pose(pose.position, turned.orientation)


def footprint(pose: Pose, size: Sequence[float], *, round_: bool = False) -> Array:
    """(n, 2) convex outline of a body seen from above; a standing cylinder (``round_``) gives 16 points of a circle."""
    if round_ and abs(rotation(pose)[2, 2]) > 0.99:
        angles = np.arange(16) * (2 * np.pi / 16)
        radius = max(size[0], size[1]) / 2
        circle = np.stack([np.cos(angles), np.sin(angles)], axis=1) * radius
        return hull(circle + np.asarray(pose.position[:2]))
    return hull(corners(pose, size)[:, :2])


def resting(pose: Pose, size: Sequence[float], rays: Rays, *, round_: bool = False) -> tuple[Pose, str | None]:
    """Where the body comes to rest below ``pose`` and on what (None: there is nothing below).

    A surface bears the body when its centre lies in the hull of the points of the footprint that are on the surface.
    One that does not is left behind: the body slips off, away from that surface's points, just far enough.
    """
    pose = upright(pose)
    half = float((np.abs(rotation(pose)) @ np.asarray(size, dtype=float))[2]) / 2
    for _ in range(50):
        outline = footprint(pose, size, round_=round_)
        center = np.asarray(pose.position[:2])
        points = np.vstack([center] + [center + (outline - center) * share for share in (0.33, 0.66, 0.98)])
        top = np.column_stack([points, np.full(len(points), pose.position[2] - half + _UP)])
        names, heights = rays(top, top - np.array([0.0, 0.0, _DEPTH]))
        hits = np.array([name is not None for name in names])
        if not hits.any():
            return pose, None
        level = float(heights[hits].max())
        bearing = points[hits & (heights > level - _LEVEL)]
        if inside(hull(bearing), center):
            best = int(np.argmax(np.where(hits, heights, -np.inf)))
            return Pose((pose.position[0], pose.position[1], level + half), pose.orientation), names[best]
        away = center - bearing.mean(axis=0)
        length = float(np.linalg.norm(away))
        direction = away / length if length > 1e-6 else np.array([1.0, 0.0])
        x, y = (center + direction * _STEP).tolist()
        pose = Pose((x, y, pose.position[2]), pose.orientation)
    return pose, None


def fall(height: float, speed: float, rate: int) -> tuple[float, float]:
    """One step of free fall: new height [m] and speed [m/s]."""
    speed += GRAVITY / rate
    return height - speed / rate, speed
