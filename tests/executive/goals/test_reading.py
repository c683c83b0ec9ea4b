"""Goals name things, classes, states and relations that the map and its world have; others are refused with what is."""

from __future__ import annotations

import pytest

from planlang.diagnostics import BadInput
from tests.executive.goals.conftest import MakeWorld


@pytest.mark.parametrize(
    ("phrase", "code", "message", "help"),
    [
        ("room1 closed", "P012", "room1 has no door, drawer or lid", "there are: cabinet1, cabinet_door1, handle1"),
        ("bottle1 switched on", "P012", "bottle1 is no device", "there is none"),
        ("bottle1 held by table1", "P012", "table1 holds nothing", "a thing is held by: robot"),
        ("robot in reach of bottle1", "P012", "'in reach of' of the robot is nothing that a world decides", "facing"),
        ("bottle1 visible from table1", "P012", "'visible from' of a thing is nothing that a world decides", "near"),
        ("bottle1 near a place on table1", "P012", "a place is no thing: 'near' names one in a goal", "name a thing"),
        ("bottle1 on the bed", "P008", "the map has no Bed-PieceOfFurniture", "it has room1, cabinet1"),
        ("bottle1 contains table1", "P012", "table1 is a thing, not a substance", "write: table1 in bottle1"),
        ("bottel1 on table1", "P002", "unknown thing 'bottel1'", "did you mean 'bottle1'?"),
        ("robot is open", "P012", "of the robot, a goal says where it is", "robot in kitchen1"),
        ("bottle1 is sparkling", "P001", "'sparkling' is neither a state nor a relation", "states: open, closed"),
        ("cup1 cabinet1", "P003", "the goal does not say what has to hold", "held by"),
    ],
)
def test_what_no_world_of_the_map_decides_is_refused(
    make_world: MakeWorld, phrase: str, code: str, message: str, help: str
) -> None:
    with pytest.raises(BadInput) as caught:
        make_world("kitchenette").read(phrase)
    (found,) = caught.value.diagnostics
    assert (found.code, found.message) == (code, f"{phrase!r}: {message}")
    assert help in (found.help or "")


def test_all_wrong_goals_are_named_at_once(make_world: MakeWorld) -> None:
    with pytest.raises(BadInput) as caught:
        make_world("kitchenette").read("bottle1 open", "cabinet1 closed", "bottle7 on table1")
    assert [one.message.partition(":")[0] for one in caught.value.diagnostics] == [
        "'bottle1 open'",
        "'bottle7 on table1'",
    ]


def test_states_are_those_of_the_ontology(make_world: MakeWorld) -> None:
    (goal,) = make_world("kitchenette").read("table1 is Clean")
    assert "Clean" in str(goal.fact)  # type: ignore[attr-defined]
