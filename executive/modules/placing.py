"""The process module that lowers what a hand holds onto a place, so that it stands there when the hand opens."""

from __future__ import annotations

from contextlib import suppress

from executive.locations import HandSolution
from executive.modules.process_modules import Reaching
from executive.robots.arms import ArmModel
from planlang.designators import Action, Location, Object, a_location
from planlang.failures import ActionUnresolvable, LookingFailure, PerceptionFailure
from planlang.modules import process_module

FEW = 100
"""Branches that the search of a path over a place grows: there are other hand poses to try, and other base poses."""


@process_module
class Lowering(Reaching):
    """Brings what a hand holds over a place, and straight down onto it."""

    name = "lowering"
    actions = ("LoweringAnObject",)

    def _target(self, action: Action) -> Location | None:
        """Return where the thing is to rest; for a thing on that."""
        where = action.get("to_location")
        return a_location(on=where) if isinstance(where, Object) else where if isinstance(where, Location) else None

    def _arms(self, action: Action) -> list[ArmModel]:
        """Return the arm that holds what is to be put down, else those that hold something."""
        scene, what = self.platform.scene, action.get("object_acted_on")
        name = scene.bodies.bind(what) if isinstance(what, Object) else None
        full = self.platform.arms.holding(scene.arms.all)
        meant = [arm for arm in full if (held := scene.arms.held(arm.name)) is not None and name in (None, held.name)]
        if not meant:
            missing = "nothing" if name is None else f"no {name}"
            raise ActionUnresolvable(f"there is {missing} in a hand to put down", designator=str(action))
        return meant

    async def _look_first(self, location: Location) -> None:
        """Look at what the place is relative to; what the hand holds may hide it, and then it is where it was seen."""
        with suppress(PerceptionFailure, LookingFailure):
            await super()._look_first(location)

    async def _go(self, solution: HandSolution, location: Location) -> None:
        """Go above the place, then straight down."""
        await self._joint_path(solution.arm, solution.joints[0], None, solution.plan.label, iterations=FEW)
        await self._straight(solution, solution.joints[1:2])
