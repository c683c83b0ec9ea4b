"""Paths of a hand that moves a door or a drawer: grips of its handle along the arc or line that the joint makes of it.

The joint leads: each grip is carried through the values of the joint, and inverse kinematics follows from value to
value, for many places of the base at once. What is left is looked at exactly in the planning scene, best first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.locations.hand_solutions import base_matrices
from executive.locations.rejections import COLLISION, OUT_OF_REACH, Reason, Rejections, first_body
from executive.modules.commanding import Control
from executive.modules.furniture.leaf_grips import LAGS, Grips, grips_of
from executive.motion import InverseKinematics, cartesian_path
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

STEPS = {JointKind.HINGED: 0.06, JointKind.PRISMATIC: 0.025}
"""Steps of a joint between two postures [rad, m]."""
SPACING, COARSER, HEADINGS = 0.1, 2, 16
"""Places of the base around the handle: their spacing [m], every how many of them are looked at first, headings."""
NEAREST = 0.3
"""Distance of the base from the handle, at least [m]."""
BLOCK = 24
"""Places of the base that are looked at in one go."""
MOST_BLOCKS = 16
"""Blocks that are looked at before what was found has to do."""
MOST_WAYS = 240
"""Ways of a block that are followed to their end: others differ little."""
MOST_CHECKED = 24
"""Ways of a block that are looked at exactly."""
HEIGHTS = 13
"""Heights of a torso at which it is looked whether the rest of the robot, lifted with it, touches itself."""
FARTHEST = 0.5
"""Largest move of a joint of the arm between two postures [rad, m]."""
ENOUGH = 0.12
"""Share of its way by which a hand has to move a leaf from one place, at least."""
BEHIND = (0.08, 0.2, 0.3)
"""Distances behind the handle at which the arm is that has it [m]."""
LEAVING = (0.25, 0.5, 1.0)
"""Shares of the way to the handle at which a hand that leaves it is looked at."""
SWEPT = Reason("swept over by the leaf")
NO_GRIP = "no room for the hand at the handle"


@dataclass(frozen=True, slots=True, eq=False)
class LeafPath:
    """A place of the base, a grip of the handle, and how the arm moves the leaf from there."""

    arm: ArmModel
    base: BasePose
    fingers: Fingers
    """How far the hand is open when it comes to the handle."""
    before: Array
    """Joint values before the handle (d,)."""
    poses: Array
    """Poses of the tip in the map, before the handle and then at each value (1 + n, 4, 4)."""
    values: Array
    """Values of the joint (n,)."""
    joints: Array
    """Joint values of the arm at each of them (n, d)."""


class LeafPaths:
    """Looks for ways to move one leaf; ``rejected`` counts places of the base that will not do."""

    def __init__(self, control: Control, joint: Articulation) -> None:
        self._control, self._joint, self.poses = control, joint, BasePoses(control.scene)
        self.rejected, self._tried = self.poses.log, tuple[ArmModel, ...]()
        self._values, self._enough = np.zeros(0), 0

    def towards(self, value: float, arms: Sequence[ArmModel], wanted: float) -> Iterator[LeafPath | None]:
        """Yield ways to move the leaf from where it is to a value, those that get there first; None while it looks.

        ``wanted``: the value that will do as well. Ways that end before come last, the farthest first.
        Grips that need less room are looked at where others have no way.
        """
        control, joint = self._control, self._joint
        control.sync()
        self._tried = tuple(arms)
        now = control.belief.joint(joint.leaf)
        count = max(2, math.ceil(abs(value - now) / STEPS[joint.kind]) + 1)
        values = np.linspace(now, value, count)
        enough = int(np.argmax((values >= wanted) if value > now else (values <= wanted))) + 1
        self._values, self._enough = values, enough
        partial: list[LeafPath] = []
        found = False
        for arm, tight in ((arm, tight) for tight in (False, True) for arm in arms):
            if tight and found:
                break
            paths = self._of_arm(arm, values, enough, tight=tight)
            for path in _whole_first(paths, count) if joint.kind is JointKind.PRISMATIC else paths:
                found = found or path is not None
                if path is None or len(path.values) >= enough:
                    yield path
                else:
                    partial.append(path)
        least = max(2, math.ceil(ENOUGH * count))
        yield from sorted((one for one in partial if len(one.values) > least), key=lambda one: -len(one.values))

    def reach(self, rise: float = 0.0) -> bool:
        """Return whether an arm reaches the handle, if that were higher by ``rise`` [m], whatever the arm is in.

        That is from where the base has room and can drive to.
        """
        control, joint = self._control, self._joint
        others = LeafPaths(control, joint)  # where nothing is counted that was not tried
        for arm in self._tried:
            grips = grips_of(control.scene, arm, joint).raised(rise)
            if len(grips):
                bases, _ = others._bases(arm, self._values, grips, self._enough)
                roomy = np.ones(len(self._values), bool)
                ways = _Ways(control, joint, arm, grips, self._values, roomy, others.rejected)
                if len(bases) and ways.reach(bases[: BLOCK * MOST_BLOCKS]):
                    return True
        return False

    def _of_arm(self, arm: ArmModel, values: Array, enough: int, *, tight: bool) -> Iterator[LeafPath | None]:
        """Yield ways with one arm, as far as they are free; best places of the base first, None after some of them."""
        grips = self._free(arm, grips_of(self._control.scene, arm, self._joint, tight=tight))
        if not len(grips):
            return
        roomy = self._roomy(arm, grips, values, enough)
        ways = _Ways(self._control, self._joint, arm, grips, values, roomy, self.rejected)
        bases, steps = self._bases(arm, values, grips, enough)
        for first in range(0, min(len(bases), BLOCK * MOST_BLOCKS), BLOCK):
            block = slice(first, first + BLOCK)
            yield from ways.of(bases[block], steps[block])
            yield None

    def _free(self, arm: ArmModel, grips: Grips) -> Grips:
        """Return the grips in which the hand alone is inside nothing, wherever the base is."""
        if not len(grips):
            self.rejected.add("too wide for the gripper")
            return grips
        check = self._control.scene.collisions.arm_check(arm, self._joint.handle, grips.fingers)
        met = [one or other for one, other in zip(*map(check.hand_hit, (grips.starts, grips.before)), strict=True)]
        self.rejected.count(Reason(NO_GRIP, one) for one in met if one is not None)
        return grips.chosen(np.array([one is None for one in met], bool))

    def _roomy(self, arm: ArmModel, grips: Grips, values: Array, enough: int) -> NDArray[np.bool_]:
        """Return at which values of the joint a way of the leaf may end (n,): a hand can come to the handle again.

        What is opened beside a wall would else be opened until nobody closes it. As far as is ``enough`` it goes. The
        arm follows its hand straight on for :data:`BEHIND`.
        """
        first = self._joint.motion(float(values[0])).inverse().matrix()
        check = self._control.scene.collisions.arm_check(arm, self._joint.handle, grips.fingers)
        ways = np.stack([grips.short_by(away) for away in (0.0, *BEHIND)], axis=1)
        roomy = np.ones(len(values), bool)
        for number in range(enough, len(values) if values[-1] > values[0] else 0):
            motion = product(self._joint.motion(float(values[number])).matrix(), first)
            met = check.hand_hit(product(motion, ways).reshape(-1, 4, 4))
            roomy[number] = np.array([one is None for one in met]).reshape(len(grips), -1).all(axis=1).any()
        return roomy

    # Places of the base

    def _bases(self, arm: ArmModel, values: Array, grips: Grips, enough: int) -> tuple[Array, NDArray[np.intp]]:
        """Return free places of the base within reach of the handle (m, 3), best first.

        And how many values of the joint the leaf can go from each: as far as the arm reaches, and the leaf does not
        sweep over the base (m,).
        """
        first = self._joint.motion(float(values[0])).inverse().matrix()
        middle = grips.points.mean(axis=0)
        tips = np.stack([moved(product(self._joint.motion(v).matrix(), first), middle) for v in values.tolist()])
        bases, coarse = self._lattice(arm, tips)
        reached, strain = _within_reach(arm, bases, tips)
        near = reached > 1
        self.rejected.add(OUT_OF_REACH.text, 0 if near.any() else len(near))
        near[near] = self.poses.free(bases[near], -strain[near])
        bases, coarse, reached, strain = bases[near], coarse[near], reached[near], strain[near]
        steps = np.minimum(reached, self._beside(bases, values))
        self.rejected.count([SWEPT] * int((steps <= 1).sum()))
        order = np.lexsort((strain.round(6), ~coarse, -np.minimum(steps, enough)))
        order = order[steps[order] > 1]
        return bases[order], steps[order]

    def _lattice(self, arm: ArmModel, tips: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return places around the way of the handle (m, 3), that of the base first; and which are tried first."""
        here = np.array([self._control.base()])
        if self._control.robot.base.fixed:
            return here, np.ones(1, bool)
        middle = tips.mean(axis=0)
        shoulder = float(np.hypot(*arm.shoulder_low[:2]))
        count = math.ceil((arm.reach + shoulder + np.hypot(*(tips - middle)[:, :2].T).max()) / SPACING)
        cells, turns = np.arange(-count, count + 1), np.arange(HEADINGS)
        i, j, k = (grid.ravel() for grid in np.meshgrid(cells, cells, turns, indexing="ij"))
        bases = np.column_stack([middle[0] + SPACING * i, middle[1] + SPACING * j, k * 2 * math.pi / HEADINGS])
        coarse = (i % COARSER == 0) & (j % COARSER == 0) & (k % COARSER == 0)
        apart = np.hypot(*(bases[:, :2] - tips[0, :2]).T) > NEAREST
        bases[:, 2] = np.remainder(bases[:, 2] + math.pi, 2 * math.pi) - math.pi
        return np.concatenate([here, bases[apart]]), np.concatenate([[True], coarse[apart]])

    def _beside(self, bases: Array, values: Array) -> NDArray[np.intp]:
        """Return for how many values the leaf does not sweep over bases (m, 3), taken for round (m,)."""
        joint, scene = self._joint, self._control.scene
        leaf, radius = scene.world.scene.body(joint.leaf), 0.8 * scene.base_radius
        free = np.ones((len(bases), len(values)), bool)
        for number, value in enumerate(values.tolist()):
            pose = joint.motion(value) @ leaf.pose
            points = np.column_stack([bases[:, :2], np.full(len(bases), pose.position[2])])
            local = np.abs(moved(pose.inverse().matrix(), points)) - np.asarray(leaf.size) / 2
            free[:, number] = np.linalg.norm(np.maximum(local, 0.0), axis=1) > radius
        return np.asarray(np.logical_and.accumulate(free, axis=1).sum(axis=1))


def _whole_first(paths: Iterator[LeafPath | None], count: int) -> Iterator[LeafPath | None]:
    """Yield ways through all of so many values as they come, others after their block, the farthest first.

    A drawer that is open by less covers what lies at its back.
    """
    others: list[LeafPath] = []
    for path in paths:
        if path is None:
            yield from sorted(others, key=lambda one: -len(one.values))
            others.clear()
        if path is None or len(path.values) == count:
            yield path
        else:
            others.append(path)


def _within_reach(arm: ArmModel, bases: Array, tips: Array) -> tuple[NDArray[np.intp], Array]:
    """Return how many of the places of a tip (n, 3), from the first on, an arm is long enough for at bases (m, 3).

    And by how much it is bent or stretched there, at most (m,).
    """
    shoulder = moved(base_matrices(bases), (arm.shoulder_low + arm.shoulder_high) / 2)
    low, high = arm.shoulder_low[2], arm.shoulder_high[2]
    gaps = shoulder[:, None] - tips[None]
    gaps[..., 2] = np.clip(tips[None, :, 2], low, high) - tips[None, :, 2]
    away = np.linalg.norm(gaps, axis=2) / arm.reach
    reached = np.logical_and.accumulate(away < 1.0, axis=1)
    strain = np.where(reached, np.abs(away - 0.65), 0.0).max(axis=1)
    return np.asarray(reached.sum(axis=1)), strain


def _lifted(control: Control, arm: ArmModel) -> InverseKinematics:
    """Return the inverse kinematics of an arm with the torso where the rest of the robot does not touch itself."""
    if arm.lift is None:
        return arm.solver
    chain, column = arm.solver.chain, arm.lift.column
    heights = np.linspace(chain.lower[column], chain.upper[column], HEIGHTS).tolist()
    free = control.scene.collisions.lifted(arm, heights)
    if len(free) in (0, HEIGHTS):
        return arm.solver
    return InverseKinematics(chain.between(arm.lift.joint, min(free), max(free)))


class _Ways:
    """Ways of one arm with its grips of a handle."""

    def __init__(
        self,
        control: Control,
        joint: Articulation,
        arm: ArmModel,
        grips: Grips,
        values: Array,
        roomy: NDArray[np.bool_],
        rejected: Rejections,
    ) -> None:
        self._control, self._joint, self._arm, self._grips, self._values = control, joint, arm, grips, values
        self._roomy, self._rejected, self._before, self._poses = (
            roomy,
            rejected,
            grips.before,
            grips.along(joint, values),
        )
        lags = np.ones((len(grips), len(LAGS)), bool)
        lags[~grips.turns, 1:] = False
        self._lags = lags
        self._solver = _lifted(control, arm)

    def of(self, bases: Array, steps: NDArray[np.intp]) -> Iterator[LeafPath]:
        """Yield ways from some places (m, 3), from which the leaf can go for so many values (m,), longest first."""
        tried, checked = set[BasePose](), 0
        for base, grip, lag, joints in self._solved(bases, steps):
            if base in tried:
                continue
            path = self._checked(base, grip, lag, joints)
            if path is not None:
                tried.add(base)
                yield path
            elif (checked := checked + 1) == MOST_CHECKED:
                return

    def _solved(self, bases: Array, steps: NDArray[np.intp]) -> list[tuple[BasePose, int, int, Array]]:
        """Return place, grip, lag and the joint values from before the handle on (k, d), longest ways first."""
        there = inverse(base_matrices(bases))
        rows, grips, before, start = self._at_handle(bases, there)
        numbers, lags = np.nonzero(self._lags[grips])
        joints = np.zeros((len(numbers), len(self._values) + 1, len(self._arm.joints)))
        joints[:, 0], joints[:, 1] = before[numbers], start[numbers]
        rows, grips = rows[numbers], grips[numbers]
        reached = np.ones(len(rows), np.intp)
        near = np.arange(len(rows))
        for k in range(1, len(self._values)):
            near = near[steps[rows[near]] > k]
            if not len(near):
                break
            targets = product(there[rows[near]], self._poses[grips[near], lags[near], k])
            q, good = self._solver.solve(targets, joints[near, k][:, None])
            joints[near, k + 1] = q
            near = near[good & (np.abs(q - joints[near, k]).max(axis=1) < FARTHEST)]
            reached[near] = k + 1
        order = [row for row in np.argsort(-reached, kind="stable").tolist() if reached[row] > 1]
        places = [(x, y, yaw) for x, y, yaw in bases.tolist()]
        return [(places[rows[row]], int(grips[row]), int(lags[row]), joints[row, : reached[row] + 1]) for row in order]

    def _at_handle(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Return places (w,), grips (w,) and joint values before and at the handle (w, d) where nothing is hit."""
        arm, grips = self._arm, self._grips
        rows, numbers, before, start = self._reached(bases, there)
        self._rejected.count([OUT_OF_REACH] * (len(bases) - len(np.unique(rows))))
        check = self._control.scene.collisions.arm_check(arm, self._joint.handle, grips.fingers)
        poses = base_matrices(bases)[rows]
        met = [one or other for one, other in zip(check.hit(poses, start), check.hit(poses, before), strict=True)]
        self._rejected.count(Reason(COLLISION, one) for one in met if one is not None)
        free = np.flatnonzero([one is None for one in met])
        free = free[:: max(1, len(free) // MOST_WAYS)]
        return rows[free], numbers[free], before[free], start[free]

    def reach(self, bases: Array) -> bool:
        """Return whether the arm reaches a grip from one of places (m, 3), whatever is in its way."""
        return len(self._reached(bases, inverse(base_matrices(bases)))[0]) > 0

    def _reached(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Return places (w,), grips (w,) and joint values before and at the handle (w, d) of what the arm reaches."""
        arm, grips = self._arm, self._grips
        rows, numbers = (grid.ravel() for grid in np.indices((len(bases), len(grips))))
        seeds = np.broadcast_to(arm.seeds, (len(rows), *arm.seeds.shape))
        start, good = self._solver.solve(product(there[rows], grips.starts[numbers]), seeds)
        near = np.flatnonzero(good)
        q, good = self._solver.solve(product(there[rows[near]], self._before[numbers[near]]), start[near][:, None])
        good &= np.abs(q - start[near]).max(axis=1) < 2 * FARTHEST
        near, before = near[good], q[good]
        # as the arm will get there
        q, good = self._solver.solve(product(there[rows[near]], grips.starts[numbers[near]]), before[:, None])
        near = near[good]
        return rows[near], numbers[near], before[good], q[good]

    def _checked(self, base: BasePose, grip: int, lag: int, joints: Array) -> LeafPath | None:
        """Return a way as far as nothing is in it, None if not even the handle can be taken."""
        arm, handle, collisions = self._arm, self._joint.handle, self._control.scene.collisions
        fingers = self._grips.fingers
        assert handle is not None

        def is_free(q: Array, touches: str | None = handle) -> bool:
            met = collisions.contacts(base, arm, q, touches, fingers)
            self._rejected.count([Reason(COLLISION, first_body(met))] if met else [])
            return not met

        if collisions.contacts(base) or not (is_free(joints[0], None) and is_free(joints[1])):
            return None
        poses = np.concatenate([self._before[grip][None], self._poses[grip, lag]])
        ends = product(inverse(base_matrices(np.array([base]))[0]), poses[:2])
        line = cartesian_path(self._solver, joints[0], ends[0], ends[1], is_free)
        if line.waypoints is None or np.abs(line.waypoints[-1] - joints[1]).max() > 0.1:
            return None
        closed = collisions.closed_on(base, arm, joints[1], handle, fingers)
        if closed is None:
            self._rejected.add("no hold for the fingers")
            return None
        count = 1 + self._free_steps(base, joints[1:], closed)
        free = np.flatnonzero(self._roomy[:count] & self._leaves(grip, lag, count))
        if not len(free):
            self._rejected.add("no way for the fingers to leave the handle")
            return None
        count = 1 + int(free[-1])
        return LeafPath(arm, base, fingers, joints[0], poses[: 1 + count], self._values[:count], joints[1 : 1 + count])

    def _leaves(self, grip: int, lag: int, count: int) -> NDArray[np.bool_]:
        """Return at which of the first values of the joint the open hand can go back from the leaf as it came (count,).

        A hand that turned less than the leaf stands at an angle to it, with a finger between leaf and handle.
        """
        tips, grips = self._poses[grip, lag, :count], self._grips
        back = tips[:, :3, :3] @ grips.approach
        ways = np.repeat(tips[:, None], len(LEAVING), axis=1)
        ways[..., :3, 3] -= grips.back * np.multiply.outer(LEAVING, back).swapaxes(0, 1)
        # to the leaf as it is now
        first = self._joint.motion(float(self._values[0])).inverse().matrix()
        motions = np.stack([product(self._joint.motion(one).matrix(), first) for one in self._values[:count].tolist()])
        check = self._control.scene.collisions.arm_check(self._arm, self._joint.handle, grips.fingers)
        met = check.hand_hit(product(inverse(motions)[:, None], ways).reshape(-1, 4, 4))
        return np.asarray(np.array([one != self._joint.leaf for one in met]).reshape(count, -1).all(axis=1))

    def _free_steps(self, base: BasePose, rows: Array, fingers: Mapping[str, float]) -> int:
        """Return how many steps the arm can go with the fingers closed on the handle, and the leaf behind them."""
        control, arm, world = self._control, self._arm, self._control.scene.world
        joints = {**world.configuration().joints, **fingers}
        try:
            world.set_configuration(Configuration(base, joints | dict(zip(arm.joints, rows[0].tolist(), strict=True))))
            world.lead(control.robot.arm(arm.name).tip, self._joint.leaf)
            for number, row in enumerate(rows[1:]):
                met = world.contacts(Configuration(base, joints | dict(zip(arm.joints, row.tolist(), strict=True))))
                if met:
                    self._rejected.count([Reason(COLLISION, first_body(met))])
                    return number
            return len(rows) - 1
        finally:
            world.let_go(self._joint.leaf)
            control.sync()
