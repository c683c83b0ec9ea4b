"""Joint paths of two arms that grasp an object together, move it level, and put it down, from given base poses.

A pose of the object determines the poses of both tips, which stay fixed to each other. Collision checks include the
held object and all that stands on it. It stays level, because it is only translated and turned about the vertical.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
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
from executive.robots.openings import Fingers
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, product
from planlang.protocols import Configuration, Trajectory
from planlang.records import dataclass
from planlang.state import Grip, Hold
from sim import PlanningWorld

STEP, TURN = 0.02, 0.05
"""Spacing of waypoints for an object in both hands [m, rad]."""
STRAY, TWIST = 0.004, 0.03
"""Largest change of the relative pose of the hands along a path [m, rad]; more would let the object slip."""
LIFT = 0.08
"""Height by which an object is lifted before it is moved, and from which it is lowered [m]."""
MOST_PAIRS = 6
"""Pairs of grips to check exactly for each base pose and torso height."""
MOST_BASES = 40
"""Base poses to check."""
TOUCHES_ITSELF = "touches itself"
"""Reason for rejecting a path on which the robot is in self-collision."""
HAIR = 1e-12
"""Guard against division by zero [rad^2]."""
LARGEST_TURN = 1.2
"""Largest turn of an object relative to the base between carrying it and putting it down [rad]."""


class _Refused(Exception):
    """Rejection of a path; arguments: the reason, and the colliding body, if any."""


@dataclass(frozen=True, slots=True, eq=False)
class PairGrasp:
    """Joint paths of two arms that grasp an object from a base pose."""

    base: BasePose
    approach: Array
    """Joint positions (k, n) from the pre-grasp to the grasp."""
    lift: Array
    """Joint positions (k, n) from the grasp to the lifted object."""
    fingers: tuple[Fingers, Fingers]
    """Opening of each hand for the approach."""


@dataclass(frozen=True, slots=True, eq=False)
class PairPlace:
    """Joint path of two arms that puts down an object from a base pose."""

    base: BasePose
    lower: Array
    """Joint positions (k, n) from the carrying posture to above the place, then down."""
    pose: Pose
    """Put-down pose of the object in the map."""


@dataclass(eq=False)
class PairPaths:
    """Planner of joint paths for two arms; ``log`` counts the reasons for rejections."""

    control: Control
    pair: ArmPair
    log: Rejections = field(default_factory=Rejections)

    # Where it is

    def now(self) -> Array:
        """Read the current joint positions (n,)."""
        return self.control.joints(self.pair.names)

    def _torso(self, q: Array) -> float:
        return 0.0 if self.pair.torso is None else float(q[self.pair.torso])

    def _collides(
        self,
        base: BasePose,
        q: Array,
        name: str | None = None,
        fingers: Fingers = (),
        world: PlanningWorld | None = None,
    ) -> str | None:
        """Find a body or link that the robot collides with at joint positions (n,); fingers may touch ``name``.

        ``world``: of a state that is supposed; by default as is believed.
        """
        joints = dict(zip(self.pair.names, q.tolist(), strict=True)) | dict(fingers)
        grippers = [arm.gripper for arm in self.pair.arms]
        links = [link for one in grippers if one is not None for link in sorted(one.finger_links)]
        ignore = [(link, name) for link in links] if name is not None else []
        world, moving = world or self.control.scene.world, (*self.pair.names, *(joint for joint, _ in fingers))
        there = Configuration(base, {**world.configuration().joints, **joints})
        return next((contact.body for contact in world.contacts(there, moving, ignore=ignore)), None)

    def _refuse(self, reason: str, body: str | None = None, number: int = 1) -> None:
        if body is not None and body not in self.control.scene.world.names():  # a link of the robot
            reason, body = TOUCHES_ITSELF, None
        self.log.add(reason, number)
        if body is not None:
            self.log.blocking[body] += 1

    # Taking

    def grasps(self, name: str, bases: Iterable[BasePose]) -> Iterator[PairGrasp | None]:
        """Yield paths that grasp an object, in the order of base poses; None after each base pose and torso height."""
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
        """Yield the grasps from one base pose and torso height, best first. ``fits``: mask of opposite grips."""
        to_base, solved, reached = inverse(base_matrices(np.array([base]))[0]), [], []
        for arm, one in enumerate(grips):
            seeds = self._seeds(arm, len(one.plans))
            q, good = self.pair.solve_one(arm, product(to_base, one.poses[:, 1]), seeds, np.full(len(seeds), torso))
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
            tips = product(to_base, np.stack([grips[0].poses[i], grips[1].poses[k]], axis=1))
            fingers = grips[0].plans[i].fingers, grips[1].plans[k].fingers
            try:
                yield self._checked(name, base, at, tips, fingers)
            except _Refused as refused:
                self._refuse(*refused.args)

    def _is_free(self, base: BasePose, torso: float, arm: int, part: Array, fingers: Fingers) -> bool:
        """Check whether one arm with open fingers collides with no body at its solved joint positions ``part``."""
        model, now = self.pair.arms[arm], self.now()
        other = now[self.pair.solved[1 - arm]]
        parts = (part[None], other[None]) if arm == 0 else (other[None], part[None])
        q = self.pair.joined(parts, np.array([torso]), now)[0][self.pair.group.columns[arm]]
        contacts = self.control.scene.collisions.contacts(base, model, q, fingers=fingers)
        bodies = self.control.scene.world.names()  # not the robot's own links: the other arm will have moved
        body = next((contact.body for contact in contacts if contact.body in bodies), None)
        if body is not None:
            self._refuse(COLLISION, body)
        return body is None

    def _seeds(self, arm: int, count: int) -> Array:
        """Build seeds (count, s, n) in the joints of both arms for the inverse kinematics of one."""
        model, now = self.pair.arms[arm], self.now()
        rows = np.tile(now, (1 + len(model.seeds), 1))
        rows[1:, self.pair.group.columns[arm]] = model.seeds
        return np.broadcast_to(rows, (count, *rows.shape))

    def _checked(
        self, name: str, base: BasePose, at: Array, tips: Array, fingers: tuple[Fingers, Fingers]
    ) -> PairGrasp:
        """Plan approach and lift for a grasp at joint positions ``at`` (n,), with hand poses ``tips`` (4, 2, 4, 4).

        ``tips`` are the grips' series of poses, for both hands, in the base's frame. Raises _Refused.
        """
        opened = tuple(item for one in fingers for item in one)
        if (body := self._collides(base, at, fingers=opened)) is not None:
            raise _Refused(COLLISION, body)
        torso = np.full(1, self._torso(at))
        rows, reached = self.pair.along(between(tips[1], tips[0])[None], at[None], np.repeat(torso, 99)[None])
        approach = np.concatenate([at[None], rows[0]])[::-1]
        if reached[0] < len(rows[0]):
            raise _Refused("no straight approach")
        if any((body := self._collides(base, row, fingers=opened)) is not None for row in approach):
            raise _Refused(COLLISION, body)
        closed: dict[str, float] = {}
        for arm, one in zip(self.pair.arms, fingers, strict=True):
            q = at[self.pair.group.columns[self.pair.arms.index(arm)]]
            held = self.control.scene.collisions.closed_on(base, arm, q, name, one)
            if held is None:
                raise _Refused("no hold for the fingers")
            gripper = arm.gripper
            closed |= {joint: held[joint] for joint in gripper.joints} if gripper is not None else {}
        raised = tips[1].copy()
        raised[:, 2, 3] += LIFT
        poses = between(tips[1], raised)
        # Two ways to lift: with the arms alone, or with the torso as far as it goes.
        heights = np.linspace([torso[0]] * 2, [torso[0], self.pair.raised(torso[0], LIFT)], len(poses) + 1)[1:].T
        rows, reached = self.pair.along(np.stack([poses, poses]), np.stack([at, at]), heights)
        lift = np.concatenate([at[None], rows[int(reached.argmax())]])
        if reached.max() < len(poses):
            raise _Refused("cannot be lifted from there")
        if (body := self._collides_holding(name, base, lift, closed)) is not None:
            raise _Refused(COLLISION, body)
        return PairGrasp(base, approach, lift, fingers)

    def _collides_holding(self, name: str, base: BasePose, rows: Array, fingers: dict[str, float]) -> str | None:
        """Find a body or link in collision along a path (k, n), with the object attached to both hands at its start."""
        control, state, world = self.control, self.control.belief.state, self.control.scene.world
        start = dict(zip(self.pair.names, rows[0].tolist(), strict=True))
        at = Configuration(base, {**world.configuration().joints, **fingers, **start})
        thing, tips = state.poses[name], [(arm.name, arm.tip) for arm in self.pair.arms]
        holds = [Hold(arm, tip, world.link_pose(tip, at).inverse() @ thing) for arm, tip in tips]
        held = {**state.held, name: Grip(*holds[0], thing, tuple(holds[1:]))}
        supposed = control.scene.supposing(replace(state.with_robot(control.belief.robot, at), held=held))
        bodies = (self._collides(base, row, world=supposed.world) for row in rows[1:])
        return next((body for body in bodies if body is not None), None)

    # Moving the held object

    def held_tips(self, name: str) -> Array:
        """Look up the poses (2, 4, 4) of both tips in the frame of their object."""
        hands = {hand.arm: hand.offset for hand in self.control.belief.held[name].hands}
        return np.stack([hands[arm.name].inverse().matrix() for arm in self.pair.arms])

    def pose_of(self, name: str, q: Array) -> Array:
        """Compute the pose (4, 4) of the held object in the base's frame at joint positions (n,)."""
        return np.asarray(product(self.pair.tips(q)[0], inverse(self.held_tips(name)[0])))

    def shifted(self, name: str, shift: Array) -> Array:
        """Plan a joint path (k, n) that shifts a held object by (3,) in the base's frame, as far as it is free.

        What the arms alone do not raise or lower all the way, the torso does as far as it goes.
        """
        start = self.now()
        here = self.pose_of(name, start)
        there = here.copy()
        there[:3, 3] += shift
        poses = _steps(here, there)
        targets = product(poses[:, None], self.held_tips(name))
        path = self._as_far_as_free(targets)
        if len(path) <= len(targets) and shift[2]:
            path = max(path, self._as_far_as_free(targets, raised=float(shift[2])), key=len)
        return path

    def places(
        self, name: str, poses: Sequence[Pose], bases: Callable[[Pose], Iterable[BasePose]]
    ) -> Iterator[PairPlace | None]:
        """Yield paths that put the held object down at map poses, from their base poses; None after each pose."""
        start = self.now()
        here, tips = self.pose_of(name, start), self.held_tips(name)
        for pose in poses:
            candidates = list(islice(bases(pose), MOST_BASES))
            there = product(inverse(base_matrices(np.array(candidates).reshape(-1, 3))), pose.matrix())
            turns = np.abs([_yaw(turn) for turn in product(there, inverse(here))])
            self._refuse("turned too far", number=int((turns > LARGEST_TURN).sum()))
            kept = np.flatnonzero(turns <= LARGEST_TURN).tolist()
            yield from self._down(pose, [candidates[k] for k in kept], there[kept], (start, here, tips))
            yield None

    def _down(
        self, pose: Pose, bases: Sequence[BasePose], there: Array, held: tuple[Array, Array, Array]
    ) -> Iterator[PairPlace]:
        """Yield the collision-free paths to a map pose, which is ``there`` (m, 4, 4) in the frames of ``bases``.

        ``held``: joint positions now, and the poses of the object in the base and of the tips in the object.
        """
        start, here, tips = held
        if not bases:
            return
        above = there.copy()
        above[:, 2, 3] += LIFT
        count = max(_count(here, one) for one in above)
        poses = np.stack(
            [np.concatenate([_steps(here, up, count), _steps(up, end)]) for up, end in zip(above, there, strict=True)]
        )
        # The torso moves to one of its heights on the way to above the place, or lowers the object at the end.
        torsos = self.pair.torsos(self._torso(start))
        done = np.arange(1, poses.shape[1] + 1)
        shares = np.clip([done / count, (done - count) / max(poses.shape[1] - count, 1)], 0.0, 1.0)
        lowered = self.pair.raised(self._torso(start), -LIFT)
        torsos, shares = np.append(torsos, lowered), np.vstack([np.tile(shares[0], (len(torsos), 1)), shares[1]])
        heights = self._torso(start) + (torsos - self._torso(start))[:, None] * shares
        targets = np.repeat(poses[:, :, None] @ tips, len(torsos), axis=0)
        rows, reached = self.pair.along(targets, np.tile(start, (len(targets), 1)), np.tile(heights, (len(bases), 1)))
        self._refuse("out of reach of both hands", number=int((reached < poses.shape[1]).sum()))
        for k in np.flatnonzero(reached == poses.shape[1]).tolist():
            base = bases[k // len(torsos)]
            body = next((hit for row in rows[k] if (hit := self._collides(base, row)) is not None), None)
            if body is None:
                yield PairPlace(base, np.concatenate([start[None], rows[k]]), pose)
            else:
                self._refuse(COLLISION, body)

    def away(self, name: str) -> Array:
        """Plan a joint path (k, n) on which both hands retreat straight from a released object, as far as is free."""
        start = self.now()
        here = self.pair.tips(start)
        there = here.copy()
        for k, arm in enumerate(self.pair.arms):
            there[k, :3, 3] -= LIFT * (here[k, :3, :3] @ np.asarray(arm.frame.approach))
        return self._as_far_as_free(between(here, there), name)

    def _as_far_as_free(self, targets: Array, touches: str | None = None, raised: float = 0.0) -> Array:
        """Follow poses of both tips (k, 2, 4, 4) from here, up to a collision; fingers may touch a body.

        The torso lifts the arms by ``raised`` [m] on the way.
        """
        start, base = self.now(), self.control.base()
        here = self._torso(start)
        torsos = np.linspace(here, self.pair.raised(here, raised) if raised else here, len(targets) + 1)[None, 1:]
        rows, reached = self.pair.along(targets[None], start[None], torsos)
        kept = [start]
        for row in rows[0][: reached[0]]:
            if self._collides(base, row, touches) is not None:
                break
            kept.append(row)
        return np.array(kept)

    def rest(self, rows: Array) -> Array:
        """Find what is left of a joint path (k, n), from here: from the joint positions on that it is nearest to."""
        now = self.now()
        near = self.pair.group.near(rows, now)
        starts, edges = near[:-1], np.diff(near, axis=0)
        lengths = np.maximum((edges**2).sum(axis=1), HAIR)
        shares = np.clip(((now - starts) * edges).sum(axis=1) / lengths, 0.0, 1.0)
        nearest = starts + shares[:, None] * edges
        passed = int(np.linalg.norm(now - nearest, axis=1).argmin())
        return np.concatenate([now[None], rows[passed + 1 :]])

    def timed(self, rows: Array) -> Trajectory:
        """Time a joint path (k, n). Raises a MotionError if hands that hold an object would move relatively."""
        rows = self.pair.group.near(rows, self.now())
        held = any(set(grip.arms) == {arm.name for arm in self.pair.arms} for grip in self.control.belief.held.values())
        for timing in (time_curve, time_path):
            trajectory = self.control.timed(self.pair.names, rows, timing)
            away, turned = strays(self.pair, trajectory.positions)
            within = self.pair.group.within(trajectory.positions, 1e-6).all()
            if within and not (held and (away > STRAY or turned > TWIST)):
                return trajectory
        raise MotionError("the hands would move relative to each other, or the arms beyond their limits")


def between(start: Array, end: Array) -> Array:
    """Interpolate poses (k, ..., 4, 4) between poses of the same rotation (..., 4, 4), without the first."""
    distance = float(np.linalg.norm(end[..., :3, 3] - start[..., :3, 3], axis=-1).max())
    shares = np.linspace(0.0, 1.0, max(2, math.ceil(distance / STEP) + 1))[1:]
    poses = np.repeat(start[None], len(shares), axis=0)
    poses[..., :3, 3] += np.multiply.outer(shares, end[..., :3, 3] - start[..., :3, 3])
    return poses


def _yaw(turn: Array) -> float:
    return math.atan2(turn[1, 0], turn[0, 0])


def _count(start: Array, end: Array) -> int:
    """Compute the number of waypoints between two poses (4, 4)."""
    distance = float(np.linalg.norm(end[:3, 3] - start[:3, 3]))
    return max(1, math.ceil(distance / STEP), math.ceil(abs(_yaw(product(end, inverse(start)))) / TURN))


def _steps(start: Array, end: Array, count: int | None = None) -> Array:
    """Interpolate poses (k, 4, 4) between two that differ by a turn about the vertical, without the first."""
    turn, count = _yaw(product(end, inverse(start))), count or _count(start, end)
    shares = np.arange(1, count + 1) / count
    poses = np.repeat(start[None], count, axis=0)
    poses[:, :3, 3] += shares[:, None] * (end[:3, 3] - start[:3, 3])
    c, s = np.cos(turn * shares), np.sin(turn * shares)
    zero, one = np.zeros(count), np.ones(count)
    turns = np.stack([np.stack([c, -s, zero], 1), np.stack([s, c, zero], 1), np.stack([zero, zero, one], 1)], axis=1)
    poses[:, :3, :3] = turns @ start[:3, :3]
    return poses
