"""Process module that waits."""

from __future__ import annotations

from executive.modules.giving_way import Lookout
from executive.modules.platform import PlatformModule
from planlang.designators import Action, Location
from planlang.failures import ActionUnresolvable, DesignatorFailure
from planlang.kernel import sleep
from planlang.language.process_module import process_module


@process_module
class Waiting(PlatformModule):
    """Waits for the duration that the action states; other processes, such as heating, continue.

    With ``to_location``, at most so long, until other robots have left the way to there.
    """

    name = "waiting"
    actions = ("Waiting",)
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> None:
        """Wait for ``duration`` [s]. Raises ActionUnresolvable if it is missing or negative."""
        duration = action.get("duration")
        if isinstance(duration, bool) or not isinstance(duration, int | float) or not duration >= 0:
            raise ActionUnresolvable("state a duration of at least 0 seconds to wait for", designator=str(action))
        match action.get("to_location"):
            case Location() as where:
                await Lookout(self.platform).wait_for(where, float(duration))
            case _:
                await sleep(float(duration))
