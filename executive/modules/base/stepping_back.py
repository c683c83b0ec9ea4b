"""The process module that takes the base a step back from what the robot has worked at."""

from __future__ import annotations

from executive.modules.arm.hand_work import BACK, HandWork
from planlang import checkpoint
from planlang.designators import Action
from planlang.failures import NavigationFailure
from planlang.language.process_module import process_module


@process_module
class SteppingBack(HandWork):
    """Drives back to where there is room for the arms, if there is such a place; a fixed base stays."""

    name = "stepping_back"
    actions = ("SteppingBack",)
    failures = (NavigationFailure,)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the base."""
        return ("base",)

    async def execute(self, action: Action) -> None:
        """Step back; raises a NavigationFailure if something stops the base."""
        room = self.platform.drive.room_for(self.platform.arms.untucked(), least=BACK)
        if room is None:
            await checkpoint()
        else:
            await self.drive(room)
