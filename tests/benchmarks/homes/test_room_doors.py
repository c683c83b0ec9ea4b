"""Doors in drawn flats: the map has them closed, with room to open; the witness looks behind them."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

from executive.maps import read_map, scene_of
from planlang.ontology import load
from sim import Scene
from sim.joints import JointKind
from tests.benchmarks.homes.furnishing import Rectangle
from tests.benchmarks.homes.tasks import TEMPLATES, Task, drawn, module_of
from tests.benchmarks.homes.trial import robot_of, write
from tests.benchmarks.homes.witness import Witness

DOOR_TEMPLATES = [name for name in TEMPLATES if module_of(name) == "door_tasks"]


def scene(task: Task, folder: Path) -> Scene:
    """Return the scene of the map of a task."""
    return scene_of(read_map(load(write(task, 0, folder)[1])))


@pytest.fixture(scope="module")
def drawn_doors(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Task, Scene]]:
    """Tasks with doors, and the scenes of their maps."""
    folder = tmp_path_factory.mktemp("doors")
    tasks = [drawn(name, seed) for name in DOOR_TEMPLATES for seed in range(5)]
    return [(task, scene(task, folder)) for task in tasks]


def test_each_door_that_has_to_be_opened_is_closed_hangs_in_its_doorway_and_has_two_handles(
    drawn_doors: list[tuple[Task, Scene]],
):
    kinds = set()
    for task, built in drawn_doors:
        joints = {joint.leaf: joint for joint in built.joints if joint.frame}
        needed = {need.thing for need in task.needs if need.kind == "open"}
        assert needed == joints.keys()
        for joint in joints.values():
            assert (joint.first, len(joint.handles)) == (0.0, 2)
            assert joint.upper > 0.5
            kinds.add(joint.kind)
    assert kinds == set(JointKind)


def test_a_leaf_on_its_way_meets_no_furniture(drawn_doors: list[tuple[Task, Scene]]):
    for task, built in drawn_doors:
        for joint in (one for one in built.joints if one.frame):
            leaf = built.body(joint.leaf)
            for share in (0.3, 0.6, 0.9):
                pose = joint.motion(share * joint.upper) @ leaf.pose
                area = Rectangle(*pose.position[:2], pose.yaw, (leaf.size[0] / 2, leaf.size[1] / 2))
                assert not any(area.overlaps(other) for other in task.home.floor)


def test_a_hinged_door_opens_into_no_hall(drawn_doors: list[tuple[Task, Scene]]):
    for task, built in drawn_doors:
        halls = [area for name, area in task.home.rooms.items() if name.startswith("hall")]
        for joint in (one for one in built.joints if one.frame and one.kind is JointKind.HINGED):
            leaf = built.body(joint.leaf)
            pose = joint.motion(joint.upper) @ leaf.pose
            area = Rectangle(*pose.position[:2], pose.yaw, (leaf.size[0] / 2, leaf.size[1] / 2))
            assert not any(area.overlaps(hall) for hall in halls)


def test_doors_of_one_flat_do_not_meet(drawn_doors: list[tuple[Task, Scene]]):
    for _, built in drawn_doors:
        leaves = [built.body(joint.leaf) for joint in built.joints if joint.frame]
        for one, two in combinations(leaves, 2):
            assert one.pose.distance(two.pose) > 0.3


def test_the_witness_takes_floor_behind_a_door_that_may_be_opened_as_within_reach(
    drawn_doors: list[tuple[Task, Scene]],
):
    task, built = drawn_doors[1]
    witness = Witness(built, robot_of("amigo"))
    try:
        for area in task.home.rooms.values():
            assert (area.distances(witness.floor.cells) == 0).any()
    finally:
        witness.close()
