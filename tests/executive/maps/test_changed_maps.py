"""Maps changed as failures advise: what was to change has changed when the map is read again, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.changed import changed_map
from planlang.advice import Change
from planlang.diagnostics import BadInput
from planlang.ontology import load
from sim import Scene

ROOM = """
Prefix: : <http://example.org/pantry.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/pantry.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: table1
    Types: knowrob:KitchenTable
    Facts: knowrob:translation "1.6 0 0.37", knowrob:heading 90, knowrob:boundingBoxSize "1.2 0.7 0.74"
Individual: cup1
    Types: knowrob:Cup
    Facts: knowrob:relativeTo table1, knowrob:translation "0.1 0.2 0.42", knowrob:boundingBoxSize "0.07 0.07 0.1"
Individual: box1
    Types: knowrob:Box-Container
    Facts: knowrob:translation "1.6 0.4 0.84", knowrob:boundingBoxSize "0.2 0.2 0.2"
Individual: cupboard1
    Types: knowrob:Cupboard
    Facts: knowrob:translation "-2 0 0.9", knowrob:boundingBoxSize "0.4 0.6 1.8", knowrob:properPhysicalParts door1
Individual: door1
    Types: knowrob:Door
    Facts: knowrob:translation "-1.79 0 0.9", knowrob:boundingBoxSize "0.02 0.6 1.8",
        knowrob:properPhysicalParts handle1
Individual: handle1
    Types: knowrob:Handle
    Facts: knowrob:translation "-1.76 0.25 0.9", knowrob:boundingBoxSize "0.04 0.02 0.2"
"""


@pytest.fixture
def room(tmp_path: Path) -> SemanticMap:
    (tmp_path / "pantry.omn").write_text(ROOM)
    return read_map(load(tmp_path / "pantry.omn"))


def changed(room: SemanticMap, *changes: Change) -> Scene:
    """The scene of the changed map."""
    file = room.ontology.documents[0].path
    assert file is not None
    text = changed_map(room, (file,), changes, [])
    return scene_of(read_map(load(file, content=text.encode())))


def others_are_as_before(room: SemanticMap, scene: Scene, *names: str) -> None:
    before = {body.name: body for body in scene_of(room).bodies}
    assert {body.name for body in scene.bodies} | {*names} == set(before)
    for body in scene.bodies:
        if body.name not in names:
            assert body.pose.distance(before[body.name].pose) < 1e-6
            assert body.size == before[body.name].size


def test_a_thing_moves_to_a_place_in_the_frame_of_the_map_whatever_its_pose_was_relative_to(room: SemanticMap) -> None:
    scene = changed(room, Change("translation", (1.4, -0.1, 0.79), "cup1"))
    assert scene.body("cup1").pose.position == pytest.approx((1.4, -0.1, 0.79))
    others_are_as_before(room, scene, "cup1")


def test_what_is_stated_relative_to_a_thing_stays_when_that_is_moved_alone(room: SemanticMap) -> None:
    scene = changed(room, Change("translation", (2.6, 0.0, 0.37), "table1"))
    others_are_as_before(room, scene, "table1")


def test_a_door_is_open_as_far_as_a_change_says(room: SemanticMap) -> None:
    scene = changed(room, Change("jointPosition", 1.0, "door1"))
    joint = next(one for one in scene.joints if one.leaf == "door1")
    assert abs(joint.first) == pytest.approx(1.0)
    others_are_as_before(room, scene, "door1", "handle1")


@pytest.mark.parametrize(("name", "gone"), [("box1", {"box1"}), ("door1", {"door1", "handle1"})])
def test_what_is_absent_is_gone_with_its_parts(room: SemanticMap, name: str, gone: set[str]) -> None:
    scene = changed(room, Change("absent", True, name))
    assert not gone & {body.name for body in scene.bodies}
    others_are_as_before(room, scene, *gone)


def test_a_thing_that_the_map_lacks_is_named(room: SemanticMap) -> None:
    with pytest.raises(BadInput, match="the map has no cup9"):
        changed(room, Change("absent", True, "cup9"))


@pytest.mark.parametrize(
    ("name", "position", "told"),
    [("cup1", 0.5, "cup1 has no joint, so it cannot be put to 0.5"), ("door1", 99.0, "does not get to 99")],
)
def test_a_position_that_would_change_nothing_is_refused(
    room: SemanticMap, name: str, position: float, told: str
) -> None:
    with pytest.raises(BadInput, match=told):
        changed(room, Change("jointPosition", position, name))
