"""Process module that backs the base off from the place where the robot has worked."""

from __future__ import annotations

from executive.modules.arm.hand_work import BACK, HandWork
from planlang.designators import Action
from planlang.failures import NavigationFailure
from planlang.kernel import checkpoint
from planlang.language.process_module import process_module


@process_module
class SteppingBack(HandWork):
    """Backs off to the nearest base pose with room for the arms, if there is one; a fixed base stays."""

    name = "stepping_back"
    actions = ("SteppingBack",)
    failures = (NavigationFailure,)
    needs = ("base",)

    async def execute(self, action: Action) -> None:
        """Back off with the base. Raises a NavigationFailure if something stops it."""
        if not await self.back_off(self.platform.arms.untucked(), BACK):
            await checkpoint()
