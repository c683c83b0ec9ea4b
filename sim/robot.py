"""The robot in one physics client: joints, links, and bounding boxes of links."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import BadInput, Span, error
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, product, rigid, rotated, rotations
from planlang.geometry.shapes import ConvexSolid, SolidKind, convex_solid
from planlang.kept import Latest
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.description import Follower, loadable, read_description
from sim.engine import bullet, c_numbers, quiet
from sim.scene import RobotBody

BASE = ("x", "y", "yaw")
"""Coordinates of the base, used in place of joint names."""
WITHIN = 0.001
"""Distance of queries between links of one body [m]: with 0, PyBullet 3.2.7 misses overlaps of centimetres."""
MESH_MARGIN = 0.002
"""Margin by which PyBullet may enlarge a mesh [m]."""
_BALL = np.array([[math.cos(k * math.pi / 8), math.sin(k * math.pi / 8), 0.0] for k in range(16)])
"""Points on a horizontal unit circle."""
Shape = tuple[str, tuple[float, float, float], Pose]
"""Kind, extents [m] and pose of a primitive."""


Numbers = slice | Sequence[int] | NDArray[np.intp]
"""Numbers of solid links, as a row index."""

MOST_ROBOTS = 8
"""Number of descriptions whose link points are cached."""
_spanning: Latest[tuple[str, str], dict[int, Array]] = Latest(MOST_ROBOTS)
"""Points (n, 3) that span solid links, in their frames, by URDF and link number."""


@dataclass(slots=True)
class _Boxes:
    """Cached boxes around solid links; :meth:`Robot.show` marks the ones that move."""

    base: tuple[float, float, float]
    center: Array
    """(n, 3), in the map."""
    spans: Array
    """(n, 3, 3): axes, as columns, in the map."""
    stale: set[int]
    """Links, by number, that joints have moved since."""
    corners: tuple[Array, Array] | None = None
    """Map-aligned lower and upper corners (n, 3), computed on demand."""


class Robot:
    """URDF in a client, its base frame placed in the plane.

    ``show`` puts it into a configuration; all other methods refer to the configuration shown last. Links with collision
    shapes are "solid" and numbered 0..n-1 in the order of the URDF. Joints that mimic another are not listed as joints;
    they move along.
    """

    def __init__(self, client: int, body: RobotBody) -> None:
        self.client, self.body = client, body
        self.description = read_description(body.urdf)
        self.key = str(body.urdf), self.description.text
        """Key that identifies its description."""
        self.uid = self._load()
        self._read_joints()
        self._read_links()
        self._hulls: dict[int, list[ConvexSolid]] = {}
        self._points = _spanning.of(self.key, dict)
        self.shown: dict[str, float] = {}
        self.base = (0.0, 0.0, 0.0)
        every = len(self.solid)
        self._boxed = _Boxes(self.base, np.zeros((every, 3)), np.zeros((every, 3, 3)), set(range(every)))
        self._moved: dict[str, frozenset[int]] = {}
        self.moves = 0
        """Counter of placements: while it is unchanged, so are all link poses."""
        self.show(Configuration(self.base, {name: min(max(0.0, lo), hi) for name, (lo, hi) in self.limits.items()}))
        self._measure()
        self._moved |= {name: self._moved_with(name) for name in self.joints}
        self._apart: dict[frozenset[str], NDArray[np.bool_]] = {}
        self.grounded = frozenset(range(len(self.solid))).difference(
            *(self._below(index) for index in range(len(self.link_names) - 1) if index not in self.fixed)
        )
        """Numbers of the solid links that no joint moves: contact with the floor is normal for them."""
        self.show(Configuration(self.base, {**self.shown, **self._known(body.posture)}))
        self._at_first = Configuration(self.base, dict(self.shown))

    def _load(self) -> int:
        """Load the URDF into the client; raises BadInput if PyBullet refuses it."""
        with loadable(self.description) as path, quiet(), c_numbers():
            # the cache goes by file name, and temporary files reuse names
            bullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.client)
            # true cylinders, not polyhedra: faster and exact
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
        self._merged = {name: Pose.from_matrix(pose) for name, (_, pose) in self.description.merged.items()}
        """Poses of merged links in those that carry them."""
        self.links |= {name: self.links[carrier] for name, (carrier, _) in self.description.merged.items()}
        self._read_used()

    def _read_used(self) -> None:
        """Remove joints that mimic others; mark joints that are never commanded (wheels) as fixed."""
        moving = self.joints if self.body.moving is None else self.body.moving
        self.fixed |= {index for name, index in self.joints.items() if name not in moving}
        self.followers: dict[str, tuple[tuple[int, Follower], ...]] = {}
        """Joint -> indices of the joints that mimic it, with their ratios."""
        every = dict(self.joints)
        for name, followers in self.description.followers.items():
            if name not in every:  # it never moves, and so neither do they
                for one in followers:
                    bullet.resetJointState(self.uid, every[one.joint], one.offset, physicsClientId=self.client)
                    del self.joints[one.joint], self.limits[one.joint]
                    self.fixed.add(every[one.joint])
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
            for index in sorted(self.link_names)
            if bullet.getCollisionShapeData(self.uid, index, physicsClientId=self.client)
        ]
        self.solid_names = [self.link_names[index] for index in self.solid]
        self.number = {name: k for k, name in enumerate(self.solid_names)}
        self.number |= {n: self.number[c] for n, (c, _) in self.description.merged.items() if c in self.number}
        self._above = [frozenset(self.ancestors(index)) for index in self.solid]

    def _known(self, posture: Mapping[str, float]) -> dict[str, float]:
        unknown = sorted(set(posture) - set(self.joints))
        if unknown:
            raise ValueError(
                f"the robot has no joint {', '.join(unknown)}; {self.body.urdf.name} has {', '.join(self.joints)}"
            )
        return {name: float(value) for name, value in posture.items()}

    def whole(self, link: str) -> str:
        """Name of the link that a link is a part of, for one that was merged: contacts are those of the whole."""
        return self.description.merged[link][0] if link in self.description.merged else link

    def configuration(self) -> Configuration:
        """The configuration shown."""
        return Configuration(self.base, dict(self.shown))

    def show(self, configuration: Configuration) -> None:
        """Put the robot into a configuration; joints not named keep their values. ``ValueError`` if unknown."""
        changed = [(n, float(v)) for n, v in configuration.joints.items() if self.shown.get(n) != v]
        if changed:
            if any(name not in self.joints for name, _ in changed):
                self._known(dict(changed))
            moved = [(self.joints[name], value) for name, value in changed]
            if self.followers:
                moved += [
                    (index, one.multiplier * value + one.offset)
                    for name, value in changed
                    for index, one in self.followers.get(name, ())
                ]
            # NaN until they are set: an interrupt in between leaves them unknown, so that the next call sets them again
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

    def link_pose(self, link: str) -> Pose:
        """Pose of a link frame in the map; ``KeyError`` for an unknown link."""
        if link not in self.links:
            raise KeyError(f"the robot has no link {link!r}; it has {', '.join(self.links)}")
        index, pose = self.links[link], Pose.planar(*self.base)
        if index >= 0:
            state = bullet.getLinkState(self.uid, index, computeForwardKinematics=True, physicsClientId=self.client)
            pose = Pose(tuple(state[4]), tuple(state[5]))
        return pose @ self._merged[link] if link in self._merged else pose

    def frames(self) -> Array:
        """Frames of the solid links in the map (n, 7): positions and quaternions."""
        return self._frames(range(len(self.solid)))

    def _frames(self, numbers: Sequence[int]) -> Array:
        """Frames of some solid links, in their order."""
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
        """Store a box around each solid link, in its frame: the map-aligned one at this configuration."""
        frames = self.frames()
        axes = rotations(frames[:, 3:])
        around = [bullet.getAABB(self.uid, index, physicsClientId=self.client) for index in self.solid]
        corners = np.array(around, dtype=float).reshape(-1, 2, 3)
        self._axes = np.swapaxes(axes, 1, 2)
        self._center = rotated(self._axes, corners.mean(axis=1) - frames[:, :3])
        self._half = (corners[:, 1] - corners[:, 0]) / 2

    def boxes(self) -> tuple[Array, Array]:
        """Compute lower and upper corners (n, 3) of map-aligned boxes around the solid links, to 0.01 mm.

        PyBullet is queried only for links that joints have moved; after a move of the base the boxes move along, which
        rounds them slightly.
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
        """Oriented boxes around the solid links: centres (n, 3), axes (n, 3, 3) as columns, half extents (n, 3)."""
        return (*self._spans(self.frames(), slice(None)), self._half)

    def boxes_of(self, numbers: Sequence[int]) -> tuple[Array, Array]:
        """Compute the corners for some links, in ascending order; bit-equal whatever was shown before."""
        return self._corners(*self._spans(self._frames(numbers), numbers), numbers)

    def _spans(self, frames: Array, numbers: Numbers) -> tuple[Array, Array]:
        """Compute centres (m, 3) and axes (m, 3, 3) of boxes around some links at frames (m, 7)."""
        axes = rotations(frames[:, 3:])
        return frames[:, :3] + rotated(axes, self._center[numbers]), product(axes, self._axes[numbers])

    def _corners(self, center: Array, spans: Array, numbers: Numbers) -> tuple[Array, Array]:
        half = rotated(np.abs(spans), self._half[numbers])
        return center - half, center + half

    def boxes_along(self, numbers: Sequence[int], steps: Iterable[Mapping[str, float]]) -> tuple[Array, Array]:
        """Compute the corners for some links, ascending, at a sequence of joint values, which are shown in turn."""
        frames = [np.zeros((0, 7))]
        for joints in steps:
            self.show(Configuration(self.base, joints))
            frames.append(self._frames(numbers))
        every = np.tile(np.array(numbers, np.intp), len(frames) - 1)
        return self._corners(*self._spans(np.concatenate(frames), every), every)

    def ancestors(self, index: int) -> list[int]:
        """Chain of indices from a link to the root."""
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
        """Numbers of the solid links that a joint, or "x", "y", "yaw" of the base, moves."""
        return self._moved[name] if name in self._moved else frozenset(range(len(self.solid)))

    def moved_apart(self, names: frozenset[str]) -> NDArray[np.bool_]:
        """Find which pairs of solid links some joints move relative to each other, (n, n)."""
        if names not in self._apart:
            moved = np.zeros((len(names), len(self.solid)), bool)
            for row, name in zip(moved, sorted(names), strict=True):
                row[list(self.moved_by(name))] = True
            moved = np.unique(moved, axis=0)
            self._apart[names] = np.asarray((moved[:, :, None] != moved[:, None]).any(axis=0))
        return self._apart[names]

    def carrier(self, link: str) -> frozenset[int]:
        """Number of the nearest solid link at or above a link, which moves with it, as a set."""
        index = self._solid_above(link)
        return frozenset({self.solid.index(index)}) if index in self.solid else frozenset()

    def hand_of(self, link: str) -> frozenset[int]:
        """Numbers of the solid links of the hand at a link: the nearest at or above it, and all below that."""
        return self._below(self._solid_above(link))

    def _solid_above(self, link: str) -> int:
        """Index of the nearest solid link at or above a link, or of the root."""
        above = self.ancestors(self.links[link])
        return next((index for index in above if index in self.solid), above[-1])

    def spread(self, number: int) -> float:
        """Largest distance of a solid link from the map's z axis, where it is now [m]."""
        frame = self.link_pose(self.solid_names[number])
        largest = 0.0
        for one in self.hulls(number):
            if one.kind == SolidKind.MESH:
                return float(np.hypot(*self.points([number])[0].T[:2]).max()) + MESH_MARGIN
            points, radius = one.points, 0.0
            if one.kind != SolidKind.BOX:  # balls at both ends enclose a round shape
                points, radius = np.array([[0.0, 0.0, one.size[2] / 2], [0.0, 0.0, -one.size[2] / 2]]), one.size[0] / 2
            if one.kind == SolidKind.SPHERE:
                points = np.zeros((1, 3))
            there = moved((frame @ one.pose).matrix(), points)
            largest = max(largest, float(np.hypot(there[:, 0], there[:, 1]).max()) + radius)
        return largest

    def shapes(self, number: int) -> tuple[Shape, ...]:
        """Primitives of a solid link: kinds, extents [m] and poses in the link's frame.

        A cylinder's axis is z; a capsule is given as a cylinder without caps, a mesh as a box around it.
        """
        hulls = self.hulls(number)
        if any(one.kind == SolidKind.MESH for one in hulls):
            matrix = rigid(self._axes[number], self._center[number])
            x, y, z = (2 * self._half[number]).tolist()
            return ((SolidKind.MESH, (x, y, z), Pose.from_matrix(matrix)),)
        kinds = [SolidKind.CYLINDER if one.kind == SolidKind.CAPSULE else one.kind for one in hulls]
        return tuple((kind, one.size, one.pose) for kind, one in zip(kinds, hulls, strict=True))

    def hulls(self, number: int) -> list[ConvexSolid]:
        """Convex shapes of a solid link, in the link's frame."""
        if not self._hulls:
            # Bullet's poses are accurate to 1e-7 m only: measured anywhere else they would depend on what ran before
            now = Configuration(self.base, dict(self.shown))
            self.show(self._at_first)
            self._hulls = {one: self._hulls_of(one) for one in range(len(self.solid))}
            self.show(now)
        return self._hulls[number]

    def _hulls_of(self, number: int) -> list[ConvexSolid]:
        """Measure them at the configuration shown."""
        index = self.solid[number]
        frame = self.link_pose(self.link_names[index]).inverse()
        if index == -1:
            place = Pose(*bullet.getBasePositionAndOrientation(self.uid, physicsClientId=self.client))
        else:
            state = bullet.getLinkState(self.uid, index, computeForwardKinematics=True, physicsClientId=self.client)
            place = Pose(state[0], state[1])
        return _solids_of(self.client, self.uid, index, frame @ place)

    def points(self, numbers: Sequence[int]) -> list[Array]:
        """Points (n, 3) in the map that span the inside of solid links, on the circles of round shapes."""
        frames = self.frames()[list(numbers)]
        turns = rotations(frames[:, 3:])
        return [rotated(turn, self._spanning(k)) + at[:3] for k, turn, at in zip(numbers, turns, frames, strict=True)]

    def ground_points(self) -> Array:
        """Points (n, 3) in the map on the links that no joint moves."""
        return np.concatenate([np.zeros((0, 3)), *self.points(sorted(self.grounded))])

    def _spanning(self, number: int) -> Array:
        """Points of one link in its own frame."""
        if number not in self._points:
            groups = [np.zeros((0, 3))]  # an infinite plane has none
            for one in self.hulls(number):
                own = one.points if not one.radius else one.points + one.radius * _BALL
                groups.append(moved(one.pose.matrix(), own))
            self._points[number] = np.concatenate(groups).round(9)  # independent of the posture they were read in
        return self._points[number]

    def hand_links(self, link: str) -> frozenset[str]:
        """Names of the solid links of the hand at a link."""
        return frozenset(self.solid_names[number] for number in self.hand_of(link))

    def hand_radius(self, link: str, axis: tuple[float, float, float]) -> float:
        """Largest extent of the hand at a link, in its present posture, around an axis through the link's frame [m]."""
        lower, upper = self.boxes_of(sorted(self.hand_of(link)))
        points = np.array([np.where(side, lower, upper) for side in np.ndindex(2, 2, 2)]).reshape(-1, 3)
        pose = self.link_pose(link)
        offsets = rotated(pose.rotation.T, points - np.asarray(pose.position))
        across = offsets - np.outer(offsets @ np.asarray(axis), axis)
        return float(np.linalg.norm(across, axis=1).max())

    def hand_corners(self, link: str, without: Collection[str] = ()) -> Array:
        """Corners (n, 3) [m] of the pieces of the hand at a link, in its frame and present posture.

        ``without`` names links that are left out.
        """
        back = self.link_pose(link).inverse()
        groups = [np.zeros((0, 3))]
        left_out = set(map(self.whole, without))
        for number in sorted(one for one in self.hand_of(link) if self.solid_names[one] not in left_out):
            groups.append(moved((back @ self.link_pose(self.solid_names[number])).matrix(), self._spanning(number)))
        return np.concatenate(groups)

    def near_pairs(self, pairs: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
        """Select the pairs whose boxes overlap."""
        lower, upper = self.boxes()
        first, second = np.array(pairs, np.intp).reshape(-1, 2).T
        near = np.all((lower[first] <= upper[second]) & (upper[first] >= lower[second]), axis=1)
        return [pairs[k] for k in np.flatnonzero(near).tolist()]

    def depth_between(self, a: int, b: int) -> float:
        """Penetration depth of two solid links [m], 0 if they are apart."""
        points = bullet.getClosestPoints(
            self.uid, self.uid, WITHIN, self.solid[a], self.solid[b], physicsClientId=self.client
        )
        return max((-point[8] for point in points), default=0.0)

    def depth_with(self, number: int, uid: int) -> float:
        """Penetration depth of a solid link and a piece [m], 0 if they are apart."""
        points = bullet.getClosestPoints(self.uid, uid, 0.0, self.solid[number], -1, physicsClientId=self.client)
        return max((-point[8] for point in points), default=0.0)


def _text(name: bytes) -> str:
    return name.decode()


def _primitive(kind: int, dimensions: Sequence[float]) -> tuple[SolidKind, tuple[float, float, float]] | None:
    """Convert a PyBullet shape to a kind and extents [m]; None for a mesh."""
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
    """List the shapes of a link whose inertial frame is at a pose."""
    shapes = bullet.getCollisionShapeData(uid, index, physicsClientId=client)
    solids = []
    for shape in shapes:
        primitive = _primitive(shape[2], shape[3])
        if primitive is not None:
            solids.append(convex_solid(*primitive, at @ Pose(shape[5], shape[6])))
    # PyBullet returns the vertices of all meshes of a link together
    if any(shape[2] == bullet.GEOM_MESH for shape in shapes):
        points = np.array(bullet.getMeshData(uid, index, physicsClientId=client)[1]).reshape(-1, 3)
        solids.append(ConvexSolid(SolidKind.MESH, (0.0, 0.0, 0.0), at, points))
    return solids
