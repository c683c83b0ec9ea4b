"""Process module that closes doors between rooms again, and goes back to where the plan had brought the robot."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from executive.ahead.closing import reached_from
from executive.belief.doorways import BEYOND
from executive.belief.scene_collisions import BasePose
from executive.locations.shut_ways import side_of
from executive.modules.platform import PlatformModule
from executive.motion.floods import Drivable
from planlang.designators import Action, FixedPose, Object, action
from planlang.failures import (
    ActionUnresolvable,
    ContainerStuck,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    ManipulationFailure,
    NavigationFailure,
    PlanFailure,
)
from planlang.geometry.matrices import apart
from planlang.kernel import checkpoint
from planlang.language.performing import perform
from planlang.language.process_module import process_module
from planlang.language.recovery import Recovery
from planlang.recoveries import NOT_OPERATED, step_back_and_repeat

NEARBY = 0.01
"""Distance and turn up to which the base counts as being where it was [m, rad]."""


@process_module
class ClosingAgain(PlatformModule):
    """Closes doors that were opened only so that the robot gets through; the base is back in its place afterwards."""

    name = "closing_again"
    actions = ("ClosingDoorsAgain",)
    failures = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)

    async def execute(self, request: Action) -> tuple[str, ...]:
        """Close those of ``object_acted_on`` that are open, the farthest first; return the names of those that are not.

        Each is closed from the side of the base's place, so that the base gets back there. Of one that stays open the
        trace, and the run's progress, say why, and also why the base does not get back. Raises NavigationFailure
        then: whether the plan has reached its goal all the same depends on the plan.
        """
        await checkpoint()
        scene, place, stay_open = self.platform.scene, self.platform.base(), list[str]()
        doors = self._doors(request)
        joints = (scene.belief.joints[leaf] for leaf in doors if scene.belief.is_left_open(leaf))
        sides = {joint.leaf: side_of(scene, joint, there=False) for joint in joints}
        while sides:
            leaf = self._next(sides)
            try:
                await self._close(doors[leaf], sides.pop(leaf))
                await self._keep_way(doors[leaf], place)
            except PlanFailure as failure:
                with suppress(PlanFailure):  # what it is now may be in the way
                    await self._keep_way(doors[leaf], place)
                stay_open.append(leaf)
                scene.belief.tell("stays open", {"name": leaf, "because": str(failure)})
        if any(one > NEARBY for one in apart(place, self.platform.base())):
            x, y, yaw = place
            # a hand that could not be drawn back from the last door keeps the base there at first
            again = Recovery(NavigationFailure, step_back_and_repeat(next(iter(doors.values()))), retries=2)
            try:
                await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw), recoveries=[again])
            except PlanFailure as failure:
                scene.belief.tell("stays away", {"because": str(failure)})
                raise NavigationFailure("the robot does not get back from closing doors") from failure
        return tuple(stay_open)

    def _doors(self, request: Action) -> dict[str, Object]:
        """Bind the doors of an action, by leaf. Raises ActionUnresolvable if it names something else."""
        what = request.get("object_acted_on")
        named = what if isinstance(what, tuple) else (what,)
        bodies, joints = self.platform.scene.bodies, self.platform.scene.belief.joints
        doors = {bodies.bind(one): one for one in named if isinstance(one, Object)}
        if len(doors) < len(named) or not all(leaf in joints and joints[leaf].frame for leaf in doors):
            raise ActionUnresolvable("name doors between rooms as object_acted_on", designator=str(request))
        return doors

    def _next(self, sides: dict[str, FixedPose | None]) -> str:
        """Choose the door that is closed next, the last opened first.

        From the side on which the base is once that is shut, it gets to all the others.
        """
        for leaf in reversed(sides):
            reached = self._reached(leaf, sides[leaf])
            others = [one for other, one in sides.items() if other != leaf and one is not None]
            if reached is not None and all(reached.comes_near(np.array([one.x, one.y]), BEYOND) for one in others):
                return leaf
        return next(reversed(sides))

    def _reached(self, leaf: str, side: FixedPose | None) -> Drivable | None:
        """Compute where the base may drive once a door is shut from that side, or from where it is now."""
        scene = self.platform.scene
        if side is None:
            return scene.supposing(scene.belief.with_leaf(leaf, 0.0)).collisions.drivable()
        return reached_from(scene, leaf, (side.x, side.y, side.yaw))

    async def _keep_way(self, door: Object, place: BasePose) -> None:
        """Open a door again that parts the base from its place. Raises ContainerStuck then."""
        if not self.platform.scene.collisions.drivable()(np.array([place]))[0]:
            await perform(action("OpeningAContainerArtifact", object_acted_on=door))
            raise ContainerStuck("shut, it would part the robot from its place", what=str(door))

    async def _close(self, door: Object, side: FixedPose | None) -> None:
        again = Recovery(NOT_OPERATED, step_back_and_repeat(door))
        properties = {"object_acted_on": door} if side is None else {"object_acted_on": door, "to_location": side}
        await perform(action("ClosingAContainerArtifact", **properties), recoveries=[again])
