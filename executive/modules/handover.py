"""The process module of handovers: offers what an arm holds, feels it being taken, only then opens the gripper."""

from __future__ import annotations

from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang import wait_for
from planlang.designators import Action, Object, Person
from planlang.failures import (
    ActionUnresolvable,
    CommunicationFailure,
    DesignatorFailure,
    GripperFailure,
    HandoverNotTaken,
)
from planlang.modules import process_module

PATIENCE = 15.0
"""How long an object is offered [s]: long enough to notice it and to reach out."""


@process_module
class Handover:
    """Offers what an arm holds until somebody takes it."""

    name = "handover"
    actions = ("HandingOverAnObject",)
    failures = (CommunicationFailure, GripperFailure, DesignatorFailure)

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that holds the object."""
        return tuple(arm.name for arm in self._arm(action))

    async def execute(self, action: Action) -> str:
        """Hand over ``object_acted_on`` (default: what is held); return the name of the person who took it."""
        arms = self._arm(action)
        if not arms:
            raise ActionUnresolvable("no arm holds what is to be handed over", designator=str(action))
        platform, arm = self.platform, arms[0]
        held = platform.scene.arms.held(arm.name)
        assert held is not None
        recipient = action.get("recipient")
        wanted = str(recipient) if isinstance(recipient, Person) else None
        person = await wait_for(platform.hands.taken(held.name), timeout=PATIENCE)
        if person is None:
            raise HandoverNotTaken(what=held.name, recipient=wanted)
        if isinstance(recipient, Person) and platform.scene.bodies.bind(recipient) != person:
            raise HandoverNotTaken(f"{person} takes {held.name} instead of {wanted}", what=held.name, recipient=wanted)
        platform.hands.let_go(held.name, to=person)
        await platform.hands.move(arm, closed=False)
        return str(person)

    def _arm(self, action: Action) -> list[ArmModel]:
        platform = self.platform
        what = action.get("object_acted_on")
        name = platform.scene.bodies.bind(what) if isinstance(what, Object) else None
        found = []
        for arm in platform.scene.arms.all:
            held = platform.scene.arms.held(arm.name)
            if held is not None and name in (None, held.name):
                found.append(arm)
        return found[:1]
