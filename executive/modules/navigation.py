"""Process module that drives the base: plans in the planning scene, and replans around obstacles that it touches."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator
from contextlib import suppress
from functools import partial

import numpy as np

from executive.belief.doorways import narrow_doorway
from executive.belief.scene_collisions import BasePose
from executive.modules.giving_way import PATIENCE, Lookout
from executive.modules.platform import PlatformModule
from executive.modules.runner import Skill
from executive.modules.ways_out import planned, way_out_of_base
from executive.motion import GoalInCollision, MotionError, StartInCollision
from planlang.designators import Action, FixedPose, Location, Object, Posture, a_location
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LocationUnresolvable,
    NavigationFailure,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
    ObjectLost,
    ObjectNowhereToBeFound,
)
from planlang.geometry.matrices import apart
from planlang.language.process_module import process_module
from planlang.protocols import MotionState, Trajectory

REPLANS = 3
"""Paths around unexpected obstacles to try before the failure is left to the plan."""
MOST_PLACES = 100
"""Places of one exploration or search to try."""
FAR, ASKEW = 0.5, 0.5
"""Where other robots drive, the base turns to a goal farther away [m] that is in another direction [rad] first."""
AT_GOAL = 0.15
"""Radius around the goal in which floor counts for finding the body that closes the way [m]."""


@process_module
class Navigation(PlatformModule):
    """Moves the base to a pose, or to the best base pose of a location."""

    name = "navigation"
    actions = ("Translation-LocationChange",)
    failures = (NavigationFailure, ObjectLost, DesignatorFailure, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base, and the head where other robots drive."""
        return ("base", "head") if Lookout(self.platform).others else ("base",)

    async def execute(self, action: Action) -> None:
        """Drive to ``x``, ``y``, ``yaw``, or to a base pose that satisfies ``to_location``.

        The name of an exploration or a search stands for its next place; unreachable ones are skipped.
        """
        await Skill(partial(self._goals, action), self._drive, failures=(NavigationFailure,), most=MOST_PLACES).run()

    async def _goals(self, action: Action) -> AsyncIterator[BasePose]:
        """Yield the goal of an action; for a name that stands for several places, one after the other."""
        yield await self._goal(action)
        while self.platform.goes_elsewhere(action.get("to_location")):
            yield await self._goal(action)

    async def _drive(self, goal: BasePose) -> None:
        """Drive to a pose: after a touch, which changes what is believed, by another path."""
        await Skill(
            lambda: (goal,),
            self._go,
            believed=lambda: self.platform.belief.revision,
            failures=(NavigationGoalNotReached,),
            most=REPLANS,
        ).run()

    async def _go(self, goal: BasePose) -> None:
        """Drive to a pose; where other robots drive, wait for those that are in the way."""
        if max(apart(goal, self.platform.base())) < 1e-3:
            return
        lookout = Lookout(self.platform)
        if not lookout.others:
            return await self._once(goal)
        await lookout.look()
        await self._face(goal, lookout)
        for _ in range(round(lookout.patience(lookout.others) / PATIENCE)):
            try:
                return await self._once(goal, lookout)
            except NavigationFailure as failure:
                is_closed = self.platform.drive.seconds(goal) is None
                if failure.blocked_by not in lookout.others and not (is_closed and self._is_free_without_others(goal)):
                    raise
            await lookout.wait()
        await self._once(goal, lookout)

    def _is_free_without_others(self, goal: BasePose) -> bool:
        """Check whether a path leads to a pose if other robots are not where they stand now."""
        scene = self.platform.scene
        if not (others := scene.movers()):
            return False
        without = scene.supposing(scene.belief.state.placed(dict.fromkeys(others)))
        return self.platform.supposing(without).drive.seconds(goal) is not None

    async def _once(self, goal: BasePose, lookout: Lookout | None = None) -> None:
        """Follow a path to a pose, out of a collision first if the robot is in one."""
        follow = partial(self._follow, goal=goal, lookout=lookout)
        await follow(await planned(partial(self._path, goal), partial(way_out_of_base, self.platform), follow))

    async def _face(self, goal: BasePose, lookout: Lookout) -> None:
        """Turn to where the way leads, as far as there is room: the camera sees what comes from there."""
        x, y, yaw = self.platform.base()
        heading = math.atan2(goal[1] - y, goal[0] - x)
        away, askew = apart((x, y, yaw), (*goal[:2], heading))
        if away > FAR and askew > ASKEW:
            with suppress(MotionError, NavigationGoalNotReached):
                await self._follow(self.platform.drive.path((x, y, heading)), goal, lookout)

    async def _follow(self, path: Trajectory, goal: BasePose, lookout: Lookout | None) -> None:
        try:
            motion = await self.platform.follow("base", path, closes=None if lookout is None else lookout.closes)
        finally:
            self.platform.drive.moved()
        if motion.state is MotionState.MOVING and lookout is not None:
            raise NavigationGoalNotReached(target=goal, blocked_by=lookout.closed_by)
        if motion.state is not MotionState.DONE:
            raise NavigationGoalNotReached(target=goal, blocked_by=await self.platform.sensing.bump(motion))

    async def _goal(self, action: Action) -> BasePose:
        match action.get("x"), action.get("y"), action.get("yaw"), action.get("to_location"):
            case float(x), float(y), float(yaw), None:
                return x, y, yaw
            case None, None, None, FixedPose() as pose:
                return self.platform.base_at(pose)
            case None, None, None, Posture(name=str(name)) | str(name) if goal := self.platform.made_goal(name):
                return goal
            case None, None, None, Location() | Object() as where:
                return await self._place(where if isinstance(where, Location) else self._at(where))
        raise ActionUnresolvable("state a goal of the base: to_location, or x, y and yaw", designator=str(action))

    def _at(self, what: Object) -> Location:
        """Say where the base goes if it is sent to a thing: into a room, within reach of anything else."""
        bodies = self.platform.scene.bodies
        is_room = bodies.is_room(bodies.bind(what))
        return a_location(in_=what) if is_room else a_location(in_reach_of=what)

    async def _place(self, location: Location) -> BasePose:
        """Find the best base pose of a location, if need be after other robots have left."""
        resolver, lookout = self.platform.resolver, Lookout(self.platform)
        with suppress(LocationUnresolvable):
            return next(resolver.bases(location)).base
        if names := resolver.waits_for(location):
            await lookout.wait_for(location, lookout.patience(names))
        return next(resolver.bases(location)).base

    async def _path(self, goal: BasePose) -> Trajectory:
        if self.platform.robot.base.fixed:
            what = "the base is fixed: start it where all is within its reach"
            raise NavigationPoseUnreachable(what, target=goal)
        try:
            return self.platform.drive.path(goal)
        except GoalInCollision as problem:
            raise NavigationGoalInCollision(target=goal, blocked_by=self._blocking(problem)) from problem
        except StartInCollision as problem:
            stuck = self._blocking(problem)
            raise NavigationGoalNotReached("the base is stuck", target=goal, blocked_by=stuck) from problem
        except MotionError as problem:
            if (touched := self.platform.belief.memory.met) is not None:
                raise NavigationGoalNotReached(target=goal, blocked_by=self._obstacle(touched)) from problem
            if (narrow := narrow_doorway(self.platform.scene, np.array(goal[:2]))) is not None:
                raise NavigationPoseUnreachable(str(narrow), target=goal, blocked_by=narrow.name) from problem
            closing = next(iter(self.platform.scene.collisions.closes_way(np.array(goal[:2]), AT_GOAL)), None)
            raise NavigationPoseUnreachable(target=goal, blocked_by=self._obstacle(closing)) from problem

    def _blocking(self, problem: GoalInCollision | StartInCollision) -> str | None:
        return self._obstacle(next((body for _, body in problem.pairs), None))

    def _obstacle(self, name: str | None) -> str | None:
        """Name in words what stopped the base, if that is known."""
        return None if name is None else self.platform.scene.bodies.as_obstacle(name)
