"""Answers are kept exactly as long as what they depend on: the belief, and where the robot is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import islice, pairwise

import pytest

from executive.locations import Rejections
from executive.locations.resolver import MOST, Answers
from planlang.designators import Location, a_location, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Configuration, Detection, Solution
from tests.executive.conftest import BOTTLE, THE_BOTTLE, Stage, hold_bottle

TO_REACH, TO_SEE = a_location(in_reach_of=THE_BOTTLE), a_location(visible_from=THE_BOTTLE)
NOWHERE = a_location(in_reach_of=THE_BOTTLE, near=an_object("Bed-PieceOfFurniture"))


@pytest.fixture
def searched(ward: Stage, monkeypatch: pytest.MonkeyPatch) -> list[Location]:
    """The locations that were searched for, not looked up."""
    found: list[Location] = []
    search = ward.resolver._bases

    def counted(location: Location, log: Rejections) -> Iterator[Solution]:
        found.append(location)
        return search(location, log)

    monkeypatch.setattr(ward.resolver, "_bases", counted)
    return found


def ask(stage: Stage, location: Location = TO_REACH, number: int = 2) -> list[Solution]:
    """The first places, as a plan asks for them."""
    stage.platform.sync()
    return list(islice(stage.resolver.bases(location), number))


def test_what_was_asked_before_is_not_searched_for_again(ward: Stage, searched: list[Location]) -> None:
    first = ask(ward)
    assert ask(ward) == first
    assert ask(ward, number=4)[:2] == first, "more of it goes on where it ended"
    ask(ward, TO_SEE)
    assert ask(ward) == first
    assert searched == [TO_REACH, TO_SEE]


def test_a_failure_is_kept_too(ward: Stage, searched: list[Location]) -> None:
    told = []
    for _ in range(2):
        with pytest.raises(LocationUnresolvable) as caught:
            ask(ward, NOWHERE)
        told.append((str(caught.value), dict(caught.value.counts)))
    assert told[0] == told[1]
    assert searched == [NOWHERE]


def turn_head(stage: Stage) -> None:
    now = stage.truth.configuration()
    stage.truth.set_configuration(Configuration(now.base, {**now.joints, "neck_pan_joint": 0.3}))


def drive(stage: Stage) -> None:
    now = stage.truth.configuration()
    stage.truth.set_configuration(Configuration((-0.3, 0.2, 1.0), now.joints))


CHANGES: dict[str, Callable[[Stage], None]] = {
    "a thing is seen elsewhere": lambda stage: stage.belief.see([Detection("bottle", Pose((1.5, 0.2, 0.9)), 1.0)]),
    "a thing is felt": lambda stage: stage.belief.bump("bed", Pose((-2.5, 0.1, 0.275))),
    "a thing is looked for in vain": lambda stage: stage.belief.not_seen("bottle", (0.5, 0.0, 0.0)),
    "a hand holds it": hold_bottle,
    "the robot drives": drive,
    "the robot turns its head": turn_head,
}


@pytest.mark.parametrize("change", CHANGES)
def test_they_are_searched_for_anew_when(change: str, ward: Stage, searched: list[Location]) -> None:
    ask(ward)
    CHANGES[change](ward)
    ask(ward)
    ask(ward)
    assert searched == [TO_REACH, TO_REACH]


def test_what_is_seen_where_it_was_changes_nothing(ward: Stage, searched: list[Location]) -> None:
    first = ask(ward)
    ward.belief.see([Detection("bottle", BOTTLE.pose, 1.0)])
    ward.belief.see([Detection("bottle", BOTTLE.pose, 1.0)])
    revision = ward.belief.revision
    assert [place.base for place in ask(ward)] == [place.base for place in first]
    ward.belief.see([Detection("bottle", BOTTLE.pose, 1.0)])
    assert ward.belief.revision == revision


def test_no_two_places_are_at_one_point(ward: Stage) -> None:
    for location in (TO_REACH, TO_SEE, a_location(near=an_object("Bed-PieceOfFurniture"))):
        found = ask(ward, location, 12)
        for before, after in pairwise(found):
            assert (before.base[0] - after.base[0]) ** 2 + (before.base[1] - after.base[1]) ** 2 > 0.05**2
        assert len({place.base[:2] for place in found}) == 12


def test_an_interrupted_search_begins_anew_and_few_questions_are_kept() -> None:
    answers: Answers[int] = Answers()
    begun: list[str] = []

    def count(name: str, stop: int) -> Iterator[int]:
        begun.append(name)
        for number in range(5):
            if number == stop and begun.count(name) == 1:
                raise KeyboardInterrupt
            yield number

    with pytest.raises(KeyboardInterrupt):
        list(answers.of("a", 1, lambda: count("a", 3)))
    assert list(answers.of("a", 1, lambda: count("a", 3))) == [0, 1, 2, 3, 4]
    assert begun == ["a", "a"]
    for number in range(MOST):
        list(answers.of(number, 1, lambda: count("b", 9)))
    list(answers.of("a", 1, lambda: count("a", 9)))
    assert begun.count("a") == 3, "the oldest was forgotten"
