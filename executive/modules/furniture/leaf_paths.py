"""Paths of a hand that moves a door or drawer by its handle, along the arc or line that the joint prescribes.

Each grip is carried through the values of the joint, and inverse kinematics follows from value to value, for many base
poses at once. The remaining candidates are checked exactly in the planning scene, best first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.changes import CLOSE, Changes
from executive.locations.explanations import height_of
from executive.locations.hand_solutions import base_matrices
from executive.locations.rejections import COLLISION, NO_ROOM, NO_WAY, OUT_OF_REACH, Reason, Rejections, first_body
from executive.locations.standing import Standing
from executive.maps.single_changes import leaf_moved
from executive.modules.furniture.leaf_grips import LAGS, Grips, grips_of, on_side_of_handle, shut_out, within_reach
from executive.motion import Chain, cartesian_path
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.advice import Advice
from planlang.designators import Action, action
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

STEPS = {JointKind.HINGED: 0.06, JointKind.PRISMATIC: 0.025}
"""Steps of the leaf's joint between two postures of the arm [rad, m]."""
BLOCK = 24
"""Base poses per batch."""
MOST_BLOCKS = 16
"""Most batches to search."""
MOST_WAYS = 240
"""Candidates of a batch to follow to their end; more differ little."""
MOST_CHECKED = 24
"""Candidates of a batch that may fail the exact check before the batch is given up."""
HEIGHTS = 13
"""Torso heights at which to check the lifted upper body for self-collision."""
FARTHEST = 0.5
"""Largest step of an arm joint between two postures [rad, m]."""
ENOUGH = 0.12
"""Least share of its range by which to move a leaf from one base pose."""
PART = 0.35
"""Share of the way that is left by which it is worth to move a door between rooms from one base pose."""
AJAR = 0.6
"""Share of its range to which a door between rooms is moved from the side on which the base would be shut out."""
BEHIND = (0.08, 0.2, 0.3)
"""Distances behind the handle at which the hand stands for the arm that follows it [m]."""
LEAVING = (0.25, 0.5, 1.0)
"""Shares of the retreat from the handle at which to check the hand."""
SWEPT = Reason("swept over by the leaf")
NO_GRIP = "no room for the hand at the handle"
MOST_SUPPOSED = 6
"""Most batches and paths of a search in a scene that is supposed."""
MOST_NAMED = 3
"""Most obstacles to name in a failure."""


@dataclass(frozen=True, slots=True, eq=False)
class LeafPath:
    """Base pose, grip of the handle, and motion of the arm that moves the leaf from there."""

    arm: ArmModel
    handle: str
    base: BasePose
    fingers: Fingers
    """Opening of the hand for the approach to the handle."""
    before: Array
    """Joint positions of the arm before the handle (d,)."""
    poses: Array
    """Poses of the tip in the map, before the handle and then at each value (1 + n, 4, 4)."""
    values: Array
    """Values of the leaf's joint (n,)."""
    joints: Array
    """Joint positions of the arm at each value (n, d)."""


class LeafPaths:
    """Search for paths that move one leaf; ``rejected`` counts why base poses were rejected."""

    def __init__(
        self, scene: PlanningScene, joint: Articulation, home: BasePose | None = None, *, only_there: bool = False
    ) -> None:
        """``home``: on which side the base stays of a door that it shuts; with ``only_there`` by no means elsewhere."""
        self._scene, self._joint, self._standing = scene, joint, Standing(scene)
        self._home, self._only_there = scene.base() if home is None else home, only_there
        self.poses = self._standing.poses
        self.rejected, self._tried = self.poses.log, tuple[ArmModel, ...]()
        self._values, self._enough = np.zeros(0), 0

    def towards(self, value: float, arms: Sequence[ArmModel], sufficient: float) -> Iterator[LeafPath | None]:
        """Yield paths that move the leaf from its believed value to ``value``; None between batches.

        Paths that reach ``sufficient`` come as they are found, shorter ones at the end, longest first; those of a door
        between rooms also if they go a good part of the way, as it takes several base poses to move one. Grips that
        need less room are tried only if the others allow no path.
        """
        joint = self._joint
        self._tried = tuple(arms)
        current = self._scene.belief.joint(joint.leaf)
        count = max(2, math.ceil(abs(value - current) / STEPS[joint.kind]) + 1)
        values = np.linspace(current, value, count)
        enough = int(np.argmax((values >= sufficient) if value > current else (values <= sufficient))) + 1
        self._values, self._enough = values, enough
        soon = math.ceil(PART * enough) if joint.frame else enough
        partial, any_path = list[LeafPath](), False
        hands = [(by, arm) for by in self._by_handles() for arm in arms]
        for (by, arm), tight in ((hand, tight) for tight in (False, True) for hand in hands):
            if tight and any_path:
                break
            paths = self._of_arm(by, arm, values, enough, tight=tight)
            for path in _whole_first(paths, count) if joint.frame or joint.kind is JointKind.PRISMATIC else paths:
                any_path = any_path or path is not None
                if path is None or len(path.values) >= soon:
                    yield path
                else:
                    partial.append(path)
        least = max(2, math.ceil(ENOUGH * count))
        yield from sorted((one for one in partial if len(one.values) > least), key=lambda one: -len(one.values))

    def _by_handles(self) -> list[Articulation]:
        """List the joint as it is moved by each handle of the leaf, those on the side of the base first."""
        joint, scene, here = self._joint, self._scene, np.array([self._scene.base()])
        by = list(map(joint.by, joint.handles))
        if joint.other_handles and self._values[-1] < self._values[0]:
            shut = [scene.world.scene.body(handle).pose.position for handle in joint.handles]
            order = np.argsort(shut_out(scene, joint, self._home, np.array(shut)), kind="stable")
            return [by[number] for number in order.tolist()]
        return sorted(by, key=lambda one: not on_side_of_handle(scene, one, here)[0]) if len(by) > 1 else by

    def is_reached(self, scene: PlanningScene) -> bool:
        """Check whether an arm, whose collisions are ignored, reaches the handle from a free base pose of a scene."""
        hypothetical = LeafPaths(scene, self._joint)  # its own counts: these candidates were not really tried
        for by, arm in ((by, arm) for by in self._by_handles() for arm in self._tried):
            grips = grips_of(scene, arm, by)
            if len(grips):
                bases, _ = hypothetical._bases(by, arm, self._values, grips, self._enough)
                roomy = np.ones(len(self._values), bool)
                search = _ArmPaths(scene, by, arm, grips, self._values, roomy, hypothetical.rejected)
                if len(bases) and search.reach(bases[: BLOCK * MOST_BLOCKS]):
                    return True
        return False

    def _moves(self, scene: PlanningScene) -> bool:
        """Check whether a path moves the leaf far enough in a scene that is supposed, within a few batches."""
        if not self.is_reached(scene):  # the cheaper question
            return False
        value, sufficient = float(self._values[-1]), float(self._values[self._enough - 1])
        paths = LeafPaths(scene, self._joint).towards(value, self._tried, sufficient)
        return any(path is not None and len(path.values) >= self._enough for path in islice(paths, MOST_SUPPOSED))

    # Why there is none

    def failure(self, *, advised: bool = True) -> LocationUnresolvable:
        """Build the failure of a search that found nothing, with the likeliest reason and its figures.

        Unless it is ``advised``, no search looks for what would help.
        """
        self.poses.name_crowding()
        rejected, handle, counts = self.rejected, str(self._joint.handle), self.rejected.ordered()
        as_obstacle = self._scene.bodies.as_obstacle
        rejected.first, advice = self._once_closed() if advised else (None, None)
        figures = "" if advice is None else advice.sentence
        if not figures and set(counts) == {NO_GRIP}:
            figures = f"in each of the {counts[NO_GRIP]} grips checked, the hand is in collision, mostly with "
            figures += as_obstacle(next(iter(rejected.ordered_blocking())))
        elif not figures and counts.get(COLLISION):
            obstacles = dict.fromkeys(map(as_obstacle, rejected.ordered_blocking()))
            bodies = ", ".join(islice(obstacles, MOST_NAMED))
            figures = f"{counts[COLLISION]} postures with a hand at it are in collision, mostly with {bodies}"
        elif not figures and counts and set(counts) <= {OUT_OF_REACH.text, NO_ROOM, NO_WAY, SWEPT.text, NO_GRIP}:
            height = height_of(handle, self._scene, self._tried)
            changes = Changes(handle, self._scene, rejected, self._moves)
            advice = changes.helping() if advised else None
            none_found = changes.none_found() if advised else ""
            figures = "; ".join(filter(None, (height, none_found))) if advice is None else advice.sentence
        rejected.changes = () if advice is None else advice.changes
        rejected.figures = {next(iter(counts), ""): figures} if figures else {}
        wanted = f"the base with a hand at {handle} as {self._joint.leaf} moves"
        return rejected.failure(wanted, self._scene.bodies)

    def _once_closed(self) -> tuple[Action | None, Advice | None]:
        """Find an open door or drawer with which closed there is a path, and the action that closes it; else None."""
        belief, blocking, own = self._scene.belief, self.rejected.ordered_blocking(), self._joint.leaf
        others = [one for one in belief.joints.values() if one.leaf != own and belief.is_left_open(one.leaf)]
        counts = {one.leaf: sum(blocking.get(name, 0) for name in one.bodies) for one in others}
        leaf = max(counts, key=lambda one: counts[one], default=None)
        if leaf is None or not counts[leaf] or not self._tried:
            return None, None
        once = LeafPaths(self._scene.supposing(belief.with_leaf(leaf, 0.0)), self._joint)
        paths = once.towards(float(self._values[-1]), self._tried, float(self._values[self._enough - 1]))
        if all(path is None for path in paths):
            return None, None
        advice = Advice(f"with {leaf} closed, a hand could move {own}", leaf_moved(belief.joints[leaf], 0.0))
        return action(CLOSE, object_acted_on=self._scene.bodies.designator(leaf)), advice

    # One arm

    def _of_arm(
        self, joint: Articulation, arm: ArmModel, values: Array, enough: int, *, tight: bool
    ) -> Iterator[LeafPath | None]:
        """Yield the collision-free paths of one arm by one handle, best base poses first; None after each batch."""
        grips = self._free(joint, arm, grips_of(self._scene, arm, joint, tight=tight))
        if not len(grips):
            return
        roomy = self._roomy(joint, arm, grips, values, enough)
        search = _ArmPaths(self._scene, joint, arm, grips, values, roomy, self.rejected)
        bases, steps = self._bases(joint, arm, values, grips, enough)
        for first in range(0, min(len(bases), BLOCK * MOST_BLOCKS), BLOCK):
            block = slice(first, first + BLOCK)
            yield from search.of(bases[block], steps[block])
            yield None

    def _free(self, joint: Articulation, arm: ArmModel, grips: Grips) -> Grips:
        """Select the grips in which the hand itself, without its arm, is free at the handle and before it."""
        if not len(grips):
            self.rejected.add("too wide for the gripper")
            return grips
        check = self._scene.collisions.arm_check(arm, joint.handle, grips.fingers)
        hits = [one or other for one, other in zip(*map(check.hand_hit, (grips.starts, grips.before)), strict=True)]
        self.rejected.count(Reason(NO_GRIP, one) for one in hits if one is not None)
        return grips.chosen(np.array([one is None for one in hits], bool))

    def _roomy(self, joint: Articulation, arm: ArmModel, grips: Grips, values: Array, enough: int) -> NDArray[np.bool_]:
        """Mark the values (n,) of the joint at which a hand could grasp the handle again, so that a path may end there.

        Otherwise a door beside a wall would be opened so far that no hand could close it again. Values up to ``enough``
        are always allowed. The arm is approximated by its hand at the distances :data:`BEHIND`.
        """
        first = joint.motion(float(values[0])).inverse().matrix()
        check = self._scene.collisions.arm_check(arm, joint.handle, grips.fingers)
        approaches = np.stack([grips.short_by(away) for away in (0.0, *BEHIND)], axis=1)
        roomy = np.ones(len(values), bool)
        for number in range(enough, len(values) if values[-1] > values[0] else 0):
            motion = product(joint.motion(float(values[number])).matrix(), first)
            hits = check.hand_hit(product(motion, approaches).reshape(-1, 4, 4))
            roomy[number] = np.array([one is None for one in hits]).reshape(len(grips), -1).all(axis=1).any()
        return roomy

    # Base poses

    def _bases(
        self, joint: Articulation, arm: ArmModel, values: Array, grips: Grips, enough: int
    ) -> tuple[Array, NDArray[np.intp]]:
        """Sample free base poses (m, 3) within reach of the handle and, of a door between rooms, on its side.

        The best come first.

        Also returns for how many of ``values`` the leaf can move from each (m,): as far as the arm reaches and the leaf
        does not sweep over the base.
        """
        first = joint.motion(float(values[0])).inverse().matrix()
        middle = grips.points.mean(axis=0)
        tips = np.stack([moved(product(joint.motion(v).matrix(), first), middle) for v in values.tolist()])
        bases, coarse = self._standing.lattice(arm, tips)
        if joint.frame:
            here = on_side_of_handle(self._scene, joint, bases)
            bases, coarse = bases[here], coarse[here]
        reached, strain = within_reach(arm, bases, tips)
        kept = reached > 1
        self.rejected.add(OUT_OF_REACH.text, 0 if kept.any() else len(kept))
        kept[kept] = self.poses.free(bases[kept], -strain[kept])
        bases, coarse, reached, strain = bases[kept], coarse[kept], reached[kept], strain[kept]
        steps = np.minimum(reached, self._unswept(bases, values))
        self.rejected.count([SWEPT] * int((steps <= 1).sum()))
        out = np.zeros(len(bases), bool)
        if joint.frame and values[-1] < values[0]:
            out = shut_out(self._scene, joint, self._home, bases)
            ajar = int((values > AJAR * joint.upper).sum())
            most = ajar if ajar > PART * len(values) else 0 if self._only_there else len(values)
            steps = np.where(out, np.minimum(steps, most), steps)
        moves = steps > 1  # first, because a path to each of the others would be searched for in vain
        bases, coarse, strain, steps, out = bases[moves], coarse[moves], strain[moves], steps[moves], out[moves]
        order = np.lexsort((strain.round(6), ~coarse, -np.minimum(steps, enough), out, self._beyond(joint, bases)))
        return bases[order], steps[order]

    def _beyond(self, joint: Articulation, bases: Array) -> NDArray[np.bool_]:
        """Mark the bases (m, 3) to which no path surely leads: those behind a door between rooms that is half open."""
        if not joint.frame or joint.is_shut(self._scene.belief.joint(joint.leaf)):
            return np.zeros(len(bases), bool)
        return ~self._scene.collisions.have_way(bases)

    def _unswept(self, bases: Array, values: Array) -> NDArray[np.intp]:
        """Count the leading values (m,) at which the leaf does not overlap bases (m, 3), approximated by circles."""
        joint, scene = self._joint, self._scene
        leaf, radius = scene.world.scene.body(joint.leaf), 0.8 * scene.robot.base.radius
        free = np.ones((len(bases), len(values)), bool)
        for number, value in enumerate(values.tolist()):
            pose = joint.motion(value) @ leaf.pose
            points = np.column_stack([bases[:, :2], np.full(len(bases), pose.position[2])])
            local = np.abs(moved(pose.inverse().matrix(), points)) - np.asarray(leaf.size) / 2
            free[:, number] = np.linalg.norm(np.maximum(local, 0.0), axis=1) > radius
        return np.asarray(np.logical_and.accumulate(free, axis=1).sum(axis=1))


def _whole_first(paths: Iterator[LeafPath | None], count: int) -> Iterator[LeafPath | None]:
    """Yield paths through all ``count`` values at once, shorter ones after their batch, longest first.

    For drawers, as one that is only partly open covers what lies at its back, and for doors between rooms.
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


def _lifted(scene: PlanningScene, arm: ArmModel) -> Chain:
    """Get the chain of an arm, its torso limited to heights without self-collision of the upper body."""
    if arm.lift is None:
        return arm.chain
    chain, column = arm.chain, arm.lift.column
    heights = np.linspace(chain.lower[column], chain.upper[column], HEIGHTS).tolist()
    free = scene.collisions.lifted(arm, heights)
    if len(free) in (0, HEIGHTS):
        return arm.chain
    return chain.between(arm.lift.joint, min(free), max(free))


class _ArmPaths:
    """Search for the paths of one arm with its grips of a handle."""

    def __init__(
        self,
        scene: PlanningScene,
        joint: Articulation,
        arm: ArmModel,
        grips: Grips,
        values: Array,
        roomy: NDArray[np.bool_],
        rejected: Rejections,
    ) -> None:
        self._scene, self._joint, self._arm, self._grips, self._values = scene, joint, arm, grips, values
        self._roomy, self._rejected, self._before, self._poses = (
            roomy,
            rejected,
            grips.before,
            grips.along(joint, values),
        )
        lags = np.ones((len(grips), len(LAGS)), bool)
        lags[~grips.turns, 1:] = False
        self._lags = lags
        self._chain = _lifted(scene, arm)

    def of(self, bases: Array, steps: NDArray[np.intp]) -> Iterator[LeafPath]:
        """Yield paths from base poses (m, 3), from which the leaf can move for ``steps`` values (m,), longest first."""
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
        """Solve for base pose, grip, lag, and joint positions (k, d) from before the handle on, longest paths first."""
        # Followed from value to value, each solution seeds the next, so that the arm moves without a jump between
        # branches of its inverse kinematics. All candidates take each step together, as one call of the solver for
        # hundreds of rows is much cheaper than one for each; those that are left behind drop out.
        there = inverse(base_matrices(bases))
        rows, grips, before, start = self._at_handle(bases, there)
        numbers, lags = np.nonzero(self._lags[grips])
        joints = np.zeros((len(numbers), len(self._values) + 1, len(self._arm.joints)))
        joints[:, 0], joints[:, 1] = before[numbers], start[numbers]
        rows, grips = rows[numbers], grips[numbers]
        reached = np.ones(len(rows), np.intp)
        active = np.arange(len(rows))
        for k in range(1, len(self._values)):
            active = active[steps[rows[active]] > k]
            if not len(active):
                break
            targets = product(there[rows[active]], self._poses[grips[active], lags[active], k])
            q, good = self._chain.solve(targets, joints[active, k][:, None])
            joints[active, k + 1] = q
            active = active[good & (np.abs(q - joints[active, k]).max(axis=1) < FARTHEST)]
            reached[active] = k + 1
        order = [row for row in np.argsort(-reached, kind="stable").tolist() if reached[row] > 1]
        poses = [(x, y, yaw) for x, y, yaw in bases.tolist()]
        return [(poses[rows[row]], int(grips[row]), int(lags[row]), joints[row, : reached[row] + 1]) for row in order]

    def _at_handle(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Find the collision-free starts: rows of bases (w,), grips (w,), joints before and at the handle (w, d).

        ``there``: inverse base poses (m, 4, 4).
        """
        arm, grips = self._arm, self._grips
        rows, numbers, before, start = self._reached(bases, there)
        self._rejected.count([OUT_OF_REACH] * (len(bases) - len(np.unique(rows))))
        check = self._scene.collisions.arm_check(arm, self._joint.handle, grips.fingers)
        poses = base_matrices(bases)[rows]
        hits = [one or other for one, other in zip(check.hit(poses, start), check.hit(poses, before), strict=True)]
        self._rejected.count(Reason(COLLISION, one) for one in hits if one is not None)
        free = np.flatnonzero([one is None for one in hits])
        free = free[:: max(1, len(free) // MOST_WAYS)]
        return rows[free], numbers[free], before[free], start[free]

    def reach(self, bases: Array) -> bool:
        """Check whether the arm reaches a grip from one of base poses (m, 3), ignoring collisions."""
        return len(self._reached(bases, inverse(base_matrices(bases)))[0]) > 0

    def _reached(self, bases: Array, there: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
        """Find the reachable starts, as :meth:`_at_handle` does, ignoring collisions."""
        arm, grips = self._arm, self._grips
        rows, numbers = (grid.ravel() for grid in np.indices((len(bases), len(grips))))
        seeds = np.broadcast_to(arm.seeds, (len(rows), *arm.seeds.shape))
        start, good = self._chain.solve(product(there[rows], grips.starts[numbers]), seeds)
        kept = np.flatnonzero(good)
        q, good = self._chain.solve(product(there[rows[kept]], self._before[numbers[kept]]), start[kept][:, None])
        good &= np.abs(q - start[kept]).max(axis=1) < 2 * FARTHEST
        kept, before = kept[good], q[good]
        # Solve the grip again from before the handle, because the arm will come from there: the first solution may be
        # on another branch, to which no straight line leads.
        q, good = self._chain.solve(product(there[rows[kept]], grips.starts[numbers[kept]]), before[:, None])
        kept = kept[good]
        return rows[kept], numbers[kept], before[good], q[good]

    def _checked(self, base: BasePose, grip: int, lag: int, joints: Array) -> LeafPath | None:
        """Cut a candidate to its collision-free part; None if not even the handle can be grasped and left again."""
        arm, handle, collisions = self._arm, self._joint.handle, self._scene.collisions
        fingers = self._grips.fingers
        assert handle is not None

        def is_free(q: Array, touches: str | None = handle) -> bool:
            contacts = collisions.contacts(base, arm, q, touches, fingers)
            self._rejected.count([Reason(COLLISION, first_body(contacts))] if contacts else [])
            return not contacts

        if collisions.contacts(base) or not (is_free(joints[0], None) and is_free(joints[1])):
            return None
        poses = np.concatenate([self._before[grip][None], self._poses[grip, lag]])
        ends = product(inverse(base_matrices(np.array([base]))[0]), poses[:2])
        line = cartesian_path(self._chain, joints[0], ends[0], ends[1], is_free)
        if line.waypoints is None or np.abs(line.waypoints[-1] - joints[1]).max() > 0.1:
            return None
        closed = collisions.closed_on(base, arm, joints[1], handle, fingers)
        if closed is None:
            self._rejected.add("no hold for the fingers")
            return None
        count = 1 + self._free_steps(base, joints[1:], closed)
        free = np.flatnonzero(self._roomy[:count] & self._leaves(grip, lag, count))
        if not free.any():  # from none, or only from where the leaf is now
            self._rejected.add("no way for the fingers to leave the handle")
            return None
        count = 1 + int(free[-1])
        return LeafPath(
            arm, handle, base, fingers, joints[0], poses[: 1 + count], self._values[:count], joints[1 : 1 + count]
        )

    def _leaves(self, grip: int, lag: int, count: int) -> NDArray[np.bool_]:
        """Mark the first ``count`` values of the joint at which the open hand can retreat from the leaf (count,).

        A hand that turned less than the leaf is at an angle to it, with a finger between leaf and handle.
        """
        tips, grips = self._poses[grip, lag, :count], self._grips
        approaches = tips[:, :3, :3] @ grips.approach
        retreats = np.repeat(tips[:, None], len(LEAVING), axis=1)
        retreats[..., :3, 3] -= grips.back * np.multiply.outer(LEAVING, approaches).swapaxes(0, 1)
        # The scene has the leaf at its current value: move the hands there instead of the leaf to each value.
        first = self._joint.motion(float(self._values[0])).inverse().matrix()
        motions = np.stack([product(self._joint.motion(one).matrix(), first) for one in self._values[:count].tolist()])
        check = self._scene.collisions.arm_check(self._arm, self._joint.handle, grips.fingers)
        hits = check.hand_hit(product(inverse(motions)[:, None], retreats).reshape(-1, 4, 4))
        return np.asarray(np.array([one != self._joint.leaf for one in hits]).reshape(count, -1).all(axis=1))

    def _free_steps(self, base: BasePose, rows: Array, fingers: Mapping[str, float]) -> int:
        """Count the collision-free steps of the arm with the fingers closed on the handle and the leaf moving along."""
        scene, arm = self._scene, self._arm
        joints = {**scene.world.configuration().joints, **fingers}
        at = Configuration(base, joints | dict(zip(arm.joints, rows[0].tolist(), strict=True)))
        led = {**scene.belief.led, self._joint.leaf: arm.tip}
        world = scene.supposing(replace(scene.belief.state.with_robot(scene.belief.robot, at), led=led)).world
        for number, row in enumerate(rows[1:]):
            hits = world.contacts(Configuration(base, joints | dict(zip(arm.joints, row.tolist(), strict=True))))
            if hits:
                self._rejected.count([Reason(COLLISION, first_body(hits))])
                return number
        return len(rows) - 1
