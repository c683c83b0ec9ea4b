"""What happens around each action that a process module performs, whichever module it is.

Before, objects at unknown places are searched for, if the action uses the base; afterwards the effects that its class
declares are applied. Hands that fail are noted, so that another one is used in the end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from executive.modules.effects import ActionEffects
from executive.modules.platform import Platform
from executive.modules.tools.turning_over import check_turned
from planlang.changes import TurnedOver
from planlang.designators import Action, Location, Object, action, local_name
from planlang.failures import (
    AmountNotPoured,
    GraspMissed,
    GraspSlipped,
    GripperFailure,
    GripperGoalNotReached,
    LookingFailure,
    ObjectNotTurned,
    ObjectNowhereToBeFound,
    PerceptionFailure,
)
from planlang.kernel import PlanStructureError, sleep
from planlang.language.performing import perform
from planlang.language.process_module import LEFT_TO_MOTIONS, ModuleOnce, ProcessModule, stated_as_before


class RobotModule(ModuleOnce):
    """Process module of a robot, as plans use it."""

    def __init__(
        self, module: ProcessModule, platform: Platform, effects: ActionEffects, finding: frozenset[str]
    ) -> None:
        """Wrap ``module``. ``finding``: action classes that search for objects themselves."""
        super().__init__(module)
        self._platform, self._effects, self._finding = platform, effects, finding
        around = PerceptionFailure, LookingFailure, ObjectNowhereToBeFound, ObjectNotTurned, AmountNotPoured
        self.failures = (*module.failures, *around)
        self._by_motions = [kind for name in stated_as_before(module) for kind in LEFT_TO_MOTIONS[name]]

    async def execute(self, action: Action) -> Any:
        """Search for unknown objects, perform the action, then apply its effects.

        Raises ObjectNowhereToBeFound if a search fails, PlanStructureError if the module has changed the world by
        itself, ObjectNotTurned if the action's class turns objects over and none has turned, and AmountNotPoured if it
        states more than the vessel held, or the other one had room for.
        """
        effects = self._effects
        effects.catch_up()
        if (due := effects.due(action)) is not None:
            await sleep(due)
        lay = effects.lying(action) or {}
        begun = effects.begins(self._by_motions)
        for what in self._unknown(action):
            await perform(looking_for(what))
        try:
            result = await super().execute(action)
        except (GripperGoalNotReached, GraspMissed, GraspSlipped) as failure:
            if failure.arm is not None and failure.where is None:  # else another module has raised and noted it
                self._hand_failed(failure, failure.arm)
            raise
        self._platform.belief.learn()
        effects.catch_up()
        if not effects.untouched():
            raise PlanStructureError(
                f"process module {self.name} has changed the world itself, which only declared effects may do: state "
                "an ObjectChange for the class of its actions (docs/guides/modules.md)"
            )
        there = effects.lying(action)
        effects.apply(action, begun)
        effects.restored()
        if begun.missed:
            raise begun.missed[0]
        if there == {}:
            raise ObjectNotTurned(f"there is nothing that {local_name(action.type)} could turn over")
        if there and any(isinstance(change, TurnedOver) for change in begun.done_by_motions):
            for name, pose in (there | lay).items():
                await check_turned(self._platform, name, pose)
        return result

    def _hand_failed(self, failure: GripperFailure, arm: str) -> None:
        """Note that a hand has failed; a failure of the last one whose fingers have moved so far says so."""
        belief, hands = self._platform.belief, self._platform.scene.arms.hands
        belief.hand_failed(arm)
        given_up = belief.memory.given_up
        if isinstance(failure, GripperGoalNotReached) and all(one.name in given_up for one in hands):
            which = "the robot has no other hand" if len(hands) == 1 else "the other hands were given up as well"
            failure.message = f"{failure}; {which}"

    def _unknown(self, action: Action) -> Iterator[Object]:
        """Yield the objects of an action whose place is unknown, for an action that uses the base.

        Others are performed where the plan has put the robot; there the plan's recoveries search.
        """
        platform = self._platform
        if not platform.belief.memory.unknown or "base" not in self.resources(action):
            return
        if not self._finding.isdisjoint(platform.ancestors(action.type)):
            return
        bodies = platform.scene.bodies
        for what in dict.fromkeys(_things(value for _, value in action.properties)):
            if bodies.means_unknown(what) and bodies.known(what) is None:
                yield what


def looking_for(what: Object) -> Action:
    """Build the action that searches for an object."""
    return action("LookingForSomething", object_acted_on=what)


def _things(values: Iterable[object]) -> Iterator[Object]:
    for value in values:
        if isinstance(value, Object):
            yield value
        elif isinstance(value, Location):
            yield from value.things()
        elif isinstance(value, tuple):
            yield from _things(value)
