"""Dispatch of actions to performers: the module or the plan of the nearest class, in replays as in runs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.failures import NavigationGoalNotReached, ObjectLost, ObjectUnreachable
from planlang.language.process_module import RecordedModule, WrappedModule, performs
from planlang.language.replaying import replay
from planlang.runs import RecordedRun

CUP = an_object("Cup", "http://example.org/map#cup1")
STIR = "http://example.org/soup#Stir"
STIR_FAST = action_class("http://example.org/soup#StirFast", below=STIR)


@plan(STIR)
async def stir(*, cup: Object = CUP) -> str:
    await sleep(1)
    return f"stirred {cup}"


async def moves(wanted: Action) -> str:
    return "moved"


def test_the_plan_of_a_nearer_class_performs_an_action_rather_than_a_module_of_a_farther_one(
    executive: Any, module: Any
) -> None:
    executive.parents = {STIR: ("PurposefulAction",)}
    executive.extra.append(module("anything", ("PurposefulAction",), moves))
    stirring = partial(perform, action(STIR_FAST), otherwise=partial(stir, cup=CUP))
    assert go(stirring, executive) == "stirred cup1"
    executive.extra.append(module("stirring", (STIR,), moves))
    assert go(stirring, executive) == "moved"


def test_a_module_of_a_class_above_is_found_in_the_replay_too(executive: Any, module: Any) -> None:
    executive.parents = {"Whisking": ("Stirring",)}
    executive.extra.append(module("stirring", ("Stirring",), moves))
    trace = Trace()
    top = partial(perform, action("Whisking"))
    assert go(top, executive, trace=trace, resumable=True) == "moved"
    assert replay(top, RecordedRun.of(trace.events)).equal


def test_a_base_that_is_moved_away_after_what_must_not_be_repeated_ends_the_scope(executive: Any, module: Any) -> None:
    executive.extra.append(module("stirring", ("Stirring",), moves))

    async def body() -> None:
        await perform(action("Stirring"), once=True)
        await sleep(5)

    async def push() -> None:
        await sleep(3)
        executive.base = (9.0, 9.0, 0.0)

    with pytest.raises((NavigationGoalNotReached, ObjectUnreachable)) as caught:
        go(lambda: par(partial(at_location, a_location(in_reach_of=CUP), body), push), executive)
    assert "must not be repeated" in explain(caught.value)
    assert executive.log == ["at 1"]


def test_without_a_branch_that_grasps_the_body_itself_grasps_again_what_was_lost(executive: Any, module: Any) -> None:
    lost = [ObjectLost(what="cup1")]

    async def body() -> str:
        if lost:
            raise lost.pop()
        return "carried"

    executive.extra.append(module("perception", ("LookingForSomething",), moves))
    assert go(partial(with_failure_handling, body, Recovery(ObjectLost, fetch_again(CUP))), executive) == "carried"


class Left:
    """A process module that reaches with the left hand only."""

    name = "left hand"
    actions = ("Reaching",)
    failures = ()

    def performs(self, action: Action) -> bool:
        return action.get("device_used") == "left"

    def resources(self, action: Action) -> tuple[str, ...]:
        return ()

    async def execute(self, action: Action) -> str:
        return "reached"


class Answers:
    """Answers that are kept by their questions."""

    def __init__(self) -> None:
        self.kept: dict[str, Any] = {}

    def answer(self, question: str, find: Callable[[], Any]) -> Any:
        return self.kept.setdefault(question, find())


class Right(Left):
    """A module that acts outside the world, and performs all actions of its class."""

    performs = None
    once = True


def test_what_a_module_says_besides_is_forwarded_and_not_asked_where_it_says_nothing() -> None:
    answers = Answers()
    for around in (WrappedModule(Right()), RecordedModule(Right(), answers)):  # type: ignore[arg-type]
        assert (around.once, around.performs(action("Reaching"))) == (True, True)
    assert answers.kept == {}


@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_module_around_another_performs_what_that_one_does_and_what_it_said_is_recorded(hand: str) -> None:
    asked, answers = action("Reaching", device_used=hand), Answers()
    assert performs(WrappedModule(Left()), asked) is (hand == "left")
    assert performs(RecordedModule(Left(), answers), asked) is (hand == "left")  # type: ignore[arg-type]
    assert [*answers.kept.values()] == [hand == "left"]
