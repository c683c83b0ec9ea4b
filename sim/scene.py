"""Descriptions of a world: bodies of simple shape, the robot's body, camera optics; and random deviations from a map.

Lengths in metres, angles in radians; the map has z up and the floor at z = 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import field, replace
from enum import StrEnum
from itertools import product
from pathlib import Path

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import footprint, half_extents, inside
from planlang.records import dataclass
from sim.controls import Control
from sim.joints import Articulation
from sim.matter import Portion, Rules


class BodyShape(StrEnum):
    BOX = "box"
    CYLINDER = "cylinder"
    """Axis z, the diameter is the larger horizontal size: bottles, cups."""
    PERSON = "person"
    """A person lying, seated or standing, depending on the size; x of the pose is where the person faces."""
    MARKER = "marker"
    """A place without substance: cannot be touched or seen."""
    ROOM = "room"
    """A room: size and pose are of the *interior*; walls stand outside it, there is no ceiling."""


THIN = 0.02
"""Height up to which a movable thing lies flat, so that a blade goes under it [m]."""
GRASPABLE_WIDTH = 0.12
"""Horizontal width up to which a hand can take a movable body [m]."""
LONGEST = 0.6
"""Greatest length of a thing that a hand takes [m]."""


@dataclass(frozen=True, slots=True)
class Cavity:
    """Hollow inside a box, along the box's axes: centre in the box's frame, and extents [m].

    Where it reaches beyond the box, the box is open.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Handle:
    """Box that sticks out of a body, by which a hand takes it: pose in the body's frame, and extents [m]."""

    pose: Pose
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Body:
    """Body of the map: a box of ``size`` (along its own axes) whose centre is at ``pose``."""

    name: str
    pose: Pose
    size: tuple[float, float, float]
    shape: BodyShape = BodyShape.BOX
    """Shape; its value as text works as well."""
    iri: str = ""
    type: str = ""
    """Class of the thing: local name or IRI."""
    movable: bool = False
    """True for things that may be displaced from the map: see :func:`sim.scene.perturb`."""
    color: tuple[float, float, float, float] | None = None
    cavities: tuple[Cavity, ...] = ()
    """Hollows of a box: compartments, the inside of a drawer; for a room, openings in its walls."""
    content: tuple[Portion, ...] = ()
    """Initial contents, or what it consists of."""
    capacity: float = 0.0
    """Capacity as a vessel [ml]."""
    is_on: bool = False
    """True for a device that is initially on."""
    blade: float = 0.0
    """Length of the blade at the front end of its longest axis [m]; 0 without one."""
    wall: float = 0.0
    """Wall thickness of a hollow thing that is open above, such as a plate or a bowl [m]; 0 if solid."""
    soft: bool = False
    """True for cloth and the like: two fingers that close on it from above form a fold."""
    handles: tuple[Handle, ...] = ()
    """Handles by which it is taken."""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of its box in its own frame [m]: nonzero only for a tool, whose frame is in its blade."""
    mass: float = 0.0
    """Mass without its contents [kg]; 0 if unknown."""
    largest_tilt: float | None = None
    """Largest angle of its z axis from the vertical while carried [rad]; None if unrestricted."""
    hands: int = 1
    """Number of hands it takes to hold; it slips out of fewer."""
    kinds: tuple[str, ...] = field(default=(), repr=False, compare=False)
    """Its class and superclasses by local names, nearest first: determines its looks."""

    def __post_init__(self) -> None:
        if self.shape not in tuple(BodyShape):
            raise ValueError(f"body {self.name!r} has unknown shape {self.shape!r}; shapes are {', '.join(BodyShape)}")
        object.__setattr__(self, "shape", BodyShape(self.shape))
        if self.shape is not BodyShape.MARKER and not all(extent > 0 for extent in self.size):
            raise ValueError(
                f"body {self.name!r} has size {self.size}; every extent of a {self.shape} must be positive"
            )

    @property
    def thin(self) -> bool:
        """Whether a blade goes under it: movable, and not higher than :data:`THIN`."""
        return self.movable and self.size[2] <= THIN

    @property
    def graspable(self) -> bool:
        """Whether a hand can take it: a movable box or cylinder that is narrow or soft, or has a rim or a handle."""
        narrow = min(self.size[:2]) <= GRASPABLE_WIDTH or self.wall > 0 or self.soft or bool(self.handles)
        return self.movable and self.shape in (BodyShape.BOX, BodyShape.CYLINDER) and narrow


@dataclass(frozen=True, slots=True)
class Scene:
    """All bodies, in an order that is preserved everywhere, and the robot's start."""

    bodies: tuple[Body, ...]
    bounds: tuple[float, float, float, float] = (-5.0, -5.0, 5.0, 5.0)
    """Rectangle in which the robot may drive: x_min, y_min, x_max, y_max."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Initial base pose of the robot: x, y, yaw."""
    joints: tuple[Articulation, ...] = ()
    """Joints of the leaves; the poses of their bodies, and of what lies in them, are given for closed leaves."""
    controls: tuple[Control, ...] = ()
    """Buttons and knobs of devices."""
    rules: Rules = field(default_factory=Rules)
    """Effects of heat and tilting on things."""
    _by_name: Mapping[str, Body] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        object.__setattr__(self, "_by_name", {body.name: body for body in self.bodies})
        twice = sorted(name for name, number in Counter(names).items() if number > 1)
        if twice:
            raise ValueError(f"names of bodies must be unique; these occur twice: {', '.join(twice)}")
        moving = [name for joint in self.joints for name in joint.bodies]
        if not set(moving) <= set(names) or len(set(moving)) != len(moving):
            raise ValueError("every body moved by a joint must be in the scene, and be moved by that joint only")

    def body(self, name: str) -> Body:
        """Look up a body by name; ``KeyError`` lists the names that exist."""
        if name in self._by_name:
            return self._by_name[name]
        raise KeyError(f"no body {name!r} in the scene; there are {', '.join(body.name for body in self.bodies)}")

    def first_pose(self, body: Body) -> Pose:
        """Initial pose of a body, given that some leaves may be open."""
        joint = next((joint for joint in self.joints if joint.first and body.name in joint.bodies), None)
        return body.pose if joint is None else joint.motion(joint.first) @ body.pose

    def with_poses(self, poses: Mapping[str, Pose]) -> Scene:
        """Copy the scene with some bodies at other poses."""
        return replace(self, bodies=tuple(replace(body, pose=poses.get(body.name, body.pose)) for body in self.bodies))


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Optics of a camera at a link of the robot."""

    link: str
    fov: float = 1.0
    """Horizontal opening angle [rad]."""
    near: float = 0.3
    far: float = 4.0
    """Range [m]: objects whose centre is nearer or farther are not recognised."""
    width: int = 160
    height: int = 120
    forward: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Viewing direction in the link's frame: z for an optical frame, x for a body frame."""
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    """Upward direction of its picture, in the link's frame."""
    recognises: tuple[str, ...] | None = None
    """Classes of things with recognition models from the start; None: all."""

    @property
    def half_angle(self) -> float:
        """Angle from the centre of the picture to its corners [rad]."""
        return math.atan(math.tan(self.fov / 2) * math.hypot(1.0, self.height / self.width))


@dataclass(frozen=True, slots=True)
class RobotBody:
    """The robot as the simulator needs it."""

    urdf: Path
    camera: CameraModel
    hands: Mapping[str, Collection[str]] = field(default_factory=dict)
    """Link of a hand -> links of its fingers."""
    allowed: Collection[tuple[str, str]] = ()
    """Pairs of links that may touch, besides the pairs that the simulator finds itself."""
    posture: Mapping[str, float] = field(default_factory=dict)
    """Initial joint positions; joints not named are at zero, or at the limit nearest to it."""
    moving: Collection[str] | None = None
    """Commanded joints; the others never move, unless they mimic these. None: all."""


OBJECT_DISTANCE = 0.3
"""Largest displacement of a graspable object from the map [m]."""
FURNITURE_DISTANCE = 0.2
"""Largest displacement of movable furniture from the map [m]; it turns by up to 0.2 rad."""
START_DISTANCE = 0.3
"""Largest displacement of the robot's start [m]; it turns by up to 0.5 rad."""

_TRIES = 60
"""Draws per thing; in a crowded room most things stay in place after fewer would."""
_CLEARANCE = 0.01
"""Distance between things [m]: more than the contact tolerance."""
_RIM = 0.005
"""Distance of a thing from the edge of its support [m], so that it cannot fall."""
_SUPPORTED = 0.025
"""Tolerated gap or penetration between a thing and its support, as found in real maps [m]."""


def perturb(scene: Scene, seed: int, *, radius: float = 0.45, height: float = 1.6) -> Scene:
    """Displace things at random, as the real world differs from a map; seed 0 changes nothing.

    Equal seeds give equal scenes. ``radius`` and ``height`` [m] describe an upright cylinder around the robot. Movable
    furniture is displaced first, with what stands on it, then graspable objects shift and turn on their support, then
    the robot's start. Whatever would touch something, or leave its support or the scene's bounds, stays where it is.
    """
    if seed == 0:
        return scene
    room = _Room(scene, np.random.default_rng(seed))
    for body in scene.bodies:
        if body.movable and not (body.graspable or body.thin) and body.shape in (BodyShape.BOX, BodyShape.CYLINDER):
            room.move_furniture(body)
    for body in scene.bodies:
        if (body.graspable or body.thin) and body.name not in room.supports.values():
            room.move_object(body)
    start = room.moved_start(radius, height)
    return replace(scene.with_poses(room.poses), start=start)


class _Room:
    """Poses of all bodies while they are displaced, one after another."""

    def __init__(self, scene: Scene, generator: np.random.Generator) -> None:
        self.scene, self.generator = scene, generator
        self.bodies = {body.name: body for body in scene.bodies}
        self.poses = {body.name: body.pose for body in scene.bodies}
        self._index = {body.name: index for index, body in enumerate(scene.bodies)}
        self._centres = np.array([body.pose.position for body in scene.bodies]).reshape(-1, 3)
        self._reach = np.array([_reach(body) for body in scene.bodies])
        half = {body.name: _half_height(body.pose, body) for body in scene.bodies}
        self.supports = {body.name: _support(body, self._around(body, body.pose), half) for body in scene.bodies}

    def _around(self, body: Body, pose: Pose) -> list[Body]:
        """List the bodies that a body at a pose may stand on, stand in or touch, in the order of the scene."""
        distances = np.hypot(*(self._centres - pose.position)[:, :2].T)
        return [self.scene.bodies[index] for index in np.flatnonzero(distances <= self._reach + _reach(body)).tolist()]

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
        for shift in self._shifts(FURNITURE_DISTANCE, 0.2):
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
        for shift in self._shifts(OBJECT_DISTANCE, math.pi):
            pose = _shifted(self.poses[body.name], shift, self.poses[body.name])
            stands = all(inside(surface, point, _RIM) for surface in surfaces for point in _outline(body, pose))
            if stands and self._is_free(body, pose, (body.name, support)):
                self._put({body.name: pose})
                return

    def moved_start(self, radius: float, height: float) -> tuple[float, float, float]:
        """Draw a start pose at which an upright cylinder is free."""
        x_min, y_min, x_max, y_max = self.scene.bounds
        start = self.scene.start
        for dx, dy, turn in self._shifts(START_DISTANCE, 0.5):
            x, y = start[0] + dx, start[1] + dy
            pose = Pose((x, y, height / 2 + 0.02))
            robot = Body("the robot", pose, (2 * radius, 2 * radius, height), BodyShape.CYLINDER)
            within = x_min + radius <= x <= x_max - radius and y_min + radius <= y <= y_max - radius
            if within and self._is_free(robot, pose, ()):
                return (x, y, start[2] + turn)
        return start

    def _shifts(self, distance: float, turn: float) -> Iterator[tuple[float, float, float]]:
        """Yield shifts, uniform in a disc, and turns, uniform in an interval."""
        uniform = self.generator.uniform
        for _ in range(_TRIES):
            angle, radius = uniform(0, 2 * math.pi), distance * math.sqrt(uniform(0, 1))
            yield radius * math.cos(angle), radius * math.sin(angle), float(uniform(-turn, turn))

    def _is_free(self, body: Body, pose: Pose, group: Sequence[str]) -> bool:
        """Check whether a body at a pose is clear of all bodies outside its group, except supports below it."""
        return not any(
            _overlap(one, one.pose, another, another.pose)
            for other in self._around(body, pose)
            if other.name not in group and other.name != body.name and other.shape is not BodyShape.MARKER
            for one, another in product(_solids(body, pose), _solids(other, self.poses[other.name]))
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
    for other in (one for one in bodies if one.wall and one is not body):
        floor = other.pose.position[2] - half[other.name] + other.wall
        if abs(floor - bottom) <= _RIM and inside(_outline(other, other.pose), body.pose.position):
            return other.name
    for other in bodies:
        if other is body or other.shape in (BodyShape.ROOM, BodyShape.MARKER, BodyShape.PERSON):
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
