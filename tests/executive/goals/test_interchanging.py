"""Things that differ in nothing stand for each other in goals, unless a mark tells them apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace

import pytest

from executive.goals import Judge
from executive.goals.reading import read_goals
from executive.maps import MapObject, SemanticMap
from executive.runs.phrases import lexicon_of
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import expand, load
from planlang.state.matter import Portion
from sim import Body, PyBulletWorld, Scene
from sim.likeness import is_like

MAP = "http://example.org/map.owl#"
TABLE = Body("table1", Pose((2.0, 0.0, 0.35)), (0.8, 1.6, 0.7), type="Table-PieceOfFurniture")
SHELF = replace(TABLE, name="table2", pose=Pose((-2.0, 0.0, 0.35)))
CUP = Body("cup1", Pose((2.0, 0.3, 0.75)), (0.08, 0.08, 0.1), "cylinder", type="Cup", movable=True)
OTHER = replace(CUP, name="cup2", pose=Pose((2.0, -0.3, 0.75)))
THIRD = replace(CUP, name="cup3", pose=Pose((2.0, 0.0, 0.75)))
PLACES = {"there": Pose((-2.0, 0.0, 0.75)), "beside": Pose((-2.0, 0.4, 0.75))}

Judged = Callable[..., tuple[str, ...]]


@pytest.fixture
def judged() -> Iterator[Judged]:
    """Says what becomes of goals after some of the things were moved."""
    ontology = load(bundled("ontologies") / "knowrob.omn")
    with ExitStack() as stack:

        def judge(bodies: tuple[Body, ...], goals: tuple[str, ...], **moved: str) -> tuple[str, ...]:
            bodies = (TABLE, SHELF, *bodies)
            things = tuple(
                MapObject(MAP + one.name, one.name, (expand(one.type),), one.pose, one.size) for one in bodies
            )
            there = SemanticMap(MAP, ontology, things, ())
            world = PyBulletWorld(Scene(bodies))
            stack.callback(world.close)
            read = read_goals(goals, lexicon_of(there, ()), there, world.scene)
            judge = Judge(read, world, there)
            for name, place in moved.items():
                world.set_pose(name, PLACES[place])
            return tuple(str(one).removeprefix("goal ") for one in judge.verdicts())

        yield judge


def test_what_is_like_a_named_thing_stands_for_it(judged: Judged) -> None:
    assert judged((CUP, OTHER), ("cup1 on table2",), cup2="there") == (
        "cup1 on table2: holds of cup2, which is like cup1",
    )
    assert judged((CUP, OTHER), ("cup1 on table2",), cup1="there") == ("cup1 on table2: holds",)
    assert judged((CUP, OTHER), ("cup1 on table2",)) == ("cup1 on table2: does not hold: cup1 is on table1",)


@pytest.mark.parametrize(
    "changed",
    [
        {"mark": "Ann"},
        {"colour": "red"},
        {"size": (0.08, 0.08, 0.13)},
        {"type": "DrinkingBottle"},
        {"content": (Portion("Water", 50.0),)},
    ],
)
def test_what_differs_in_something_does_not(judged: Judged, changed: dict[str, object]) -> None:
    other = replace(OTHER, **changed)  # type: ignore[arg-type]
    (verdict,) = judged((CUP, other), ("cup1 on table2",), cup2="there")
    assert verdict == "cup1 on table2: does not hold: cup1 is on table1"
    assert judged((replace(CUP, **changed), other), ("cup1 on table2",), cup2="there")[0].endswith("like cup1")  # type: ignore[arg-type]


def test_one_thing_does_not_stand_for_two(judged: Judged) -> None:
    goals = ("cup1 on table2", "cup2 on table2")
    assert judged((CUP, OTHER), goals, cup2="there") == (
        "cup1 on table2: does not hold: cup1 is on table1",
        "cup2 on table2: holds",
    )
    assert judged((CUP, OTHER, THIRD), goals, cup2="there", cup3="beside") == (
        "cup1 on table2: holds of cup3, which is like cup1",
        "cup2 on table2: holds",
    )


def test_all_goals_about_a_thing_are_about_the_same_one(judged: Judged) -> None:
    goals = ("cup1 on table2", "cup1 is empty", "cup1 not on table1")
    assert judged((CUP, OTHER), goals, cup2="there") == tuple(
        f"{one}: holds of cup2, which is like cup1" for one in goals
    )


def test_what_was_so_before_or_shall_not_be_so_is_nothing_that_another_thing_brings_about(judged: Judged) -> None:
    there = replace(OTHER, pose=PLACES["there"])
    assert judged((CUP, there), ("cup1 on table2",)) == ("cup1 on table2: does not hold: cup1 is on table1",)
    assert judged((CUP, OTHER), ("cup1 not on table2",), cup1="there") == (
        "cup1 not on table2: does not hold: cup1 is on table2",
    )


def test_what_a_goal_refers_to_is_the_thing_itself(judged: Judged) -> None:
    near = ("cup1 within 60 cm of cup2",)
    assert judged((CUP, OTHER, THIRD), near, cup1="there", cup3="beside") == (
        "cup1 within 60 cm of cup2: does not hold: cup1 is on table2, not on table1 as cup2 is",
    )


def test_furniture_is_told_by_its_place() -> None:
    assert is_like(TABLE, SHELF)
    assert not is_like(TABLE, CUP)
