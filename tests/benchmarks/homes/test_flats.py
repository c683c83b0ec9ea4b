"""Flats that are drawn at random: their rooms are joined by doorways, and the witness says who gets through them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
import pytest

from executive.maps import read_map, scene_of
from planlang.ontology import load
from tests.benchmarks.homes.flats import Flat, flat, person_in_hall
from tests.benchmarks.homes.furnishing import Home, NoRoom
from tests.benchmarks.homes.tasks import TEMPLATES, Need, Task, drawn, module_of
from tests.benchmarks.homes.trial import verdict, write
from tests.benchmarks.homes.witness import Answer, Verdict, is_right_reason

Judged = Callable[[float, str, tuple[str, ...]], Verdict]
FLAT_TEMPLATES = [name for name in TEMPLATES if module_of(name) == "flat_tasks"]


def flats(rooms: int, *, hall: bool) -> list[Flat]:
    """Return ten flats of so many rooms."""
    found = []
    for seed in range(40):
        try:
            found.append(flat(Home(np.random.default_rng(seed)), rooms, hall=hall))
        except NoRoom:
            continue
    return found[:10]


@pytest.mark.parametrize("rooms", [2, 3, 4, 5])
@pytest.mark.parametrize("hall", [False, True])
def test_rooms_share_no_floor_and_each_is_behind_a_doorway(rooms: int, hall: bool):
    found = flats(rooms, hall=hall)
    assert len(found) == 10
    for made in found:
        assert len(made.rooms) == rooms == len(made.parents) + 1
        assert len(made.halls) == int(hall)
        assert made.rooms[0] not in made.halls
        areas = made.home.rooms.values()
        assert not any(one.overlaps(two) for one, two in combinations(areas, 2))


def test_the_map_has_an_opening_in_both_rooms_for_each_doorway(tmp_path: Path):
    for seed in range(5):
        task = drawn("fetch_from_another_room", seed)
        _, home = write(task, seed, tmp_path)
        scene = scene_of(read_map(load(home)))
        doorways = [name for name in task.home.things if name.startswith("doorway")]
        assert sum(len(body.cavities) for body in scene.bodies if body.shape == "room") == 2 * len(doorways)


def test_nothing_stands_before_a_doorway():
    for name in FLAT_TEMPLATES:
        home = drawn(name, 3).home
        doorways = [area for area in home.kept_free if area.half[0] == pytest.approx(0.9)]
        assert not any(area.overlaps(other) for area in doorways for other in home.floor)


def test_the_way_between_two_rooms_passes_the_doorways_between_them():
    made = Flat(Home(np.random.default_rng(0)), ["a", "b", "c", "d"])
    made.parents |= {"b": ("a", "a-b"), "c": ("b", "b-c"), "d": ("b", "b-d")}
    assert made.ways("d") == ["a-b", "b-d"]
    assert made.ways("c", "d") == ["b-d", "b-c"]
    assert made.ways("a", "c") == ["b-c", "a-b"]
    assert made.farthest in ("c", "d")


def test_a_person_in_a_hall_stands_within_its_walls_and_before_no_doorway():
    for made in flats(4, hall=True):
        home, hall = made.home, made.halls[0]
        try:
            person = person_in_hall(home, hall)
        except NoRoom:
            continue
        pose = home.things[person].pose
        assert pose is not None
        assert home.rooms[hall].distances(np.array([pose.position[:2]]))[0] == 0
        assert not any(home.floor[-1].overlaps(area) for area in home.kept_free)


def with_doorways(task: Task, width: float) -> Task:
    """Return a task with all doorways of a width."""
    things = task.home.things
    for name, one in things.items():
        if one.cls == "Doorway" and one.size is not None:
            things[name] = replace(one, size=(one.size[0], width, one.size[2]))
    return task


@pytest.fixture
def judged(tmp_path: Path) -> Judged:
    """Return a function that asks the witness about the task of a seed in a flat with doorways of a width."""

    def verdict_of(width: float, robot: str, kinds: tuple[str, ...]) -> Verdict:
        task = with_doorways(drawn("fetch_from_another_room", EASY), width)
        _, home = write(task, EASY, tmp_path)
        needs = tuple(need for need in task.needs if need.kind in kinds)
        return verdict(replace(task, needs=needs), scene_of(read_map(load(home))), robot)

    return verdict_of


EASY = 4
"""A seed with a row of rooms, the thing at the edge of a table."""


@pytest.mark.parametrize(
    ("robot", "kinds"), [("amigo", ("pass", "grasp", "place")), pytest.param("pr2", ("pass",), marks=pytest.mark.pr2)]
)
def test_an_easy_flat_is_possible(judged: Judged, robot: str, kinds: tuple[str, ...]):
    assert judged(0.95, robot, kinds).answer is Answer.POSSIBLE


@pytest.mark.parametrize(
    ("robot", "width"), [("amigo", 0.62), pytest.param("pr2", 0.62, marks=pytest.mark.pr2), ("panda", 0.45)]
)
def test_a_doorway_that_is_narrower_than_the_base_is_impossible(judged: Judged, robot: str, width: float):
    found = judged(width, robot, ("pass",))
    assert (found.answer, found.kind) == (Answer.IMPOSSIBLE, "too narrow")
    assert found.thing.startswith("doorway")


def test_the_reason_of_a_narrow_doorway_names_it():
    said = {"kind": "too narrow", "thing": "doorway1"}
    assert is_right_reason(said, ("NoWay",), "doorway1 is 0.62 m wide; with empty hands the robot needs 0.72 m")
    assert not is_right_reason(said, ("NoWay",), "doorway2 is 0.62 m wide; with empty hands the robot needs 0.72 m")


def test_needs_of_doorways_are_in_the_order_of_the_way():
    task = drawn("fetch_from_another_room", EASY)
    passed = [need.thing for need in task.needs if need.kind == "pass"]
    assert passed
    places = [task.home.things[name].pose for name in passed]
    assert all(one is not None and two is not None and one.distance(two) < 8.0 for one, two in pairwise(places))
    assert Need("pass", passed[0]) in task.needs
