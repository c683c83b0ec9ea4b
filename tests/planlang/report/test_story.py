"""What the story of a run, and the cards of its failures, tell of doors, things and places to stand."""

from __future__ import annotations

import pytest

from planlang.failures import HandleNotReachable, LocationUnresolvable, ObjectNotFound, ObjectNowhereToBeFound
from planlang.report import Told, model_of
from planlang.runs.codec import dump_failure
from planlang.testing import run_plan


def test_a_story_tells_to_whom_a_thing_was_handed() -> None:
    told = Told()
    place = {"step": 1, "event": "belief", "revision": 1, "change": "released", "name": "cup1"}
    told.add(place | {"to": "child1"})
    told.add(place | {"to": None})
    said = [text for _, _, text, kind in model_of(told)["story"] if kind == "belief"]
    assert said == ["The robot hands cup1 to child1.", "The robot lets go of cup1."]


def test_a_story_tells_what_becomes_of_doors_and_devices() -> None:
    changes: list[dict[str, object]] = [
        {"change": "leads", "name": "door1"},
        {"change": "led", "name": "door1", "value": 1.2},
        {"change": "let go", "name": "door1"},
        {"change": "led", "name": "door1", "value": 1.5},
        {"change": "let go", "name": "door1"},
        {"change": "led", "name": "door1", "value": 0.7},
        {"change": "let go", "name": "door1"},
        {"change": "led", "name": "door1", "value": 0.0},
        {"change": "let go", "name": "door1"},
        {"change": "let go", "name": "door3"},
        {"change": "switched", "name": "lamp1", "state": "DeviceStateOff"},
        {"change": "switched", "name": "table1", "state": "Clean"},
        {"change": "stays open", "name": "door2", "because": "the handle is out of reach"},
        {"change": "not seen", "name": "cup1"},
        {"change": "released", "name": "cup1", "to": None},
    ]
    told = Told.of({"event": "belief", "step": step, "revision": step, **one} for step, one in enumerate(changes))
    assert [text for _, _, text, kind in model_of(told)["story"] if kind == "belief"] == [
        "The robot takes door1 by its handle.",
        "door1 stands open.",
        "door1 is opened further.",
        "door1 is partly closed.",
        "door1 is closed.",
        "lamp1 is off.",
        "table1 is clean.",
        "door2 stays open: the handle is out of reach.",
        "The robot lets go of cup1.",
    ]


@pytest.mark.parametrize(
    ("bases", "second"),
    [
        (((1.0, 0.0, 0.0), (2.0, 0.0, 0.0)), "The robot chooses another place to stand: x 2.00 y 0.00 yaw 0.00."),
        (((1.0, 0.0, 0.0), (1.0, 0.0, 0.0)), "The robot tries again from the same place: x 1.00 y 0.00 yaw 0.00."),
    ],
)
def test_a_story_tells_whether_a_place_is_another_one(
    bases: tuple[tuple[float, ...], tuple[float, ...]], second: str
) -> None:
    told = Told()
    started = {"event": "started", "node": 1, "parent": None, "kind": "at_location", "name": "at_location"}
    told.add({"step": 0, **started})
    told.add({"step": 0, "event": "solution", "node": 1, "attempt": 1, "base": [*bases[0]]})
    told.add({"step": 5, "event": "pose failed", "node": 1, "attempt": 1, "base": [*bases[0]]})
    told.add({"step": 5, "event": "solution", "node": 1, "attempt": 2, "base": [*bases[1]]})
    said = [text for _, _, text, kind in model_of(told)["story"] if kind in ("begin", "recovery")]
    assert said == ["The robot chooses a place to stand: x 1.00 y 0.00 yaw 0.00.", second]


def test_what_was_tried_is_neither_a_step_that_went_on_nor_a_further_place_where_there_was_none() -> None:
    failure = {"type": "ObjectUnreachable", "message": "the object cannot be reached: cup1"}
    told = Told.of(
        [
            {"step": 0, "event": "started", "node": 1, "parent": None, "kind": "perform", "name": "PickItUp"},
            {"step": 0, "event": "started", "node": 2, "parent": 1, "kind": "at_location", "name": "at_location"},
            {"step": 0, "event": "no more poses", "node": 2, "attempt": 1, "failure": failure},
            {"step": 0, "event": "ended", "node": 2, "status": "failed", "failure": failure},
            {"step": 9, "event": "ended", "node": 1, "status": "succeeded"},
        ]
    )
    (card,) = model_of(told)["cards"]
    assert [text for _, _, text in card["tried"]] == ["there is no place to stand"]


def test_the_reason_of_a_search_is_told_where_it_caused_another_failure() -> None:
    async def opened() -> None:
        search = LocationUnresolvable(designator="a place", figures="handle1 is too low", counts={"out of reach": 4})
        raise HandleNotReachable("the handle is out of reach", what="drawer1") from search

    run = run_plan(opened)
    told = Told.of(run.events)
    told.add({"step": 0, "event": "performed", "node": 1, "failure": dump_failure(run.failure)})
    (failure,) = model_of(told)["failures"]
    assert failure["headline"] == "handle1 is too low"
    assert failure["chain"][-1]["counts"] == {"out of reach": 4}


def test_a_pose_of_a_hand_is_told_by_from_where_it_comes() -> None:
    told = Told()
    told.add({"step": 0, "event": "started", "node": 1, "parent": None, "kind": "at_location", "name": "at_location"})
    detail = {"arm": "left", "reaches": ["grasp cup1, tilted, heading -3.06"]}
    told.add({"step": 0, "event": "solution", "node": 1, "attempt": 1, "base": [1.0, 0.0, 0.0], "detail": detail})
    (node,) = model_of(told)["nodes"]
    assert node["events"][0][2].endswith("left arm: grasp cup1 at a tilt, heading -3.06")


def test_a_failure_begins_with_its_reason_and_names_what_a_description_by_class_means() -> None:
    failure = {"type": "ObjectUnreachable", "message": "no simple change helps; Cup is too far away", "where": "fetch"}
    told = Told.of(
        [
            {"step": 0, "event": "started", "node": 1, "parent": None, "kind": "branch", "name": "fetch"},
            {"step": 0, "event": "started", "node": 2, "parent": 1, "kind": "perform", "name": "Grasp"},
            {"step": 0, "event": "means", "what": "Cup", "name": "cup1", "within": "fetch/Grasp"},
            {"step": 9, "event": "ended", "node": 2, "status": "failed", "failure": failure},
            {"step": 9, "event": "ended", "node": 1, "status": "failed", "failure": failure},
        ]
    )
    (entry,) = model_of(told)["failures"]
    assert entry["headline"] == "cup1 is too far away; no simple change helps"
    assert entry["chain"][0]["message"] == "no simple change helps; cup1 is too far away"


def test_a_thing_that_was_not_found_is_told_by_where_it_was_looked_for() -> None:
    async def find() -> None:
        raise ObjectNowhereToBeFound("keys1 was not found; looked at: table1", what="keys1") from ObjectNotFound(
            what="keys1"
        )

    (failure,) = model_of(Told.of(run_plan(find).events))["failures"]
    assert failure["headline"] == "keys1 was not found; looked at: table1"
