"""Of what a step may do, it does first what leaves later steps a way, as far as a few questions tell."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest

from executive.ahead import foresight
from executive.ahead.foresight import MOST_QUESTIONS, Foresight
from executive.ahead.later_steps import closed_later, reached_through
from executive.maps import MapObject
from executive.modules.furniture.leaf_paths import LeafPaths
from planlang import SimulationHost, perform, run
from planlang.designators import Action, a_location, action
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.kernel import checkpoint
from tests.support.leaves import Room, room, thing

FRONT = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
CAN = thing("can", "TinCan", Pose((1.04, -0.3, 0.26)), (0.07, 0.07, 0.1))
"""A can at the back of a cupboard, to the right."""


def chest(stack: ExitStack) -> Room:
    """A chest with a can in its drawer."""
    things = (
        thing("case", "Cabinet-PieceOfFurniture", Pose((0.85, 0.0, 0.4)) @ FRONT, (0.5, 0.5, 0.8), "leaf"),
        thing("leaf", "Drawer", Pose((0.84, 0.0, 0.65)) @ FRONT, (0.48, 0.46, 0.2), "grip"),
        thing("grip", "Handle", Pose((0.56, 0.0, 0.65)) @ FRONT, (0.012, 0.2, 0.012)),
        thing("can", "TinCan", Pose((0.75, 0.0, 0.62)), (0.07, 0.07, 0.1)),
    )
    return room(stack, things)


class Asked:
    """Foresight over a room, the candidates of which is asked, and what is told about it."""

    def __init__(self, stack: ExitStack) -> None:
        self.stage = chest(stack)
        self.ahead, self.asked, self.told = self.stage.platform.ahead, list[Any](), list[dict[str, Any]]()
        self.stage.platform.belief.tell = lambda event, details: self.told.append({"event": event, **details})
        self._away = self.stage.platform.belief.with_leaf("leaf", 0.4)

    def ordered(self, candidates: Iterable[Any], good: Callable[[Any], bool]) -> Iterator[Any]:
        """Order candidates of which the good ones leave a way; each asks whether the base gets away."""

        def leaves(one: Any) -> bool:
            self.asked.append(one)
            state = self._away.with_robot("amigo", self.stage.platform.scene.world.configuration())
            near = state.robots["amigo"]
            self.ahead.gets_away(self._away.with_robot("amigo", type(near)((0.2, 0.0, 0.0), near.joints)))
            return good(one)

        return self.ahead.first("which", candidates, leaves)


def test_candidates_that_leave_no_way_come_last_and_what_was_asked_is_told(stack: ExitStack) -> None:
    asked = Asked(stack)
    assert list(asked.ordered("abcd", lambda one: one in "bd")) == ["b", "d", "a", "c"]
    assert [(one["event"], one["questions"], one["put_off"]) for one in asked.told] == [
        ("looked ahead", 2, 1),
        ("looked ahead", 4, 2),
    ]
    assert all(one["checks"] > 0 == one["searches"] for one in asked.told)


def test_a_decision_asks_about_a_few_candidates_only(stack: ExitStack) -> None:
    asked = Asked(stack)
    assert list(asked.ordered(range(20), lambda one: False)) == list(range(20))
    assert asked.asked == list(range(MOST_QUESTIONS))


def test_the_failure_that_ends_the_candidates_comes_after_those_put_off(stack: ExitStack) -> None:
    def ending() -> Iterator[str]:
        yield from "ab"
        raise LocationUnresolvable("that was all")

    left = Asked(stack).ordered(ending(), lambda one: one == "b")
    assert [next(left), next(left)] == ["b", "a"]
    with pytest.raises(LocationUnresolvable, match="that was all"):
        next(left)


def test_what_needs_neither_search_nor_check_is_no_question(stack: ExitStack) -> None:
    asked = Asked(stack)
    assert list(asked.ahead.first("which", range(20), lambda one: one % 2 == 1)) == [*range(1, 20, 2), *range(0, 20, 2)]
    assert asked.told == []


def test_an_answer_is_kept_and_with_the_budget_spent_nothing_is_searched(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = chest(stack)
    ahead, belief = Foresight(stage.platform.scene, stage.platform.resolver), stage.platform.belief
    where, wide = a_location(in_reach_of=stage.designator("can")), belief.with_leaf("leaf", 0.38)
    told = list[dict[str, Any]]()
    belief.tell = lambda event, details: told.append(dict(details))
    assert list(ahead.first("which", "ab", lambda one: ahead.reaches(where, wide))) == ["a", "b"]
    assert [one["searches"] for one in told] == [1]
    monkeypatch.setattr(foresight, "MOST_SEARCHES", 1)
    assert ahead.reaches(where, belief.with_leaf("leaf", 0.0)), "as nothing more is searched"


def later(stage: Room, *around: Action, leaf: str = "leaf") -> str:
    """Return where the base stands for the next step through a drawer or door, inside these actions."""
    found = list[str]()

    async def ask() -> None:
        found.append(str(reached_through(stage.platform.belief.joints[leaf], stage.platform.scene)))
        await checkpoint()

    inside(stage, ask, *around)
    return found[0]


def inside(stage: Room, body: Callable[[], Awaitable[Any]], *around: Action) -> None:
    """Run something as what these actions do, the first of them outermost."""

    async def plan() -> None:
        inner = body
        for each in reversed(around):
            inner = (lambda act, further: lambda: perform(act, otherwise=further))(each, inner)
        await inner()

    run(plan, host=SimulationHost(stage.truth), executive=stage.executive, max_steps=30_000)


def test_a_step_that_takes_something_out_of_a_drawer_reaches_through_it(stack: ExitStack) -> None:
    stage = chest(stack)
    can, case = stage.designator("can"), stage.designator("case")
    assert later(stage, action("FetchingAnObject", object_acted_on=can)) == "in_reach_of(can)"
    assert later(stage, action("FetchingAnObject", object_acted_on=case)) == "None"
    assert later(stage) == "None"


def cupboard(*things: MapObject) -> tuple[MapObject, ...]:
    """A cupboard with two doors, its front at x = 0.6, and things in it."""
    doors = [
        part
        for name, side in (("left", 1.0), ("right", -1.0))
        for part in (
            thing(name, "Door", Pose((0.59, 0.201 * side, 0.6)) @ FRONT, (0.02, 0.4, 0.8), f"grip_{name}"),
            thing(f"grip_{name}", "Handle", Pose((0.545, 0.05 * side, 0.7)) @ FRONT, (0.012, 0.012, 0.2)),
        )
    ]
    case = thing("case", "Cupboard", Pose((0.85, 0.0, 0.6)) @ FRONT, (0.5, 0.82, 0.84), "left", "right")
    return (case, *doors, *things)


def test_a_step_reaches_through_either_door_of_the_cupboard_that_something_is_in(stack: ExitStack) -> None:
    stage = room(stack, cupboard(CAN))
    fetching = action("FetchingAnObject", object_acted_on=stage.designator("can"))
    for leaf in ("left", "right"):
        assert later(stage, fetching, leaf=leaf) == "in_reach_of(can)"


def test_a_door_is_opened_as_far_as_it_goes_where_no_way_in_was_found(stack: ExitStack) -> None:
    wall = thing("wall", "Wall-GenericBarrier", Pose((-0.55, 0.0, 1.0)), (0.1, 3.2, 2.0))
    stage = room(stack, cupboard(wall, CAN), start=(0.1, -1.8, 1.57))
    fetching = action("FetchingAnObject", object_acted_on=stage.designator("can"))
    opening = action("OpeningAContainerArtifact", object_acted_on=stage.designator("right"))
    inside(stage, lambda: perform(opening), fetching)
    assert stage.truth.joint("right") == pytest.approx(1.57, abs=0.1)


def test_a_later_step_closes_a_leaf_by_its_name_or_by_that_of_its_furniture(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = room(stack, cupboard(CAN))
    joint, ancestors = stage.platform.belief.joints["right"], stage.platform.ancestors

    def closes(cls: str, name: str) -> bool:
        steps = [action("Lifting"), action(cls, object_acted_on=stage.designator(name))]
        monkeypatch.setattr("executive.ahead.later_steps.remaining_actions", lambda: iter(steps))
        return closed_later(joint, stage.platform.scene, ancestors)

    asked = [("ClosingAContainerArtifact", name) for name in ("right", "case", "left")]
    assert [closes(*one) for one in (*asked, ("OpeningAContainerArtifact", "right"))] == [True, True, False, False]


def test_a_door_that_a_later_step_closes_is_opened_no_farther_than_a_hand_could_close_it(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    stage = room(stack, cupboard(CAN))
    closing = action("ClosingAContainerArtifact", object_acted_on=stage.designator("right"))
    monkeypatch.setattr("executive.ahead.later_steps.remaining_actions", lambda: iter([closing]))
    monkeypatch.setattr(LeafPaths, "moves_on", lambda paths, then, *to: then.belief.joint("right") < 1.35)
    stage.do("OpeningAContainerArtifact", "right")
    assert 1.0 < stage.truth.joint("right") < 1.35


def test_what_a_decision_costs_is_told_once_and_where_nothing_more_is_searched_the_answer_is_as_stated(
    stack: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, searched = Asked(stack), list[object]()
    ahead, state = asked.ahead, asked.stage.platform.belief.state

    def search(scene: object) -> bool:
        searched.append(scene)
        return True

    def decide() -> bool:
        return ahead.finds("it", state, search, otherwise=False)

    assert ahead.decided("what to do", decide)
    assert ahead.decided("what to do", decide)
    assert len(searched) == 1
    assert asked.told == [
        {"event": "looked ahead", "decision": "what to do", "questions": 0, "searches": 1, "checks": 0}
    ]
    monkeypatch.setattr(foresight, "MOST_SEARCHES", 1)
    assert not decide()
    assert ahead.finds("it", state, search)
