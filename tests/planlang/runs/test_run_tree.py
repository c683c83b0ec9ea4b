"""The tree of a run: its nodes, what happened in them, and how the belief changed."""

from __future__ import annotations

from typing import Any

import pytest

from planlang import Trace, VirtualHost, action, at_location, perform, run
from planlang.designators import a_location, an_object
from planlang.failures import ManipulationPoseUnreachable
from planlang.runs import RunTree
from planlang.runs.run_tree import Changes, with_names
from planlang.testing.script import Script
from planlang.testing.scripted import ScriptedExecutive

CUP = an_object("Cup", "http://example.org/k.owl#cup1")


def tree_of(script: Script) -> RunTree:
    """The tree of a run that grasps a cup."""

    async def grasp() -> None:
        await perform(action("Reaching", to_location=a_location(in_center_of=CUP)))
        await perform(action("ClosingAGripper", object_acted_on=CUP))

    async def fetch() -> None:
        await at_location(a_location(in_reach_of=CUP), grasp)

    trace: Trace = Trace()
    run(fetch, host=VirtualHost(), executive=ScriptedExecutive(script), trace=trace)
    return RunTree(trace.events)


def events(tree: RunTree, kind: str) -> list[list[Any]]:
    """What happened in the nodes of a kind, beside the resources that they took."""
    return [
        [one.event for one in node.happened if one.event not in ("acquired", "released", "request")]
        for node in tree.numbered.values()
        if node.kind == kind
    ]


def test_a_node_tells_what_happened_in_it() -> None:
    script = Script().on("Reaching", fails=ManipulationPoseUnreachable, times=1)
    (happened,) = events(tree_of(script), "at_location")
    assert happened == ["solution", "pose failed", "solution"]


def test_the_tree_tells_how_the_belief_changed() -> None:
    tree = tree_of(Script())
    (change,) = tree.belief
    assert (change.event, change.details["holding"]) == ("belief", ["cup1"])
    assert change.step == tree.roots[0].ended


def test_a_node_is_within_those_around_it() -> None:
    tree = tree_of(Script())
    (root,) = tree.roots
    grasp = next(node for node in tree.numbered.values() if node.action == "Reaching")
    assert grasp.within(root)
    assert not root.within(grasp)
    assert not root.within(root)


@pytest.mark.parametrize(
    ("details", "text"),
    [
        (
            {"change": "switched", "name": "stove1", "state": "http://knowrob.org/kb/knowrob.owl#DeviceStateOn"},
            "stove1 on",
        ),
        ({"change": "moved", "name": "door1", "value": 0.01}, "door1 closed"),
        ({"change": "led", "name": "door1", "value": 0.0}, "door1 closed"),
        ({"change": "released", "name": "cup1", "to": "patient1"}, "cup1 handed to patient1"),
        ({"change": "leads", "name": "door1"}, "door1 held by its handle"),
        ({"change": "seen", "name": "cup1"}, "cup1 seen"),
        (
            {"change": "alike", "name": "cup1", "others": ["cup2"], "by": "its mark"},
            "cup1 is one of two alike, taken by its mark",
        ),
        (
            {"change": "alike", "name": "cup1", "others": ["cup2", "cup3", "cup#4", "cup#5"], "by": None},
            "cup1 is one of 5 alike, and its mark cannot be read from here",
        ),
        ({}, "something changed"),
    ],
)
def test_a_change_of_the_belief_is_told_in_words(details: dict[str, Any], text: str) -> None:
    assert Changes().text(details) == text


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ((0.2, 0.7), [None, "door1 being opened", "door1 released, open"]),
        ((1.2, 0.4), [None, "door1 being closed", "door1 released, open"]),
        ((0.4, 0.01), [None, "door1 closed", "door1 released"]),
    ],
)
def test_a_door_in_the_hand_is_said_to_be_opened_or_closed(values: tuple[float, ...], texts: list[str]) -> None:
    changes = Changes()
    told = [changes.text({"change": "led", "name": "door1", "value": value}) for value in values]
    assert [*told, changes.text({"change": "let go", "name": "door1"})] == texts


def test_what_a_description_means_in_a_step_is_told_by_its_name() -> None:
    tree = RunTree()
    what = "Cup that is on(table1)"
    tree.add({"step": 0, "event": "started", "node": 1, "parent": None, "kind": "plan", "name": "tidy"})
    tree.add({"step": 0, "event": "means", "what": what, "name": "cup2", "within": "tidy/Bring"})
    for number, name in ((2, "Bring"), (3, "Bring#2")):
        tree.add({"step": 0, "event": "started", "node": number, "parent": 1, "kind": "perform", "name": name})
    tree.add({"step": 1, "event": "means", "what": "Cup", "name": "cup3", "within": "tidy/Bring"})
    asked = f"Bring(what={what}, by=in_front_of(Cup), to=Cupboard)"
    assert tree.numbered[2].named(asked) == "Bring(what=cup2, by=in_front_of(cup3), to=Cupboard)"
    assert tree.numbered[3].named(asked) == asked


def test_a_description_that_begins_as_another_one_keeps_its_own_name() -> None:
    assert with_names("Cup that is on(a), Cup", {"Cup": "cup1"}) == "Cup that is on(a), cup1"


def test_a_text_without_a_description_stays_as_it_is() -> None:
    assert with_names("Tray", {"Cup": "cup1"}) == "Tray"


def test_a_damaged_record_of_what_is_meant_tells_nothing() -> None:
    tree = RunTree()
    tree.add({"step": 0, "event": "started", "node": 1, "parent": None, "kind": "plan", "name": "tidy"})
    tree.add({"step": 0, "event": "means", "what": "Cup", "name": None, "within": ""})
    assert tree.roots[0].named("Cup") == "Cup"


def test_a_door_that_was_seen_open_is_said_to_be_opened_further() -> None:
    changes = Changes()
    assert changes.text({"change": "seen", "name": "door1", "value": 0.2}) == "door1 seen"
    assert changes.text({"change": "led", "name": "door1", "value": 0.7}) == "door1 being opened"
