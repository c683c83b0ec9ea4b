"""The robot inside one physics client: joints, links, boxes around its links, pairs of links that must not touch."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import BadInput, Span, error
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, product, rigid, rotated, rotations
from planlang.geometry.shapes import ConvexSolid, SolidKind, convex_solid
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.description import Follower, loadable, read_description
from sim.engine import bullet, quiet
from sim.scene import RobotBody

BASE = ("x", "y", "yaw")
"""The coordinates of the base, where joints go by their names."""
WITHIN = 0.001
"""Distance up to which links of one body are looked at [m]: asked for 0, PyBullet 3.2.7 misses pairs that overlap by
centimetres."""
MESH_MARGIN = 0.002
"""Margin by which PyBullet may take a mesh wider than its vertices [m]."""
_BALL = np.array([[math.cos(k * math.pi / 8), math.sin(k * math.pi / 8), 0.0] for k in range(16)])
"""Points on a level circle of radius 1."""
Shape = tuple[str, tuple[float, float, float], Pose]
"""Kind, extents [m] and pose of a primitive."""


Numbers = slice | Sequence[int] | NDArray[np.intp]
"""Numbers of solid links, as a row index."""

MOST_ROBOTS = 8
"""Descriptions of which points of links are kept."""
_spanning: dict[tuple[str, str], dict[int, Array]] = {}
"""The points (n, 3) that span solid links, in their frames, by URDF and number: read once in a process."""


@dataclass(slots=True)
class _Boxes:
    """Boxes around solid links at their last poses: a cache that :meth:`Robot.show` notifies of moves."""

    base: tuple[float, float, float]
    center: Array
    """(n, 3), in the map."""
    spans: Array
    """(n, 3, 3): axes, as columns, in the map."""
    stale: set[int]
    """Numbers of the links that are elsewhere by now, not by the base alone."""
    corners: tuple[Array, Array] | None = None
    """Lower and upper ones along the map's axes (n, 3), once asked for."""


class Robot:
    """A URDF in a client, its base frame placed in the plane.

    ``show`` puts it into a configuration; every other method speaks of the configuration shown last. Links with
    collision shapes are "solid" and numbered 0..n-1 in the order of the URDF. Joints that mimic another are no joints
    here: they move with it.
    """

    def __init__(self, client: int, body: RobotBody) -> None:
        self.client, self.body = client, body
        self.description = read_description(body.urdf)
        self.key = str(body.urdf), self.description.text
        """The key that identifies its description."""
        self.uid = self._load()
        self._read_joints()
        self._read_links()
        self._hulls: dict[int, list[ConvexSolid]] = {}
        while len(_spanning) > MOST_ROBOTS:
            del _spanning[next(iter(_spanning))]
        self._points = _spanning.setdefault(self.key, {})
        self.shown: dict[str, float] = {}
        self.base = (0.0, 0.0, 0.0)
        every = len(self.solid)
        self._boxed = _Boxes(self.base, np.zeros((every, 3)), np.zeros((every, 3, 3)), set(range(every)))
        self._moved: dict[str, frozenset[int]] = {}
        self.moves = 0
        """The number of times it was put elsewhere: while this stays, so do its links."""
        self.show(Configuration(self.base, {name: min(max(0.0, lo), hi) for name, (lo, hi) in self.limits.items()}))
        self._measure()
        self._moved |= {name: self._moved_with(name) for name in self.joints}
        self._apart: dict[frozenset[str], NDArray[np.bool_]] = {}
        self.grounded = frozenset(range(len(self.solid))).difference(
            *(self._below(index) for index in range(len(self.link_names) - 1) if index not in self.fixed)
        )
        """Numbers of the solid links that no joint lifts: the floor is no obstacle to them."""
        self.show(Configuration(self.base, {**self.shown, **self._known(body.posture)}))
        self._at_first = Configuration(self.base, dict(self.shown))

    def _load(self) -> int:
        """Load the body into the client; raises BadInput if PyBullet refuses the URDF."""
        with loadable(self.description) as path, quiet():
            # what is kept of a file would be taken for another one of the same name
            bullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.client)
            # true cylinders, not polyhedra: faster and as wide as they are
            flags = bullet.URDF_USE_IMPLICIT_CYLINDER
            try:
                return int(bullet.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=self.client))
            except bullet.error as problem:
                message = f"the simulator cannot load this URDF: {problem}"
                raise BadInput([error("B009", message, Span(str(self.body.urdf)))]) from None

    def _read_joints(self) -> None:
        self.joints: dict[str, int] = {}
        self.limits: dict[str, tuple[float, float]] = {}
        self.links: dict[str, int] = {_text(bullet.getBodyInfo(self.uid, physicsClientId=self.client)[0]): -1}
        self.parent: dict[int, int] = {-1: -2}
        self.fixed: set[int] = set()
        for index in range(bullet.getNumJoints(self.uid, physicsClientId=self.client)):
            info = bullet.getJointInfo(self.uid, index, physicsClientId=self.client)
            self.links[_text(info[12])], self.parent[index] = index, info[16]
            if info[2] not in (bullet.JOINT_REVOLUTE, bullet.JOINT_PRISMATIC):
                self.fixed.add(index)
                continue
            lower, upper = float(info[8]), float(info[9])
            self.joints[_text(info[1])] = index
            self.limits[_text(info[1])] = (lower, upper) if lower < upper else (-float("inf"), float("inf"))
        self.link_names = {index: name for name, index in self.links.items()}
        self._read_used()

    def _read_used(self) -> None:
        """Take out joints that follow others; note joints that never move because nothing uses them (wheels)."""
        moving = self.joints if self.body.moving is None else self.body.moving
        self.fixed |= {index for name, index in self.joints.items() if name not in moving}
        self.followers: dict[str, tuple[tuple[int, Follower], ...]] = {}
        """Joint -> indices of the joints that mimic it, and how."""
        every = dict(self.joints)
        for name, followers in self.description.followers.items():
            if name not in every:
                continue
            self.followers[name] = tuple((every[one.joint], one) for one in followers if one.joint in every)
            for index, one in self.followers[name]:
                del self.joints[one.joint], self.limits[one.joint]
                if name in moving:
                    self.fixed.discard(index)

    def _read_links(self) -> None:
        inertial = bullet.getDynamicsInfo(self.uid, -1, physicsClientId=self.client)
        self._inertial = Pose(tuple(inertial[3]), tuple(inertial[4]))
        self._frame = self._inertial.inverse()
        self.solid = [
            index
            for index in sorted(self.links.values())
            if bullet.getCollisionShapeData(self.uid, index, physicsClientId=self.client)
        ]
        self.solid_names = [self.link_names[index] for index in self.solid]
        self.number = {name: k for k, name in enumerate(self.solid_names)}
        self._above = [frozenset(self.ancestors(index)) for index in self.solid]

    def _known(self, posture: Mapping[str, float]) -> dict[str, float]:
        unknown = sorted(set(posture) - set(self.joints))
        if unknown:
            raise ValueError(
                f"the robot has no joint {', '.join(unknown)}; {self.body.urdf.name} has {', '.join(self.joints)}"
            )
        return {name: float(value) for name, value in posture.items()}

    def configuration(self) -> Configuration:
        """Return the configuration that is shown."""
        return Configuration(self.base, dict(self.shown))

    def show(self, configuration: Configuration) -> None:
        """Put the robot there; joints not named stay. Unknown joints raise ``ValueError``."""
        changed = [(n, float(v)) for n, v in configuration.joints.items() if self.shown.get(n) != v]
        if changed:
            if any(name not in self.joints for name, _ in changed):
                self._known(dict(changed))
            moved = [(self.joints[name], value) for name, value in changed]
            if self.followers:
                moved += [follow for name, value in changed for follow in self._following(name, value)]
            # until they are there nobody knows where they are: an interrupt may come at any moment
            self.moves += 1
            self._boxed.stale.update(*(self._moved.get(name, ()) for name, _ in changed))
            self.shown.update((name, math.nan) for name, _ in changed)
            bullet.resetJointStatesMultiDof(
                self.uid,
                [index for index, _ in moved],
                [[value] for _, value in moved],
                physicsClientId=self.client,
            )
            self.shown.update(changed)
        base = (float(configuration.base[0]), float(configuration.base[1]), float(configuration.base[2]))
        if base != self.base:
            pose = Pose.planar(*base) @ self._inertial
            self.moves, self.base = self.moves + 1, (math.nan, math.nan, math.nan)
            bullet.resetBasePositionAndOrientation(
                self.uid, pose.position, pose.orientation, physicsClientId=self.client
            )
            self.base = base

    def _following(self, name: str, value: float) -> list[tuple[int, float]]:
        """Return where the joints are that mimic a joint, by index."""
        return [(index, one.multiplier * value + one.offset) for index, one in self.followers.get(name, ())]

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link frame in the map; ``KeyError`` for an unknown link."""
        if link not in self.links:
            raise KeyError(f"the robot has no link {link!r}; it has {', '.join(self.links)}")
        index = self.links[link]
        if index < 0:
            return Pose.planar(*self.base)
        state = bullet.getLinkState(self.uid, index, computeForwardKinematics=True, physicsClientId=self.client)
        return Pose(tuple(state[4]), tuple(state[5]))

    def frames(self) -> Array:
        """Return (n, 7) positions and quaternions in the map of the frames of the solid links."""
        return self._frames(range(len(self.solid)))

    def _frames(self, numbers: Sequence[int]) -> Array:
        """Return the same for links of some numbers, in their order."""
        indices, rows = [self.solid[number] for number in numbers], []
        if indices and indices[0] < 0:
            pose = Pose.planar(*self.base)
            rows.append(pose.position + pose.orientation)
        moving = indices[len(rows) :]
        if moving:
            states = bullet.getLinkStates(self.uid, moving, computeForwardKinematics=True, physicsClientId=self.client)
            rows += [state[4] + state[5] for state in states]
        return np.array(rows, dtype=float).reshape(-1, 7)

    def _measure(self) -> None:
        """Keep a box around each solid link, in its frame: the map-aligned one at this configuration."""
        frames = self.frames()
        axes = rotations(frames[:, 3:])
        around = [bullet.getAABB(self.uid, index, physicsClientId=self.client) for index in self.solid]
        corners = np.array(around, dtype=float).reshape(-1, 2, 3)
        self._axes = np.swapaxes(axes, 1, 2)
        self._center = rotated(self._axes, corners.mean(axis=1) - frames[:, :3])
        self._half = (corners[:, 1] - corners[:, 0]) / 2

    def boxes(self) -> tuple[Array, Array]:
        """Return (n, 3) lower and upper corners of map-aligned boxes around the solid links, right to 0.01 mm.

        Only what joints have moved is asked of PyBullet; the boxes go along with the base, which it rounds a little.
        """
        last = self._boxed
        if last.stale and last.base != self.base:
            last.stale.update(range(len(self.solid)))
        if last.stale:
            numbers = sorted(last.stale)
            last.center[numbers], last.spans[numbers] = self._spans(self._frames(numbers), numbers)
            last.base, last.corners = self.base, None
            last.stale.clear()
        if last.base == self.base:
            last.corners = last.corners or self._corners(last.center, last.spans, slice(None))
            return last.corners
        turn = Pose.planar(0.0, 0.0, self.base[2] - last.base[2]).rotation
        (x, y, _), (to_x, to_y, _) = last.base, self.base
        return self._corners(
            rotated(turn, last.center - (x, y, 0.0)) + np.array([to_x, to_y, 0.0]),
            product(turn, last.spans),
            slice(None),
        )

    def spans(self) -> tuple[Array, Array, Array]:
        """Return boxes around the solid links: centres (n, 3), axes (n, 3, 3) as columns, half extents (n, 3)."""
        return (*self._spans(self.frames(), slice(None)), self._half)

    def boxes_of(self, numbers: Sequence[int]) -> tuple[Array, Array]:
        """Return the same for links of some numbers in ascending order, to the last bit whatever was shown before."""
        return self._corners(*self._spans(self._frames(numbers), numbers), numbers)

    def _spans(self, frames: Array, numbers: Numbers) -> tuple[Array, Array]:
        """Return centres (m, 3) of boxes around links of some numbers, and their axes (m, 3, 3), at frames (m, 7)."""
        axes = rotations(frames[:, 3:])
        return frames[:, :3] + rotated(axes, self._center[numbers]), product(axes, self._axes[numbers])

    def _corners(self, center: Array, spans: Array, numbers: Numbers) -> tuple[Array, Array]:
        half = rotated(np.abs(spans), self._half[numbers])
        return center - half, center + half

    def boxes_along(self, numbers: Sequence[int], steps: Iterable[Mapping[str, float]]) -> tuple[Array, Array]:
        """Return the same for links of some numbers, ascending, at joint values that are shown one after another."""
        frames = [np.zeros((0, 7))]
        for joints in steps:
            self.show(Configuration(self.base, joints))
            frames.append(self._frames(numbers))
        every = np.tile(np.array(numbers, np.intp), len(frames) - 1)
        return self._corners(*self._spans(np.concatenate(frames), every), every)

    def ancestors(self, index: int) -> list[int]:
        """Return a link and its ancestors, by index."""
        chain = [index]
        while chain[-1] != -1:
            chain.append(self.parent[chain[-1]])
        return chain

    def _below(self, index: int) -> frozenset[int]:
        return frozenset(k for k, above in enumerate(self._above) if index in above)

    def _moved_with(self, name: str) -> frozenset[int]:
        indices = (self.joints[name], *(index for index, _ in self.followers.get(name, ())))
        return frozenset[int]().union(*map(self._below, indices))

    def moved_by(self, name: str) -> frozenset[int]:
        """Return the numbers of the solid links that a joint, or "x", "y", "yaw" of the base, moves."""
        return self._moved[name] if name in self._moved else frozenset(range(len(self.solid)))

    def moved_apart(self, names: frozenset[str]) -> NDArray[np.bool_]:
        """Return which pairs of solid links some joints move against each other, (n, n)."""
        if names not in self._apart:
            moved = np.zeros((len(names), len(self.solid)), bool)
            for row, name in zip(moved, sorted(names), strict=True):
                row[list(self.moved_by(name))] = True
            moved = np.unique(moved, axis=0)
            self._apart[names] = np.asarray((moved[:, :, None] != moved[:, None]).any(axis=0))
        return self._apart[names]

    def carrier(self, link: str) -> frozenset[int]:
        """Return the numbers of the nearest solid link upwards from a link: it moves when the link does."""
        index = self._solid_above(link)
        return frozenset({self.solid.index(index)}) if index in self.solid else frozenset()

    def hand_of(self, link: str) -> frozenset[int]:
        """Return the numbers of the solid links of the hand at a link: the next solid link upwards and all below it."""
        return self._below(self._solid_above(link))

    def _solid_above(self, link: str) -> int:
        """Return the index of the nearest solid link upwards from a link, or of the root."""
        above = self.ancestors(self.links[link])
        return next((index for index in above if index in self.solid), above[-1])

    def spread(self, number: int) -> float:
        """Return how far a solid link reaches from the map's z axis, in its present place [m]."""
        frame = self.link_pose(self.solid_names[number])
        away = 0.0
        for one in self.hulls(number):
            if one.kind == SolidKind.MESH:
                return float(np.hypot(*self.points([number])[0].T[:2]).max()) + MESH_MARGIN
            points, radius = one.points, 0.0
            if one.kind != SolidKind.BOX:  # balls at the ends of a round shape hold it
                points, radius = np.array([[0.0, 0.0, one.size[2] / 2], [0.0, 0.0, -one.size[2] / 2]]), one.size[0] / 2
            if one.kind == SolidKind.SPHERE:
                points = np.zeros((1, 3))
            there = moved((frame @ one.pose).matrix(), points)
            away = max(away, float(np.hypot(there[:, 0], there[:, 1]).max()) + radius)
        return away

    def shapes(self, number: int) -> tuple[Shape, ...]:
        """Return the primitives of a solid link: kinds, extents [m] and poses in the link's frame.

        A cylinder lies along z (a capsule is given as one, without its caps); of a mesh it is a box around it.
        """
        found = self.hulls(number)
        if any(one.kind == SolidKind.MESH for one in found):
            matrix = rigid(self._axes[number], self._center[number])
            x, y, z = (2 * self._half[number]).tolist()
            return ((SolidKind.MESH, (x, y, z), Pose.from_matrix(matrix)),)
        kinds = [SolidKind.CYLINDER if one.kind == SolidKind.CAPSULE else one.kind for one in found]
        return tuple((kind, one.size, one.pose) for kind, one in zip(kinds, found, strict=True))

    def hulls(self, number: int) -> list[ConvexSolid]:
        """Return the convex shapes of a solid link, in the link's frame."""
        if not self._hulls:
            # Bullet tells places to about 1e-7 m: from wherever the robot stands they would depend on what ran before
            now = Configuration(self.base, dict(self.shown))
            self.show(self._at_first)
            self._hulls = {one: self._hulls_of(one) for one in range(len(self.solid))}
            self.show(now)
        return self._hulls[number]

    def _hulls_of(self, number: int) -> list[ConvexSolid]:
        """Work out the same where the robot is shown."""
        index = self.solid[number]
        frame = self.link_pose(self.link_names[index]).inverse()
        if index == -1:
            place = Pose(*bullet.getBasePositionAndOrientation(self.uid, physicsClientId=self.client))
        else:
            state = bullet.getLinkState(self.uid, index, computeForwardKinematics=True, physicsClientId=self.client)
            place = Pose(state[0], state[1])
        return _solids_of(self.client, self.uid, index, frame @ place)

    def points(self, numbers: Sequence[int]) -> list[Array]:
        """Return points (n, 3) in the map that span what solid links surely fill, all around round shapes."""
        frames = self.frames()[list(numbers)]
        turns = rotations(frames[:, 3:])
        return [rotated(turn, self._spanning(k)) + at[:3] for k, turn, at in zip(numbers, turns, frames, strict=True)]

    def _spanning(self, number: int) -> Array:
        """Return the points of one link in its own frame."""
        if number not in self._points:
            found = [np.zeros((0, 3))]  # of an endless plane there are none
            for one in self.hulls(number):
                own = one.points if not one.radius else one.points + one.radius * _BALL
                found.append(moved(one.pose.matrix(), own))
            self._points[number] = np.concatenate(found).round(9)  # whatever posture they were read in
        return self._points[number]

    def hand_links(self, link: str) -> frozenset[str]:
        """Return the names of the solid links of the hand at a link."""
        return frozenset(self.solid_names[number] for number in self.hand_of(link))

    def hand_radius(self, link: str, axis: tuple[float, float, float]) -> float:
        """Return how far the hand at a link extends around an axis through the link's frame, as it is now [m]."""
        lower, upper = self.boxes_of(sorted(self.hand_of(link)))
        points = np.array([np.where(side, lower, upper) for side in np.ndindex(2, 2, 2)]).reshape(-1, 3)
        pose = self.link_pose(link)
        away = rotated(pose.rotation.T, points - np.asarray(pose.position))
        across = away - np.outer(away @ np.asarray(axis), axis)
        return float(np.linalg.norm(across, axis=1).max())

    def hand_corners(self, link: str, without: Collection[str] = ()) -> Array:
        """Return the corners (n, 3) [m] of the pieces of the hand at a link, in its frame, as it is.

        ``without`` names links that are left out.
        """
        back = self.link_pose(link).inverse()
        found = [np.zeros((0, 3))]
        for number in sorted(one for one in self.hand_of(link) if self.solid_names[one] not in without):
            found.append(moved((back @ self.link_pose(self.solid_names[number])).matrix(), self._spanning(number)))
        return np.concatenate(found)

    def near_pairs(self, pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
        """Return the pairs whose boxes overlap."""
        lower, upper = self.boxes()
        first, second = np.array(pairs, np.intp).reshape(-1, 2).T
        near = np.all((lower[first] <= upper[second]) & (upper[first] >= lower[second]), axis=1)
        return [pairs[k] for k in np.flatnonzero(near).tolist()]

    def depth_between(self, a: int, b: int) -> float:
        """Return the penetration of two solid links [m], 0 when they are apart."""
        points = bullet.getClosestPoints(
            self.uid, self.uid, WITHIN, self.solid[a], self.solid[b], physicsClientId=self.client
        )
        return max((-point[8] for point in points), default=0.0)

    def depth_with(self, number: int, uid: int) -> float:
        """Return the penetration of a solid link and a piece [m], 0 when they are apart."""
        points = bullet.getClosestPoints(self.uid, uid, 0.0, self.solid[number], -1, physicsClientId=self.client)
        return max((-point[8] for point in points), default=0.0)


def _text(name: bytes) -> str:
    return name.decode()


def _primitive(kind: int, dimensions: Sequence[float]) -> tuple[SolidKind, tuple[float, float, float]] | None:
    """Return the kind and extents [m] of a primitive, as PyBullet gives them; None for a mesh."""
    a, b, c = dimensions
    match kind:
        case bullet.GEOM_BOX:
            return SolidKind.BOX, (a, b, c)
        case bullet.GEOM_SPHERE:
            return SolidKind.SPHERE, (2 * a, 2 * a, 2 * a)
        case bullet.GEOM_CYLINDER:
            return SolidKind.CYLINDER, (2 * b, 2 * b, a)
        case bullet.GEOM_CAPSULE:
            return SolidKind.CAPSULE, (2 * b, 2 * b, a)
    return None


def _solids_of(client: int, uid: int, index: int, at: Pose) -> list[ConvexSolid]:
    """Return the shapes of a link whose frame of mass is at a pose."""
    shapes = bullet.getCollisionShapeData(uid, index, physicsClientId=client)
    found = []
    for shape in shapes:
        primitive = _primitive(shape[2], shape[3])
        if primitive is not None:
            found.append(convex_solid(*primitive, at @ Pose(shape[5], shape[6])))
    if any(shape[2] == bullet.GEOM_MESH for shape in shapes):  # the vertices of all meshes of a link come at once
        points = np.array(bullet.getMeshData(uid, index, physicsClientId=client)[1]).reshape(-1, 3)
        found.append(ConvexSolid(SolidKind.MESH, (0.0, 0.0, 0.0), at, points))
    return found
