"""The truth differs from the map: things stand a little elsewhere, by a seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.box import half_extents
from planlang.geometry.matrices import rotated
from planlang.geometry.outline import footprint, inside
from sim.scene import Body, BodyShape, Scene

OBJECT_DISTANCE = 0.3
"""Largest distance of a graspable object from where the map has it [m]."""
FURNITURE_DISTANCE = 0.2
"""Largest distance of movable furniture from where the map has it [m]; it turns by up to 0.2 rad."""
START_DISTANCE = 0.3
"""Largest distance of the robot's start from the given one [m]; it turns by up to 0.5 rad."""

_TRIES = 60
_CLEARANCE = 0.01
_RIM = 0.005
_SUPPORTED = 0.025
_FLAT = 0.999


def perturb(scene: Scene, seed: int, *, radius: float = 0.45, height: float = 1.6) -> Scene:
    """Return the scene as it might really be; seed 0 leaves it unchanged, equal seeds give equal scenes.

    ``radius`` and ``height`` [m] are the size of a standing cylinder around the robot. Movable furniture goes first and
    takes along what stands on it, then graspable objects move on their support and turn, then the robot's start.
    Whatever would touch something, leave its support or the scene's bounds, stays.
    """
    if seed == 0:
        return scene
    generator = np.random.default_rng(seed)
    supports = {body.name: _support(body, scene.bodies) for body in scene.bodies}
    bodies = {body.name: body for body in scene.bodies}
    poses = {body.name: body.pose for body in scene.bodies}
    for body in scene.bodies:
        if body.movable and not body.graspable and body.shape in (BodyShape.BOX, BodyShape.CYLINDER):
            _move_furniture(body, bodies, poses, supports, scene.bounds, generator)
    for body in scene.bodies:
        if body.graspable and body.name not in supports.values():
            _move_object(body, bodies, poses, supports[body.name], generator)
    start = _move_start(scene.start, (radius, height), bodies, poses, scene.bounds, generator)
    moved = scene.with_poses(poses)
    return Scene(moved.bodies, moved.bounds, start)


def _support(body: Body, bodies: Sequence[Body]) -> str | None:
    """Return what a body stands on or in: the one whose top is at its bottom, or that contains its centre."""
    if body.shape in (BodyShape.ROOM, BodyShape.MARKER):
        return None
    bottom = body.pose.position[2] - _half_height(body.pose, body)
    for other in bodies:
        if other is body or other.shape in (BodyShape.ROOM, BodyShape.MARKER, BodyShape.PERSON):
            continue
        top = other.pose.position[2] + _half_height(other.pose, other)
        outline = footprint(other.pose, other.size, cylinder=other.shape is BodyShape.CYLINDER)
        if not inside(outline, body.pose.position):
            continue
        if abs(top - bottom) <= _SUPPORTED or abs(other.pose.position[2] - body.pose.position[2]) < top / 2 > bottom:
            return other.name
    return None


def _half_height(pose: Pose, body: Body) -> float:
    return float(half_extents(pose, body.size)[2])


def _drawn(generator: np.random.Generator, distance: float, turn: float) -> tuple[float, float, float]:
    """Return a shift uniform in a disc and a turn uniform in an interval."""
    angle, radius = generator.uniform(0, 2 * math.pi), distance * math.sqrt(generator.uniform(0, 1))
    return radius * math.cos(angle), radius * math.sin(angle), float(generator.uniform(-turn, turn))


def _shifted(pose: Pose, shift: tuple[float, float, float], about: Pose) -> Pose:
    """Turn about the vertical through another pose's position and shift."""
    dx, dy, turn = shift
    here, there = Pose(about.position), Pose.planar(0.0, 0.0, turn)
    turned = here @ there @ here.inverse() @ pose
    x, y, z = turned.position
    return Pose((x + dx, y + dy, z), turned.orientation)


def _move_furniture(
    body: Body,
    bodies: Mapping[str, Body],
    poses: dict[str, Pose],
    supports: Mapping[str, str | None],
    bounds: tuple[float, float, float, float],
    generator: np.random.Generator,
) -> None:
    group = _contents(body.name, supports)
    for _ in range(_TRIES):
        shift = _drawn(generator, FURNITURE_DISTANCE, 0.2)
        moved = {name: _shifted(poses[name], shift, poses[body.name]) for name in group}
        outline = footprint(moved[body.name], body.size)
        within = (outline >= bounds[:2]).all() and (outline <= bounds[2:]).all()
        if within and all(_free(bodies[name], pose, bodies, poses, group) for name, pose in moved.items()):
            poses.update(moved)
            return


def _contents(name: str, supports: Mapping[str, str | None]) -> tuple[str, ...]:
    """Return the body and everything that stands on it, directly or not."""
    group = [name]
    for member in group:
        group += [other for other, support in supports.items() if support == member and other not in group]
    return tuple(group)


def _move_object(
    body: Body,
    bodies: Mapping[str, Body],
    poses: dict[str, Pose],
    support: str | None,
    generator: np.random.Generator,
) -> None:
    if support is None:
        return
    surface = footprint(poses[support], bodies[support].size, cylinder=bodies[support].shape is BodyShape.CYLINDER)
    for _ in range(_TRIES):
        pose = _shifted(poses[body.name], _drawn(generator, OBJECT_DISTANCE, math.pi), poses[body.name])
        outline = footprint(pose, body.size, cylinder=body.shape is BodyShape.CYLINDER)
        if all(inside(surface, point, _RIM) for point in outline) and _free(
            body, pose, bodies, poses, (body.name, support)
        ):
            poses[body.name] = pose
            return


def _move_start(
    start: tuple[float, float, float],
    outline: tuple[float, float],
    bodies: Mapping[str, Body],
    poses: Mapping[str, Pose],
    bounds: tuple[float, float, float, float],
    generator: np.random.Generator,
) -> tuple[float, float, float]:
    """Return where a standing cylinder of this radius and height is free."""
    radius, height = outline
    size = (2 * radius, 2 * radius, height)
    for _ in range(_TRIES):
        dx, dy, turn = _drawn(generator, START_DISTANCE, 0.5)
        x, y = start[0] + dx, start[1] + dy
        pose = Pose((x, y, height / 2 + 0.02))
        body = Body("the robot", pose, size, BodyShape.CYLINDER)
        within = bounds[0] + radius <= x <= bounds[2] - radius
        within = within and bounds[1] + radius <= y <= bounds[3] - radius
        if within and _free(body, pose, bodies, poses, ()):
            return (x, y, start[2] + turn)
    return start


def _free(body: Body, pose: Pose, bodies: Mapping[str, Body], poses: Mapping[str, Pose], group: Sequence[str]) -> bool:
    """Return whether a body at a pose keeps clear of all bodies outside its group, supports below it apart."""
    return not any(
        _overlap(body, pose, other, poses[other.name])
        for other in bodies.values()
        if other.name not in group and other.name != body.name and other.shape not in (BodyShape.MARKER,)
    )


def _overlap(a: Body, a_pose: Pose, b: Body, b_pose: Pose) -> bool:
    if b.shape is BodyShape.ROOM:
        local = rotated(b_pose.rotation[:2, :2].T, footprint(a_pose, a.size) - np.asarray(b_pose.position[:2]))
        return bool((np.abs(local) > np.asarray(b.size[:2]) / 2 - _CLEARANCE).any())
    heights = _half_height(a_pose, a) + _half_height(b_pose, b)
    if abs(a_pose.position[2] - b_pose.position[2]) >= heights - 0.02:  # standing on each other, or far apart
        return False
    first = footprint(a_pose, a.size, cylinder=a.shape is BodyShape.CYLINDER)
    second = footprint(b_pose, b.size, cylinder=b.shape is BodyShape.CYLINDER)
    return not _separated(first, second) and not _separated(second, first)


def _separated(polygon: Array, other: Array) -> bool:
    """Return whether an edge of a convex polygon has all of another outside, by the clearance (separating axis)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    distances = np.einsum("ij,kij->ki", normals, other[:, None] - polygon[None])
    return bool((distances.min(axis=0) >= _CLEARANCE).any())
