"""The process module that hands over what an arm holds, and waits until the person takes it."""

from __future__ import annotations

from executive.modules.platform import PlatformModule
from executive.robots.arms import ArmModel
from planlang.designators import (
    Action,
    Object,
    Person,
)
from planlang.failures import (
    ActionUnresolvable,
    CommunicationFailure,
    DesignatorFailure,
    GripperFailure,
    HandoverNotTaken,
    ObjectLost,
)
from planlang.language.process_module import process_module

DRAWN_BACK = (0.12, 0.06)
"""Distances by which a hand is taken straight back from what it has handed over [m]."""
PATIENCE = 15.0
"""Time for which an object is offered [s]: long enough to notice it and to reach out."""


@process_module
class Handover(PlatformModule):
    """Offers what an arm holds until somebody takes it."""

    name = "handover"
    actions = ("HandingOverAnObject",)
    failures = (CommunicationFailure, GripperFailure, ObjectLost, DesignatorFailure)

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
        if not await platform.hands.offer(arm, held.name, PATIENCE):
            raise HandoverNotTaken(what=held.name, recipient=wanted)
        meant = platform.scene.bodies.bind(recipient) if isinstance(recipient, Person) else None
        person = platform.scene.bodies.taker(held.name, meant)
        if person is None or meant not in (None, person):
            said = f"{person or 'somebody unknown'} takes {held.name} instead of {wanted}"
            raise HandoverNotTaken(said, what=held.name, recipient=wanted)
        mates = platform.scene.arms.mates(arm.name)
        platform.hands.let_go(held.name, to=person)
        for one in (arm, *mates):
            await platform.hands.move(one, closed=False)
        if not mates:
            await self._draw_back(arm, held.name)
        return person

    async def _draw_back(self, arm: ArmModel, name: str) -> None:
        """Take the hand straight back from what the person has now, as far as there is room: an arm turns off there."""
        path = self.platform.arms.drawn(arm, (far * self.back_of(arm) for far in DRAWN_BACK), name)
        if path is not None:
            await self.platform.sensing.bump(await self.platform.follow(arm.name, path))

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
