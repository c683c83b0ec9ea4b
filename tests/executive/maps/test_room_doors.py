"""Doors between rooms as maps state them: where they hang, how they open, and what they lack."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.maps import scene_of
from planlang.diagnostics import Diagnostic
from sim import Scene
from sim.joints import Articulation, JointKind
from tests.support.room_doors import RoomDoor


def read(door: RoomDoor, folder: Path) -> tuple[Scene, list[Diagnostic]]:
    """The scene of a door, and what was noticed."""
    notes: list[Diagnostic] = []
    return scene_of(door.map(folder), notes), notes


def opened(door: RoomDoor, folder: Path) -> tuple[Articulation, tuple[float, float]]:
    """The joint of a door about which nothing was noticed, and where the middle of the open leaf is."""
    scene, notes = read(door, folder)
    assert notes == []
    (joint,) = scene.joints
    x, y, _ = (joint.motion(joint.upper) @ scene.body("door").pose).position
    return joint, (x, y)


def code(door: RoomDoor, folder: Path) -> str:
    """The code of the only diagnostic about a door, which names its line."""
    _, (found,) = read(door, folder)
    assert found.span is not None
    assert found.help
    return found.code


@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("opens", [-1.0, 1.0])
def test_a_door_in_a_doorway_hinges_opposite_its_handles_and_opens_along_its_box(
    tmp_path: Path, side: float, opens: float
) -> None:
    joint, (x, y) = opened(RoomDoor(side=side, opens=opens), tmp_path)
    assert joint.kind is JointKind.HINGED
    assert joint.point[:2] == pytest.approx((0.05, 0.44 * side))
    assert (x, y) == pytest.approx((0.05 + 0.44 * opens, 0.44 * side), abs=1e-3)
    assert (joint.holder, joint.frame) == (None, ("doorway", "here", "there"))
    assert joint.handles == (("grip1", "grip0") if opens > 0 else ("grip0", "grip1"))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_door_with_a_prismatic_joint_slides_away_from_its_handles_until_one_is_at_the_wall(
    tmp_path: Path, side: float
) -> None:
    joint, (x, y) = opened(RoomDoor(side=side, slides=True), tmp_path)
    assert (joint.kind, joint.frame[0]) == (JointKind.PRISMATIC, "doorway")
    assert (x, y) == pytest.approx((-0.035, side * joint.upper))
    assert 0.7 < joint.upper < 0.9


def test_a_stated_joint_of_a_door_between_rooms_counts(tmp_path: Path) -> None:
    hinge = "Individual: hinge\n    Types: knowrob:HingedJoint\n    Facts: knowrob:maxJointValue 1.9, "
    door = RoomDoor(facts=("knowrob:jointPosition 0.5",), more=f"{hinge}knowrob:connectedTo-Rigidly door\n")
    joint, _ = opened(door, tmp_path)
    assert (joint.upper, joint.first) == (1.9, 0.5)


@pytest.mark.parametrize("holder", ["there", "partition"])
def test_a_door_without_doorway_has_an_opening_of_its_size(tmp_path: Path, holder: str) -> None:
    wall = 'Types: knowrob:WallOfAConstruction\n    Facts: knowrob:translation "0.05 0 1.3", '
    held = f'Individual: partition\n    {wall}knowrob:boundingBoxSize "0.1 4 2.6"\n'
    door = RoomDoor(doorway="", more=f"{held}Individual: {holder}\n    Facts: knowrob:properPhysicalParts door\n")
    scene, notes = read(door, tmp_path)
    assert [one.code for one in notes] == []
    assert [joint.frame[0] for joint in scene.joints] == [holder]
    for name in ("here", "there", "partition"):
        (cavity,) = scene.body(name).cavities
        assert cavity.size[1:] == pytest.approx((0.9, 2.0))


def test_what_a_door_between_rooms_lacks_is_said_where_it_is_stated(tmp_path: Path) -> None:
    hinge = 'Individual: hinge\n    Types: knowrob:HingedJoint\n    Facts: knowrob:translation "0.05 -0.44 1"\n'
    placed = ("knowrob:properPhysicalParts hinge",)
    assert code(RoomDoor(handles=(), facts=placed, more=hinge), tmp_path) == "M038"
    assert code(RoomDoor(handles=(1.0,)), tmp_path) == "M039"
    assert code(RoomDoor(doorway=""), tmp_path) == "M038", "nothing holds it"
    assert code(RoomDoor(behind="Table-PieceOfFurniture"), tmp_path) == "M038", "there is no room behind it"
    assert code(RoomDoor(size=False), tmp_path) == "M038"


def test_a_plain_door_in_a_wall_without_doorway_stays_as_it_is(tmp_path: Path) -> None:
    scene, notes = read(RoomDoor(doorway="", handles=()), tmp_path)
    assert (scene.joints, notes) == ((), [])
