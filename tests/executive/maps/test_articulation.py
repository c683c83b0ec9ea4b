"""Doors, drawers and lids: those of real maps, and small ones with stated and with derived joints."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.belief import Belief
from executive.belief.believed_bodies import BelievedBodies
from executive.maps import SemanticMap, read_map, scene_of
from planlang.geometry import Pose
from planlang.ontology import load
from sim import PlanningWorld, WorldMirror, perturb
from sim.joints import Articulation, JointKind
from tests.support.detections import recognise
from tests.support.examples import some

Write = Callable[..., str]
Read = Callable[..., SemanticMap]

COUNTS = {
    "ias_hospital_room@re_stack.owl.in": (1, 0, 1),
    "ias_hospital_room_with_objects@re_stack.owl.in": (1, 0, 1),
    "map_hospital_room@re_stack.owl.in": (1, 0, 0),
    "ias_semantic_map@hydro.owl": (14, 8, 19),
}
"""Map -> doors that turn, drawers that slide, and how many of them have a handle."""


def joints_of(path: Path) -> dict[str, Articulation]:
    """The joints of a map, by leaf."""
    return {joint.leaf: joint for joint in scene_of(read_map(load(path))).joints}


@pytest.mark.parametrize("name", some(COUNTS, every=4))
def test_every_door_and_drawer_of_a_real_map_has_a_joint(corpus: Path, name: str) -> None:
    joints = joints_of(corpus / "environments" / name).values()
    hinged = sum(joint.kind is JointKind.HINGED for joint in joints)
    handles = sum("handle" in (joint.handle or "") for joint in joints)
    assert (hinged, len(joints) - hinged, handles) == COUNTS[name]


def test_the_room_between_rooms_has_doors_without_furniture(corpus: Path) -> None:
    assert joints_of(Path(__file__).parents[3] / "ontologies" / "environments" / "hospital_room.omn") == {}


def test_hinges_of_the_kitchen_are_where_the_map_has_them(corpus: Path) -> None:
    semantic_map = read_map(load(corpus / "environments" / "ias_semantic_map@hydro.owl"))
    compared = 0
    for joint in scene_of(semantic_map).joints:
        door = semantic_map.find(joint.leaf)
        assert door is not None
        for hinge in (semantic_map.find(part) for part in door.parts if "hinge" in part):
            assert hinge is not None
            assert hinge.pose is not None
            across = np.array(hinge.pose.position) - joint.point
            across -= (across @ np.array(joint.axis)) * np.array(joint.axis)
            assert np.linalg.norm(across) < 0.01, joint.leaf
            compared += 1
    assert compared == 14


def test_every_leaf_of_the_kitchen_opens_away_from_its_furniture(corpus: Path) -> None:
    scene = scene_of(read_map(load(corpus / "environments" / "ias_semantic_map@hydro.owl")))
    for joint in scene.joints:
        leaf = scene.body(joint.leaf)
        inside = scene.body(joint.holder).pose if joint.holder else leaf.pose @ Pose((0.0, 0.0, 0.0))
        there = joint.motion(0.3 * joint.upper) @ leaf.pose
        moved = math.dist(there.position, inside.position) - math.dist(leaf.pose.position, inside.position)
        assert moved > 0.0, joint.leaf


def test_the_door_inside_the_cabinet_is_moved_to_the_face_with_its_handle(corpus: Path) -> None:
    joint = joints_of(corpus / "environments" / "ias_hospital_room@re_stack.owl.in")["door1"]
    assert joint.point[0] == pytest.approx(-1.366, abs=1e-3)
    assert joint.point[1] == pytest.approx(-2.262, abs=1e-3)


def test_flaps_turn_up_and_ovens_down(corpus: Path) -> None:
    joints = joints_of(corpus / "environments" / "ias_semantic_map@hydro.owl")
    assert {name: round(joints[name].point[2], 3) for name in ("door8", "door9", "door11")} == {
        "door8": 2.229,
        "door9": 0.442,
        "door11": 0.322,
    }


def cabinet(thing: Write, seen: Write, *more: str, parts: str = "door1", facts: tuple[str, ...] = ()) -> list[str]:
    """A cabinet with a door 0.4 m wide and 0.6 m high at the right of its front."""
    return [
        thing("cabinet1", "Cabinet-PieceOfFurniture", (0.5, 1.0, 1.0), f"properPhysicalParts {parts}"),
        thing("door1", "Door", (0.02, 0.4, 0.6), *facts),
        seen("cabinet1", (0.0, 0.0, 0.5)),
        seen("door1", (0.25, -0.25, 0.5)),
        *more,
    ]


def only(semantic_map: SemanticMap) -> Articulation:
    """The only joint of a map."""
    (joint,) = scene_of(semantic_map).joints
    return joint


def test_a_door_without_handle_hinges_at_the_side_of_its_furniture(map_of: Read, thing: Write, seen: Write) -> None:
    joint = only(map_of(*cabinet(thing, seen)))
    assert (joint.point[:2], joint.axis, joint.upper) == ((0.25, -0.45), (0.0, 0.0, -1.0), 1.57)


def test_a_door_hinges_opposite_its_handle(map_of: Read, thing: Write, seen: Write) -> None:
    handle = thing("handle1", "Handle", (0.02, 0.02, 0.1)), seen("handle1", (0.28, -0.4, 0.5))
    joint = only(map_of(*cabinet(thing, seen, *handle, facts=("properPhysicalParts handle1",))))
    assert joint.point[:2] == pytest.approx((0.25, -0.05))
    assert (joint.axis, joint.handle) == ((0.0, 0.0, 1.0), "handle1")


def test_a_stated_hinge_takes_precedence(map_of: Read, thing: Write, seen: Write) -> None:
    hinge = (
        "Individual: hinge1\n    Types: knowrob:HingedJoint\n"
        "    Facts: knowrob:minJointValue 0.0, knowrob:maxJointValue 2.0, knowrob:direction up\n",
        "Individual: up\n    Types: knowrob:Vector\n"
        "    Facts: knowrob:vectorX 0.0, knowrob:vectorY 0.0, knowrob:vectorZ 2.0\n",
        seen("hinge1", (0.25, -0.05, 0.5)),
    )
    joint = only(map_of(*cabinet(thing, seen, *hinge, facts=("properPhysicalParts hinge1",))))
    assert (joint.point, joint.axis, joint.lower, joint.upper) == ((0.25, -0.05, 0.5), (0.0, 0.0, 1.0), 0.0, 2.0)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_a_stated_axis_is_reversed_if_the_hinge_opens_towards_smaller_values(
    z: float, map_of: Read, thing: Write, seen: Write
) -> None:
    hinge = (
        "Individual: hinge1\n    Types: knowrob:HingedJoint\n"
        "    Facts: knowrob:minJointValue -1.2, knowrob:maxJointValue 0.0, knowrob:direction axis1,\n"
        "        knowrob:connectedTo-Rigidly door1\n",
        "Individual: axis1\n    Types: knowrob:Vector\n"
        f"    Facts: knowrob:vectorX 0.0, knowrob:vectorY 0.0, knowrob:vectorZ {z}\n",
    )
    joint = only(map_of(*cabinet(thing, seen, *hinge)))
    assert (joint.axis, joint.lower, joint.upper) == ((0.0, 0.0, -z), 0.0, 1.2)


def test_without_an_axis_a_hinge_opens_outwards_whatever_the_sign_of_its_limits(
    map_of: Read, thing: Write, seen: Write
) -> None:
    hinge = (
        "Individual: hinge1\n    Types: knowrob:HingedJoint\n"
        "    Facts: knowrob:minJointValue -1.2, knowrob:maxJointValue 0.0, knowrob:connectedTo-Rigidly door1\n"
    )
    plain, stated = only(map_of(*cabinet(thing, seen))), only(map_of(*cabinet(thing, seen, hinge)))
    assert (stated.axis, stated.lower, stated.upper) == (plain.axis, 0.0, 1.2)


def test_a_stated_slide_has_its_limits(map_of: Read, thing: Write, seen: Write) -> None:
    slide = "Individual: slide1\n    Types: knowrob:PrismaticJoint\n    Facts: knowrob:maxJointValue 0.3\n"
    joint = only(
        map_of(
            thing("drawer1", "Drawer", (0.5, 0.4, 0.2), "properPhysicalParts slide1"),
            slide,
            seen("drawer1", (0, 0, 0.5)),
        )
    )
    assert (joint.kind, joint.axis, joint.upper) == (JointKind.PRISMATIC, (1.0, 0.0, 0.0), 0.3)


def test_a_lid_turns_up_at_the_back_of_its_box(map_of: Read, thing: Write, seen: Write) -> None:
    joint = only(
        map_of(
            thing("box1", "Box-Container", (0.4, 0.6, 0.3), "properPhysicalParts lid1"),
            thing("lid1", "ContainerLid", (0.4, 0.6, 0.02)),
            seen("box1", (0, 0, 0.15)),
            seen("lid1", (0, 0, 0.3)),
        )
    )
    assert joint.point == (-0.2, 0.0, 0.3)
    assert (joint.motion(1.0) @ Pose((0.2, 0.0, 0.3))).position[2] > 0.5


@pytest.mark.parametrize(("x", "hinge"), [(0.0, -0.2), (0.15, -0.2), (-0.15, 0.2)])
def test_a_lid_hinges_opposite_its_handle_or_at_the_back_if_that_is_in_the_middle(
    map_of: Read, thing: Write, seen: Write, x: float, hinge: float
) -> None:
    joint = only(
        map_of(
            thing("box1", "Box-Container", (0.4, 0.4, 0.3), "properPhysicalParts lid1"),
            thing("lid1", "ContainerLid", (0.4, 0.4, 0.02), "properPhysicalParts knob1"),
            thing("knob1", "ControlKnob", (0.03, 0.03, 0.03)),
            seen("box1", (0, 0, 0.15)),
            seen("lid1", (0, 0, 0.31)),
            seen("knob1", (x, 0, 0.335)),
        )
    )
    assert joint.point == pytest.approx((hinge, 0.0, 0.31))
    assert (joint.motion(1.0) @ Pose((0.0, 0.0, 0.31))).position[2] > 0.4


@pytest.fixture
def shelf(map_of: Read, thing: Write, seen: Write) -> SemanticMap:
    """A cabinet with a bottle behind its door and one in an open compartment; a drawer with a cup in it."""
    return map_of(
        *cabinet(thing, seen, parts="door1, knowrob:properPhysicalParts box1"),
        thing("box1", "Box-Container", (0.48, 0.4, 0.6)),
        thing("bottle1", "DrinkingBottle", (0.06, 0.06, 0.2)),
        thing("bottle2", "DrinkingBottle", (0.06, 0.06, 0.2)),
        thing("drawer1", "Drawer", (0.5, 0.4, 0.2)),
        thing("cup1", "Cup", (0.08, 0.08, 0.1)),
        seen("box1", (0.0, 0.25, 0.5)),
        seen("bottle1", (0.1, -0.25, 0.3)),
        seen("bottle2", (0.1, 0.25, 0.3)),
        seen("drawer1", (2.0, 0.0, 0.5)),
        seen("cup1", (2.1, 0.0, 0.46)),
    )


@pytest.fixture
def believed(shelf: SemanticMap) -> tuple[Belief, PlanningWorld]:
    """A belief about the shelf, without a robot."""
    world = PlanningWorld(scene_of(shelf))
    return Belief(shelf, world), world


def test_the_belief_knows_which_closed_leaf_hides_an_object(believed: tuple[Belief, PlanningWorld]) -> None:
    belief, world = believed
    bodies = BelievedBodies(WorldMirror(world, belief.robot), belief)
    names = ("bottle1", "bottle2", "cup1", "cabinet1")
    assert [bodies.closed_before(name) for name in names] == ["door1", None, "drawer1", None]
    belief.moved("door1", 1.5)
    belief.moved("drawer1", 0.3)
    assert [bodies.closed_before(name) for name in names] == [None] * 4


def test_things_stand_in_hollow_furniture_and_move_with_a_drawer(believed: tuple[Belief, PlanningWorld]) -> None:
    belief, world = believed
    assert {name: world.support(name) for name in ("bottle1", "bottle2", "cup1")} == {
        "bottle1": "cabinet1",
        "bottle2": "cabinet1",
        "cup1": "drawer1",
    }
    belief.moved("drawer1", 0.3)
    assert belief.pose("cup1").position == pytest.approx((2.4, 0.0, 0.46))
    WorldMirror(world, belief.robot).at(belief.state)
    assert world.pose("cup1") == belief.pose("cup1")
    assert world.joint("drawer1") == 0.3
    belief.moved("drawer1", 0.0)
    assert belief.pose("cup1").position == pytest.approx((2.1, 0.0, 0.46))


def test_empty_furniture_has_an_inside_behind_its_door_and_in_its_drawer(
    map_of: Read, thing: Write, seen: Write
) -> None:
    scene = scene_of(
        map_of(
            *cabinet(thing, seen),
            thing("drawer1", "Drawer", (0.5, 0.4, 0.2)),
            seen("drawer1", (2.0, 0.0, 0.5)),
            thing("table1", "Table-PieceOfFurniture", (0.8, 1.4, 0.7)),
            seen("table1", (-2.0, 0.0, 0.35)),
        )
    )
    assert {body.name: len(body.cavities) for body in scene.bodies} == {
        "cabinet1": 1,
        "door1": 0,
        "drawer1": 1,
        "table1": 0,
    }


def test_a_door_that_is_seen_ajar_is_believed_to_be_ajar(believed: tuple[Belief, PlanningWorld]) -> None:
    belief, world = believed
    world.set_joint("door1", 0.7)
    recognise(belief, "door1", world.pose("door1"), 1.0)
    assert belief.joint("door1") == pytest.approx(0.7)


def test_what_is_believed_of_joints_is_remembered(believed: tuple[Belief, PlanningWorld], shelf: SemanticMap) -> None:
    belief, _ = believed
    belief.moved("drawer1", 0.25)
    other = Belief(shelf, PlanningWorld(scene_of(shelf)))
    left = belief.snapshot()
    other.restore(left)
    assert (other.joint("drawer1"), other.pose("cup1")) == (0.25, belief.pose("cup1"))
    with pytest.raises(ValueError, match="door7"):
        other.restore({**left, "belief": {**left["belief"], "leaves": {"door7": 0.2}}})


def test_seeds_displace_objects_in_a_cabinet_only_within_it(shelf: SemanticMap) -> None:
    scene = scene_of(shelf)
    for seed in range(1, 9):
        real = perturb(scene, seed)
        assert np.abs(np.array(real.body("bottle1").pose.position[:2]) - (0.0, -0.25)).max() < 0.25


def test_circular_parts_are_read(map_of: Read, thing: Write, seen: Write) -> None:
    names = [f"drawer{number}" for number in range(60)]
    parts = zip(names, [*names[1:], names[0]], strict=True)
    semantic_map = map_of(
        *(thing(name, "Drawer", (0.3, 0.3, 0.1), f"properPhysicalParts {part}") for name, part in parts),
        *(seen(name, (number, 0, 0.5)) for number, name in enumerate(names)),
    )
    assert [body.name for body in scene_of(semantic_map).bodies] == names
