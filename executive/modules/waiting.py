"""Process module that waits."""

from __future__ import annotations

from executive.modules.giving_way import Lookout
from executive.modules.platform import PlatformModule
from planlang.designators import Action, FixedPose, Location
from planlang.failures import ActionUnresolvable, DesignatorFailure, ObjectLost
from planlang.kernel import sleep
from planlang.language.process_module import process_module


@process_module
class Waiting(PlatformModule):
    """Waits for the duration that the action states; other processes, such as heating, continue.

    With ``to_location``, and other robots in the map, at most so long, until they have left the way to there.
    """

    name = "waiting"
    actions = ("Waiting",)
    failures = (DesignatorFailure, ObjectLost)

    async def execute(self, action: Action) -> None:
        """Wait for ``duration`` [s]. Raises ActionUnresolvable if it is missing or negative.

        Raises ObjectLost if what a hand holds for this branch of the plan slips out of it meanwhile.
        """
        duration = action.get("duration")
        if isinstance(duration, bool) or not isinstance(duration, int | float) or not duration >= 0:
            raise ActionUnresolvable("state a duration of at least 0 seconds to wait for", designator=str(action))
        where, lookout = action.get("to_location"), Lookout(self.platform)
        if lookout.others and isinstance(where, Location) and not isinstance(where, FixedPose):
            await lookout.wait_for(where, float(duration))
        elif holding := [arm.name for arm in self.platform.arms.holding(self.platform.scene.arms.all)]:
            await self.platform.wait_holding(holding, lambda: False, "a hand emptied", float(duration))
        else:
            await sleep(float(duration))
