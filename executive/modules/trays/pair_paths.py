"""Ways of two arms that take a thing together, move it level, and put it down, from places of the base.

Each pose of the thing gives poses of both tips, which stay as they are to each other; what is held is looked at with
the arms, and all that stands on it. Nothing leans on the way: the thing is only shifted, and turned about the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import base_matrices
from executive.locations.opposite_grips import Grips, grips_of, opposite
from executive.locations.rejections import COLLISION, Rejections
from executive.modules.commanding import Control
from executive.motion import MotionError, time_curve, time_path
from executive.robots.arm_pair import ArmPair, strays
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, product
from planlang.protocols import Configuration, Trajectory
from planlang.records import dataclass

STEP, TURN = 0.02, 0.05
"""Steps in which a thing that both hands hold is moved [m], and turned [rad]."""
STRAY, TWIST = 0.004, 0.03
"""Greatest change of how the hands are to each other on a way [m, rad]: less than what slips out of them."""
LIFT = 0.08
"""Height by which a thing is lifted before it is moved, and from which it is lowered [m]."""
MOST_PAIRS = 6
"""Pairs of grips from one base pose, with one height of the torso, that are looked at exactly."""
MOST_BASES = 40
"""Places of the base that are looked at."""
TOUCHES_ITSELF = "touches itself"
"""The reason of ways on which the robot meets its own body."""
LARGEST_TURN = 1.2
"""Largest turn of a thing between the hands from how they carry it to how they put it down [rad]."""


class _Refused(Exception):
    """The refusal of a way, with the reason, and the body that is in it, if one is."""


@dataclass(frozen=True, slots=True, eq=False)
class PairGrasp:
    """A way in which two arms take a thing from a place of the base."""

    base: BasePose
    approach: Array
    """Joint values (k, n) from before the thing to it."""
    lift: Array
    """Joint values (k, n) from the thing to where it is lifted."""
    fingers: tuple[Fingers, Fingers]


@dataclass(frozen=True, slots=True, eq=False)
class PairPlace:
    """A way in which two arms put down what they hold, from a place of the base."""

    base: BasePose
    lower: Array
    """Joint values (k, n) from how it is carried to over its place, and down (k, n)."""
    pose: Pose
    """The pose of the thing at its place."""


@dataclass(eq=False)
class PairPaths:
    """Ways of two arms; ``log`` counts why others are none."""

    control: Control
    pair: ArmPair
    log: Rejections = field(default_factory=Rejections)

    # Where it is

    def now(self) -> Array:
        """Return the joint values (n,)."""
        return self.control.joints(self.pair.names)

    def _torso(self, q: Array) -> float:
        return 0.0 if self.pair.torso is None else float(q[self.pair.torso])

    def _meets(self, base: BasePose, q: Array, name: str | None = None, fingers: Fingers = ()) -> str | None:
        """Return what the robot touches wrongly with its arms at joint values (n,); its fingers may be at a body."""
        joints = dict(zip(self.pair.names, q.tolist(), strict=True)) | dict(fingers)
        links = [link for arm in self.pair.arms for link in sorted(self._finger_links(arm))]
        ignore = [(link, name) for link in links] if name is not None else []
        now = self.control.scene.world.configuration().joints
        moving = (*self.pair.names, *(joint for joint, _ in fingers))
        met = self.control.scene.world.contacts(Configuration(base, {**now, **joints}), moving, ignore=ignore)
        return next((contact.body for contact in met), None)

    def _finger_links(self, arm: ArmModel) -> Sequence[str]:
        gripper = self.control.robot.arm(arm.name).gripper
        return () if gripper is None else gripper.finger_links

    def _refuse(self, reason: str, body: str | None = None, number: int = 1) -> None:
        if body is not None and body not in self.control.scene.world.names():  # a link of the robot
            reason, body = TOUCHES_ITSELF, None
        self.log.add(reason, number)
        if body is not None:
            self.log.blocking[body] += 1

    # Taking

    def grasps(self, name: str, bases: Iterable[BasePose]) -> Iterator[PairGrasp | None]:
        """Yield ways to take a thing from places of the base, the first places first; None after each search."""
        self.control.sync()
        scene = self.control.scene
        first, second = (grips_of(name, arm, scene, self.log) for arm in self.pair.arms)
        fits = opposite(first, second, scene.bodies.block(name).centre)
        if not fits.any():
            self._refuse("no opposite grips", number=len(first.plans) + len(second.plans))
            return
        for base in islice(bases, MOST_BASES):
            for torso in self.pair.torsos(self._torso(self.now())).tolist():
                yield from self._from_base(name, base, torso, (first, second), fits)
                yield None

    def _from_base(
        self, name: str, base: BasePose, torso: float, grips: tuple[Grips, Grips], fits: NDArray[np.bool_]
    ) -> Iterator[PairGrasp]:
        back, solved, reached = inverse(base_matrices(np.array([base]))[0]), [], []
        for arm, one in enumerate(grips):
            seeds = self._seeds(arm, len(one.plans))
            q, good = self.pair.solve_one(arm, product(back, one.poses[:, 1]), seeds, np.full(len(seeds), torso))
            solved.append(q)
            reached.append(good)
            self._refuse(f"out of reach of {one.arm.name}", number=int((~good).sum()))
        for arm in (0, 1) if (fits & reached[0][:, None] & reached[1][None]).any() else ():
            for k in np.flatnonzero(reached[arm]).tolist():
                reached[arm][k] = self._is_free(base, torso, arm, solved[arm][k], grips[arm].plans[k].fingers)
        both = np.argwhere(fits & reached[0][:, None] & reached[1][None])
        weights = grips[0].weights[both[:, 0]] * grips[1].weights[both[:, 1]]
        for row in np.argsort(-weights.round(6), kind="stable")[:MOST_PAIRS].tolist():
            i, k = both[row].tolist()
            parts = solved[0][i][None], solved[1][k][None]
            at = self.pair.joined(parts, np.array([torso]), self.now())[0]
            tips = product(back, np.stack([grips[0].poses[i], grips[1].poses[k]], axis=1))
            fingers = grips[0].plans[i].fingers, grips[1].plans[k].fingers
            try:
                yield self._checked(name, base, at, tips, fingers)
            except _Refused as refused:
                self._refuse(*refused.args)

    def _is_free(self, base: BasePose, torso: float, arm: int, part: Array, fingers: Fingers) -> bool:
        """Return whether one arm, at the joint values that are solved for, is in nothing, with open fingers."""
        model, now = self.pair.arms[arm], self.now()
        other = now[self.pair.solved[1 - arm]]
        parts = (part[None], other[None]) if arm == 0 else (other[None], part[None])
        q = self.pair.joined(parts, np.array([torso]), now)[0][self.pair.group.columns[arm]]
        met = self.control.scene.collisions.contacts(base, model, q, fingers=fingers)
        known = self.control.scene.world.names()  # the other arm will be elsewhere
        body = next((contact.body for contact in met if contact.body in known), None)
        if body is not None:
            self._refuse(COLLISION, body)
        return body is None

    def _seeds(self, arm: int, count: int) -> Array:
        """Return joint values (count, s, n) of both arms from which inverse kinematics of one begins."""
        model, now = self.pair.arms[arm], self.now()
        rows = np.tile(now, (1 + len(model.seeds), 1))
        rows[1:, self.pair.group.columns[arm]] = model.seeds
        return np.broadcast_to(rows, (count, *rows.shape))

    def _checked(
        self, name: str, base: BasePose, at: Array, tips: Array, fingers: tuple[Fingers, Fingers]
    ) -> PairGrasp:
        """Return the way with the hands at the thing at joint values (n,); tips (4, 2, 4, 4). Raises _Refused."""
        opened = tuple(item for one in fingers for item in one)
        if (body := self._meets(base, at, fingers=opened)) is not None:
            raise _Refused(COLLISION, body)
        torso = np.full(1, self._torso(at))
        rows, reached = self.pair.along(between(tips[1], tips[0])[None], at[None], np.repeat(torso, 99)[None])
        approach = np.concatenate([at[None], rows[0]])[::-1]
        if reached[0] < len(rows[0]):
            raise _Refused("no straight way to it")
        if any((body := self._meets(base, row, fingers=opened)) is not None for row in approach):
            raise _Refused(COLLISION, body)
        closed: dict[str, float] = {}
        for arm, one in zip(self.pair.arms, fingers, strict=True):
            q = at[self.pair.group.columns[self.pair.arms.index(arm)]]
            held = self.control.scene.collisions.closed_on(base, arm, q, name, one)
            if held is None:
                raise _Refused("no hold for the fingers")
            gripper = self.control.robot.arm(arm.name).gripper
            closed |= {joint: held[joint] for joint in gripper.joints} if gripper is not None else {}
        raised = tips[1].copy()
        raised[:, 2, 3] += LIFT
        way = between(tips[1], raised)
        heights = np.linspace([torso[0]] * 2, [torso[0], self.pair.raised(torso[0], LIFT)], len(way) + 1)[1:].T
        rows, reached = self.pair.along(np.stack([way, way]), np.stack([at, at]), heights)
        lift = np.concatenate([at[None], rows[int(reached.argmax())]])
        if reached.max() < len(way):
            raise _Refused("cannot be lifted from there")
        if (body := self._met_holding(name, base, lift, closed)) is not None:
            raise _Refused(COLLISION, body)
        return PairGrasp(base, approach, lift, fingers)

    def _met_holding(self, name: str, base: BasePose, rows: Array, fingers: dict[str, float]) -> str | None:
        """Return what is met on a way (k, n) with the thing in both hands, from the first row on."""
        control, world = self.control, self.control.scene.world
        joints = {**world.configuration().joints, **fingers}
        try:
            start = dict(zip(self.pair.names, rows[0].tolist(), strict=True))
            world.set_configuration(Configuration(base, {**joints, **start}))
            for arm in self.pair.arms:
                world.attach(control.robot.arm(arm.name).tip, name)
            met = (self._meets(base, row) for row in rows[1:])
            return next((body for body in met if body is not None), None)
        finally:
            world.release(name)
            control.sync()
            world.set_pose(name, control.belief.pose(name))
            control.sync()

    # Moving what is held

    def held_tips(self, name: str) -> Array:
        """Return the poses of both tips in the frame of the thing that they hold (2, 4, 4)."""
        hands = {hand.arm: hand.offset for hand in self.control.belief.held[name].hands}
        return np.stack([hands[arm.name].inverse().matrix() for arm in self.pair.arms])

    def pose_of(self, name: str, q: Array) -> Array:
        """Return the pose (4, 4) in the base of the thing that both hands hold at joint values (n,)."""
        return np.asarray(product(self.pair.tips(q)[0], inverse(self.held_tips(name)[0])))

    def shifted(self, name: str, shift: Array) -> Array:
        """Return joint values (k, n), from those now on, that shift a held thing (3,) in the base as far as it goes."""
        start = self.now()
        here = self.pose_of(name, start)
        there = here.copy()
        there[:3, 3] += shift
        poses = _steps(here, there)
        targets = product(poses[:, None], self.held_tips(name))
        torsos = np.full((1, len(targets)), self._torso(start))
        rows, reached = self.pair.along(targets[None], start[None], torsos)
        base, kept = self.control.base(), [start]
        for row in rows[0][: reached[0]]:
            if self._meets(base, row) is not None:
                break
            kept.append(row)
        return np.array(kept)

    def places(
        self, name: str, poses: Sequence[Pose], bases: Callable[[Pose], Iterable[BasePose]]
    ) -> Iterator[PairPlace | None]:
        """Yield ways to put down what the hands hold at poses of the map, from places of the base; None in between."""
        start = self.now()
        here, tips = self.pose_of(name, start), self.held_tips(name)
        for pose in poses:
            several = list(islice(bases(pose), MOST_BASES))
            there = product(inverse(base_matrices(np.array(several).reshape(-1, 3))), pose.matrix())
            turns = np.abs([_yaw(turn) for turn in product(there, inverse(here))])
            self._refuse("turned too far", number=int((turns > LARGEST_TURN).sum()))
            near = np.flatnonzero(turns <= LARGEST_TURN).tolist()
            yield from self._down(pose, [several[k] for k in near], there[near], (start, here, tips))
            yield None

    def _down(
        self, pose: Pose, bases: Sequence[BasePose], there: Array, held: tuple[Array, Array, Array]
    ) -> Iterator[PairPlace]:
        """Yield the ways to a pose, (m, 4, 4) in the frames of bases, that are free."""
        start, here, tips = held
        if not bases:
            return
        above = there.copy()
        above[:, 2, 3] += LIFT
        count = max(_count(here, one) for one in above)
        ways = np.stack(
            [np.concatenate([_steps(here, up, count), _steps(up, end)]) for up, end in zip(above, there, strict=True)]
        )
        torsos = self.pair.torsos(self._torso(start))
        done = np.arange(1, ways.shape[1] + 1)
        shares = np.clip([done / count, (done - count) / max(ways.shape[1] - count, 1)], 0.0, 1.0)
        lowered = self.pair.raised(self._torso(start), -LIFT)  # at the end, with the arms as they are to it
        torsos, shares = np.append(torsos, lowered), np.vstack([np.tile(shares[0], (len(torsos), 1)), shares[1]])
        heights = self._torso(start) + (torsos - self._torso(start))[:, None] * shares
        several = np.repeat(ways[:, :, None] @ tips, len(torsos), axis=0)
        rows, reached = self.pair.along(several, np.tile(start, (len(several), 1)), np.tile(heights, (len(bases), 1)))
        self._refuse("out of reach of both hands", number=int((reached < ways.shape[1]).sum()))
        for k in np.flatnonzero(reached == ways.shape[1]).tolist():
            base = bases[k // len(torsos)]
            body = next((met for row in rows[k] if (met := self._meets(base, row)) is not None), None)
            if body is None:
                yield PairPlace(base, np.concatenate([start[None], rows[k]]), pose)
            else:
                self._refuse(COLLISION, body)

    def away(self, name: str) -> Array:
        """Return joint values (k, n) that take both hands straight back, from where they have let go."""
        start = self.now()
        here = self.pair.tips(start)
        there = here.copy()
        for k, arm in enumerate(self.pair.arms):
            there[k, :3, 3] -= LIFT * (here[k, :3, :3] @ np.asarray(arm.frame.approach))
        way = between(here, there)
        torsos = np.full((1, len(way)), self._torso(start))
        rows, reached = self.pair.along(way[None], start[None], torsos)
        kept, base = [start], self.control.base()
        for row in rows[0][: reached[0]]:
            if self._meets(base, row, name) is not None:
                break
            kept.append(row)
        return np.array(kept)

    def timed(self, rows: Array, *, held: bool) -> Trajectory:
        """Return a way (k, n) with times; what both hands hold is held on it. Raises a MotionError."""
        rows = self.pair.group.near(rows, self.now())
        for timing in (time_curve, time_path):
            trajectory = self.control.timed(self.pair.names, rows, timing)
            away, turned = strays(self.pair, trajectory.positions)
            within = self.pair.group.within(trajectory.positions, 1e-6).all()
            if within and not (held and (away > STRAY or turned > TWIST)):
                return trajectory
        raise MotionError("the hands would not stay as they are to each other")


def between(start: Array, end: Array) -> Array:
    """Return poses (k, ..., 4, 4) on the way between poses of one rotation (..., 4, 4), without the first."""
    far = float(np.linalg.norm(end[..., :3, 3] - start[..., :3, 3], axis=-1).max())
    shares = np.linspace(0.0, 1.0, max(2, math.ceil(far / STEP) + 1))[1:]
    poses = np.repeat(start[None], len(shares), axis=0)
    poses[..., :3, 3] += np.multiply.outer(shares, end[..., :3, 3] - start[..., :3, 3])
    return poses


def _yaw(turn: Array) -> float:
    return math.atan2(turn[1, 0], turn[0, 0])


def _count(start: Array, end: Array) -> int:
    """Return the number of steps between two poses (4, 4)."""
    far = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    return max(1, math.ceil(far / STEP), math.ceil(abs(_yaw(product(end, inverse(start)))) / TURN))


def _steps(start: Array, end: Array, count: int | None = None) -> Array:
    """Return poses (k, 4, 4) between two that are turned against each other about the vertical, without the first."""
    turn, count = _yaw(product(end, inverse(start))), count or _count(start, end)
    shares = np.arange(1, count + 1) / count
    poses = np.repeat(start[None], count, axis=0)
    poses[:, :3, 3] += shares[:, None] * (end[:3, 3] - start[:3, 3])
    c, s = np.cos(turn * shares), np.sin(turn * shares)
    zero, one = np.zeros(count), np.ones(count)
    turns = np.stack([np.stack([c, -s, zero], 1), np.stack([s, c, zero], 1), np.stack([zero, zero, one], 1)], axis=1)
    poses[:, :3, :3] = turns @ start[:3, :3]
    return poses
