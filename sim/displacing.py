"""Random deviations of the true world from a map: things, furniture, doors, drawers and lids, devices, and the start.

Each draws its own random numbers by the seed and its name. So it stays where a seed put it when the map gains or loses
another one, as long as that is not in its way.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from hashlib import blake2b
from itertools import product

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import footprint, half_extents, inside
from sim.joints import HALFWAY, Articulation, JointKind
from sim.leaves import contents
from sim.movers import Mover
from sim.scene import Body, BodyShape, Scene

OBJECT_DISTANCE = 0.3
"""Largest displacement of a graspable object from the map [m]."""
FURNITURE_DISTANCE = 0.2
"""Largest displacement of movable furniture from the map [m]; it turns by up to 0.2 rad."""
START_DISTANCE = 0.3
"""Largest displacement of the robot's start [m]; it turns by up to 0.5 rad."""
AS_MAPPED = 0.5
"""Share of doors, drawers, lids and devices that are as the map says; the others are open by any part of their range,
or in the other state."""

_TRIES = 60
"""Draws per thing; in a crowded room most things stay in place after fewer would."""
_CLEARANCE = 0.01
"""Distance between things [m]: more than the contact tolerance."""
_RIM = 0.005
"""Distance of a thing from the edge of its support [m], so that it cannot fall."""
_STEPS = {JointKind.HINGED: 0.1, JointKind.PRISMATIC: 0.05}
"""Steps in which to check the motion of a door or drawer [rad, m]."""
_SUPPORTED = 0.025
"""Tolerated gap or penetration between a thing and its support, as found in real maps [m]."""


def perturb(scene: Scene, seed: int, *, radius: float = 0.45, height: float = 1.6) -> Scene:
    """Displace things at random, as the real world differs from a map; seed 0 changes nothing.

    Equal seeds give equal scenes. ``radius`` and ``height`` [m] describe an upright cylinder around the robot. Movable
    furniture is displaced first, with what stands on it, then graspable objects shift and turn on their support, then
    doors, drawers and lids are opened or closed, with what is in them, devices with a button or a knob are on or off,
    and the robot's start is displaced. Whatever would touch something, or leave its support or the scene's bounds,
    stays where it is.
    """
    if seed == 0:
        return scene
    room = _Room(scene, seed)
    for body in scene.bodies:
        if body.movable and not (body.graspable or body.thin) and body.shape in (BodyShape.BOX, BodyShape.CYLINDER):
            room.move_furniture(body)
    for body in scene.bodies:
        if (body.graspable or body.thin) and body.name not in room.supports.values():
            room.move_object(body)
    poses = room.mapped()
    standing = Pose((*scene.start[:2], height / 2 + 0.02))
    robot = Body("the robot", standing, (2 * radius, 2 * radius, height), BodyShape.CYLINDER)
    for joint in scene.joints:
        if not joint.is_knob:
            room.move_leaf(joint, robot)
    room.switch_devices()
    start = room.moved_start(robot)
    movers = tuple(room.moved_mover(one, replace(robot, pose=Pose((*start[:2], height / 2)))) for one in scene.movers)
    moved = scene.with_poses(poses)
    bodies = (replace(one, is_on=room.is_on.get(one.name, one.is_on)) for one in moved.bodies)
    joints = (replace(one, first=room.values[one.leaf]) for one in scene.joints)
    return replace(moved, bodies=tuple(bodies), joints=tuple(joints), movers=movers, start=start)


class _Room:
    """Poses of all bodies while they are displaced, one after another, with doors and drawers as far open as they are.

    ``values`` are those of the joints, ``is_on`` the states of displaced devices.
    """

    def __init__(self, scene: Scene, seed: int) -> None:
        self.scene, self._seed = scene, seed
        self.bodies = {body.name: body for body in scene.bodies}
        self.values = {joint.leaf: joint.first for joint in scene.joints}
        self.is_on: dict[str, bool] = {}
        self._carried = {joint.leaf: self._inside(joint) for joint in scene.joints}
        """Leaf -> movable bodies in it, which move with it."""
        self.poses = {body.name: scene.first_pose(body) for body in scene.bodies}
        for joint in (one for one in scene.joints if one.first):
            motion = joint.motion(joint.first)
            self.poses |= {name: motion @ self.poses[name] for name in self._carried[joint.leaf]}
        self._mapped = dict(self.poses)
        self._index = {body.name: index for index, body in enumerate(scene.bodies)}
        self._centres = np.array([self.poses[body.name].position for body in scene.bodies]).reshape(-1, 3)
        self._reach = np.array([_reach(body) for body in scene.bodies])
        placed = [replace(body, pose=self.poses[body.name]) for body in scene.bodies]
        half = {body.name: _half_height(body.pose, body) for body in placed}
        self.supports = {body.name: _support(body, self._around(body, body.pose), half) for body in placed}

    def _inside(self, joint: Articulation) -> tuple[str, ...]:
        leaf = self.bodies[joint.leaf]
        return tuple(
            contents(leaf.pose, leaf.size, {body.name: body.pose for body in self.scene.bodies if body.movable})
        )

    def _random(self, name: str) -> np.random.Generator:
        """Make the random numbers of one thing: the same ones whatever else there is."""
        digest = blake2b(f"{self._seed} {name}".encode("utf-8", "surrogatepass"), digest_size=16).digest()
        return np.random.default_rng(int.from_bytes(digest, "big"))

    def mapped(self) -> dict[str, Pose]:
        """List the poses of displaced things as a scene states them: as if all drawers were closed."""
        moved = {name: pose for name, pose in self.poses.items() if pose != self._mapped[name]}
        for joint in (one for one in self.scene.joints if one.first):
            back = joint.motion(joint.first).inverse()
            moved |= {name: back @ moved[name] for name in self._carried[joint.leaf] if name in moved}
        return moved

    def _around(self, body: Body, pose: Pose) -> list[Body]:
        """List the bodies that a body at a pose may stand on, stand in or touch, in the order of the scene."""
        distances = np.hypot(*(self._centres - pose.position)[:, :2].T)
        near = np.flatnonzero(distances <= self._reach + _reach(body)).tolist()
        return [replace(self.scene.bodies[k], pose=self.poses[self.scene.bodies[k].name]) for k in near]

    def _put(self, poses: Mapping[str, Pose]) -> None:
        self.poses.update(poses)
        for name, pose in poses.items():
            self._centres[self._index[name]] = pose.position

    def move_furniture(self, body: Body) -> None:
        """Displace a piece of furniture with what stands on it."""
        group = [body.name]
        for member in group:
            group += [other for other, support in self.supports.items() if support == member and other not in group]
        x_min, y_min, x_max, y_max = self.scene.bounds
        for shift in self._shifts(body.name, FURNITURE_DISTANCE, 0.2):
            moved = {name: _shifted(self.poses[name], shift, self.poses[body.name]) for name in group}
            outline = footprint(moved[body.name], body.size)
            within = (outline >= (x_min, y_min)).all() and (outline <= (x_max, y_max)).all()
            if within and all(self._is_free(self.bodies[name], pose, group) for name, pose in moved.items()):
                self._put(moved)
                return

    def move_object(self, body: Body) -> None:
        """Displace an object on its support."""
        support = self.supports[body.name]
        if support is None:
            return
        surfaces = list(_surfaces(self.bodies[support], self.poses[support], self.poses[body.name]))
        for shift in self._shifts(body.name, OBJECT_DISTANCE, math.pi):
            pose = _shifted(self.poses[body.name], shift, self.poses[body.name])
            stands = all(inside(surface, point, _RIM) for surface in surfaces for point in _outline(body, pose))
            if stands and self._is_free(body, pose, (body.name, support)):
                self._put({body.name: pose})
                return

    def move_leaf(self, joint: Articulation, robot: Body) -> None:
        """Open or close a door, drawer or lid, with what is in it, as far as nothing is in its way, the robot included.

        One that something stands on stays as it is.
        """
        random, first = self._random(joint.leaf), self.values[joint.leaf]
        carried = self._carried[joint.leaf]
        if any(support in joint.bodies and name not in carried for name, support in self.supports.items()):
            return
        if random.uniform() < AS_MAPPED:
            return
        start = {name: self.poses[name] for name in (*joint.bodies, *carried)}
        touching = [name for name in self.bodies if name != joint.holder and self._touch(start, name)]
        if any(self.bodies[name].shape is BodyShape.ROOM for name in touching):
            return
        group, back = (*start, *touching, joint.holder or ""), joint.motion(first).inverse()
        for value in random.uniform(0.0, joint.upper, _TRIES).tolist():
            steps = 2 + math.ceil(abs(value - first) / _STEPS[joint.kind])
            ways = [joint.motion(one) @ back for one in np.linspace(first, value, steps)[1:].tolist()]
            if all(self._is_clear({n: way @ pose for n, pose in start.items()}, group, robot) for way in ways):
                self._put({name: ways[-1] @ pose for name, pose in start.items()})
                self.values[joint.leaf] = value
                return

    def _touch(self, poses: Mapping[str, Pose], other: str) -> bool:
        """Check whether a body touches others at poses, beside those themselves."""
        body = replace(self.bodies[other], pose=self.poses[other])
        if other in poses or body.shape is BodyShape.MARKER:
            return False
        near = ((self.bodies[name], pose) for name, pose in poses.items())
        return any(
            math.dist(pose.position[:2], body.pose.position[:2]) <= _reach(one) + _reach(body)
            and any(_overlap(a, a.pose, b, b.pose) for a, b in product(_solids(one, pose), _solids(body, body.pose)))
            for one, pose in near
        )

    def _is_clear(self, poses: Mapping[str, Pose], group: Sequence[str], robot: Body) -> bool:
        bodies = [(self.bodies[name], pose) for name, pose in poses.items()]
        return all(
            self._is_free(body, pose, group) and not _overlap(body, pose, robot, robot.pose) for body, pose in bodies
        )

    def switch_devices(self) -> None:
        """Switch devices on or off, by their knob if they have one."""
        joints = {joint.leaf: joint for joint in self.scene.joints}
        for control in self.scene.controls:
            random, was_on = self._random(control.device), self.bodies[control.device].is_on
            if control.device in self.is_on or random.uniform() < AS_MAPPED:
                continue
            if control.turns:
                joint = joints[control.body]
                is_turned = joint.first >= HALFWAY * joint.upper
                if is_turned == was_on:  # on means turned, as usual
                    self.values[joint.leaf] = 0.0 if is_turned else joint.upper
            self.is_on[control.device] = not was_on

    def moved_start(self, robot: Body) -> tuple[float, float, float]:
        """Draw a start pose at which the robot's cylinder is free."""
        x_min, y_min, x_max, y_max = self.scene.bounds
        start, radius = self.scene.start, robot.size[0] / 2
        for dx, dy, turn in self._shifts("", START_DISTANCE, 0.5):
            x, y = start[0] + dx, start[1] + dy
            within = x_min + radius <= x <= x_max - radius and y_min + radius <= y <= y_max - radius
            if within and self._is_free(robot, Pose((x, y, robot.pose.position[2])), ()):
                return (x, y, start[2] + turn)
        return start

    def moved_mover(self, mover: Mover, robot: Body) -> Mover:
        """Draw where on its way to and fro a mover is when it begins, clear of the robot."""
        body, random = self.bodies[mover.body], self._random(mover.body)
        for gone in random.uniform(0.0, 2 * mover.length, _TRIES).tolist():
            if not _overlap(body, mover.pose_at(gone, self.poses[body.name].position[2]), robot, robot.pose):
                return replace(mover, first=gone)
        return mover

    def _shifts(self, name: str, distance: float, turn: float) -> Iterator[tuple[float, float, float]]:
        """Yield shifts of a thing, uniform in a disc, and turns, uniform in an interval."""
        uniform = self._random(name).uniform
        for _ in range(_TRIES):
            angle, radius = uniform(0, 2 * math.pi), distance * math.sqrt(uniform(0, 1))
            yield radius * math.cos(angle), radius * math.sin(angle), float(uniform(-turn, turn))

    def _is_free(self, body: Body, pose: Pose, group: Sequence[str]) -> bool:
        """Check whether a body at a pose is clear of all bodies outside its group, except supports below it."""
        return not any(
            _overlap(one, one.pose, another, another.pose)
            for other in self._around(body, pose)
            if other.name not in group and other.name != body.name and other.shape is not BodyShape.MARKER
            for one, another in product(_solids(body, pose), _solids(other, other.pose))
        )


def _solids(body: Body, pose: Pose) -> Iterator[Body]:
    """Yield a body at a pose, and its handles as separate bodies."""
    yield replace(body, pose=pose)
    for handle in body.handles:
        yield Body(body.name, pose @ handle.pose, handle.size)


def _reach(body: Body) -> float:
    """Bound the radius of a body in any orientation, with clearance [m]; infinite for a room."""
    if body.shape is BodyShape.ROOM:
        return math.inf
    handles = (math.hypot(*one.pose.position) + math.hypot(*one.size) / 2 for one in body.handles)
    return max((math.hypot(max(body.size[:2]), *body.size) / 2, *handles)) + 2 * _CLEARANCE + _SUPPORTED


def _outline(body: Body, pose: Pose) -> Array:
    return footprint(pose, body.size, cylinder=body.shape is BodyShape.CYLINDER)


def _surfaces(support: Body, pose: Pose, of: Pose) -> Iterator[Array]:
    """Yield the outlines within which a thing at ``of`` stays when it moves on a body, or in a cavity of it."""
    x, y, z = support.size
    yield _outline(replace(support, size=(x - 2 * support.wall, y - 2 * support.wall, z)), pose)
    for cavity in support.cavities:
        centre = pose @ Pose(cavity.centre)
        if (np.abs((centre.inverse() @ of).position) < np.asarray(cavity.size) / 2).all():
            yield footprint(centre, cavity.size)


def _support(body: Body, bodies: Sequence[Body], half: Mapping[str, float]) -> str | None:
    """Find what a body stands on or in: a dish on whose floor it is, else a body just below it or around its centre.

    ``half`` holds the half heights of bodies by name [m].
    """
    if body.shape in (BodyShape.ROOM, BodyShape.MARKER):
        return None
    bottom = body.pose.position[2] - half[body.name]
    for other in (one for one in bodies if one.wall and one.name != body.name):
        floor = other.pose.position[2] - half[other.name] + other.wall
        if abs(floor - bottom) <= _RIM and inside(_outline(other, other.pose), body.pose.position):
            return other.name
    for other in bodies:
        if other.name == body.name or other.shape in (BodyShape.ROOM, BodyShape.MARKER, BodyShape.PERSON):
            continue
        centre, height = other.pose.position[2], half[other.name]
        within = abs(centre - body.pose.position[2]) < height and bottom < centre
        if (within or abs(centre + height - bottom) <= _SUPPORTED) and inside(
            _outline(other, other.pose), body.pose.position
        ):
            return other.name
    return None


def _half_height(pose: Pose, body: Body) -> float:
    return float(half_extents(pose, body.size)[2])


def _shifted(pose: Pose, shift: tuple[float, float, float], about: Pose) -> Pose:
    """Turn a pose about the vertical through another pose's position, then shift it."""
    dx, dy, turn = shift
    here, there = Pose(about.position), Pose.planar(0.0, 0.0, turn)
    turned = here @ there @ here.inverse() @ pose
    x, y, z = turned.position
    return Pose((x + dx, y + dy, z), turned.orientation)


def _overlap(a: Body, a_pose: Pose, b: Body, b_pose: Pose) -> bool:
    if b.shape is BodyShape.ROOM:
        local = rotated(b_pose.rotation[:2, :2].T, footprint(a_pose, a.size) - np.asarray(b_pose.position[:2]))
        return bool((np.abs(local) > np.asarray(b.size[:2]) / 2 - _CLEARANCE).any())
    heights = _half_height(a_pose, a), _half_height(b_pose, b)
    # one on top of the other, or far apart in height: 2 cm of overlap, or all of a flat body's half height, are allowed
    if abs(a_pose.position[2] - b_pose.position[2]) >= sum(heights) - min(0.02, *heights):
        return False
    first, second = _outline(a, a_pose), _outline(b, b_pose)
    return not _separated(first, second) and not _separated(second, first)


def _separated(polygon: Array, other: Array) -> bool:
    """Check whether an edge of a convex polygon has all of another outside, by the clearance (separating axis)."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(edges, axis=1)[:, None]
    distances = np.einsum("ij,kij->ki", normals, other[:, None] - polygon[None])
    return bool((distances.min(axis=0) >= _CLEARANCE).any())
