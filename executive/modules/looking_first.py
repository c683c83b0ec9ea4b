"""Search for the objects of an action at unknown places before a process module that drives performs it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from executive.modules.platform import Platform
from planlang.designators import Action, Location, Object, action
from planlang.failures import LookingFailure, ObjectNowhereToBeFound, PerceptionFailure
from planlang.language.performing import perform
from planlang.language.process_module import ProcessModule, WrappedModule


class LookingFirst(WrappedModule):
    """Process module that first searches for its action's objects, if the action uses the base.

    Other actions are performed where the plan has put the robot; there the plan's recoveries search.
    """

    def __init__(self, module: ProcessModule, platform: Platform, finding: frozenset[str]) -> None:
        """Wrap ``module``. ``finding``: action classes that search for objects themselves."""
        super().__init__(module)
        self._platform, self._finding = platform, finding

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise, including those of the search."""
        return (*super().failures, PerceptionFailure, LookingFailure, ObjectNowhereToBeFound)

    async def execute(self, action: Action) -> Any:
        """Search for unknown objects, then perform the action. Raises ObjectNowhereToBeFound if a search fails."""
        for what in self._unknown(action):
            await perform(looking_for(what))
        return await super().execute(action)

    def _unknown(self, action: Action) -> Iterator[Object]:
        """Yield the objects of an action whose place is unknown."""
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
