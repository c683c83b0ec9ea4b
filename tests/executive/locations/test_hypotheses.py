"""Properties of questions about other states than the believed one: answered alone, and answered once."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import pytest

from executive.locations import Resolver
from planlang.designators import Location, a_location
from planlang.failures import ObjectUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Solution
from planlang.state import WorldState
from tests.executive.conftest import BOTTLE, THE_BOTTLE, Stage
from tests.support.detections import recognise

TO_REACH, TO_SEE = a_location(in_reach_of=THE_BOTTLE), a_location(visible_from=THE_BOTTLE)
ELSEWHERE = Pose((1.5, 0.2, 0.9))


def moved(stage: Stage, y: float = 0.2) -> WorldState:
    """The state in which the bottle stands elsewhere on the cabinet, made anew at each call."""
    return stage.belief.state.placed({"bottle": Pose((1.5, y, 0.9))})


def answers(resolver: Resolver, location: Location = TO_REACH, number: int = 2) -> list[Solution]:
    return list(islice(resolver.bases(location), number))


def test_a_location_resolves_in_another_state_as_it_does_when_that_is_believed(ward: Stage) -> None:
    supposed = answers(ward.resolver.when(moved(ward)))
    recognise(ward.belief, "bottle", BOTTLE.pose, 1.0)  # what is supposed is known as well as it was
    assert [one.base for one in supposed] == [one.base for one in answers(ward.resolver.when(moved(ward)))]
    recognise(ward.belief, "bottle", ELSEWHERE, 1.0)
    assert [one.base for one in supposed] == [one.base for one in answers(ward.resolver)]


def test_what_is_asked_of_another_state_changes_no_answer_about_this_one(ward: Stage) -> None:
    before, believed = answers(ward.resolver), (ward.belief.state, ward.belief.memory)
    there = answers(ward.resolver.when(moved(ward)))
    assert [one.base for one in there] != [one.base for one in before]
    assert all(one is other for one, other in zip(answers(ward.resolver), before, strict=True))
    assert (ward.belief.state, ward.belief.memory) == believed


def test_an_equal_hypothesis_made_anew_is_answered_by_what_was_found_before(ward: Stage) -> None:
    first = answers(ward.resolver.when(moved(ward)))
    assert answers(ward.resolver.when(moved(ward, 0.1))) != first
    again = answers(ward.resolver.when(moved(ward)))
    assert all(one is other for one, other in zip(again, first, strict=True))


def test_all_questions_are_answered_in_the_other_state(ward: Stage) -> None:
    gone = ward.resolver.when(ward.belief.state.placed({"bottle": None}))
    with pytest.raises(ObjectUnresolvable):
        answers(gone)
    here = answers(ward.resolver, TO_SEE, 1)[0].base
    robot = ward.belief.robot
    stands = ward.belief.state.robots[robot]
    turned = ward.belief.state.with_robot(robot, replace(stands, base=(*here[:2], here[2] + 3.0)))
    assert ward.resolver.when(turned).holds(TO_SEE) is False
    assert ward.resolver.when(ward.belief.state.with_robot(robot, replace(stands, base=here))).holds(TO_SEE) is True


def test_a_hypothesis_is_asked_anew_when_something_became_known(ward: Stage) -> None:
    first = answers(ward.resolver.when(moved(ward)), TO_SEE)
    ward.belief.not_seen("bottle", first[0].base)
    assert answers(ward.resolver.when(moved(ward)), TO_SEE)[0].base != first[0].base
