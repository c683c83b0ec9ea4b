"""Measure how much of a room a robot's camera has shown, by rays in the true world: shares no code with exploring."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pybullet as bullet

from planlang.geometry import Array
from sim import PyBulletWorld
from sim.scene import BodyShape
from tests.support.scenarios import Watched

CELL = 0.05
"""Side of the cells in which surface points count [m]."""
TOP = 2.0
"""Height up to which they count [m]."""
SPACING = 0.5
"""Distance of the base poses from which is asked what can be seen at all [m]."""
STEP = math.radians(2.5)
"""Angle between their rays [rad]: a sample of what they see."""
EYES = 1.2
"""Height from which they look [m]."""
TILTS = (-1.1, 0.75)
"""Lowest and highest direction in which they look [rad]."""
AT_ONCE = 16_000
Cells = set[tuple[int, int, int]]


def watch_pictures(watched: Watched) -> None:
    """Keep what is in the picture at each step at which the camera stands still."""
    world = watched.world
    model = world.robot.body.camera
    pose = world.link_pose(model.link)
    before, watched.notes["camera"] = watched.notes.get("camera"), pose
    if before != pose or watched.notes.get("counted") == pose:
        return
    watched.notes["counted"] = pose
    frame = pose.matrix()
    forward, up = frame[:3, :3] @ np.asarray(model.forward), frame[:3, :3] @ np.asarray(model.up)
    wide, tall = math.tan(model.fov / 2), math.tan(model.fov / 2) * model.height / model.width
    sides, heights = np.meshgrid(np.linspace(-wide, wide, model.width), np.linspace(-tall, tall, model.height))
    rays = forward + sides.reshape(-1, 1) * np.cross(forward, up) + heights.reshape(-1, 1) * up
    seen = watched.notes.setdefault("seen", set())
    assert isinstance(seen, set)
    seen |= hits(world, frame[:3, 3], rays, model.far, robot=True)


def hits(
    world: PyBulletWorld, eye: Array, rays: Array, far: float, *, robot: bool, met_bodies: set[int] | None = None
) -> Cells:
    """Cells of the surfaces that rays (n, 3) from an eye (3,) meet first within a distance [m].

    ``met_bodies`` gets PyBullet's numbers of what they meet.
    """
    rays = rays / np.linalg.norm(rays, axis=1)[:, None]
    found: Cells = set()
    for first in range(0, len(rays), AT_ONCE):
        some = rays[first : first + AT_ONCE]
        starts, ends = eye + 0.05 * some, eye + far * some
        mask = -1 if robot else ~64
        met = bullet.rayTestBatch(
            starts.tolist(), ends.tolist(), collisionFilterMask=mask, physicsClientId=world._client
        )
        if met_bodies is not None:
            met_bodies.update(one[0] for one in met)
        points = np.array([one[3] for one in met if one[0] >= 0 and one[0] != world.robot.uid]).reshape(-1, 3)
        points = points[(points[:, 2] > -1e-3) & (points[:, 2] <= TOP)]
        found |= set(map(tuple, np.floor(points / CELL + 1e-6).astype(int).tolist()))
    return found


def visible_at_all(world: PyBulletWorld, far: float) -> tuple[Cells, set[str]]:
    """Cells of surfaces that a camera sees from some base pose that is free, and the names of the bodies."""
    radius = 0.4
    outlines = [
        (world.pose(body.name), body.size)
        for body in world.scene.bodies
        if body.shape not in (BodyShape.MARKER, BodyShape.ROOM) and not body.movable
    ]
    x_min, y_min, x_max, y_max = world.scene.bounds
    pans = np.arange(-math.pi, math.pi, STEP)
    tilts = np.arange(*TILTS, STEP)
    turned = np.array(
        [(math.cos(t) * math.cos(p), math.cos(t) * math.sin(p), math.sin(t)) for t, p in product(tilts, pans)]
    )
    found: Cells = set()
    numbers: set[int] = set()
    for x, y in product(
        np.arange(x_min + radius, x_max - radius, SPACING), np.arange(y_min + radius, y_max - radius, SPACING)
    ):
        gaps = [_gap(pose, size, x, y) for pose, size in outlines]
        if min(gaps, default=1.0) > radius:
            found |= hits(world, np.array([x, y, EYES]), turned, far, robot=False, met_bodies=numbers)
    return found, {name for name in map(world._bodies.name_of, numbers) if name is not None}


def _gap(pose: object, size: tuple[float, float, float], x: float, y: float) -> float:
    local = pose.inverse().matrix() @ [x, y, pose.position[2], 1.0]  # type: ignore[attr-defined]
    return float(np.hypot(*np.maximum(np.abs(local[:2]) - np.array(size[:2]) / 2, 0.0)))
