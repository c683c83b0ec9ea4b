"""Process module that hands a held object to a person and waits until they take it."""

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
"""Distances to try for the straight retreat of a hand after the handover [m]."""
PATIENCE = 15.0
"""Time for which to offer an object [s]: long enough for a person to notice it and reach out."""


@process_module
class Handover(PlatformModule):
    """Offers a held object until a person takes it."""

    name = "handover"
    actions = ("HandingOverAnObject",)
    failures = (CommunicationFailure, GripperFailure, ObjectLost, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that holds the object."""
        return tuple(arm.name for arm in self._arm(action))

    async def execute(self, action: Action) -> str:
        """Hand over ``object_acted_on`` (default: any held object); return the name of the person who took it.

        Raises HandoverNotTaken if nobody, or another person, pulls at it.
        """
        arms = self._arm(action)
        if not arms:
            raise ActionUnresolvable("no arm holds the object to hand over; grasp it first", designator=str(action))
        platform, arm = self.platform, arms[0]
        held = platform.scene.arms.held(arm.name)
        assert held is not None
        recipient = action.get("recipient")
        stated = str(recipient) if isinstance(recipient, Person) else None
        if not await platform.hands.offer(arm, held.name, PATIENCE):
            raise HandoverNotTaken(what=held.name, recipient=stated)
        expected = platform.scene.bodies.bind(recipient) if isinstance(recipient, Person) else None
        person = platform.scene.bodies.taker(held.name, expected)
        if person is None or expected not in (None, person):
            message = f"{person or 'an unknown person'} takes {held.name} instead of {stated}"
            raise HandoverNotTaken(message, what=held.name, recipient=stated)
        mates = platform.scene.arms.mates(arm.name)
        platform.hands.let_go(held.name, to=person)
        for one in (arm, *mates):
            await platform.hands.move(one, closed=False)
        if not mates:
            await self._draw_back(arm, held.name)
        return person

    async def _draw_back(self, arm: ArmModel, name: str) -> None:
        """Retreat straight from the object, if there is room: the arm's next motion might sweep into it otherwise."""
        path = self.platform.arms.drawn(arm, (far * self.back_of(arm) for far in DRAWN_BACK), name)
        if path is not None:
            await self.platform.sensing.bump(await self.platform.follow(arm.name, path))

    def _arm(self, action: Action) -> list[ArmModel]:
        """Find the first arm that holds the object, as a list of at most one."""
        scene, arms = self.platform.scene, self.platform.arms
        what = action.get("object_acted_on")
        name = scene.bodies.bind(what) if isinstance(what, Object) else None
        for arm in scene.arms.all if name is not None else arms.holding_for(action, scene.arms.all):
            held = scene.arms.held(arm.name)
            if held is not None and name in (None, held.name):
                return [arm]
        return []
