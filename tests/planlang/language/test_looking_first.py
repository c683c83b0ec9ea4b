"""Places that are looked at before they are gone to, and what modules are told of where they run."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.designators import Object
from planlang.failures import LocationUnresolvable, NavigationPoseUnreachable, ObjectUnreachable, ObjectUnresolvable
from planlang.language.performing import actions_around
from planlang.language.plans import innermost_plan
from planlang.protocols import Solution

CUP = an_object("Cup", "http://example.org/map#cup1")
NEAR_CUP = a_location(in_reach_of=CUP)
LOOK = action("LookingForSomething", object_acted_on=CUP)


@pytest.mark.parametrize("moved", [False, True])
def test_before_a_place_is_gone_to_what_is_not_seen_from_there_is_looked_at(
    executive: Any, module: Any, moved: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def look(wanted: Any) -> None:
        executive.log.append("looked")
        executive.belief += moved and executive.log.count("looked") == 1

    def solutions(location: Location) -> Iterator[Solution]:
        for place in executive.places:
            yield Solution(place, executive.belief, {}, (LOOK,))

    executive.extra.append(module("perception", ("LookingForSomething",), look))
    monkeypatch.setattr(executive, "solutions", solutions)

    async def body() -> None: ...

    go(partial(at_location, NEAR_CUP, body), executive)
    assert executive.log == (["looked", "looked", "at 1"] if moved else ["looked", "at 1"])


def test_a_look_that_the_base_cannot_drive_to_ends_the_search_with_what_was_the_last_failure(
    executive: Any, module: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def look(wanted: Any) -> None:
        raise NavigationPoseUnreachable("no way to where it is seen")

    def solutions(location: Location) -> Iterator[Solution]:
        yield Solution((1.0, 0.0, 0.0), executive.belief, {}, (LOOK,))

    executive.extra.append(module("perception", ("LookingForSomething",), look))
    monkeypatch.setattr(executive, "solutions", solutions)

    async def body() -> None: ...

    with pytest.raises(PlanFailure) as caught:
        go(partial(at_location, NEAR_CUP, body), executive)
    assert isinstance(caught.value.__cause__, NavigationPoseUnreachable)


@pytest.mark.parametrize("ends", ["shows the way", "shows nothing", "fails"])
def test_a_look_that_is_no_place_itself_is_taken_once_and_may_lead_to_one(
    executive: Any, module: Any, ends: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def look(wanted: Any) -> None:
        executive.log.append("looked")
        executive.belief += ends != "shows nothing"
        if ends == "fails":
            raise NavigationPoseUnreachable("no way to where it is seen")

    def solutions(location: Location) -> Iterator[Solution]:
        if ends == "shows the way" and executive.belief > 0:
            yield Solution((2.0, 0.0, 0.0), executive.belief, {})
        else:
            yield Solution((1.0, 0.0, 0.0), executive.belief, {}, (LOOK,), provisional=True)
        raise LocationUnresolvable(figures="it is too far away")

    executive.extra.append(module("perception", ("LookingForSomething",), look))
    monkeypatch.setattr(executive, "solutions", solutions)

    async def body() -> str:
        return "done"

    if ends == "shows the way":
        assert go(partial(at_location, NEAR_CUP, body), executive) == "done"
        assert executive.log == ["looked", "at 2"]
    else:
        with pytest.raises(ObjectUnreachable) as caught:
            go(partial(at_location, NEAR_CUP, body), executive)
        assert "it is too far away" in explain(caught.value).splitlines()[0]
        assert executive.log == ["looked"]


def test_a_module_sees_the_actions_and_the_plan_around_it(executive: Any, module: Any) -> None:
    seen: list[object] = []

    async def pour(wanted: Any) -> None:
        seen.extend([[one.type for one in actions_around()], innermost_plan().rpartition("/")[2]])

    executive.extra.append(module("pouring", ("Pouring",), pour))

    async def recipe() -> None:
        await perform(action("Pouring"))

    @plan
    async def cook() -> None:
        await perform(action("AddingSomething"), otherwise=recipe)

    go(cook, executive)
    assert seen == [["Pouring", "AddingSomething"], "cook"]
    assert (list(actions_around()), innermost_plan()) == ([], "")


def test_a_thing_of_which_nothing_is_known_is_looked_for_before_a_place_is(executive: Any, module: Any) -> None:
    looked: list[Object] = []

    async def look(wanted: Any) -> None:
        looked.append(wanted.get("object_acted_on"))

    executive.extra.append(module("perception", ("LookingForSomething",), look))

    async def fetch() -> None:
        if not looked:
            raise ObjectUnresolvable(designator="Cup")

    recovery = Recovery(ObjectUnresolvable, look_from_another_place(CUP), retries=1)
    go(partial(with_failure_handling, fetch, recovery), executive)
    assert looked == [CUP]
    assert executive.asked == [], "no place to look from was asked for"
