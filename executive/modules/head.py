"""The process module of the head: points the camera at things."""

from __future__ import annotations

from executive.modules.platform import Platform
from planlang.designators import Action, Object
from planlang.failures import ActionUnresolvable, DesignatorFailure, LookingFailure
from planlang.modules import process_module


@process_module
class Head:
    """Turns the neck so that an object is in the middle of the picture."""

    name = "head"
    actions = ("LookingAtSomething",)
    failures = (LookingFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the head."""
        return ("head",)

    async def execute(self, action: Action) -> None:
        """Look at ``object_acted_on``; raises LookingGoalUnreachable beyond the neck's limits."""
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("looking at something needs object_acted_on", designator=str(action))
        scene = self.platform.scene
        name = scene.bodies.bind(what)
        await self.platform.sensing.look_at(scene.bodies.block(name).centre, name)
