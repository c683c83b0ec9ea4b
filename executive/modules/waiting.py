"""The process module that lets time pass."""

from __future__ import annotations

from executive.modules.platform import PlatformModule
from planlang import sleep
from planlang.designators import Action
from planlang.failures import ActionUnresolvable, DesignatorFailure
from planlang.language.process_module import process_module


@process_module
class Waiting(PlatformModule):
    """Waits as long as the action says; meanwhile heat and whatever else goes on does its work."""

    name = "waiting"
    actions = ("Waiting",)
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> None:
        """Wait for ``duration`` [s]; raises ActionUnresolvable without one."""
        duration = action.get("duration")
        if isinstance(duration, bool) or not isinstance(duration, int | float) or not duration >= 0:
            raise ActionUnresolvable("waiting needs a duration in seconds, at least 0", designator=str(action))
        await sleep(float(duration))
