"""The process module that drives: planned in the planning scene, driven in the true world, taught by contacts."""

from __future__ import annotations

import math

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.platform import PlatformModule
from executive.modules.ways_out import way_out_of_base
from executive.motion import GoalInCollision, MotionError, StartInCollision
from planlang.designators import Action, FixedPose, Location, Object, Posture, a_location
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    NavigationFailure,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
    ObjectLost,
    ObjectNowhereToBeFound,
)
from planlang.language.process_module import process_module
from planlang.protocols import MotionState, Trajectory

REPLANS = 3
"""Paths that are planned around obstacles that were not believed to be there: then the plan decides."""

AT_GOAL = 0.15
"""Distance from its goal within which floor counts when a body is sought that keeps the base from there [m]."""


@process_module
class Navigation(PlatformModule):
    """Moves the base to a pose, or to the best base pose of a location."""

    name = "navigation"
    actions = ("Translation-LocationChange",)
    failures = (NavigationFailure, ObjectLost, DesignatorFailure, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base."""
        return ("base",)

    async def execute(self, action: Action) -> None:
        """Drive to ``x``, ``y``, ``yaw``, or to a base pose that satisfies ``to_location``.

        What a step made means the next place at each use: where one cannot be driven to, the one after it.
        """
        while True:
            try:
                return await self._drive(self._goal(action))
            except NavigationFailure:
                if not self.platform.goes_elsewhere(action.get("to_location")):
                    raise

    async def _drive(self, goal: BasePose) -> None:
        blocked_by: str | None = None
        for _ in range(REPLANS):
            if _close(goal, self.platform.base()):
                return
            path, arrives = self._path_or_way_out(goal)
            try:
                motion = await self.platform.follow("base", path)
            finally:
                self.platform.drive.moved()
            if motion.state is MotionState.DONE and arrives:
                return
            if motion.state is MotionState.DONE:
                continue
            blocked_by = motion.blocked_by
            await self.platform.sensing.bump(motion)
        raise NavigationGoalNotReached(target=goal, blocked_by=blocked_by)

    def _goal(self, action: Action) -> BasePose:
        match action.get("x"), action.get("y"), action.get("yaw"), action.get("to_location"):
            case float(x), float(y), float(yaw), None:
                return x, y, yaw
            case None, None, None, FixedPose() as pose:
                return self.platform.base_at(pose)
            case None, None, None, Posture(name=str(name)) | str(name) if goal := self.platform.made_goal(name):
                return goal
            case None, None, None, Location() | Object() as where:
                location = where if isinstance(where, Location) else a_location(in_reach_of=where)
                return next(self.platform.resolver.bases(location)).base
        raise ActionUnresolvable("a base motion needs to_location, or x, y and yaw", designator=str(action))

    def _path_or_way_out(self, goal: BasePose) -> tuple[Trajectory, bool]:
        """Return a path to a pose, or first a short way out of what the robot is in; and whether it leads there."""
        try:
            return self._path(goal), True
        except NavigationGoalNotReached as stuck:
            if not isinstance(stuck.__cause__, StartInCollision) or (out := way_out_of_base(self.platform)) is None:
                raise
            return out, False

    def _path(self, goal: BasePose) -> Trajectory:
        if self.platform.robot.base.fixed:
            raise NavigationPoseUnreachable("the base is fixed", target=goal)
        try:
            return self.platform.drive.path(goal)
        except GoalInCollision as problem:
            raise NavigationGoalInCollision(target=goal, blocked_by=_blocking(problem)) from problem
        except StartInCollision as problem:
            stuck = _blocking(problem)
            raise NavigationGoalNotReached("the base is stuck", target=goal, blocked_by=stuck) from problem
        except MotionError as problem:
            if (met := self.platform.belief.met) is not None:
                raise NavigationGoalNotReached(target=goal, blocked_by=met) from problem
            closing = self.platform.scene.collisions.closes_way(np.array(goal[:2]), AT_GOAL)
            raise NavigationPoseUnreachable(target=goal, blocked_by=closing) from problem


def _blocking(problem: GoalInCollision | StartInCollision) -> str | None:
    return next((body for _, body in problem.pairs), None)


def _close(one: BasePose, other: BasePose) -> bool:
    turn = math.remainder(one[2] - other[2], 2 * math.pi)
    return math.dist(one[:2], other[:2]) < 1e-3 and abs(turn) < 1e-3
