"""Homes of the tasks that robots fell short of: what is special of each is in its map, and the witness knows it."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from executive.maps import read_map, scene_of
from planlang.ontology import load
from sim import Scene
from sim.truth import tilt
from tests.benchmarks.homes.furnishing import Rectangle
from tests.benchmarks.homes.tasks import Task, drawn
from tests.benchmarks.homes.trial import robot_of, verdict, write
from tests.benchmarks.homes.witness import Answer, is_right_reason, suited_to


def scene(task: Task, folder: Path) -> Scene:
    """Return the scene of the map of a task."""
    return scene_of(read_map(load(write(task, 0, folder)[1])))


def test_a_pot_has_two_handles_and_water_and_takes_two_hands(tmp_path: Path):
    for seed in range(4):
        body = scene(drawn("pot_with_water", seed), tmp_path).body("pot1")
        assert (body.hands, len(body.handles)) == (2, 2)
        assert sum(one.amount for one in body.content) >= 300.0


def test_two_hands_are_asked_for_what_two_hands_carry():
    suits = suited_to(robot_of("amigo"))
    assert any(suits(drawn("pot_with_water", seed)) for seed in range(4))


def test_a_robot_with_one_hand_cannot_hold_two_things_or_a_pot(tmp_path: Path):
    for name, thing in (("two_in_two_hands", ""), ("pot_with_water", "pot1")):
        task = drawn(name, 0, suited_to(robot_of("panda")))
        found = verdict(task, scene(task, tmp_path), "panda")
        assert (found.answer, found.kind) == (Answer.IMPOSSIBLE, "no hand")
        assert thing in found.thing


def test_the_reason_of_a_missing_hand_says_how_many_hands_it_takes():
    said = {"kind": "no hand", "thing": "can1"}
    assert is_right_reason(said, (), "can1 cannot be taken too: the robot has one hand, and it holds cup1")
    assert not is_right_reason(said, (), "no hand holds anything to put down; grasp can1 first")


def test_a_lying_bottle_lies_on_its_table(tmp_path: Path):
    for seed in range(4):
        task = drawn("lying_bottle", seed)
        body = scene(task, tmp_path).body("bottle1")
        table = next(need.at for need in task.needs if need.kind == "place")
        assert tilt(body.pose) == pytest.approx(math.pi / 2, abs=1e-3)
        under = [one for one in task.home.surfaces.values() if one.owner != table]
        lowest = body.pose.position[2] - body.size[0] / 2
        assert any(lowest == pytest.approx(one.height, abs=0.01) for one in under)


def test_cupboards_beside_drawers_touch_no_drawer_and_are_near():
    for seed in range(4):
        home = drawn("from_drawer_to_cupboard", seed).home
        boxes = []
        for name in ("chest1", "cupboard1"):
            thing = home.things[name]
            assert thing.pose is not None
            assert thing.size is not None
            x, y, _ = thing.pose.position
            boxes.append(Rectangle(x, y, thing.pose.yaw, (thing.size[0] / 2, thing.size[1] / 2)))
        assert not boxes[0].overlaps(boxes[1])
        assert boxes[0].distances(boxes[1].corners()).min() < 0.04


def test_the_only_cups_are_those_that_are_brought():
    for seed in range(6):
        task = drawn("while_a_cup_is_seen", seed)
        cups = {name for name, one in task.home.things.items() if one.cls == "Cup"}
        assert cups == {need.thing for need in task.needs if need.kind == "grasp"}


def test_a_loop_over_any_cup_names_no_cup():
    task = drawn("while_a_cup_is_seen", 0)
    assert "some knowrob:Cup" in task.recipe
    assert "cup1" not in task.recipe
