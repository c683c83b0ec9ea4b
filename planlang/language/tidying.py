"""Tidying: what a plan leaves is as others need it: doors are closed again, and no hand holds anything after a failure.

A recovery that opens a door closes it behind the robot at once, if no later step leads back through it. Otherwise the
door is owed: after the plan has succeeded, what is still owed is closed, and the robot goes back to where the plan has
brought it. The plan has reached its goal then: it does not fail because a door stays open. It fails if its last action
was a movement of the base, and the robot does not get back: to be there was what it was to do.

After a plan has failed, the robot puts down what it still holds, if its ontologies state that for the failure. The
failure then says where the things are.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from contextlib import suppress
from contextvars import ContextVar
from typing import TypeVar

from planlang.action_classes import levels_above
from planlang.designators import Action, Condition, FixedPose, Object, action
from planlang.failures import NavigationFailure, PlanFailure
from planlang.language.branches import evaporating
from planlang.language.executive import Executive, executive_for
from planlang.language.performing import last_resources, perform
from planlang.language.recovery import recoveries_are_on
from planlang.language.remaining import remaining_actions

V = TypeVar("V")
MOVING = frozenset({"base", "head"})
"""Resources of an action that does nothing but move the base, where the head watches the way."""

_owed: ContextVar[dict[Object, None] | None] = ContextVar("doors to close again", default=None)
"""Doors that stand open for later steps, in the order in which they were opened."""


async def tidied(body: Callable[[], Awaitable[V]]) -> V:
    """Run a body; when it has succeeded, close the doors that :func:`passed` has left open in it, if possible.

    When it has failed, put down what is held, if possible and where recoveries are on; then raise the failure. Raises
    NavigationFailure if the body ended with a movement of the base, and the robot does not get back from the doors.
    """
    owed, failure, last = dict[Object, None](), None, list[str]()
    token, of_last = _owed.set(owed), last_resources.set(last)
    try:
        result = await body()
    except PlanFailure as raised:
        failure = raised
    finally:
        last_resources.reset(of_last)
        _owed.reset(token)
    if failure is not None:
        await _put_down(failure)
        raise failure
    if owed:
        try:
            await perform(action("ClosingDoorsAgain", object_acted_on=tuple(owed)))
        except NavigationFailure:
            if {"base"} <= {*last} <= MOVING:
                raise
        except PlanFailure:  # the tree of the run has it
            pass
    return result


async def _put_down(failure: PlanFailure) -> None:
    """Put down what is held after a failure, for which the executive knows whether that is to be done.

    The failure gets a sentence about each thing.
    """
    if not recoveries_are_on() or evaporating() or not executive_for("tidied").held():
        return
    kinds = tuple(kind.__name__ for kind in type(failure).__mro__ if issubclass(kind, PlanFailure))
    with suppress(PlanFailure):  # the failure of the plan is the one to report; the tree of the run has this one
        failure.afterwards = tuple(await perform(action("EmptyingTheHands", after_failure=kinds)) or ())


async def passed(door: Object, beyond: FixedPose | None) -> None:
    """Close a door from ``beyond``, its other side, if no later step leads back through it; else after the plan.

    The robot drives through it for that. Without ``beyond`` nobody knows yet where the robot goes from there, as in a
    search: it is closed after the plan. So it is if a hand is not empty, if the door cannot be closed from
    there, or if another one is left open, to which a later step leads. It stays open if a later step is to open it.
    Without effect outside of :func:`tidied`.
    """
    owed, executive = _owed.get(), executive_for("passed")
    if owed is None or any(_opens(step, door, executive) for step in remaining_actions()):
        return
    if beyond is not None and not owed and not executive.held():
        leads_back = executive.holds(Condition("leads_back", (door, beyond)))
        with suppress(PlanFailure):
            if not leads_back:
                await perform(action("ClosingAContainerArtifact", object_acted_on=door, to_location=beyond))
                return
    owed[door] = None


def _opens(step: Action, door: Object, executive: Executive) -> bool:
    what = step.get("object_acted_on")
    if not isinstance(what, Object) or what.name != door.name:
        return False
    return any("OpeningAContainerArtifact" in level for level in levels_above(step.type, executive.ancestors))
