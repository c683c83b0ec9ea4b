"""Take note of the hands that fail in process modules, so that another one is used in the end."""

from __future__ import annotations

from typing import Any

from executive.belief import Belief
from planlang.designators import Action
from planlang.failures import GripperGoalNotReached
from planlang.language.process_module import ProcessModule, WrappedModule


class NotingHands(WrappedModule):
    """Process module whose failures of fingers are recorded in the belief, whoever raises them.

    Only that the fingers did not reach their goal tells something about the hand: a missed grasp tells more about the
    object.
    """

    def __init__(self, module: ProcessModule, belief: Belief) -> None:
        super().__init__(module)
        self._belief = belief

    async def execute(self, action: Action) -> Any:
        """Perform the action; record which hand has failed, if one has."""
        try:
            return await super().execute(action)
        except GripperGoalNotReached as failure:
            if failure.arm is not None:
                self._belief.hand_failed(failure.arm)
            raise
