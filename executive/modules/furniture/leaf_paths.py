"""Paths of a hand that moves a door or drawer by its handle, along the arc or line that the joint prescribes.

Base poses are sampled in batches, for each hand and handle; each grip is carried through the values of the joint.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.changes import CLOSE, Changes
from executive.locations.explanations import height_of
from executive.locations.rejections import COLLISION, NO_ROOM, OUT_OF_REACH, Reason
from executive.locations.shut_ways import least_passed
from executive.locations.standing import Standing
from executive.maps.single_changes import leaf_moved
from executive.modules.furniture.hand_paths import HandPaths, LeafPath
from executive.modules.furniture.leaf_grips import Grips, grips_of, on_side_of_handle, shut_out, within_reach
from executive.robots.arms import ArmModel
from planlang.advice import Advice
from planlang.designators import Action, action
from planlang.failure_wording import NO_WAY
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.geometry.matrices import moved, product
from sim.joints import Articulation, JointKind

STEPS = {JointKind.HINGED: 0.06, JointKind.PRISMATIC: 0.025}
"""Steps of the leaf's joint between two postures of the arm [rad, m]."""
BLOCK = 24
"""Base poses per batch."""
MOST_BLOCKS = 16
"""Most batches to search."""
ENOUGH = 0.12
"""Least share of its range by which to move a leaf from one base pose."""
PART = 0.35
"""Share of the way that is left by which it is worth to move a door between rooms from one base pose."""
BEHIND = (0.08, 0.2, 0.3)
"""Distances behind the handle at which the hand stands for the arm that follows it [m]."""
SWEPT = Reason("swept over by the leaf")
NO_GRIP = "no room for the hand at the handle"
MOST_SUPPOSED = 6
"""Most batches and paths of a search in a scene that is supposed."""
MOST_NAMED = 3
"""Most obstacles to name in a failure."""


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
        self._values, self._enough, self._ajar = np.zeros(0), 0, math.inf

    def towards(self, value: float, arms: Sequence[ArmModel], sufficient: float) -> Iterator[LeafPath | None]:
        """Yield paths that move the leaf from its believed value to ``value``; None between batches.

        Paths that reach ``sufficient`` come as they are found, shorter ones at the end, longest first; those of a door
        between rooms also if they go a good part of the way, as it takes several base poses to move one, or to where
        the base only just drives past it. Grips that need less room are tried only if the others allow no path.
        """
        joint = self._joint
        self._tried = tuple(arms)
        current = self._scene.belief.joint(joint.leaf)
        values = self._on_the_way(current, value)
        count = len(values)
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
                if path is None or len(path.values) >= soon or path.values[-1] == self._ajar:
                    yield path
                else:
                    partial.append(path)
        least = max(2, math.ceil(ENOUGH * count))
        yield from sorted((one for one in partial if len(one.values) > least), key=lambda one: -len(one.values))

    def _on_the_way(self, current: float, value: float) -> Array:
        """Sample values of the joint (n,) from the believed one to another.

        Of a door between rooms that is closed, one is the last at which the base surely drives past it: so far it may
        be moved from the side on which the base would be shut out.
        """
        stops, joint = [current, value], self._joint
        if joint.frame and value < current:
            self._ajar = least_passed(self._scene, joint)
            stops[1:1] = [self._ajar] if value < self._ajar < current else []
        counts = [math.ceil(abs(end - start) / STEPS[joint.kind]) for start, end in pairwise(stops)]
        parts = [np.linspace(*ends, max(1, n), endpoint=False) for ends, n in zip(pairwise(stops), counts, strict=True)]
        return np.concatenate([*parts, [value]])

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
                search = HandPaths(scene, by, arm, grips, self._values, roomy, hypothetical.rejected)
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

    def moves_on(self, scene: PlanningScene, value: float, sufficient: float) -> bool:
        """Check whether one of the first paths in a scene that is supposed moves the leaf towards a value."""
        paths = LeafPaths(scene, self._joint).towards(value, self._tried, sufficient)
        return any(path is not None for path in islice(paths, MOST_SUPPOSED))

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
        search = HandPaths(self._scene, joint, arm, grips, values, roomy, self.rejected)
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
            ajar = int((values >= self._ajar).sum())
            most = ajar if self._only_there or ajar > PART * len(values) else len(values)
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
