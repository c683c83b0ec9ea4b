"""A judge of answers that shares no code with what finds them: the room and the robot in a PyBullet client of its own.

Used by the benchmark, by the sampler it measures and by the exhaustive search; it knows URDF, room and nothing else.
What a person is made of is part of the room: the simulator's figure, for whoever judges.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pybullet

from executive.robots import Robot
from planlang.geometry import Array, Pose
from sim import Body
from sim.bodies import plain
from sim.engine import quiet
from sim.people import parts_of
from tests.support.locations.room_walls import walls_of
from tests.support.locations.rooms import Room

TOUCHING = 0.002
"""Penetrations up to this depth are touching [m]: PyBullet's cylinders of a URDF are polyhedra, up to 1 mm wider."""
PRESSED = 0.0005
"""Beyond this something is pressed into something else [m]: what a search accepts that nobody has to confirm."""
WITHIN = 0.001
"""Distances up to this are asked for [m]: asked for none at all, PyBullet does not tell all penetrations."""
TIP, TURN = 2e-3, 2e-2
"""How far a tip may be from the pose that is claimed [m], [rad]."""
STEPS = 8
"""In so many steps the way from one pose of a claim to the next is looked at; in twice as many what one touches that
it tells, of which the tip is looked at everywhere.
"""
NEIGHBOURS = 2
"""Links that are so few joints apart may touch each other."""
GAZES = 15
"""Postures of each joint of the neck that are tried."""
SAMPLES = 40
"""Random postures; links that touch in nearly all of them are modelled so."""

BasePose = tuple[float, float, float]
HERE = Pose((0.0, 0.0, 0.0))


@dataclass(frozen=True, slots=True)
class Claim:
    """The claim of an answer: from this base the joints (k, d) bring an arm's tip to poses (k, 4, 4), touching nothing.

    The hand may touch ``target``; ``fingers`` says where its own are meanwhile. From pose to pose it goes
    straight; ``motions`` are the joints (n, d) with which, k - 1 of them, or none if that is not told.
    """

    base: BasePose
    arm: str
    joints: tuple[str, ...]
    values: Array
    poses: Array
    target: str | None
    fingers: Mapping[str, float]
    motions: tuple[Array, ...] = ()


class Oracle:
    """A room and a robot in a client of its own."""

    def __init__(self, room: Room, robot: Robot) -> None:
        self.room, self.robot = room, robot
        self.client = pybullet.connect(pybullet.DIRECT)
        flags = pybullet.URDF_USE_SELF_COLLISION | pybullet.URDF_IGNORE_VISUAL_SHAPES
        with quiet():
            self.uid = pybullet.loadURDF(str(robot.urdf), useFixedBase=True, flags=flags, physicsClientId=self.client)
        self.joints: dict[str, int] = {}
        self.links = {robot.base_link: -1}
        self.parents: dict[int, int] = {}
        self.limits: dict[str, tuple[float, float]] = {}
        for index in range(pybullet.getNumJoints(self.uid, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.uid, index, physicsClientId=self.client)
            self.links[info[12].decode()] = index
            self.parents[index] = info[16]
            if info[2] != pybullet.JOINT_FIXED:
                name = info[1].decode()
                self.joints[name] = index
                endless = info[2] == pybullet.JOINT_REVOLUTE and info[8] >= info[9]
                self.limits[name] = (-math.inf, math.inf) if endless else (float(info[8]), float(info[9]))
        self.names = {index: name for name, index in self.links.items()}
        self.followers = followers(robot.urdf)
        self._inertial = pybullet.getDynamicsInfo(self.uid, -1, physicsClientId=self.client)[3:5]
        self.posture: dict[str, float] = {name: _nearest_zero(ends) for name, ends in self.limits.items()}
        self.posture |= {n: v for n, v in robot.postures.get("carrying", {}).items() if n in self.joints}
        self.pieces: dict[int, str] = {}
        self._offsets: dict[int, Pose] = {}
        self._near: dict[tuple[int, int], bool] = {}
        """Whether two links are neighbours."""
        for body in room.bodies:
            self._build(body)
        self._allowed = self._modelled_so()
        self.checks = 0
        self._gazes: list[Array] | None = None

    def close(self) -> None:
        """End the client."""
        pybullet.disconnect(self.client)

    # Building

    def _build(self, body: Body) -> None:
        if body.shape == "room":
            for at, size in walls_of(body):
                self._piece(body.name, "box", size, at)
        else:
            for part in parts_of(body) if body.shape == "person" else plain(body):
                self._piece(body.name, part.kind, part.size, body.pose, part.offset)

    def _piece(self, name: str, kind: str, size: Sequence[float], at: Pose, offset: Pose = HERE) -> None:
        match kind:
            case "cylinder":
                shape = {"shapeType": pybullet.GEOM_CYLINDER, "radius": max(size[:2]) / 2, "height": size[2]}
            case "sphere":
                shape = {"shapeType": pybullet.GEOM_SPHERE, "radius": max(size) / 2}
            case _:
                shape = {"shapeType": pybullet.GEOM_BOX, "halfExtents": [extent / 2 for extent in size]}
        solid = pybullet.createCollisionShape(physicsClientId=self.client, **shape)
        seen = {"length" if key == "height" else key: value for key, value in shape.items()}
        visual = pybullet.createVisualShape(physicsClientId=self.client, **seen)
        pose = at @ offset
        uid = pybullet.createMultiBody(0, solid, visual, pose.position, pose.orientation, physicsClientId=self.client)
        self.pieces[uid], self._offsets[uid] = name, offset

    def move(self, name: str, pose: Pose) -> None:
        """Put a body of the room elsewhere: a leaf that is open, a thing that was carried away."""
        for uid, owner in self.pieces.items():
            if owner == name:
                there = pose @ self._offsets[uid]
                pybullet.resetBasePositionAndOrientation(
                    uid, there.position, there.orientation, physicsClientId=self.client
                )
        pybullet.performCollisionDetection(physicsClientId=self.client)

    def _modelled_so(self) -> set[frozenset[int]]:
        """Pairs of links that touch because of how the robot is modelled: in its posture, or whatever it does."""
        allowed = {frozenset((self.links[a], self.links[b])) for a, b in self.robot.allowed_contacts}
        for arm in self.robot.arms:
            if arm.gripper is not None:
                fingers = [self.links[name] for name in arm.gripper.finger_links]
                allowed |= {frozenset((a, b)) for a in fingers for b in fingers if a != b}
        self.place((0.0, 0.0, 0.0), self.posture)
        allowed |= self._self_contacts(allowed)
        rng, counts = np.random.default_rng(0), dict[frozenset[int], int]()
        for _ in range(SAMPLES):
            spans = {name: np.clip(ends, -math.pi, math.pi) for name, ends in self.limits.items()}
            self.place((0.0, 0.0, 0.0), {name: float(rng.uniform(*span)) for name, span in spans.items()})
            for pair in self._self_contacts(allowed):
                counts[pair] = counts.get(pair, 0) + 1
        return allowed | {pair for pair, count in counts.items() if count > 0.9 * SAMPLES}

    def _self_contacts(self, allowed: set[frozenset[int]], depth: float = TOUCHING) -> set[frozenset[int]]:
        return {pair for pair, point in self._pressed().items() if point[8] < -depth} - allowed

    def _pressed(self) -> dict[frozenset[int], tuple[Any, ...]]:
        """Pairs of links that are pressed into each other, where the robot is, and PyBullet's deepest point of each."""
        points = pybullet.getClosestPoints(self.uid, self.uid, WITHIN, physicsClientId=self.client)
        deep = [point for point in points if point[8] < 0.0 and not self._neighbours(point[3], point[4])]
        return {frozenset((p[3], p[4])): p for p in sorted(deep, key=lambda point: -float(point[8]))}

    def pressed_into_itself(self) -> list[tuple[Any, ...]]:
        """PyBullet's deepest point of each pair of links that are pressed into each other and should not be."""
        return [point for pair, point in self._pressed().items() if pair not in self._allowed]

    def _neighbours(self, one: int, other: int) -> bool:
        if (one, other) not in self._near:
            self._near[one, other] = self._are_neighbours(one, other)
        return self._near[one, other]

    def _are_neighbours(self, one: int, other: int) -> bool:
        up, down = self.upwards(one), self.upwards(other)
        shared = next(link for link in up if link in down)
        between = (*up[: up.index(shared)], *down[: down.index(shared)])
        moving = [link for link in between if link in self.joints.values()]
        return len(moving) <= NEIGHBOURS

    def upwards(self, link: int) -> list[int]:
        """A link and what carries it, down to the base."""
        chain = [link]
        while chain[-1] != -1:
            chain.append(self.parents[chain[-1]])
        return chain

    # Asking

    def place(self, base: BasePose, joints: Mapping[str, float]) -> None:
        """Put the robot somewhere; joints not named stay, those that mimic one go with it."""
        turn = (0.0, 0.0, math.sin(base[2] / 2), math.cos(base[2] / 2))
        self._put(([base[0], base[1], 0.0], turn), joints)

    def _put(self, frame: tuple[Sequence[float], Sequence[float]], joints: Mapping[str, float]) -> None:
        there = pybullet.multiplyTransforms(*frame, *self._inertial)
        pybullet.resetBasePositionAndOrientation(self.uid, *there, physicsClientId=self.client)
        for name, value in {**joints, **led(joints, self.followers)}.items():
            pybullet.resetJointState(self.uid, self.joints[name], value, physicsClientId=self.client)

    def link(self, name: str) -> Array:
        """Frame (4, 4) of a link in the map."""
        index = self.links[name]
        if index == -1:
            position, turn = pybullet.getBasePositionAndOrientation(self.uid, physicsClientId=self.client)
            back = pybullet.invertTransform(*self._inertial)
            position, turn = pybullet.multiplyTransforms(position, turn, *back)
        else:
            state = pybullet.getLinkState(self.uid, index, computeForwardKinematics=True, physicsClientId=self.client)
            position, turn = state[4], state[5]
        frame = np.eye(4)
        frame[:3, :3] = np.array(pybullet.getMatrixFromQuaternion(turn)).reshape(3, 3)
        frame[:3, 3] = position
        return frame

    def hand_links(self, arm: str) -> frozenset[int]:
        """Links that an arm's hand consists of."""
        root = self.links[self.robot.arm(arm).hand_link]
        return frozenset(link for link in self.links.values() if root in self.upwards(link))

    def fingers(self, arm: str) -> frozenset[int]:
        """Links that may touch what the hand takes: its fingers, or all of a hand without these."""
        gripper = self.robot.arm(arm).gripper
        return self.hand_links(arm) if gripper is None else frozenset(self.links[one] for one in gripper.finger_links)

    def touched(
        self, hand: Iterable[int] = (), target: str | None = None, *, itself: bool = True, depth: float = TOUCHING
    ) -> tuple[str, str] | None:
        """One pair of (link, body or link) that penetrate more than ``depth``, where the robot is.

        ``hand`` may touch ``target``.
        """
        self.checks += 1
        may = set(hand)
        for name, link in self.links.items():
            low, high = pybullet.getAABB(self.uid, link, physicsClientId=self.client)
            for uid, _ in pybullet.getOverlappingObjects(low, high, physicsClientId=self.client) or ():
                body = self.pieces.get(uid)
                if body is None or (body == target and link in may):
                    continue
                points = pybullet.getClosestPoints(self.uid, uid, WITHIN, link, physicsClientId=self.client)
                if any(point[8] < -depth for point in points):
                    return name, body
        if itself:
            for pair in self._self_contacts(self._allowed, depth):
                one, other = sorted(pair)
                return self.names[one], self.names[other]
        return None

    def hand_alone_is_free(self, arm: str, joints: Mapping[str, float], base: Array, target: str) -> bool:
        """Return whether a hand touches nothing but its target while the robot hangs in the air at a pose (4, 4)."""
        pose = Pose.from_matrix(base)
        self._put((pose.position, pose.orientation), joints)
        fingers = self.fingers(arm)
        for link in sorted(self.hand_links(arm)):
            low, high = pybullet.getAABB(self.uid, link, physicsClientId=self.client)
            for uid, _ in pybullet.getOverlappingObjects(low, high, physicsClientId=self.client) or ():
                body = self.pieces.get(uid)
                if body is None or (body == target and link in fingers):
                    continue
                points = pybullet.getClosestPoints(self.uid, uid, WITHIN, link, physicsClientId=self.client)
                if any(point[8] < -TOUCHING for point in points):
                    return False
        return True

    def comes_straight(self, claim: Claim) -> bool:
        """Return whether the hand alone, on straight lines from pose to pose, touches nothing but its target."""
        arm = self.robot.arm(claim.arm)
        joints = dict(zip(claim.joints, map(float, claim.values[0]), strict=True))
        joints |= claim.fingers
        self.place((0.0, 0.0, 0.0), joints)
        back = np.linalg.inv(self.link(arm.tip))
        target = claim.target or ""
        return all(self.hand_alone_is_free(claim.arm, joints, pose @ back, target) for pose in straight(claim.poses))

    def sees(self, base: BasePose, target: str) -> bool:
        """Return whether some posture of the neck shows the camera 30 % of a body, as its size and distance say.

        True for a robot without camera.
        """
        camera = self.robot.camera
        if camera is None:
            return True
        if self._gazes is None:
            self._gazes = list(self._all_gazes(camera.link))
        body = self.room.body(target)
        place = Pose.planar(*base).matrix()
        point = np.linalg.inv(place) @ np.append(np.array(body.pose.position), 1.0)
        best: tuple[float, Array] = (math.inf, np.eye(4))
        for frame in self._gazes:
            arrow = point[:3] - frame[:3, 3]
            away = float(np.linalg.norm(arrow))
            miss = 1.0 - float(frame[:3, :3] @ np.array(camera.forward) @ arrow) / away
            if camera.near <= away <= camera.far and miss < best[0]:
                best = (miss, frame)
        if best[0] == math.inf:
            return False
        self.place(base, self.posture)
        frame = place @ best[1]
        eye, ahead = frame[:3, 3], frame[:3, :3] @ np.array(camera.forward)
        view = pybullet.computeViewMatrix(list(eye), list(eye + ahead), list(frame[:3, :3] @ np.array(camera.up)))
        vertical = 2 * math.atan(math.tan(camera.fov / 2) * camera.height / camera.width)
        lens = pybullet.computeProjectionMatrixFOV(math.degrees(vertical), camera.width / camera.height, 0.02, 20.0)
        segments = pybullet.getCameraImage(
            camera.width, camera.height, view, lens, renderer=pybullet.ER_TINY_RENDERER, physicsClientId=self.client
        )[4]
        wanted = [uid for uid, name in self.pieces.items() if name == target]
        focal = camera.width / (2 * math.tan(camera.fov / 2))
        away = float(np.linalg.norm(np.array(body.pose.position) - eye))
        whole = (focal * body.size[0] / away) * (focal * body.size[2] / away)
        return int(np.isin(np.asarray(segments), wanted).sum()) >= 0.3 * whole

    def _all_gazes(self, link: str) -> Iterator[Array]:
        """Frames of the camera's link in the base frame, the neck over a grid of its postures."""
        spans = [np.linspace(*self.limits[joint], GAZES) for joint in self.robot.neck]
        for values in np.stack(np.meshgrid(*spans), -1).reshape(-1, len(spans)) if spans else np.zeros((1, 0)):
            self.place((0.0, 0.0, 0.0), {**self.posture, **dict(zip(self.robot.neck, values, strict=True))})
            yield self.link(link)

    def objection(self, claim: Claim) -> str | None:
        """Return what is wrong with a claim; None if all of it is true."""
        arm = self.robot.arm(claim.arm)
        hand = self.fingers(claim.arm) if claim.target is not None else frozenset()
        x_min, y_min, x_max, y_max = (-3.0, -2.5, 3.0, 2.5)
        if not (x_min < claim.base[0] < x_max and y_min < claim.base[1] < y_max):
            return f"the base {claim.base} is outside of the room"
        self.place(claim.base, self.posture)
        if pair := self.touched():
            return f"standing at {claim.base}, {pair[0]} touches {pair[1]}"
        for number, (values, pose) in enumerate(zip(claim.values, claim.poses, strict=True)):
            joints = dict(zip(claim.joints, map(float, values), strict=True))
            for name, value in joints.items():
                low, high = self.limits[name]
                if not low - 2e-3 <= value <= high + 2e-3:
                    return f"pose {number}: {name} is {value:.4f}, outside of {low:.4f} to {high:.4f}"
            self.place(claim.base, {**self.posture, **claim.fingers, **joints})
            reached = self.link(arm.tip)
            away, turned = np.linalg.norm(reached[:3, 3] - pose[:3, 3]), angle(reached[:3, :3], pose[:3, :3])
            if away > TIP or turned > TURN:
                return f"pose {number}: the tip is {away:.4f} m and {turned:.4f} rad from where it should be"
            if pair := self.touched(hand, claim.target):
                return f"pose {number}: {pair[0]} touches {pair[1]}"
        if claim.target is not None and not self.comes_straight(claim):
            return "the hand touches something on the straight line between its poses"
        if len(claim.motions) not in (0, len(claim.poses) - 1):
            return f"{len(claim.motions)} motions join {len(claim.poses)} poses"
        for number, rows in enumerate(claim.motions or [on_the_way(claim.values)]):
            tips, touching = [], _spread(len(rows)) if claim.motions else range(len(rows))
            for row, values in enumerate(rows.tolist()):
                joints = dict(zip(claim.joints, values, strict=True))
                self.place(claim.base, {**self.posture, **claim.fingers, **joints})
                tips.append(self.link(arm.tip))
                if row in touching and (pair := self.touched(hand, claim.target)):
                    return f"between its poses {pair[0]} touches {pair[1]}"
            if claim.motions and (problem := strays(np.array(tips), *claim.poses[number : number + 2])):
                return f"after pose {number} {problem}"
        return None

    def rests(self, name: str, at: Pose, support: str) -> str | None:
        """Return what keeps a body at a pose from resting whole on another, touching nothing else; None if it rests."""
        body, below = self.room.body(name), self.room.body(support)
        top = below.pose.position[2] + below.size[2] / 2
        if abs(at.position[2] - body.size[2] / 2 - top) > 5e-3:
            return f"its lowest point is not at the top of {support}"
        local = below.pose.inverse() @ at
        radius = max(body.size[:2]) / 2
        if any(abs(local.position[i]) + radius > below.size[i] / 2 + 1e-3 for i in (0, 1)):
            return f"it stands out over the edge of {support}"
        uid = next(uid for uid, other in self.pieces.items() if other == name)
        kept = pybullet.getBasePositionAndOrientation(uid, physicsClientId=self.client)
        pybullet.resetBasePositionAndOrientation(uid, at.position, at.orientation, physicsClientId=self.client)
        try:
            for other, owner in self.pieces.items():
                if other == uid:
                    continue
                points = pybullet.getClosestPoints(uid, other, WITHIN, physicsClientId=self.client)
                if any(point[8] < -TOUCHING for point in points):
                    return f"it is in {owner}"
        finally:
            pybullet.resetBasePositionAndOrientation(uid, *kept, physicsClientId=self.client)
        return None

    def is_grasp(self, claim: Claim) -> str | None:
        """Return what keeps a claim from being the grasp of its target: pre-grasp, grasp, then up."""
        body = self.room.body(claim.target or "")
        arm = self.robot.arm(claim.arm)
        centre = np.array(body.pose.position)
        before, grasp, lift = claim.poses[:3]
        approach = grasp[:3, :3] @ np.array(arm.approach)
        closing = grasp[:3, :3] @ np.array(arm.closing)
        off = grasp[:3, 3] - centre
        level, towards = abs(float(approach[2])) < 1e-3, max(0.0, -float(off @ approach))
        inside = (
            np.abs((body.pose.inverse() @ Pose(tuple(grasp[:3, 3]))).position)[:2]
            <= np.array(body.size[:2]) / 2 - 0.009
        )
        aside = off + towards * approach if level and body.shape == "box" and inside.all() else off
        if np.hypot(*aside[:2]) > 0.011 or not -0.011 < off[2] < body.size[2] / 2:
            return (
                "the grip point is neither within 1 cm of the middle of what is grasped, nor above or before that in it"
            )
        if np.abs(before[:3, 3] + 0.08 * approach - grasp[:3, 3]).max() > 2e-3:
            return "the pre-grasp is not 8 cm back along the approach"
        rise = lift[:3, 3] - grasp[:3, 3]
        if rise[2] < 0.03 or np.abs(rise[:2]).max() > 2e-3:
            return "the lift does not go up"
        if max(angle(before[:3, :3], grasp[:3, :3]), angle(lift[:3, :3], grasp[:3, :3])) > TURN:
            return "the hand turns between pre-grasp and lift"
        if arm.gripper is not None and body.size[0] > arm.gripper.max_opening:
            return "it does not fit between the fingers"
        if abs(closing[2]) > 0.1:
            return "the fingers do not close horizontally around what stands"
        return None


Followers = Mapping[str, tuple[str, float, float]]
"""Joint that mimics -> the joint it follows, factor, offset."""


def followers(urdf: Path) -> Followers:
    """Joints that mimic another one; PyBullet reads nothing of it."""
    found = {}
    for joint in ElementTree.parse(urdf).getroot().iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
            found[joint.get("name", "")] = mimic.get("joint", ""), factor, offset
    return found


def led(joints: Mapping[str, float], by: Followers) -> dict[str, float]:
    """Return where joints go that mimic some of these."""
    return {name: joints[to] * factor + offset for name, (to, factor, offset) in by.items() if to in joints}


def on_the_way(values: Array) -> Array:
    """Postures (n, d) on the lines between neighbouring ones (k, d), these left out."""
    shares = np.linspace(0.0, 1.0, STEPS + 1)[1:-1, None]
    lines = [one + shares * (other - one) for one, other in pairwise(values)]
    return np.concatenate([np.zeros((0, values.shape[1])), *lines])


def straight(poses: Array) -> Array:
    """Poses (n, 4, 4) on straight lines between neighbouring ones of one rotation (k, 4, 4), these left out."""
    shares = np.linspace(0.0, 1.0, STEPS + 1)[1:-1, None, None]
    return np.concatenate([np.zeros((0, 4, 4)), *(one + shares * (other - one) for one, other in pairwise(poses))])


def strays(tips: Array, start: Array, end: Array) -> str | None:
    """Return how tips (n, 4, 4) leave the straight way between two poses of one rotation (4, 4); None if none do."""
    way = end[:3, 3] - start[:3, 3]
    along = (tips[:, :3, 3] - start[:3, 3]) @ way / (way @ way)
    off = np.linalg.norm(tips[:, :3, 3] - start[:3, 3] - np.clip(along, 0.0, 1.0)[:, None] * way, axis=1)
    turned = max(angle(tip[:3, :3], start[:3, :3]) for tip in tips)
    if off.max() > TIP or turned > TURN:
        return f"the tip is {off.max():.4f} m and {turned:.4f} rad off the straight line"
    if np.diff(along, prepend=0.0, append=1.0).max() > 2 / STEPS:
        return "parts of the straight line are left out"
    return None


def _spread(count: int) -> frozenset[int]:
    """Rows of a motion, of so many, at which it is looked at what is touched; the tip is looked at in all."""
    return frozenset(np.linspace(0, count - 1, 2 * STEPS).round().astype(int).tolist())


def angle(one: Array, other: Array) -> float:
    """Angle between two rotations (3, 3) [rad]."""
    return math.acos(min(1.0, max(-1.0, float((np.trace(one.T @ other) - 1) / 2))))


def _nearest_zero(ends: tuple[float, float]) -> float:
    return min(max(0.0, ends[0]), ends[1])
