"""achieve: steps that are skipped when what they are for already holds; holds: what the belief says, as a fluent."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, TypeVar

from planlang.designators import Condition, Location, Object, located
from planlang.failures import GoalNotAchieved
from planlang.kernel import Fluent, Signal, checkpoint, wait_for
from planlang.kernel.core import here
from planlang.kernel.fluent import SIGNAL
from planlang.kernel.primitives import called, node, pause, record
from planlang.kernel.tree import name_of
from planlang.language.executive import executive_for
from planlang.language.recovery import Return
from planlang.misuse import Usage

V = TypeVar("V")

_ACHIEVE = Usage("await achieve", {"goal": "holding(cup)", "body": "grasp"}, {"within": "0.5"})
_HOLDS = Usage("holds", {"what": "a_location(near=table)"}, {"of": "cup"})
Goal = Condition | Callable[[], bool] | Signal[Any]


async def achieve(goal: Goal, body: Callable[[], Awaitable[V]], *, within: float = 0.0) -> V | None:
    """Run the body unless the goal already holds; returns its result, or None if it was skipped.

    After the body the goal must hold, at the latest ``within`` seconds of plan time later: else GoalNotAchieved.
    A condition is looked up in the executive's belief; a fluent is read anew.
    """
    _ACHIEVE.branch("body", body)
    if not isinstance(goal, (Condition, Signal)):
        _ACHIEVE.plain("goal", goal, "a condition, a fluent or a function that tells whether it holds")
    _ACHIEVE.seconds("within", within)
    text, holds = _reader(goal)
    result: V | None = await node("achieve", "achieve", partial(_achieve, text, holds, body, within), goal=text)
    return result


async def _achieve(text: str, holds: Callable[[], bool], body: Callable[[], Awaitable[V]], within: float) -> V | None:
    if holds():
        record("skipped", goal=text)
        await checkpoint()
        return None
    result: V = await called(body)
    if not holds() and not (within and await wait_for(Fluent(read=holds, name=text), within)):
        raise GoalNotAchieved(goal=text)
    return result


def holds(what: Condition | Location, of: Object | None = None) -> Fluent[bool]:
    """Return a fluent that is true while a condition holds, or something is at a location, as the executive believes.

    ``of`` is what is at a location: an object, or the hand of the device; without it the base of the robot. The same
    tests decide that validate candidates when the location is resolved.
    """
    executive = executive_for("holds")
    _HOLDS.instance("what", what, (Condition, Location), "a condition or a location")
    if of is not None:
        _HOLDS.instance("of", of, Object, "an object")
    condition = located(what, of) if isinstance(what, Location) else what
    return Fluent(read=lambda: executive.holds(condition), name=str(condition))


def _reader(goal: Goal) -> tuple[str, Callable[[], bool]]:
    if isinstance(goal, Condition):
        executive = executive_for("achieve")
        return str(goal), lambda: executive.holds(goal)
    if isinstance(goal, Signal):
        return str(goal), lambda: bool(goal.read())
    name, recorded = name_of(goal), here()[0].recorded

    def answer() -> bool:
        answer = goal()
        _ACHIEVE.at_once("goal", goal, answer)
        return bool(answer)

    return name, answer if recorded is None else lambda: bool(recorded.answer(f"{name} holds", answer))


_WHENEVER = Usage("await whenever", {"signal": "bell_rings", "body": "answer"})


async def whenever(signal: Signal[Any], body: Callable[[], Awaitable[Any]]) -> Any:
    """Run the body each time the fluent is true, at most once per world step; ``Return(v)`` from it leaves with v."""
    _WHENEVER.branch("body", body)
    _WHENEVER.instance("signal", signal, Signal, SIGNAL)
    return await node("whenever", "whenever", partial(_whenever, signal, body), signal=str(signal))


async def _whenever(signal: Signal[Any], body: Callable[[], Awaitable[Any]]) -> Any:
    while True:
        await wait_for(signal)
        result = await called(body)
        if isinstance(result, Return):
            return result.value
        await pause(1)
