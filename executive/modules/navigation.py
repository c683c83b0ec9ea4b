"""The process module of the base: plans in the planning scene, drives in the true world, learns from contacts."""

from __future__ import annotations

import math

from executive.belief.scene_collisions import BasePose
from executive.modules.platform import Platform
from executive.motion import GoalInCollision, MotionError, StartInCollision
from planlang.designators import Action, Location
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    NavigationFailure,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
)
from planlang.modules import process_module
from planlang.protocols import MotionState, Trajectory

REPLANS = 3
"""Paths that are planned around obstacles that were not believed to be there: then the plan decides."""


@process_module
class Navigation:
    """Moves the base to a pose, or to the best base pose of a location."""

    name = "navigation"
    actions = ("Translation-LocationChange",)
    failures = (NavigationFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base."""
        return ("base",)

    async def execute(self, action: Action) -> None:
        """Drive to ``x``, ``y``, ``yaw``, or to a base pose that satisfies ``to_location``."""
        goal = self._goal(action)
        blocked_by: str | None = None
        for _ in range(REPLANS):
            if _close(goal, self.platform.base()):
                return
            motion = await self.platform.follow("base", self._path(goal))
            self.platform.drive.moved()
            if motion.state is MotionState.DONE:
                return
            blocked_by = motion.blocked_by
            self.platform.sensing.bump(blocked_by)
        raise NavigationGoalNotReached(target=goal, blocked_by=blocked_by)

    def _goal(self, action: Action) -> BasePose:
        match action.get("x"), action.get("y"), action.get("yaw"), action.get("to_location"):
            case float(x), float(y), float(yaw), None:
                return x, y, yaw
            case None, None, None, Location() as location:
                return next(self.platform.resolver.bases(location)).base
        raise ActionUnresolvable("a base motion needs to_location, or x, y and yaw", designator=str(action))

    def _path(self, goal: BasePose) -> Trajectory:
        try:
            return self.platform.drive.path(goal)
        except GoalInCollision as problem:
            raise NavigationGoalInCollision(target=goal, blocked_by=_blocking(problem)) from problem
        except StartInCollision as problem:
            stuck = _blocking(problem)
            raise NavigationGoalNotReached("the base is stuck", target=goal, blocked_by=stuck) from problem
        except MotionError as problem:
            raise NavigationPoseUnreachable(target=goal) from problem


def _blocking(problem: GoalInCollision | StartInCollision) -> str | None:
    return next((body for _, body in problem.pairs), None)


def _close(one: BasePose, other: BasePose) -> bool:
    turn = math.remainder(one[2] - other[2], 2 * math.pi)
    return math.dist(one[:2], other[:2]) < 1e-3 and abs(turn) < 1e-3
