"""Things that look alike: by what a thing that is meant was taken for what a picture shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from executive.belief import Belief
from planlang.designators import an_object
from planlang.protocols import Detection
from tests.executive.belief.test_association import BODIES, MAP, at, bottle
from tests.executive.belief.test_association import made as made
from tests.executive.belief.test_association import ontology as ontology

HERE = (0.0, 0.0, 0.0)
BOTTLES = {one.name: one for one in BODIES if one.name.startswith("bottle")}


def told(belief: Belief, *looks: list[Detection], named: str = "bottle1") -> list[Mapping[str, Any]]:
    """What the listener of a belief is told of things alike while the camera shows some, if a plan names one."""
    heard: list[Mapping[str, Any]] = []
    belief.bind(an_object("DrinkingBottle", MAP + named), HERE)
    belief.tell = lambda event, details: heard.append({"event": event, **details})
    for shown in looks:
        belief.see(shown)
    return [one for one in heard if one["change"] == "alike"]


def labelled(x: float, y: float, label: str | None, visible: float = 1.0) -> Detection:
    """A bottle with a mark, as far as that can be read."""
    return replace(bottle(x, y, visible), label=label)


def test_of_two_that_nothing_distinguishes_the_one_nearest_to_its_place_is_taken_and_told(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    (one,) = told(belief, [bottle(2.0, 0.25), bottle(2.0, -0.3)])
    assert (one["name"], one["others"], one["by"]) == ("bottle1", ["bottle2"], "its place")
    assert belief.pose("bottle1") == at(2.0, 0.25)
    assert belief.alike("bottle1").same == ("bottle2",)


def test_it_is_told_again_from_another_place_only(made) -> None:  # type: ignore[no-untyped-def]
    belief, shown = made(), [bottle(2.0, 0.2), bottle(2.0, -0.2)]
    assert len(told(belief, shown, shown)) == 1
    belief.base_moved()
    assert len(told(belief, shown, shown)) == 1


def test_a_thing_that_no_plan_means_is_told_of_nothing(made) -> None:  # type: ignore[no-untyped-def]
    assert not told(made(), [bottle(2.0, 0.25), bottle(2.0, -0.3)], named="bottle2")[1:]
    assert told(made(), [bottle(2.0, 0.25), bottle(2.0, -0.3)], named="bottle2")[0]["name"] == "bottle2"


def test_what_is_beyond_the_gate_or_of_another_size_is_no_other(made) -> None:  # type: ignore[no-untyped-def]
    assert not told(made(replace(BOTTLES["bottle2"], pose=at(2.0, 4.0))), [bottle(2.0, 0.3), bottle(2.0, 4.0)])
    assert not told(made(replace(BOTTLES["bottle2"], size=(0.1, 0.1, 0.3))), [bottle(2.0, 0.3)])


def test_one_that_is_believed_within_the_gate_and_not_seen_is_another(made) -> None:  # type: ignore[no-untyped-def]
    (one,) = told(made(), [bottle(2.0, 0.3)])
    assert (one["others"], one["by"]) == (["bottle2"], "its place")


@pytest.mark.parametrize(("feature", "by"), [("mark", "its mark"), ("colour", "its colour")])
def test_a_mark_or_a_colour_decides_if_it_is_read(made, feature: str, by: str) -> None:  # type: ignore[no-untyped-def]
    belief = made(*(replace(one, **{feature: name}) for name, one in BOTTLES.items()))
    read = {"mark": "label"}.get(feature, feature)
    looks = [replace(bottle(2.0, -0.3), **{read: "bottle1"}), replace(bottle(2.0, 0.3), **{read: "bottle2"})]
    (one,) = told(belief, looks)
    assert one["by"] == by
    assert belief.pose("bottle1") == at(2.0, -0.3)
    assert not belief.alike("bottle1").same


def test_a_mark_that_both_show_does_not_decide(made) -> None:  # type: ignore[no-untyped-def]
    belief = made(*(replace(one, mark="water") for one in BOTTLES.values()))
    (one,) = told(belief, [labelled(2.0, 0.3, "water"), labelled(2.0, -0.3, "water")])
    assert one["by"] == "its place"


def test_a_mark_that_cannot_be_read_has_to_be_read_by_a_closer_look(made) -> None:  # type: ignore[no-untyped-def]
    belief = made(replace(BOTTLES["bottle1"], mark="water"))
    hidden, other = labelled(2.0, 0.3, None, 0.2), labelled(2.0, 0.1, None, 0.2)
    (one,) = told(belief, [hidden, other])
    assert one["by"] is None
    belief.not_seen("bottle1", HERE)
    belief.base_moved()
    (one,) = told(belief, [labelled(2.0, 0.3, None), labelled(2.0, 0.1, "water")])
    assert one["by"] == "a closer look"
    assert belief.pose("bottle1") == at(2.0, 0.1)


def test_what_has_not_the_mark_of_a_thing_that_is_missed_is_listed(made) -> None:  # type: ignore[no-untyped-def]
    belief = made(replace(BOTTLES["bottle1"], mark="water"))
    belief.see([bottle(2.0, 0.3), bottle(2.0, 0.1), bottle(2.0, -0.3)])
    assert belief.without_mark("bottle1") == ("bottle#3", "bottle#4")
    assert belief.without_mark("bottle2") == ()


def test_which_comes_first_in_a_picture_does_not_matter_to_what_was_seen(made) -> None:  # type: ignore[no-untyped-def]
    """Two socks of which a detector ranks now the one first, now the other (innate-inc/innate-os, pull 719)."""
    belief = made()
    belief.see([bottle(2.0, 0.11), bottle(2.0, -0.11)])
    for step in range(1, 20):
        x = 2.0 + 0.004 * step
        shown = [bottle(x, 0.11), bottle(x, -0.11)]
        belief.see(shown if step % 2 else shown[::-1])
    assert (belief.pose("bottle1").position[1], belief.pose("bottle2").position[1]) == (0.11, -0.11)


def test_all_that_is_displaced_alike_by_slip_is_what_it_was(made) -> None:  # type: ignore[no-untyped-def]
    """A can that a last picture showed elsewhere became a new entity (tue-robotics/tue_robocup, issue 139)."""
    belief = made()
    belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3)])
    assert list(belief.see([bottle(2.1, 0.65), bottle(2.1, 0.05)])) == ["bottle1", "bottle2"]
    assert (belief.pose("bottle1"), belief.pose("bottle2")) == (at(2.1, 0.65), at(2.1, 0.05))
