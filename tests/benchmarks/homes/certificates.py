"""Certificates that something is possible: a base pose that can be driven to, and an arm that gets there, free.

Hand poses are drawn around what is to be grasped, put down, opened, pressed, reached; bases on the floor within reach;
the arm follows by damped least squares, and PyBullet looks at the rest. All of it is the judge's own code.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from executive.robots import Arm
from planlang.geometry import Array, Pose
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.furnishing import Rectangle
from tests.benchmarks.homes.tasks import Need
from tests.support.locations.dense_sampler import Joints, way_from
from tests.support.locations.oracle import Oracle
from tests.support.locations.sampler import BACK, UP, hand_poses
from tests.support.locations.ways import Ways

HANDS, BASES = 48, 600
"""Poses of the hand that are tried for one place, and bases for each arm."""
PITCHES = (0.0, 0.4, 0.8, math.pi / 2)
"""Tilts of the hand [rad]."""
SIDE = 0.003
"""Room that is left between fingers on both sides together [m]."""
LEADING = (0.0, 0.35, 0.7)
"""Shares of a leaf's range at which the hand is at its handle."""
OVER = 0.2
"""Height of a hand that pours over the vessel [m]."""
ENDS = (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08)
"""Distances by which the ends of fingers may be ahead of the grip point [m]."""
BESIDE = (0.5, 0.6, 0.75, 0.9)
"""Distances from the middle of a doorway at which the base stands before and behind it [m]."""
QUARTERS = (0.0, math.pi, math.pi / 2, -math.pi / 2)
"""Headings of the base there, from the way through [rad]."""
NODES = 20_000
"""Places of the base, with headings, that are looked at for one way."""
WIPING = 0.06
"""Height of a hand that wipes over the table [m]."""
PAST = 0.35
"""Distance at which something is handed over before somebody's middle [m]."""
Hands = Array
"""Poses of a hand (n, k, 4, 4), of which the second is the one that matters."""


class Search:
    """The search for certificates in one scene."""

    def __init__(self, oracle: Oracle, chains: Mapping[str, Joints], floor: Array, seconds: float) -> None:
        self.oracle, self.chains, self.floor, self.seconds = oracle, chains, floor, seconds
        self.known = [oracle.room.start]
        """Places that the base is known to get to: where it begins, and behind each doorway that it passed."""

    def certified(self, need: Need, scene: Scene, leaves: Sequence[str]) -> bool:
        """Return True if a certificate for a need is found; ``leaves`` are open by then."""
        self.rng = np.random.default_rng(0)
        self.until = time.process_time() + self.seconds
        moved: dict[str, Pose] = {}
        try:
            is_moved = need.kind in ("open", "close")
            for leaf in leaves:
                if not is_moved or (leaf != need.thing and joint_of(scene, leaf).frame):
                    self._lead(scene, leaf, 1.0, moved)
            return self._opens(need.thing, scene, moved) if is_moved else self._does(need, scene, moved)
        finally:
            for name in moved:
                self.oracle.move(name, scene.body(name).pose)

    def _does(self, need: Need, scene: Scene, moved: dict[str, Pose]) -> bool:
        body = scene.body(need.thing)
        pose = moved.get(body.name, body.pose)
        if body.hands > 1:
            return False  # two hands at once are not looked for
        match need.kind:
            case "grasp":
                return self._grasps(body, pose)
            case "hold":
                return True  # what each hand does has a certificate of its own
            case "place":
                spots = list(self.spots(scene, body, need.at, 0.06, np.zeros(1), -0.02, moved))
                self.rng.shuffle(spots)  # type: ignore[arg-type]  # poses are not to be an array
                for spot in spots[:12]:
                    moved[body.name] = spot
                    self.oracle.move(body.name, spot)
                    if self._grasps(body, spot, share=0.2):
                        return True
                return False
            case "press":
                normal = pose.rotation[:, 0]
                hands = [self._around(arm, np.array(pose.position), -normal, ENDS) for arm in self.oracle.robot.arms]
                return self._reached(hands, scene.body(need.thing).name)
            case "pour":
                vessel = scene.body(need.at)
                return self._over(above(vessel, OVER))
            case "wipe":
                table = scene.body(need.at)
                return self._over(above(table, WIPING))
            case "hand over":
                who = scene.body(need.at)
                ahead = who.pose.rotation[:, 0] * (PAST + who.size[0] / 2 if who.size[2] > 0.8 else 0.0)
                return self._over(np.array(who.pose.position) + ahead + (0.0, 0.0, max(0.3, who.size[2] / 2) * 0.5))
            case "pass":
                return self._passes(pose)
            case "see":
                return self._sees(body.name)
        raise ValueError(need.kind)

    # Hands

    def _grasps(self, body: Body, pose: Pose, share: float = 1.0) -> bool:
        """Return True if some arm gets to a thing, before it, and lifts it."""
        hands = [self._grips(arm, body, pose) for arm in self.oracle.robot.arms]
        return self._reached(hands, body.name, share)

    def _grips(self, arm: Arm, body: Body, pose: Pose) -> Hands:
        """Return hands (n, 3, 4, 4) between whose fingers a thing fits: before it, at it, above it."""
        room = arm.gripper.max_opening if arm.gripper is not None else 0.0
        middle, found = np.array(pose.position), []
        turns = np.linspace(0.0, 2 * math.pi, 25)[:-1] + pose.yaw
        for pitch in PITCHES:
            for turn in turns.tolist():
                side = np.array([-math.sin(turn), math.cos(turn), 0.0])
                width = (
                    float(np.abs(side @ pose.rotation) @ np.array(body.size)) if body.shape == "box" else body.size[0]
                )
                grip = middle
                if width + SIDE > room and body.wall:
                    grip = middle + side * (body.size[0] / 2 - body.wall / 2) + (0.0, 0.0, body.size[2] / 2)
                elif width + SIDE > room:
                    continue
                ahead = np.array([math.cos(turn) * math.cos(pitch), math.sin(turn) * math.cos(pitch), -math.sin(pitch)])
                up = np.array([0.0, 0.0, 0.01 if body.size[2] > 0.05 else 0.0])
                points = [grip + up - BACK * ahead, grip + up, grip + up + (0.0, 0.0, UP)]
                found.append(hand_poses(arm, points, ahead, side))
        return np.array(found).reshape(-1, 3, 4, 4)

    def _around(self, arm: Arm, point: Array, ahead: Array, short: Sequence[float] = (0.0,)) -> Hands:
        """Return hands (n, 2, 4, 4) that come along a direction (3,) to a point, or short of it, turned about it."""
        side = np.cross(ahead, (0.0, 0.0, 1.0)) if abs(ahead[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
        side = side / np.linalg.norm(side)
        found = []
        for angle in np.linspace(0.0, 2 * math.pi, 9)[:-1].tolist():
            closing = math.cos(angle) * side + math.sin(angle) * np.cross(ahead, side)
            ends = [point - away * ahead for away in short]
            found += [hand_poses(arm, [end - BACK * ahead, end], ahead, closing) for end in ends]
        return np.array(found)

    def _over(self, point: Array) -> bool:
        """Return True if some hand gets to a point, from whatever side."""
        hands = []
        for arm in self.oracle.robot.arms:
            ways = [
                (math.cos(turn) * math.cos(pitch), math.sin(turn) * math.cos(pitch), -math.sin(pitch))
                for turn in np.linspace(0.0, 2 * math.pi, 13)[:-1].tolist()
                for pitch in PITCHES
            ]
            hands.append(np.concatenate([self._around(arm, point, np.array(way))[::4] for way in ways]))
        return self._reached(hands, None)

    def _opens(self, leaf: str, scene: Scene, moved: dict[str, Pose]) -> bool:
        """Return True if some hand gets to a leaf's handle, shut, half open and open, from where a base can stand."""
        for share in LEADING:
            self._lead(scene, leaf, share, moved)
            handles = joint_of(scene, leaf).handles or (leaf,)
            if not any(self._leads_by(handle, leaf, scene, moved, 0.4 / len(handles)) for handle in handles):
                return False
        return True

    def _leads_by(self, handle: str, leaf: str, scene: Scene, moved: dict[str, Pose], share: float) -> bool:
        """Return True if some hand gets to a handle of a leaf, where it is, in a ``share`` of the time that is left."""
        pose, size = moved[handle], scene.body(handle).size
        outward = self._outward(scene, leaf, moved[leaf], pose)
        hands = []
        for arm in self.oracle.robot.arms:
            every = self._around(arm, np.array(pose.position), -outward, ENDS[:4])
            closing = every[:, 1, :3, :3] @ np.array(arm.closing)
            widths = np.abs(closing @ pose.rotation) @ np.array(size)
            room = arm.gripper.max_opening if arm.gripper is not None else 0.0
            hands.append(every[widths < min(room, 0.06)])
        return self._reached(hands, handle, share)

    def _outward(self, scene: Scene, leaf: str, door: Pose, handle: Pose) -> Array:
        """Return the normal (3,) of a leaf's front at its handle."""
        joint = joint_of(scene, leaf)
        if joint.kind is JointKind.PRISMATIC and not joint.frame:
            return np.array(joint.axis)
        axis = door.rotation[:, int(np.argmin(scene.body(leaf).size))]
        return axis * math.copysign(1.0, float(axis @ (np.array(handle.position) - door.position)))

    def _lead(self, scene: Scene, leaf: str, share: float, moved: dict[str, Pose]) -> None:
        """Open a leaf, with what lies in it if it is a drawer."""
        joint, body = joint_of(scene, leaf), scene.body(leaf)
        names = list(joint.bodies)
        if joint.kind is JointKind.PRISMATIC and not joint.frame:
            names += [one.name for one in scene.bodies if one.movable and _is_in(body, one)]
        for name in names:
            moved[name] = joint.motion(share * joint.upper) @ scene.body(name).pose
            self.oracle.move(name, moved[name])

    # Bases

    def _ways(self) -> Ways:
        return Ways(self.oracle, self.known, NODES)

    def _passes(self, doorway: Pose) -> bool:
        """Return True if the base gets through a doorway, ahead or sideways, and remember where it stands then."""
        for through, turn in itertools.product((0.0, math.pi), QUARTERS):
            frame = doorway @ Pose.planar(0.0, 0.0, through)
            before, behind = (self._stands(frame, sign, turn) for sign in (-1.0, 1.0))
            if before is None or behind is None or not self._ways().lead_to(before):
                continue
            if Ways(self.oracle, (before,), NODES).lead_to(behind):
                self.known.append(behind)
                return True
        return False

    def _stands(self, frame: Pose, sign: float, turn: float) -> tuple[float, float, float] | None:
        """Return where the base stands free before or behind a doorway, turned so; None if nowhere."""
        for away in BESIDE:
            pose = frame @ Pose.planar(sign * away, 0.0, turn)
            base = (pose.position[0], pose.position[1], pose.yaw)
            self.oracle.place(base, self.oracle.posture)
            if self.oracle.touched(itself=False) is None:
                return base
        return None

    def _reached(self, hands: Sequence[Hands], target: str | None, share: float = 1.0) -> bool:
        """Return True if an arm reaches one of its hands from somewhere, in a ``share`` of the time that is left."""
        until = time.process_time() + share * max(self.until - time.process_time(), 0.0)
        ways = self._ways()
        for arm, ours in zip(self.oracle.robot.arms, hands, strict=True):
            chain = self.chains[arm.name]
            free = self._free(arm, chain, ours, target)
            if not len(free):
                continue
            bases = self._bases(free[0, 1, :3, 3], chain)
            chosen = free[self.rng.integers(len(free), size=len(bases))]
            back = np.linalg.inv(np.array([Pose.planar(*base).matrix() for base in bases]).reshape(-1, 4, 4))
            begun = self.rng.uniform(chain.lower, chain.upper, (len(bases), len(chain.names)))
            q, good = chain.solve(back @ chosen[:, 1], begun)
            for row in np.flatnonzero(good):
                if time.process_time() > until:
                    return False
                x, y, yaw = bases[row].tolist()
                if way_from(self.oracle, ways, arm, chain, (x, y, yaw), chosen[row], q[row], target):
                    return True
        return False

    def _free(self, arm: Arm, chain: Joints, hands: Hands, target: str | None) -> Hands:
        """Return some hands that touch nothing there, without their arm."""
        middle = (chain.lower + chain.upper) / 2
        back = np.linalg.inv(chain.forward(middle[None])[0][0])
        opened = dict(arm.gripper.opened) if arm.gripper is not None else {}
        joints = {**dict(zip(chain.names, middle.tolist(), strict=True)), **opened}
        found = []
        for row in self.rng.permutation(len(hands)):
            if all(self.oracle.hand_alone_is_free(arm.name, joints, one @ back, target or "") for one in hands[row]):
                found.append(hands[row])
            if len(found) == HANDS:
                break
        return np.array(found)

    def _bases(self, point: Array, chain: Joints) -> Array:
        """Return bases (n, 3) on free floor within an arm's reach of a point, more or less towards it."""
        if self.oracle.robot.base.fixed:
            return np.array([self.oracle.room.start])
        tips = chain.forward(self.rng.uniform(chain.lower, chain.upper, (500, len(chain.names))))[0][:, :2, 3]
        reach = 1.05 * float(np.linalg.norm(tips, axis=1).max())
        near = self.floor[np.linalg.norm(self.floor - point[:2], axis=1) < reach]
        if not len(near):
            return np.zeros((0, 3))
        places = near[self.rng.integers(len(near), size=BASES)]
        facing = np.arctan2(point[1] - places[:, 1], point[0] - places[:, 0])
        return np.column_stack([places, facing + self.rng.normal(0.0, 0.8, BASES)])

    def _sees(self, name: str) -> bool:
        """Return True if a thing is seen from somewhere on the floor."""
        point, ways = self.oracle.room.body(name).pose.position, self._ways()
        for place in self.floor[self.rng.integers(len(self.floor), size=60)] if len(self.floor) else ():
            base = (float(place[0]), float(place[1]), math.atan2(point[1] - place[1], point[0] - place[0]))
            self.oracle.place(base, self.oracle.posture)
            if self.oracle.touched(itself=False) is None and ways.lead_to(base) and self.oracle.sees(base, name):
                return True
        return False

    # Room on and in furniture

    def spots(
        self,
        scene: Scene,
        thing: Body,
        at: str,
        spacing: float,
        turns: Array,
        tight: float,
        moved: Mapping[str, Pose] | None = None,
    ) -> Iterator[Pose]:
        """Yield poses of a thing, upright, where it fits on or in a support; its extents may be less by ``tight``."""
        half = [max(extent / 2 - tight, 0.001) for extent in thing.size[:2]]
        for frame, size, clear in _areas(scene, at):
            if clear < thing.size[2] - tight:
                continue
            low = frame.position[2]
            others = [
                outline(body, one)
                for body in scene.bodies
                if body.movable and body.name not in (thing.name, at)
                for one in ((moved or {}).get(body.name, body.pose),)
                if low - 0.02 < one.position[2] - body.size[2] / 2 < low + thing.size[2]
            ]
            axes = [np.arange(-extent / 2, extent / 2 + 1e-6, spacing) for extent in size]
            local = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 2)
            points = local @ frame.rotation[:2, :2].T + frame.position[:2]
            gaps = np.min([np.full(len(points), np.inf), *(one.distances(points) for one in others)], axis=0)
            for (x, y), gap in zip(local[gaps > min(half)].tolist(), gaps[gaps > min(half)].tolist(), strict=True):
                for turn in turns.tolist() if thing.shape == "box" else (0.0,):
                    corners = Rectangle(x, y, turn, (half[0], half[1])).corners()
                    if (np.abs(corners) > np.array(size) / 2).any():
                        continue
                    pose = frame @ Pose.planar(x, y, turn, thing.size[2] / 2 + 0.002)
                    there = Rectangle(pose.position[0], pose.position[1], pose.yaw, (half[0], half[1]))
                    if thing.shape != "box" or gap > max(half) * 1.5 or not any(map(there.overlaps, others)):
                        yield pose


def _areas(scene: Scene, at: str) -> Iterator[tuple[Pose, tuple[float, float], float]]:
    """Yield the level areas on or in a support: the middle of each, its extents, and the height clear over it."""
    joint = next((one for one in scene.joints if one.leaf == at), None)
    holder = at if joint is None or joint.kind is JointKind.PRISMATIC or joint.holder is None else joint.holder
    body = scene.body(holder)
    for room in body.cavities:
        x, y, z = room.centre
        yield body.pose @ Pose((x, y, z - room.size[2] / 2)), (room.size[0], room.size[1]), room.size[2]
    if not body.cavities:
        yield body.pose @ Pose((0.0, 0.0, body.size[2] / 2)), (body.size[0], body.size[1]), 2.0


def outline(body: Body, at: Pose | None = None, size: Sequence[float] | None = None) -> Rectangle:
    """Return the rectangle over which a body stands, there or at a pose; that of a part with a ``size``."""
    pose, (x, y, *_) = at or body.pose, size or body.size
    return Rectangle(pose.position[0], pose.position[1], pose.yaw, (x / 2, y / 2))


def above(body: Body, height: float) -> Array:
    """Return the point (3,) above the middle of the top of what stands."""
    x, y, z = body.pose.position
    return np.array([x, y, z + body.size[2] / 2 + height])


def joint_of(scene: Scene, leaf: str) -> Articulation:
    """Return the joint of a leaf."""
    return next(one for one in scene.joints if one.leaf == leaf)


def _is_in(body: Body, other: Body) -> bool:
    local = (body.pose.inverse() @ other.pose).position
    return bool((np.abs(local) < np.array(body.size) / 2).all())
