"""Process module that opens and closes doors, drawers and lids by their handles.

The base drives to where the arm can move the leaf; the hand grasps the handle, moves with the leaf, and releases it. If
one base pose is not enough, the motion is continued from another.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice, product

import numpy as np

from executive.ahead.later_steps import beside, closed_later, reached_through
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.changes import CLOSE
from executive.locations.headroom import way_out
from executive.locations.shut_ways import behind_doors, is_gripped_from_beyond, open_wide
from executive.locations.supposed import at_rest
from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.hand_paths import LeafPath, draws_back
from executive.modules.furniture.leaf_paths import LeafPaths
from executive.modules.furniture.witnessing import is_seen_from_here, is_witnessed
from executive.modules.platform import Platform
from executive.modules.runner import Skill, nothing
from executive.motion import time_curve, time_path
from executive.robots.arms import ArmModel
from planlang.designators import Action, FixedPose, Location
from planlang.failure_wording import NO_WAY
from planlang.failures import (
    ActionUnresolvable,
    ContainerStuck,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    GraspMissed,
    GraspSlipped,
    HandleNotReachable,
    HandsFull,
    ManipulationFailure,
    ManipulationGoalInCollision,
    ManipulationPoseUnreachable,
    NavigationFailure,
    PlanFailure,
    StateUnknown,
)
from planlang.geometry import Pose
from planlang.geometry.matrices import moved
from planlang.kernel import checkpoint
from planlang.language.process_module import process_module
from planlang.protocols import Configuration, MotionState, Trajectory
from planlang.state import WorldState
from sim.joints import Articulation, JointKind

WAYS = 10
"""Most paths to try for one leaf, whether they fail or move it a little."""
ELSEWHERE = (ManipulationPoseUnreachable, ManipulationGoalInCollision, GraspMissed, NavigationFailure)
"""Failures after which another path is tried."""
STRAY = 0.01
"""Largest distance of the hand from the handle's path [m]."""
SHORTER = (0, 1, 2, 4)
"""Numbers of steps to cut off the end of a path whose timing fails."""
FELT = 0.01
"""Accuracy with which fingers feel where a handle is [m]."""
FELT_BY = 0.15
"""Share of its range by which a hand at the handle should be able to move a leaf that it only feels."""
AT_ITS_END = 0.9
"""Share of its range above which opening a drawer farther is not worth another drive."""
MOST_SHORTER = 4
"""Most ends of a path, every other one, for which to ask whether the leaf could be closed from there."""
NO_FURTHER = 0.02
"""Share of its range by which a leaf must move so that it does not count as stuck."""


def ways_tried(count: int) -> str:
    """Describe how many paths of a hand were tried in vain."""
    if count == 0:
        return "no way was found from any base pose that the base can drive to"
    return "the one way that was found failed" if count == 1 else f"{count} ways were tried and failed"


class LeafWork(HandWork):
    """Moves one door, drawer, lid or knob by its handle."""

    def __init__(self, platform: Platform, joint: Articulation, home: BasePose | None = None) -> None:
        """``home``: on which side of a door between rooms the base is once that is shut; by default where it is.

        If it is stated, the door is closed again, which no later step needs: only from there, and with the run's share
        of searching for that.
        """
        super().__init__(platform)
        self._joint, self._paths, self._home = joint, LeafPaths(platform.scene, joint), home or platform.base()
        self._share = None if home is None else platform.ahead.share(joint.leaf)
        self._later: Location | None = None
        """Where the base stands for the next step that reaches through the leaf while that is open."""
        self._beside: tuple[Articulation, ...] = ()
        """Doors beside it that have to be opened as far as they go for that, too."""
        self._in_doubt = False
        """Whether no way in was found, however far they are open."""
        self._is_closed_later = False
        """Whether a later step closes the leaf."""

    async def open(self) -> None:
        """Open the leaf; a door between rooms so far that the base drives past it, if it can be opened so far.

        Raises ContainerStuck, HandleNotReachable, StateUnknown, or BehindClosedDoor if another door is in the way.
        """
        joint = self._joint
        self._later = reached_through(joint, self.platform.scene)
        self._is_closed_later = closed_later(joint, self.platform.scene, self.platform.ancestors)
        wide = open_wide(self.platform.scene, joint) if joint.frame else joint.first_open
        try:
            await self._move(joint.upper, wide, lambda value: value >= wide)
        except (ContainerStuck, HandleNotReachable):
            if not joint.frame or not joint.is_open(self._value()):
                raise
        if self._covers_something() or self._should_be_wider():
            with suppress(EnvironmentManipulationFailure, HandsFull, ManipulationFailure, NavigationFailure):
                await self._motion(joint.upper, joint.upper).run()

    async def open_further(self) -> None:
        """Open the leaf as far as it goes; raises as :meth:`open` does if it does not move."""
        await self._motion(self._joint.upper, self._value() + NO_FURTHER * self._joint.upper).run()

    async def close(self) -> None:
        """Close the leaf; raises as :meth:`open` does."""
        await self._move(0.0, self._joint.last_shut, self._joint.is_shut)
        if self._share is not None:
            self._share.renew()

    async def _move(self, goal: float, sufficient: float, is_there: Callable[[float], bool]) -> None:
        """Move the leaf to a value, at least to ``sufficient``; if only the map says that it is there, look or feel."""

        async def is_surely_there() -> bool:
            if is_there(self._value()) and not await is_witnessed(self, self._joint.leaf):
                await self._feel()
            return is_there(self._value())

        await is_seen_from_here(self.platform, self._joint.leaf)
        await self._motion(goal, sufficient).until(is_surely_there)

    def _value(self) -> float:
        return self.platform.belief.joint(self._joint.leaf)

    async def _feel(self) -> None:
        """Close a hand on the handle of a leaf that cannot be seen, and believe what it feels. Raises StateUnknown."""
        joint, value = self._joint, self._value()
        unknown = f"it is not known how far {joint.leaf} is open: it was not seen"
        if joint.handle is None or joint.is_knob:
            raise StateUnknown(f"{unknown}, and has no handle to feel", what=joint.leaf)
        aside = joint.upper * (FELT_BY if value < joint.upper / 2 else -FELT_BY)
        try:
            motion = self._motion(value + aside, value + aside)
            await replace(motion, contact=self._grasp, verify=nothing).run()
        except (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure) as failure:
            raise StateUnknown(f"{unknown}, and no hand felt its handle", what=joint.leaf) from failure

    def _covers_something(self) -> bool:
        """Check whether a drawer opens farther, and something in it cannot be lifted straight out as it is."""
        scene, joint = self.platform.scene, self._joint
        if joint.kind is not JointKind.PRISMATIC or self._value() > AT_ITS_END * joint.upper:
            return False
        things = [name for name in scene.bodies.names() if scene.bodies.is_graspable(name)]
        inside = (name for name in things if scene.bodies.drawer_of(name) == joint)
        ways = (way_out(name, scene) for name in inside)
        return any(way is None or len(way) > 1 for way in ways)

    def _motion(self, goal: float, sufficient: float) -> Skill[LeafPath, object]:
        """State the parts of motions to a value of the joint, at least to ``sufficient``."""
        joint, start = self._joint, self._value()

        async def paths() -> AsyncIterator[LeafPath | None]:
            if joint.handle is None:
                raise self._without_handle("no handle")
            arms = self.hands_for(joint.handle, joint.leaf)
            await self.tuck()
            self._paths = LeafPaths(self.platform.scene, joint, self._home, only_there=self._share is not None)
            found = self._paths.towards(goal, arms, sufficient)
            found = found if self._share is None else self._share.within(found)
            options = self._with_shorter(found) if self._is_closed_later else found
            for path in self.platform.ahead.first(f"how to move {joint.leaf}", options, self._leaves_a_way):
                yield path
                if path is None:
                    await checkpoint()

        async def otherwise(problem: PlanFailure | None, count: int) -> PlanFailure:
            if self._share is not None and self._share.is_used_up:
                cut = f"{joint.leaf} is not closed again: the search for a way to do so was cut off"
                return HandleNotReachable(cut, what=joint.leaf)
            if count == 0 and self._paths.rejected.counts[NO_WAY]:
                wanted = f"the base with a hand at {joint.handle}"
                behind = behind_doors(self.platform.scene, self._paths.is_reached, joint.leaf, wanted, (joint.leaf,))
                if behind is not None:
                    return behind
                if joint.frame and is_gripped_from_beyond(self.platform.scene, joint):
                    return self._without_handle("its handle on the other side and none on this")
            if count == WAYS and abs(self._value() - start) > NO_FURTHER * joint.upper:
                at = f"{joint.leaf} is only at {self._value():.2f} after {count} motions"
                return ContainerStuck(at, what=joint.leaf)
            message = f"the handle of {joint.leaf} is out of reach: {ways_tried(count)}"
            failure = HandleNotReachable(message, what=joint.leaf)
            failure.__cause__ = problem or self._paths.failure(advised=self._share is None)
            return failure

        return Skill(
            paths,
            self._pull,
            approach=self._approach,
            retreat=self._leave,
            verify=self._verify,
            between=self.tuck,
            believed=self._value,
            failures=ELSEWHERE,
            most=WAYS,
            otherwise=otherwise,
        )

    def _without_handle(self, has: str) -> HandleNotReachable:
        leaf = self._joint.leaf
        missing = f"{leaf} has {has}; state one in the map as a part of it (properPhysicalParts) of the class Handle"
        return HandleNotReachable(f"{HandleNotReachable.text}: {missing}", what=leaf)

    def _leaves_a_way(self, path: LeafPath | None) -> bool:
        """Check whether hand and base get away once a path has moved the leaf, and what later steps do has a way.

        That is to reach through it, and to close it: where the hand lets go of it, a wall may be too near for the arm.
        """
        if path is None:
            return True
        state = at_rest(self.platform.scene, self._moved(path.values[-1]), path.base)
        # a drawer that is out covers nothing; a door that is wide open may still be in the way
        is_out = self._joint.kind is JointKind.PRISMATIC and path.values[-1] > AT_ITS_END * self._joint.upper
        leads_on = self.platform.ahead.gets_away(state) and draws_back(self.platform.scene.supposing(state), path)
        leads_on = leads_on and (is_out or self._is_wide_enough(state))
        return leads_on and self._can_be_closed(float(path.values[-1]))

    def _can_be_closed(self, value: float) -> bool:
        """Check whether a hand could begin to close the leaf at a value, if a later step closes it."""
        joint = self._joint

        def search(then: PlanningScene) -> bool:
            return self._paths.moves_on(then, 0.0, joint.last_shut)

        return not self._is_closed_later or self.platform.ahead.finds(
            f"{CLOSE} {joint.leaf}", self._moved(value), search
        )

    def _with_shorter(self, paths: Iterable[LeafPath | None]) -> Iterator[LeafPath | None]:
        """Yield paths, each that ends where no hand could close the leaf also cut to where one could."""
        least = max(self._joint.first_open, self._value() + NO_FURTHER * self._joint.upper)
        for path in paths:
            yield path
            if path is not None and not self._can_be_closed(float(path.values[-1])):
                ends = np.flatnonzero(path.ends & (path.values > least))[-3::-2][:MOST_SHORTER]
                counts = (number + 1 for number in ends.tolist() if self._can_be_closed(float(path.values[number])))
                yield from map(path.until, islice(counts, 1))

    def _moved(self, value: float) -> WorldState:
        return self.platform.scene.belief.with_leaf(self._joint.leaf, float(value))

    def _is_wide_enough(self, state: WorldState) -> bool:
        """Check whether the next step that reaches through the leaf could do so in a state, if it ever could.

        If it could not however far the leaf is open, then with the doors beside it opened as far as they go, too.
        """
        if self._is_reached_through(state):
            return True
        widest = self._moved(self._joint.upper)
        if not self._is_reached_through(widest):
            self._beside = beside(self._joint, self.platform.scene)[1:]
            if not self._beside or not self._is_reached_through(widest):
                self._later, self._in_doubt = None, True  # nothing more is asked
        return self._is_reached_through(state)

    def _is_reached_through(self, state: WorldState) -> bool:
        """Check whether the next step that reaches through the leaf, if there is one, could do so in a state."""
        if self._later is None:
            return True
        for one in self._beside:
            state = self.platform.scene.supposing(state).belief.with_leaf(one.leaf, one.upper)
        return self.platform.ahead.reaches(self._later, state)

    def _should_be_wider(self) -> bool:
        """Check whether the next step reaches through the leaf only if that is opened further.

        Also if no way was found for it: the step itself looks for one more thoroughly, and has the most room then.
        """
        options, decision = (self._value(), self._joint.upper), f"how far to open {self._joint.leaf}"
        if options[0] > AT_ITS_END * options[1]:
            return False
        wide = self.platform.ahead.first(decision, options, lambda one: self._is_wide_enough(self._moved(one)))
        return next(wide) > options[0] or self._in_doubt

    async def _approach(self, path: LeafPath) -> None:
        """Drive to the path's base pose, look at the leaf, and bring the open hand to the handle."""
        arm, what = path.arm, path.handle
        await self.drive(path.base)
        await is_seen_from_here(self.platform, self._joint.leaf)
        if abs(self._value() - path.values[0]) > 1e-9:  # the path begins where the leaf is not
            raise ManipulationPoseUnreachable(arm=arm.name, what=what)
        self.platform.arms.choices.choose(arm.name)
        await self.platform.hands.move(arm, closed=False, fingers=path.fingers)
        await self.follow_to_end(arm.name, self.planned(arm, path.before, None), what)
        await self.straight(arm, path.poses[1], what)

    async def _grasp(self, path: LeafPath) -> bool:
        """Close the hand on the handle; return whether it feels it where it was believed to be."""
        arm, hands = path.arm, self.platform.hands
        await hands.move(arm, closed=True)
        if not hands.is_on(arm, path.handle):
            raise GraspMissed(arm=arm.name, what=path.handle)
        return self._feels_as_believed(path)

    async def _pull(self, path: LeafPath) -> None:
        """Close the hand on the handle and move the leaf, if it is where it was believed to be."""
        if not await self._grasp(path):
            raise ManipulationPoseUnreachable(arm=path.arm.name, what=path.handle)
        await self._lead(path)

    async def _leave(self, path: LeafPath) -> None:
        """Release the handle, retreat, back off, and tuck the arm."""
        await self.platform.hands.move(path.arm, closed=False, fingers=path.fingers)
        await self.back(path.arm, path.poses, path.handle)

    async def _verify(self, path: LeafPath, problem: PlanFailure | None) -> None:
        """Look at the leaf after a motion, or a grasp that missed it. Raises ContainerStuck if it has not moved.

        If the hand slipped off its handle, only if the leaf is seen where it was: a stuck one lets no hand go on.
        """
        leaf, belief = self._joint.leaf, self.platform.belief
        if isinstance(problem, GraspMissed):
            await is_witnessed(self, leaf)
            return
        belief.doubted(leaf)
        slipped, is_seen = isinstance(problem, GraspSlipped), await is_seen_from_here(self.platform, leaf)
        if not is_seen and not slipped:
            belief.touched(leaf, self._value())  # what the hand felt
        if problem is not None and not (slipped and is_seen):
            return
        if abs(self._value() - path.values[0]) < NO_FURTHER * self._joint.upper:
            message = f"{leaf} does not move, and the hand slips off {path.handle}" if slipped else ""
            raise ContainerStuck(message, what=leaf) from problem

    def _feels_as_believed(self, path: LeafPath) -> bool:
        """Believe of a leaf that was not seen what fingers feel at its handle; return whether it was believed there."""
        platform, joint, value = self.platform, self._joint, self._value()
        point = platform.between_fingers(path.arm.name)
        if point is None or joint.is_knob or platform.belief.witnessed(joint.leaf):
            return True
        closed = np.array(platform.scene.world.scene.body(path.handle).pose.position)
        there = joint.value_at(closed, point)
        turns = joint.kind is not JointKind.PRISMATIC  # the handle moves by the lever per radian, or by the slide
        lever = float(np.linalg.norm(np.cross(joint.axis, closed - joint.point))) if turns else 1.0
        platform.belief.touched(joint.leaf, there)
        return abs(there - value) * lever <= FELT

    async def _lead(self, path: LeafPath) -> None:
        """Move the hand with the leaf. Raises GraspSlipped, or ContainerStuck if something stops them."""
        platform, arm, joint = self.platform, path.arm, self._joint
        platform.hands.lead(arm, joint.leaf)
        motion = await platform.follow(arm.name, self._timed(path))
        if joint.leaf not in platform.belief.led:  # the fingers no longer feel the handle
            raise GraspSlipped(arm=arm.name, what=path.handle)
        if motion.state is not MotionState.DONE:
            platform.belief.let_go(joint.leaf, "stuck")  # the hand feels it now, and lets go of it next
            met = await platform.sensing.bump(motion)
            how = "is stuck" if met is None else f"is stopped by {met}"
            raise ContainerStuck(f"{joint.leaf} {how}", what=joint.leaf)

    def _timed(self, path: LeafPath) -> Trajectory:
        """Time the arm's path so that the hand stays on the handle's path also between waypoints; shorten if needed.

        Raises ManipulationPoseUnreachable if no timing is free and within limits.
        """
        platform, arm = self.platform, path.arm
        start = platform.arm_joints(arm)
        whole_turns = 2 * np.pi * np.round((start - path.joints[1]) / (2 * np.pi))  # of continuous joints
        rows = np.concatenate([start[None], path.joints[1:] + whole_turns])
        for cut, timing in product(SHORTER, (time_curve, time_path)):
            trajectory = platform.timed(arm.joints, rows[: max(2, len(rows) - cut)], timing)
            within = arm.chain.within(trajectory.positions, 1e-6).all()
            if within and self._stray(path, trajectory) < STRAY and self._is_free(arm, trajectory):
                return trajectory
        raise ManipulationPoseUnreachable(arm=arm.name, what=path.handle)

    def _is_free(self, arm: ArmModel, trajectory: Trajectory) -> bool:
        """Check whether the arm and the leaf that moves with it are collision-free along a trajectory."""
        world, base = self.platform.scene.world, self.platform.base()
        rows = (dict(zip(arm.joints, row, strict=True)) for row in trajectory.positions.tolist())
        return not any(world.contacts(Configuration(base, row)) for row in rows)

    def _stray(self, path: LeafPath, trajectory: Trajectory) -> float:
        """Compute the largest distance of the tip from the polyline of the handle's path [m]."""
        tips = moved(Pose.planar(*path.base).matrix(), path.arm.chain.fk(trajectory.positions)[:, :3, 3])
        line = path.poses[1:, :3, 3]
        starts, edges = line[:-1], np.diff(line, axis=0)
        lengths = np.maximum((edges**2).sum(axis=1), 1e-12)
        shares = np.einsum("nmk,mk->nm", tips[:, None] - starts[None], edges) / lengths
        nearest = starts[None] + np.clip(shares, 0.0, 1.0)[..., None] * edges[None]
        return float(np.linalg.norm(tips[:, None] - nearest, axis=2).min(axis=1).max())


@process_module
class Containers(HandWork):
    """Opens and closes doors, drawers and lids."""

    name = "container"
    actions = ("OpeningAContainerArtifact", "ClosingAContainerArtifact")
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)
    # beside those of looking, which RobotModule declares for all modules

    async def execute(self, action: Action) -> str:
        """Open or close ``object_acted_on``; return the name of the door, drawer or lid.

        Furniture is open when one of its leaves is, the nearest that is closed, and closed when all of them are. What
        is open already is opened further ``all_the_way``. Doors between rooms are closed from the side where the base
        is, or where ``to_location`` is, a pose.
        """
        what = self.object_of(action, "open or close")
        opens = "OpeningAContainerArtifact" in self.platform.ancestors(action.type)
        leaves = self.platform.scene.bodies.leaves_of(what, shut=opens)
        if not leaves:
            raise ActionUnresolvable(f"{what} has no door, drawer or lid", designator=str(action))
        side = action.get("to_location")
        home = self.platform.base_at(side) if isinstance(side, FixedPose) else None
        for joint in leaves[: 1 if opens else len(leaves)]:
            work = LeafWork(self.platform, joint, home)
            if opens and action.get("all_the_way"):
                await work.open_further()
            else:
                await (work.open() if opens else work.close())
        return leaves[0].leaf
