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
from numpy.typing import NDArray

from executive.robots import Arm
from planlang.geometry import Array, Pose
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.arms import Arms, Drives
from tests.benchmarks.homes.floor import Floor, outline
from tests.benchmarks.homes.furnishing import Rectangle
from tests.benchmarks.homes.grips import BAR, ENDS, PITCHES, TAKEN, Grips, Hands, around, slants
from tests.benchmarks.homes.nearest import Aim, Nearest
from tests.benchmarks.homes.tasks import Need
from tests.support.locations.dense_sampler import PRESSED, Joints, way_of_two
from tests.support.locations.oracle import BasePose, Oracle
from tests.support.locations.plates import fingers_ahead
from tests.support.locations.sampler import UP
from tests.support.locations.ways import Ways

HANDS, BASES = 48, 600
"""Poses of the hand that are tried for one place, and bases for each arm."""
LEADING = (0.0, 0.35, 0.7)
"""Shares of a leaf's range at which the hand is at its handle."""
OVER = 0.2
"""Height of a hand that pours over the vessel [m]."""
SECOND = 60
"""Poses of the second hand that are tried with one of the first."""
ROUNDS = 3
"""Times that bases and postures are drawn for each arm."""
SPOTS, TURNED = 16, np.array([0.0, math.pi / 2])
"""Spots on a support where a thing is put, and how it is turned there [rad]."""
OPENED = (1.0, 0.7)
"""Shares of their range by which leaves are open that a need takes, while the others are shut."""
BESIDE = (0.5, 0.6, 0.75, 0.9)
"""Distances from the middle of a doorway at which the base stands before and behind it [m]."""
QUARTERS = (0.0, math.pi, math.pi / 2, -math.pi / 2)
"""Headings of the base there, from the way through [rad]."""
NODES = 20_000
"""Places of the base, with headings, that are looked at for one way."""
WIPING = 0.06
"""Height of a hand that wipes over the table [m]."""
AT_FIRST, THEN = (0,), (1, 2, 3, 4, 5)
"""Sets of postures that yield to contacts, before and after those drawn at random."""
CLEAR, EXACT = 0.001, 0.0008
"""Distance that they keep from everything, and what remains of it where one is good [m]."""
NEAR_OVER = 0.02
"""Half the extents of the place where a hand is that pours, wipes or hands over [m]."""
PAST = 0.35
"""Distance at which something is handed over before somebody's middle [m]."""


class Search:
    """The search for certificates in one scene."""

    def __init__(self, oracle: Oracle, chains: Mapping[str, Joints], floor: Floor, seconds: float) -> None:
        self.oracle, self.chains, self.floor, self.seconds = oracle, chains, floor, seconds
        self.grips = Grips({arm.name: fingers_ahead(oracle, arm.name) for arm in oracle.robot.arms})
        self.arms = Arms(oracle, chains)
        self.known = [oracle.room.start]
        """Places that the base is known to get to: where it begins, and behind each doorway that it passed."""

    def certified(self, need: Need, scene: Scene, leaves: Sequence[str]) -> bool:
        """Return True if a certificate for a need is found with the ``leaves`` open that a robot would open for it."""
        self.rng = np.random.default_rng(0)
        ways = list(self._opened(need, scene, leaves))
        share = self.seconds / len(ways)
        return any(self._certified(need, scene, opened, share) for opened in ways)

    def _opened(self, need: Need, scene: Scene, leaves: Sequence[str]) -> Iterator[Mapping[str, float]]:
        """Yield leaves with the shares of their range by which they are open: a robot may close the others."""
        doors = {leaf: 1.0 for leaf in leaves if joint_of(scene, leaf).frame}
        if need.kind in ("open", "close"):
            yield {leaf: share for leaf, share in doors.items() if leaf != need.thing}
            return
        yield dict.fromkeys(leaves, 1.0)
        body = scene.body(need.thing)
        holder = next((joint.holder for joint in scene.joints if joint.leaf == need.at), None)
        needed = [
            leaf
            for leaf in leaves
            if leaf == need.at or (holder and joint_of(scene, leaf).holder == holder) or carries(scene, leaf, body)
        ]
        for share in OPENED if len(leaves) > len(doors) else ():
            yield doors | dict.fromkeys(needed, share)

    def _certified(self, need: Need, scene: Scene, opened: Mapping[str, float], seconds: float) -> bool:
        self.until = time.process_time() + seconds
        moved: dict[str, Pose] = {}
        try:
            for leaf, share in opened.items():
                self._lead(scene, leaf, share, moved)
            if need.kind in ("open", "close"):
                return self._opens(need.thing, scene, moved)
            return self._does(need, scene, moved)
        finally:
            for name in moved:
                self.oracle.move(name, scene.body(name).pose)

    def _does(self, need: Need, scene: Scene, moved: dict[str, Pose]) -> bool:
        body = scene.body(need.thing)
        pose = moved.get(body.name, body.pose)
        match need.kind:
            case "grasp":
                return self._grasps(body, pose)
            case "hold":
                return True  # what each hand does has a certificate of its own
            case "place":
                spots = list(self.spots(scene, body, need.at, 0.06, TURNED, -0.02, moved))
                self.rng.shuffle(spots)  # type: ignore[arg-type]  # poses are not to be an array
                moved[body.name] = body.pose
                chosen = spots[:SPOTS]
                if spots and self._yields(self.grips.aims(body, chosen), body, chosen, AT_FIRST, self.until):
                    return True
                for spot in itertools.takewhile(lambda _: time.process_time() < self.until, spots[:SPOTS]):
                    self.oracle.move(body.name, spot)
                    if self._grasps(body, spot, share=0.2):
                        return True
                return False
            case "press":
                normal = pose.rotation[:, 0]
                hands = [around(arm, np.array(pose.position), -normal, ENDS) for arm in self.oracle.robot.arms]
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
        """Return True if some arm gets to a thing, before it, and lifts it; two of them if it takes two."""
        if body.hands > 1:
            return self._grasps_with_two(body, pose, share)
        hands = [self.grips.at_thing(arm, body, pose) for arm in self.oracle.robot.arms]
        return self._taken(self.grips.aims(body, [pose]), hands, body, pose, share)

    def _taken(self, aims: Sequence[Aim], hands: Sequence[Hands], body: Body, pose: Pose, share: float) -> bool:
        """Return True if an arm takes a body that is at a pose in one of two ways, in a ``share`` of the time left."""
        left = share * max(self.until - time.process_time(), 0.0)
        until, poses = time.process_time() + left, [pose]
        return (
            self._yields(aims, body, poses, AT_FIRST, until)
            or self._reached(hands, body.name, share / 2)
            or self._yields(aims, body, poses, THEN, until)
        )

    def _over(self, point: Array) -> bool:
        """Return True if some hand gets to a point, from whatever side."""
        hands = []
        for arm in self.oracle.robot.arms:
            ways = [
                (math.cos(turn) * math.cos(pitch), math.sin(turn) * math.cos(pitch), -math.sin(pitch))
                for turn in np.linspace(0.0, 2 * math.pi, 13)[:-1].tolist()
                for pitch in PITCHES
            ]
            hands.append(np.concatenate([around(arm, point, np.array(way))[::4] for way in ways]))
        there = Aim([Pose((float(point[0]), float(point[1]), float(point[2])))], np.full(3, NEAR_OVER))
        return self._yields([there], None, (), AT_FIRST, self.until) or self._reached(hands, None)

    def _opens(self, leaf: str, scene: Scene, moved: dict[str, Pose]) -> bool:
        """Return True if some hand gets to a leaf's handle, shut, half open and open, from where a base can stand."""
        for share in LEADING:
            self._lead(scene, leaf, share, moved)
            handles = joint_of(scene, leaf).handles or (leaf,)
            if not any(self._leads_by(handle, leaf, scene, moved, 1 / len(handles)) for handle in handles):
                return False
        return True

    def _leads_by(self, handle: str, leaf: str, scene: Scene, moved: dict[str, Pose], share: float) -> bool:
        """Return True if some hand gets to a handle of a leaf, where it is, in a ``share`` of the time that is left."""
        body, pose = scene.body(handle), moved[handle]
        normal = outward(joint_of(scene, leaf), scene.body(leaf), moved[leaf], pose)
        hands = [self.grips.at_bar(arm, pose, body.size, slants(-normal)) for arm in self.oracle.robot.arms]
        aim = Aim([pose], np.array(body.size) / 2, normal, body.size, "box", BAR)
        return self._taken([aim], hands, body, pose, share)

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

    def _drives(self) -> Drives:
        return Drives(self._ways)

    def _ways(self) -> Ways | None:
        """Return what is known of where the base gets to in its posture; None if that begins in something."""
        if not self.oracle.robot.base.fixed and not self._is_free(self.oracle.room.start):
            return None
        return Ways(self.oracle, [one for one in self.known if self._is_free(one)], NODES)

    def _is_free(self, base: BasePose) -> bool:
        self.oracle.place(base, self.oracle.posture)
        return self.oracle.touched(itself=False) is None

    def _passes(self, doorway: Pose) -> bool:
        """Return True if the base gets through a doorway, ahead or sideways, and remember where it stands then."""
        with self.arms.driving() as postures:
            for through, turn in (way for _ in postures for way in itertools.product((0.0, math.pi), QUARTERS)):
                frame = doorway @ Pose.planar(0.0, 0.0, through)
                before, behind = (self._stands(frame, sign, turn) for sign in (-1.0, 1.0))
                if before is None or behind is None:
                    continue
                ways = self._ways()
                if ways is not None and ways.lead_to(before) and Ways(self.oracle, (before,), NODES).lead_to(behind):
                    self.known.append(behind)
                    return True
        return False

    def _stands(self, frame: Pose, sign: float, turn: float) -> BasePose | None:
        """Return where the base stands free before or behind a doorway, turned so; None if nowhere."""
        for away in BESIDE:
            pose = frame @ Pose.planar(sign * away, 0.0, turn)
            base = (pose.position[0], pose.position[1], pose.yaw)
            if self._is_free(base):
                return base
        return None

    def _reached(self, hands: Sequence[Hands], target: str | None, share: float = 1.0) -> bool:
        """Return True if an arm reaches one of its hands from somewhere, in a ``share`` of the time that is left."""
        until = time.process_time() + share * max(self.until - time.process_time(), 0.0)
        drives, arms = self._drives(), self.oracle.robot.arms
        free_hands = [
            self._free(arm, self.chains[arm.name], ours, target) for arm, ours in zip(arms, hands, strict=True)
        ]
        able = [(arm, free) for arm, free in zip(arms, free_hands, strict=True) if len(free)]
        for arm, free in itertools.takewhile(lambda _: time.process_time() < until, able * ROUNDS):
            chain = self.chains[arm.name]
            bases = self._bases(free[0, 1, :3, 3], chain)
            chosen = free[self.rng.integers(len(free), size=len(bases))]
            back = np.linalg.inv(np.array([Pose.planar(*base).matrix() for base in bases]).reshape(-1, 4, 4))
            q, good = chain.solve(back @ chosen[:, 1], self._anywhere(chain, len(bases)))
            for row in np.flatnonzero(good):
                if time.process_time() > until:
                    return False
                x, y, yaw = bases[row].tolist()
                if self.arms.come(drives, arm, (x, y, yaw), chosen[row], q[row], target):
                    return True
        return False

    def _yields(
        self, aims: Sequence[Aim], body: Body | None, poses: Sequence[Pose], seeds: Sequence[int], until: float
    ) -> bool:
        """Return True if an arm gets to a body at one of some poses, and lifts it, by postures that yield to contacts.

        Each aim has as many boxes of one pose as of any other. Afterwards the body is at one of the poses.
        """
        drives = self._drives()
        for seed, aim, arm in itertools.product(seeds, aims, self.oracle.robot.arms):
            if arm.gripper is None or time.process_time() > until:
                continue
            chain = self.chains[arm.name]
            nearest = Nearest(self.oracle, chain, arm, self.floor, (0.0, self.grips.ahead(arm) - TAKEN))
            found = nearest.postures(aim, seed)
            if found is None:
                continue

            def put(box: int, aim: Aim = aim) -> None:
                if body is not None:
                    self.oracle.move(body.name, poses[box * len(poses) // len(aim.poses)])

            for left, base, q, box in nearest.yielded(aim, found, put, lambda *_: False, CLEAR):
                if time.process_time() > until:
                    return False
                if left > EXACT:
                    continue
                x, y, yaw = base.tolist()
                tip = Pose.planar(x, y, yaw).matrix() @ chain.forward(q[None])[0][0]
                every = self.grips.from_tip(arm, tip, aim, aim.poses[box], lifts=body is not None and body.movable)
                if any(self.arms.come(drives, arm, (x, y, yaw), one, q, body and body.name) for one in every):
                    return True
        return False

    def _grasps_with_two(self, body: Body, pose: Pose, share: float) -> bool:
        """Return True if two arms get to two handles of a thing, or to two sides of it, from one base, and lift it."""
        until = time.process_time() + share * max(self.until - time.process_time(), 0.0)
        arms, ways = [arm for arm in self.oracle.robot.arms if arm.gripper is not None], self._ways()
        sides = self.grips.sides_for_two(body, pose)
        pairs = list(itertools.product(itertools.permutations(arms, 2), itertools.combinations(sides, 2)))
        for two, ends in itertools.takewhile(lambda _: time.process_time() < until, pairs * ROUNDS):
            free, other = (
                self._free(arm, self.chains[arm.name], self.grips.at_bar(arm, *end), body.name)
                for arm, end in zip(two, ends, strict=True)
            )
            if not len(free) or not len(other):
                continue
            chain, second = (self.chains[arm.name] for arm in two)
            bases = self._bases(np.array(pose.position), chain)
            back = np.linalg.inv(np.array([Pose.planar(*base).matrix() for base in bases]).reshape(-1, 4, 4))
            chosen = free[self.rng.integers(len(free), size=len(bases))]
            q, rows = self._comes_and_lifts(chain, back[:, None] @ chosen, self._anywhere(chain, len(bases)))
            away = np.linalg.norm(bases[rows, :2] - pose.position[:2], axis=1)
            for row in rows[np.argsort(away, kind="stable")]:  # from near by both handles are in reach
                if not self._drives_to(bases[row].tolist(), ways):
                    continue
                # both arms may stand on one torso
                shared = {name: value for name, value in zip(chain.names, q[row], strict=True) if name in second.names}
                held, others = chain.held(shared), second.held(shared)
                poses = other[self.rng.integers(len(other), size=SECOND)]
                p, fine = self._comes_and_lifts(others, back[row] @ poses, self._anywhere(others, len(poses)))
                x, y, yaw = bases[row].tolist()
                for one in fine:
                    if time.process_time() > until:
                        return False
                    hands = [(two[0], held, chosen[row], q[row]), (two[1], others, poses[one], p[one])]
                    if ways and way_of_two(self.oracle, ways, (x, y, yaw), hands, body.name):
                        return True
        return False

    @staticmethod
    def _comes_and_lifts(chain: Joints, hands: Hands, q: Array) -> tuple[Array, NDArray[np.int64]]:
        """Return joints (n, d) at the second of each hand's poses, and in which rows the arm comes there and lifts."""
        raised = hands[:, 1].copy()
        raised[:, 2, 3] += UP
        q, good = chain.solve(hands[:, 1], q)
        rows = np.flatnonzero(good)
        for target in (hands[:, 0], raised):
            rows = rows[chain.solve(target[rows], q[rows])[1]]
        return q, rows

    def _drives_to(self, base: Sequence[float], ways: Ways | None) -> bool:
        """Return True if the base, in the posture in which it drives, stands free at a place and gets there."""
        place = (base[0], base[1], base[2])
        self.oracle.place(place, self.oracle.posture)
        return ways is not None and self.oracle.touched(depth=PRESSED) is None and ways.lead_to(place)

    def _anywhere(self, chain: Joints, number: int) -> Array:
        """Draw joint values (n, d) of a chain."""
        return self.rng.uniform(chain.lower, chain.upper, (number, len(chain.names)))

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
        tips = chain.forward(self._anywhere(chain, 500))[0][:, :2, 3]
        reach = 1.05 * float(np.linalg.norm(tips, axis=1).max())
        cells = self.floor.cells
        near = cells[np.linalg.norm(cells - point[:2], axis=1) < reach]
        if not len(near):
            return np.zeros((0, 3))
        places = near[self.rng.integers(len(near), size=BASES)]
        facing = np.arctan2(point[1] - places[:, 1], point[0] - places[:, 0])
        return np.column_stack([places, facing + self.rng.normal(0.0, 0.8, BASES)])

    def _sees(self, name: str) -> bool:
        """Return True if a thing is seen from somewhere on the floor."""
        point, ways = self.oracle.room.body(name).pose.position, self._ways()
        cells = self.floor.cells
        if ways is None or not len(cells):
            return False
        for place in cells[self.rng.integers(len(cells), size=60)]:
            base = (float(place[0]), float(place[1]), math.atan2(point[1] - place[1], point[0] - place[0]))
            if self._is_free(base) and ways.lead_to(base) and self.oracle.sees(base, name):
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
        for frame, size, clear in areas(scene, at, moved or {}):
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


def carries(scene: Scene, leaf: str, body: Body) -> bool:
    """Return True if a body is in a drawer, or behind a door in what has it, as long as the leaf is closed."""
    joint, within = joint_of(scene, leaf), scene.body(leaf)
    if joint.kind is not JointKind.PRISMATIC and joint.holder is not None:
        within = scene.body(joint.holder)
    return _is_in(within, body)


def between(body: Body) -> tuple[float, float, float] | None:
    """Return the extents of what fingers are put around; None if they take it by an edge, or it gives way."""
    return None if body.wall or body.soft or body.handles or body.hands > 1 else body.size


def outward(joint: Articulation, leaf: Body, there: Pose, handle: Pose) -> Array:
    """Return the normal (3,) of the front of a leaf that is at a pose, at its handle."""
    if joint.kind is JointKind.PRISMATIC and not joint.frame:
        return np.array(joint.axis)
    axis = there.rotation[:, int(np.argmin(leaf.size))]
    return np.array(axis * math.copysign(1.0, float(axis @ (np.array(handle.position) - there.position))))


def areas(scene: Scene, at: str, moved: Mapping[str, Pose]) -> Iterator[tuple[Pose, tuple[float, float], float]]:
    """Yield the level areas on or in a support: the middle of each, its extents, and the height clear over it."""
    joint = next((one for one in scene.joints if one.leaf == at), None)
    holder = at if joint is None or joint.kind is JointKind.PRISMATIC or joint.holder is None else joint.holder
    body = scene.body(holder)
    pose = moved.get(holder, body.pose)
    for room in body.cavities:
        x, y, z = room.centre
        yield pose @ Pose((x, y, z - room.size[2] / 2)), (room.size[0], room.size[1]), room.size[2]
    if not body.cavities:
        yield pose @ Pose((0.0, 0.0, body.size[2] / 2)), (body.size[0], body.size[1]), 2.0


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
