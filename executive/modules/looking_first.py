"""Looking for the things of an action that are yet to be found, before a process module that drives performs it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from executive.modules.platform import Platform
from planlang import perform
from planlang.designators import Action, Location, Object, action
from planlang.failures import LookingFailure, ObjectNowhereToBeFound, PerceptionFailure
from planlang.language.process_module import ProcessModule, WrappedModule


class LookingFirst(WrappedModule):
    """A process module that, if its action takes the base, may look for what the action is about.

    What does not take the base stands where the plan has put it: there the recoveries of the plan look.
    """

    def __init__(self, module: ProcessModule, platform: Platform, finding: frozenset[str]) -> None:
        """``finding`` are the action classes that look for things themselves."""
        super().__init__(module)
        self._platform, self._finding = platform, finding

    @property
    def failures(self) -> Sequence[type[Exception]]:
        """Failure classes that it may raise: those of looking, too."""
        return (*super().failures, PerceptionFailure, LookingFailure, ObjectNowhereToBeFound)

    async def execute(self, action: Action) -> Any:
        """Look for what is unknown, then perform the action; raises ObjectNowhereToBeFound for what is not found."""
        for what in self._unknown(action):
            await perform(looking_for(what))
        return await super().execute(action)

    def _unknown(self, action: Action) -> Iterator[Object]:
        """Yield the things that an action is about and of which it is not known where they are."""
        platform = self._platform
        if not platform.belief.unknown or "base" not in self.resources(action):
            return
        if not self._finding.isdisjoint(platform.ancestors(action.type)):
            return
        bodies = platform.scene.bodies
        for what in dict.fromkeys(_things(value for _, value in action.properties)):
            if bodies.means_unknown(what) and bodies.known(what) is None:
                yield what


def looking_for(what: Object) -> Action:
    """Return the action of looking for a thing."""
    return action("LookingForSomething", object_acted_on=what)


def _things(values: Iterable[object]) -> Iterator[Object]:
    for value in values:
        if isinstance(value, Object):
            yield value
        elif isinstance(value, Location):
            yield from value.things()
        elif isinstance(value, tuple):
            yield from _things(value)
