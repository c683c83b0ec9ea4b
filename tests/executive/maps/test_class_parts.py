"""Parts stated by class models, at the same poses in each instance."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from executive.maps import SemanticMap, read_map, scene_of
from planlang.ontology import load

Write = Callable[..., str]
Read = Callable[..., SemanticMap]
BOX = (0.4, 0.8, 0.8)
MODEL = """
Class: Locker
    SubClassOf: knowrob:Cabinet-PieceOfFurniture, knowrob:properPhysicalParts some LockerDoor
Class: LockerDoor
    SubClassOf: knowrob:Door, knowrob:properPhysicalParts some LockerHandle, knowrob:orientation value door_place,
        knowrob:depthOfObject value 0.02, knowrob:widthOfObject value 0.8, knowrob:heightOfObject value 0.8
Class: LockerHandle
    SubClassOf: knowrob:Handle, knowrob:orientation value handle_place,
        knowrob:depthOfObject value 0.03, knowrob:widthOfObject value 0.02, knowrob:heightOfObject value 0.1
Individual: door_place
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.21 0 0", knowrob:quaternion "0 0 0 1", knowrob:relativeTo {door_frame}
Individual: handle_place
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.02 0.3 0", knowrob:quaternion "0 0 0 1", knowrob:relativeTo LockerDoor
"""
TURNED = (0, -1, 0, 1, 0, 0, 0, 0, 1)


@pytest.fixture
def locker(thing: Write) -> Callable[..., str]:
    """Writes the frame of an instance of the class."""

    def write(name: str, *facts: str) -> str:
        return thing(name, "Cabinet-PieceOfFurniture", BOX, *facts).replace("Types: ", "Types: Locker, ")

    return write


def test_each_instance_has_the_parts_of_its_class_where_the_class_has_them(
    map_of: Read, locker: Write, seen: Write
) -> None:
    semantic_map = map_of(
        MODEL.format(door_frame="Locker"),
        *(locker(name) for name in ("one", "two")),
        seen("one", (1, 0, 0.4)),
        seen("two", (0, 3, 0.4), TURNED),
    )
    places = {thing.name: thing.pose for thing in semantic_map.objects}
    for name, pose in places.items():
        assert pose, name
    assert places["one_LockerDoor"].position == pytest.approx((1.21, 0, 0.4))  # type: ignore[union-attr]
    assert places["one_LockerHandle"].position == pytest.approx((1.23, 0.3, 0.4))  # type: ignore[union-attr]
    assert places["two_LockerHandle"].position == pytest.approx((-0.3, 3.23, 0.4))  # type: ignore[union-attr]
    assert abs(places["two_LockerDoor"].yaw) == pytest.approx(math.pi / 2)  # type: ignore[union-attr]
    assert [d.code for d in semantic_map.diagnostics] == ["M026", "M026"]
    joints = {joint.leaf: joint.handle for joint in scene_of(semantic_map).joints}
    assert joints == {"one_LockerDoor": "one_LockerHandle", "two_LockerDoor": "two_LockerHandle"}


def test_a_part_of_the_map_is_not_duplicated_and_gets_a_pose_if_it_has_none(
    map_of: Read, locker: Write, thing: Write, seen: Write
) -> None:
    door = thing("door1", "Door", (0.02, 0.8, 0.8)).replace("Types: ", "Types: LockerDoor, ")
    frames = [MODEL.format(door_frame="Locker"), locker("one", "properPhysicalParts door1"), door]
    placed = map_of(*frames, seen("one", (1, 0, 0.4)), seen("door1", (1.2, 0, 0.4)))
    poses = {one.name: one.pose.position for one in placed.objects if one.pose}
    assert poses == {
        "one": (1, 0, 0.4),
        "door1": (1.2, 0, 0.4),
        "door1_LockerHandle": pytest.approx((1.22, 0.3, 0.4)),
    }
    without = map_of(*frames, seen("one", (1, 0, 0.4)))
    assert [thing.name for thing in without.objects] == ["one", "door1", "one_LockerHandle"]
    door1 = without.find("door1")
    assert door1
    assert door1.pose
    assert door1.pose.position == pytest.approx((1.21, 0, 0.4))


@pytest.mark.parametrize("frame", ["door_place", "handle_place", "LockerDoor", "nothing_at_all"])
def test_poses_of_a_class_that_lead_nowhere_give_no_parts(frame: str, map_of: Read, locker: Write, seen: Write) -> None:
    semantic_map = map_of(MODEL.format(door_frame=frame), locker("one"), seen("one", (1, 0, 0.4)))
    assert [thing.name for thing in semantic_map.objects] == ["one"]


def test_a_class_that_is_a_part_of_itself_ends(map_of: Read, locker: Write, seen: Write) -> None:
    itself = "some LockerHandle, knowrob:properPhysicalParts some LockerDoor"
    model = MODEL.format(door_frame="Locker").replace("some LockerHandle", itself)
    semantic_map = map_of(model, locker("one"), seen("one", (1, 0, 0.4)))
    assert len(semantic_map.objects) <= 10


def test_a_real_model_gives_each_of_two_shelves_its_doors_and_handles(
    corpus: Path, map_of: Read, thing: Write, seen: Write, tmp_path: Path
) -> None:
    model = "http://knowrob.org/kb/knowrob_rel_coord_test.owl#IkeaExpedit2x2"
    shelves = [thing(name, "X", BOX).replace("knowrob:X", f"<{model}>") for name in ("one", "two")]
    map_of(*shelves, seen("one", (1, 2, 0.4)), seen("two", (-1, 2, 0.4)))
    also = [corpus / "objects" / "knowrob_rel_coord_test@hydro.owl"]
    semantic_map = read_map(load(tmp_path / "map.omn", also=also))
    doors = [thing for thing in semantic_map.objects if "_IkeaExpeditDoor" in thing.name and "Handle" not in thing.name]
    assert len(doors) == 8
    assert sorted(round(door.pose.position[0], 2) for door in doors if door.pose) == [-1.2] * 4 + [0.8] * 4
