"""A map as a run leaves it behind: what was seen and done is in it, joints that moved, and all else as it was."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.belief import Belief
from executive.belief.map_updating import updated_map
from executive.cli.app import app
from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.statements import decimal, placements
from planlang.diagnostics import Diagnostic
from planlang.files import Bundled, bundled
from planlang.geometry import Pose
from planlang.ontology import load
from sim import PlanningWorld
from tests.support.detections import recognise

Write = Callable[..., str]
Read = Callable[..., SemanticMap]
BOX = (0.4, 0.8, 0.8)
INSIDE = {"water1": "bottle1", "water2": "cup1"}
LOCKER = """
Class: Locker
    SubClassOf: knowrob:Cabinet-PieceOfFurniture, knowrob:properPhysicalParts some LockerDoor
Class: LockerDoor
    SubClassOf: knowrob:Door, knowrob:orientation value door_place,
        knowrob:depthOfObject value 0.02, knowrob:widthOfObject value 0.8, knowrob:heightOfObject value 0.8
Individual: door_place
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "0.21 0 0", knowrob:quaternion "0 0 0 1", knowrob:relativeTo Locker
"""


@pytest.fixture
def left(tmp_path: Path) -> Callable[..., SemanticMap]:
    """Reads the map that a robot leaves behind, which believes something new about one, or has opened leaves."""

    def update(semantic_map: SemanticMap, change: Callable[[Belief], object], *opened: str) -> SemanticMap:
        world = PlanningWorld(scene_of(semantic_map))
        belief = Belief(semantic_map, world)
        change(belief)
        files = {semantic_map.ontology.documents[0].path}
        path = tmp_path / "updated.omn"
        path.write_text(updated_map(belief, files, opened, []), encoding="utf-8")
        world.close()
        return read_map(load(path))

    return update


Left = Callable[..., SemanticMap]


def test_what_was_seen_elsewhere_is_there_and_newer_and_the_rest_as_it_was(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(
        *(thing(name, "Cup", (0.08, 0.08, 0.1)) for name in ("cup1", "cup2")),
        *(seen(name, (x, 0, 0.05), time="timepoint_100") for x, name in enumerate(("cup1", "cup2"))),
        "Individual: timepoint_100\n    Types: knowrob:TimePoint\n",
    )

    def look(belief: Belief) -> None:
        belief.heated_until(12.5)
        recognise(belief, "cup1", Pose((5, 0, 0.05)), 1.0)

    updated = left(semantic_map, look)
    placed = {iri.rsplit("#")[-1]: one for iri, one in placements(updated).items()}
    assert (placed["cup1"].pose.position, placed["cup1"].time) == ((5, 0, 0.05), 112.5)
    assert (placed["cup2"].pose.position, placed["cup2"].time) == ((1, 0, 0.05), 100)


def test_what_is_no_more_has_no_pose_and_what_was_never_seen_keeps_its_own(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(
        *(thing(name, "Cup", (0.08, 0.08, 0.1)) for name in ("cup1", "cup2")),
        *(seen(name, (x, 0, 0.05)) for x, name in enumerate(("cup1", "cup2"))),
    )

    def destroy_the_cup(belief: Belief) -> None:
        without = belief.state.placed({"cup1": None})
        belief.happened(replace(without, matter=without.matter.destroyed("cup1")))
        belief.learn()

    updated = left(semantic_map, destroy_the_cup)
    assert [thing.name for thing in updated.objects if thing.pose] == ["cup2"]


def test_what_was_poured_out_is_no_longer_in_its_vessel_and_what_stays_there_is(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(
        thing("bottle1", "Bottle", (0.08, 0.08, 0.2)),
        thing("cup1", "Cup", (0.08, 0.08, 0.1)),
        *(thing(name, "Water", (None, None, None), f"in-ContGeneric {vessel}") for name, vessel in INSIDE.items()),
        *(seen(name, (x, 0, 0.05)) for x, name in enumerate(("bottle1", "cup1"))),
    )

    def pour_out(belief: Belief) -> None:
        matter, portions = belief.state.matter.take("bottle1", 1000.0)
        assert portions
        belief.happened(replace(belief.state, matter=matter))

    assert {one.name for one in left(semantic_map, pour_out).objects} == {"bottle1", "cup1", "water2"}
    assert len(left(semantic_map, lambda belief: None).objects) == 4


def test_a_door_is_written_closed_with_the_radius_and_the_axis_by_which_it_was_opened(left: Left) -> None:
    room = bundled("ontologies") / "environments" / "kitchenette.omn"
    semantic_map = read_map(load(room))
    joints = {joint.leaf: joint for joint in scene_of(semantic_map).joints}
    leaf = next(name for name, joint in joints.items() if joint.kind.value == "hinged" and not joint.is_knob)
    updated = left(semantic_map, lambda belief: belief.moved(leaf, 1.0), leaf)
    again = {joint.leaf: joint for joint in scene_of(updated).joints}
    assert again.keys() == joints.keys()
    assert again[leaf].axis == pytest.approx(joints[leaf].axis, abs=1e-6)
    assert again[leaf].point[:2] == pytest.approx(joints[leaf].point[:2], abs=1e-6)
    assert (again[leaf].lower, again[leaf].upper) == pytest.approx((joints[leaf].lower, joints[leaf].upper))
    assert any("turnRadius" in triple.predicate for triple in updated.ontology.triples())
    before, after = semantic_map.find(leaf), updated.find(leaf)
    assert before
    assert after
    assert before.pose
    assert after.pose
    assert before.pose.distance(after.pose) < 1e-6


def drawer_with_a_cup(map_of: Read, thing: Write, seen: Write) -> SemanticMap:
    """A drawer that slides along x by 0.3 m, with a cup in it and another on the floor before it."""
    slide = "Individual: slide1\n    Types: knowrob:PrismaticJoint\n    Facts: knowrob:maxJointValue 0.3\n"
    return map_of(
        thing("chest1", "Cabinet-PieceOfFurniture", (0.5, 0.6, 0.8), "properPhysicalParts drawer1"),
        thing("drawer1", "Drawer", (0.4, 0.5, 0.2), "properPhysicalParts slide1", "properPhysicalParts handle1"),
        thing("handle1", "Handle", (0.03, 0.1, 0.02)),
        slide,
        *(thing(name, "Cup", (0.08, 0.08, 0.1)) for name in ("cup1", "cup2")),
        seen("chest1", (0, 0, 0.4)),
        seen("drawer1", (0.04, 0, 0.5)),
        seen("handle1", (0.26, 0, 0.5)),
        seen("cup1", (0.1, 0.1, 0.46)),
        seen("cup2", (1, 0, 0.05)),
    )


def test_a_drawer_that_was_left_open_is_open_in_the_next_run_with_what_lies_in_it(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = drawer_with_a_cup(map_of, thing, seen)

    def open_and_look(belief: Belief) -> None:
        belief.moved("drawer1", 0.25)
        recognise(belief, "cup1", Pose((0.3, 0.05, 0.46)), 1.0)

    updated = left(semantic_map, open_and_look, "drawer1")
    places = {thing.name: thing.pose.position for thing in updated.objects if thing.pose}
    assert places["drawer1"] == (0.04, 0, 0.5)
    assert places["cup1"] == pytest.approx((0.05, 0.05, 0.46))
    world = PlanningWorld(scene_of(updated))
    belief = Belief(updated, world)
    for one in (world, belief):
        assert one.joint("drawer1") == 0.25
        assert one.pose("drawer1").position == pytest.approx((0.29, 0, 0.5))
        assert one.pose("handle1").position == pytest.approx((0.51, 0, 0.5))
        assert one.pose("cup1").position == pytest.approx((0.3, 0.05, 0.46))
        assert one.pose("cup2").position == (1, 0, 0.05)
    belief.moved("drawer1", 0.0)
    assert belief.pose("drawer1").position == (0.04, 0, 0.5)
    assert belief.pose("cup1").position == pytest.approx((0.05, 0.05, 0.46))
    again = Belief(updated, world)
    again.restore(belief.snapshot())
    assert (again.joint("drawer1"), again.pose("cup1")) == (0.0, belief.pose("cup1"))
    world.close()
    closed = left(updated, lambda belief: belief.moved("drawer1", 0.0), "drawer1")
    assert not [triple for triple in closed.ontology.triples() if triple.predicate.endswith("jointPosition")]
    assert places == {thing.name: pytest.approx(thing.pose.position) for thing in closed.objects if thing.pose}


def test_what_lies_in_a_drawer_and_was_never_seen_stays_as_the_map_states_it(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = drawer_with_a_cup(map_of, thing, seen)
    updated = left(semantic_map, lambda belief: belief.moved("drawer1", 0.25), "drawer1")
    times = [one for one in placements(updated).values() if one.time > float("-inf")]
    assert times == []


def test_a_position_beyond_the_limits_is_told_and_taken_as_far_as_it_goes(
    map_of: Read, thing: Write, seen: Write
) -> None:
    found: list[Diagnostic] = []
    frames = [
        thing("chest1", "Cabinet-PieceOfFurniture", (0.5, 0.6, 0.8), "properPhysicalParts drawer1"),
        thing("drawer1", "Drawer", (0.4, 0.5, 0.2), "jointPosition 7.0"),
        seen("chest1", (0, 0, 0.4)),
        seen("drawer1", (0.04, 0, 0.5)),
    ]
    (joint,) = scene_of(map_of(*frames), found).joints
    assert joint.first == joint.upper
    assert [one.code for one in found] == ["M017"]


def cabinet_that_opens_towards_smaller_values(thing: Write, seen: Write, position: float) -> list[str]:
    """A cabinet with a door whose hinge has the limits -1.2 and 0, open to a position."""
    return [
        thing("cabinet1", "Cabinet-PieceOfFurniture", (0.5, 1.0, 1.0), "properPhysicalParts door1"),
        thing("door1", "Door", (0.02, 0.4, 0.6), "properPhysicalParts hinge1", f"jointPosition {position}"),
        "Individual: hinge1\n    Types: knowrob:HingedJoint\n"
        "    Facts: knowrob:minJointValue -1.2, knowrob:maxJointValue 0.0\n",
        seen("cabinet1", (0, 0, 0.5)),
        seen("door1", (0.25, -0.25, 0.5)),
    ]


def test_positions_of_a_joint_that_opens_towards_smaller_values_are_read_and_written_as_its_limits_are(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(*cabinet_that_opens_towards_smaller_values(thing, seen, -1.0))
    (before,) = scene_of(semantic_map).joints
    assert before.first == 1.0
    updated = left(semantic_map, lambda belief: belief.moved("door1", 0.8), "door1")
    values = [t.object for t in updated.ontology.triples() if t.predicate.endswith("jointPosition")]
    assert values == [decimal(-0.8)]
    (after,) = scene_of(updated).joints
    assert (after.first, after.lower, after.upper) == (0.8, before.lower, before.upper)
    assert after.axis == pytest.approx(before.axis)


def test_a_position_beyond_limits_that_open_towards_smaller_values_is_told_with_those_of_the_file(
    map_of: Read, thing: Write, seen: Write
) -> None:
    found: list[Diagnostic] = []
    (joint,) = scene_of(map_of(*cabinet_that_opens_towards_smaller_values(thing, seen, 1.0)), found).joints
    assert joint.first == 0.0
    assert [one.code for one in found] == ["M017"]
    assert "limits are -1.2 and 0.0" in found[0].message


def test_parts_that_follow_from_a_class_follow_from_it_again(
    left: Left, map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(
        LOCKER,
        thing("one", "Cabinet-PieceOfFurniture", BOX).replace("Types: ", "Types: Locker, "),
        seen("one", (1, 0, 0.4)),
    )
    names = [thing.name for thing in semantic_map.objects]
    assert names == ["one", "one_LockerDoor"]
    updated = left(semantic_map, lambda belief: belief.moved("one_LockerDoor", 1.0), "one_LockerDoor")
    assert [thing.name for thing in updated.objects] == names
    assert not [d for d in updated.diagnostics if d.code != "M026"]


@pytest.mark.long
def test_doors_whose_hinges_have_poses_of_their_own_open_the_same_way_in_the_next_run(left: Left, corpus: Path) -> None:
    semantic_map = read_map(load(corpus / "environments" / "ias_semantic_map@hydro.owl"))
    joints = {joint.leaf: joint for joint in scene_of(semantic_map).joints}

    def open_all(belief: Belief) -> None:
        for name, joint in joints.items():
            belief.moved(name, 0.8 * joint.upper)

    after = {joint.leaf: joint for joint in scene_of(left(semantic_map, open_all, *joints)).joints}
    assert after.keys() == joints.keys()
    for name, joint in joints.items():
        assert after[name].axis == pytest.approx(joint.axis, abs=1e-6), name
        assert after[name].first == pytest.approx(0.8 * joint.upper)


def test_a_kitchen_of_two_files_is_left_behind_as_one_with_the_same_things_and_joints(
    corpus: Path, tmp_path: Path
) -> None:
    files = [corpus / "environments" / "IAI_kitchen@iai_maps.urdf", Bundled.ENVIRONMENT.find("iai_kitchen_milk")]
    before = read_map(load(files[0], also=files[1:]))
    world = PlanningWorld(scene_of(before))
    belief, found = Belief(before, world), list[Diagnostic]()
    belief.moved("iai_fridge_door", 1.0)
    (tmp_path / "after.omn").write_text(updated_map(belief, set(files), ["iai_fridge_door"], found))
    world.close()
    assert found == []
    scenes = [scene_of(one) for one in (before, read_map(load(tmp_path / "after.omn")))]
    bodies = [{body.name: body for body in scene.bodies} for scene in scenes]
    assert bodies[0].keys() == bodies[1].keys()
    for name, body in bodies[0].items():
        assert (bodies[1][name].size, bodies[1][name].shape) == (body.size, body.shape)
        assert bodies[1][name].pose.distance(body.pose) < 1e-6
    joints = [{joint.leaf: (*joint.point, *joint.axis, joint.upper) for joint in scene.joints} for scene in scenes]
    assert joints[0].keys() == joints[1].keys()
    assert all(joints[1][leaf] == pytest.approx(joints[0][leaf], abs=1e-6) for leaf in joints[0])


@pytest.mark.long
def test_the_map_of_a_run_lets_the_next_run_begin_where_things_were_seen(tmp_path: Path) -> None:
    run = ["run", "serve_a_drink", "--seed", "3", "--update-map", str(tmp_path / "seen.omn")]
    assert CliRunner().invoke(app, run).exit_code == 0
    before = read_map(load(bundled("ontologies") / "environments" / "hospital_room.omn"))
    after = read_map(load(tmp_path / "seen.omn"))
    moved = []
    for thing in before.objects:
        other = after.find(thing.iri)
        assert other
        assert (other.size, other.types, other.parts) == (thing.size, thing.types, thing.parts)
        if thing.pose and other.pose and thing.pose.distance(other.pose) > 0.01:
            moved.append(thing.name)
    assert moved == ["bottle1"]
