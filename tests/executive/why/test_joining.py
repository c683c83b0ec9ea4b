"""Changes that are tried together: they say nothing else of the same, and what they move fits together."""

from __future__ import annotations

import pytest

from executive.why.candidates import Candidate
from executive.why.joining import can_be_joined, followed, pair
from planlang.advice import Change
from planlang.geometry import Pose
from sim import Body, Scene
from tests.support.failed_situation import BOX, CUP, SCENE, TABLE


def moved(name: str, *places: tuple[float, float, float]) -> Candidate:
    """A thing that is moved; of several places to one side the farthest is last."""
    *less, last = (Candidate((Change("translation", place, name),), "thing moved", 4.0) for place in places)
    return Candidate(last.changes, "thing moved", 4.0, smaller=tuple(less))


def test_two_actions_may_come_before_but_not_the_same_one_twice() -> None:
    doors = [Candidate((Change("before", f"OpeningAContainerArtifact door{n}"),), "before", 2.0) for n in (1, 2)]
    assert can_be_joined(*doors)
    assert not can_be_joined(doors[0], doors[0])


def test_a_later_advice_on_the_same_thing_replaces_the_earlier_one() -> None:
    near, nearer = (Candidate((Change("translation", (x, 0.0, 0.79), "cup1"),), "advice", 4.0) for x in (2.0, 2.1))
    found = followed(near, nearer, SCENE)
    assert (found.changes, round(found.cost, 6), found.parts) == (nearer.changes, 5.0, ())
    away = Candidate((*near.changes, Change("absent", True, "box1")), "advice", 9.0)
    assert followed(away, nearer, SCENE).changes == (away.changes[1], *nearer.changes)


def test_two_things_are_not_moved_to_the_same_place() -> None:
    middle = (1.9, 0.1, 0.79)
    assert pair(moved("cup1", middle), moved("box1", middle), SCENE) is None
    assert pair(moved("cup1", middle), moved("box1", (1.9, 0.3, 0.79)), SCENE) is not None


def test_a_thing_may_come_to_where_another_one_was() -> None:
    apart = Scene((TABLE, CUP, BOX))
    joined = pair(moved("box1", (1.9, 0.4, 0.79)), moved("cup1", (1.9, 0.2, 0.79)), apart)
    assert joined is not None


def test_of_the_moves_to_one_side_those_that_fit_are_kept() -> None:
    near, far = (1.9, 0.05, 0.79), (1.9, 0.1, 0.79)
    joined = pair(moved("box1", (1.9, 0.19, 0.79)), moved("cup1", near, far), Scene((TABLE, CUP, BOX)))
    assert joined is not None
    assert [one.changes[1].value for one in (*joined.smaller, joined)] == [near, far]
    closer = pair(moved("box1", (1.9, 0.17, 0.79)), moved("cup1", near, far), Scene((TABLE, CUP, BOX)))
    assert closer is not None
    assert [one.changes[1].value for one in (*closer.smaller, closer)] == [near]


@pytest.mark.parametrize(
    "other", [Change("absent", True, "shelf1"), Change("translation", (1.9, -0.4, 0.92), "shelf1")]
)
def test_nothing_is_moved_onto_what_is_not_there_any_more(other: Change) -> None:
    shelf = Body("shelf1", Pose((1.9, 0.0, 0.92)), (0.2, 0.2, 0.02))
    scene = Scene((TABLE, CUP, shelf))
    onto, away = moved("cup1", (1.9, 0.0, 0.99)), Candidate((other,), "away", 5.0)
    assert pair(onto, away, scene) is None
    assert pair(away, onto, scene) is None


def test_what_was_advised_after_a_change_is_left_out_if_both_do_not_fit() -> None:
    middle = (1.9, 0.1, 0.79)
    assert followed(moved("cup1", middle), moved("box1", middle), SCENE) is None
