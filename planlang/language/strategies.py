"""Strategies of recovery, for :class:`Recovery`'s ``do``.

Trying the next place for the base is what ``at_location`` does by itself; escalation is ``attempts=0, otherwise=...``.
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial

from planlang.designators import Object, a_location, action
from planlang.failures import (
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUndeliverable,
    ObjectUnreachable,
    PlanFailure,
)
from planlang.language.location import at_location
from planlang.language.performing import perform
from planlang.language.recovery import RETRY, Decision, Do, Return, retry
from planlang.misuse import Usage

repeat = retry
"""Run the body again, nothing else."""


def look_from_another_place(what: Object) -> Do:
    """Go where the object should be visible from and look for it there, then run the body again.

    Not finding it there either is no failure yet: the body will tell. Raises ObjectNowhereToBeFound when there is no
    other place to look from.
    """

    Usage("look_from_another_place", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> Decision:
        try:
            with suppress(ObjectNotFound):
                await at_location(a_location(visible_from=what), partial(_look_for, what))
        except (ObjectUnreachable, ObjectUndeliverable) as nowhere:
            raise ObjectNowhereToBeFound(what=str(what)) from nowhere
        return RETRY

    return look


def look_and_repeat(what: Object) -> Do:
    """Look for the object from here, which may correct where it is believed to be, then run the body again."""

    Usage("look_and_repeat", {"what": "bottle"}).instance("what", what, Object, "an object")

    async def look(failure: PlanFailure) -> Decision:
        await _look_for(what)
        return RETRY

    return look


async def ignore(failure: PlanFailure) -> Decision:
    """Go on as if the body had succeeded, with None."""
    return Return(None)


async def _look_for(what: Object) -> None:
    await perform(action("LookingForSomething", object_acted_on=what))
