"""Semantic maps: newest poses, default sizes, repairs, and the contents of real maps."""

import json
import math
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.maps import SemanticMap, default_starts, read_map, scene_of
from executive.maps.measures import stated_size
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.geometry import Pose
from planlang.measures import EXTENTS, rigid
from planlang.ontology import expand, load
from sim import PlanningWorld
from tests.support.examples import examples, some

Read = Callable[..., SemanticMap]
Write = Callable[..., str]
UNIT = "http://qudt.org/vocab/unit#"
BOX = (0.4, 0.8, 0.8)


def quarter_turn() -> tuple[float, ...]:
    return (0, -1, 0, 1, 0, 0, 0, 0, 1)


def test_the_latest_perception_places_an_object(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("cabinet1", "Cabinet-PieceOfFurniture", BOX),
        seen("cabinet1", (2, 0, 0), number=1, time="timepoint_200.5"),
        seen("cabinet1", (1, 0, 0), number=2, time="timepoint_1e"),
        seen("cabinet1", (3, 0, 0), number=3, time="timepoint_90"),
        *(f"Individual: timepoint_{t}\n    Types: knowrob:TimePoint\n" for t in ("200.5", "90", "1e")),
    )
    cabinet = semantic_map.find("cabinet1")
    assert cabinet
    assert cabinet.pose
    assert cabinet.pose.position == (2, 0, 0)


def test_of_two_simultaneous_perceptions_the_later_one_in_the_file_counts(
    map_of: Read, thing: Write, seen: Write
) -> None:
    semantic_map = map_of(
        thing("cabinet1", "Cabinet-PieceOfFurniture", BOX),
        seen("cabinet1", (2, 0, 0), number=1),
        seen("cabinet1", (1, 0, 0), number=2),
    )
    assert semantic_map.objects[0].pose
    assert semantic_map.objects[0].pose.position == (1, 0, 0)


def test_a_relative_pose_is_composed_as_parent_times_relative(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("cabinet1", "Cabinet-PieceOfFurniture", BOX),
        thing("door1", "Door", (0.02, 0.4, 0.6)),
        seen("cabinet1", (1, 2, 0.4), quarter_turn()),
        seen("door1", (0.2, 0, 0.1), quarter_turn(), relative_to="cabinet1"),
    )
    door = semantic_map.find("door1")
    assert door
    assert door.pose
    assert door.pose.position == pytest.approx((1, 2.2, 0.5))
    assert abs(door.pose.yaw) == pytest.approx(math.pi)


def test_every_invalid_pose_is_an_error_and_costs_only_its_object_if_that_is_ignored(
    map_of: Read, thing: Write, seen: Write
) -> None:
    frames = (
        *(thing(name, "Cabinet-PieceOfFurniture", (0.4, 1, 0.8)) for name in ("bad", "worse", "inside", "good")),
        seen("bad", (1, 2, 0.4)).replace("m03 1.0", 'm03 "INF"^^xsd:double'),
        seen("worse", (1, 2, 0.4)).replace("m03 1.0", 'm03 "abc"'),
        seen("inside", (1, 2, 0.4), relative_to="bad"),
        seen("good", (1, 2, 0.4)),
    )
    with pytest.raises(BadInput) as problem:
        map_of(*frames)
    assert [(d.code, d.severity) for d in problem.value.diagnostics] == [("M002", Severity.ERROR)] * 2
    semantic_map = map_of(*frames, ignore_unread=True)
    assert [thing.name for thing in semantic_map.objects if thing.pose] == ["good"]
    found: list[Diagnostic] = [*semantic_map.diagnostics]
    scene_of(semantic_map, found)
    assert [(d.code, d.severity) for d in found if d.code == "M002"] == [("M002", Severity.WARNING)] * 2
    assert [d.message.split()[0] for d in found if d.code == "M012"] == ["bad", "worse", "inside"]


@pytest.mark.long
def test_objects_beyond_the_longest_chain_of_relative_poses_have_no_pose(
    map_of: Read, thing: Write, seen: Write
) -> None:
    names = [f"cup{number}" for number in range(1500)]
    frames = [thing(name, "Cup", (0.08, 0.08, 0.1)) for name in names]
    row = [seen(one, (0.1, 0, 0), relative_to=other) for one, other in pairwise(names)]
    semantic_map = map_of(*frames, *row, seen(names[-1], (0, 0, 0)), ignore_unread=True)
    last = semantic_map.find(names[-2])
    assert last
    assert last.pose
    assert last.pose.position == (0.1, 0, 0)
    assert semantic_map.objects[0].pose is None
    assert {d.code for d in semantic_map.diagnostics} == {"M008"}


def test_a_file_without_a_valid_pose_is_not_a_map_and_the_reason_is_reported(
    map_of: Read, thing: Write, seen: Write
) -> None:
    with pytest.raises(BadInput) as problem:
        map_of(
            thing("table1", "Table-PieceOfFurniture", (0.4, 1, 0.8)),
            seen("table1", (1, 2, 0.4)).replace("m03 1.0", 'm03 "NaN"^^xsd:double'),
        )
    assert [d.code for d in problem.value.diagnostics] == ["M002"]


def test_the_newest_valid_perception_places_an_object(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("cabinet1", "Cabinet-PieceOfFurniture", BOX),
        seen("cabinet1", (2, 0, 0), number=1),
        seen("cabinet1", (1, 0, 0), number=2).replace("m03 1.0", 'm03 "abc"'),
        ignore_unread=True,
    )
    assert semantic_map.objects[0].pose
    assert semantic_map.objects[0].pose.position == (2, 0, 0)


def test_a_negative_size_makes_its_object_a_mere_place(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("cabinet1", "Cabinet-PieceOfFurniture", (0.4, -1, 0.8)),
        thing("table1", "Table-PieceOfFurniture", (0.4, 1, 0.8)),
        seen("cabinet1", (1, 2, 0.4)),
        seen("table1", (3, 2, 0.4)),
        ignore_unread=True,
    )
    assert [(one.name, one.size) for one in semantic_map.objects] == [("cabinet1", None), ("table1", (0.4, 1, 0.8))]
    assert [(d.code, d.severity) for d in semantic_map.diagnostics] == [("M007", Severity.WARNING)]


def test_an_object_without_a_size_is_a_mere_place_and_one_with_a_part_of_it_is_an_error(
    map_of: Read, thing: Write, seen: Write
) -> None:
    place, partly = ((None, None, None), (0.1, 0.1, None))
    semantic_map = map_of(thing("thing1", "SpatialThing-Localized", place), seen("thing1", (0, 0, 0)))
    assert (semantic_map.objects[0].size, semantic_map.diagnostics) == (None, ())
    assert [body.shape for body in scene_of(semantic_map).bodies] == ["marker"]
    with pytest.raises(BadInput) as problem:
        map_of(thing("thing1", "SpatialThing-Localized", partly), seen("thing1", (0, 0, 0)))
    assert [d.code for d in problem.value.diagnostics] == ["M006"]


def test_a_missing_size_is_the_default_of_the_nearest_class(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(thing("bed1", "Bed-PieceOfFurniture", (1.9, 0, None)), seen("bed1", (0, 0, 0.3)))
    size = semantic_map.objects[0].size
    assert size
    assert size[0] == 1.9
    assert size[1] > 0.5
    assert size[2] > 0.3
    assert [d.code for d in semantic_map.diagnostics] == ["M005"]


def test_an_undefined_class_is_matched_by_an_unambiguous_name(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(thing("bed1", "Bed", (None, None, None)), seen("bed1", (0, 0, 0.3)))
    assert semantic_map.objects[0].types == (expand("Bed-PieceOfFurniture"),)
    assert [(d.code, d.severity) for d in semantic_map.diagnostics] == [
        ("M031", Severity.NOTE),
        ("M005", Severity.NOTE),
    ]


def test_a_misspelt_class_is_reported_with_a_suggestion(map_of: Read, thing: Write, seen: Write) -> None:
    (found,) = map_of(thing("cup1", "DrinkingBotle", (0.1, 0.1, 0.1)), seen("cup1", (0, 0, 0.1))).diagnostics
    assert (found.code, found.severity, found.help) == ("M031", Severity.WARNING, "did you mean DrinkingBottle?")


@pytest.mark.parametrize(
    ("cls", "above"), [("CoffeeMug", "knowrob:DrinkingMug"), ("Gizmo", "..."), ("BigGizmo", "...")]
)
def test_an_undefined_class_is_to_be_defined_below_the_one_that_its_last_word_names(
    map_of: Read, thing: Write, seen: Write, cls: str, above: str
) -> None:
    (found,) = map_of(thing("thing1", cls, (0.1, 0.1, 0.1)), seen("thing1", (0, 0, 0.1))).diagnostics
    assert (found.severity, found.help) == (Severity.WARNING, f"define it: Class: {cls} SubClassOf: {above}")


def test_an_object_of_unknown_class_as_large_as_a_room_and_with_objects_inside_is_a_room(
    map_of: Read, thing: Write, seen: Write
) -> None:
    found: list[Diagnostic] = []
    room = thing("room1", "Conservatory", (5.0, 4.0, 2.5)), seen("room1", (0, 0, 1.25))
    wardrobe = thing("wardrobe1", "Armoire", (0.6, 1.6, 2.0)), seen("wardrobe1", (2, 0, 1.0))
    scene = scene_of(map_of(*room, *wardrobe), found)
    assert [body.shape for body in scene.bodies] == ["room", "box"]
    (advice,) = (d.help or "" for d in found if "room1 is presumed" in d.message)
    assert "Class: Conservatory SubClassOf: RoomInAConstruction" in advice


@pytest.mark.parametrize("cls", ["CardboardBox", "WaxedCardboardCarton", "Bag"])
def test_packages_are_movable_although_they_are_containers(map_of: Read, thing: Write, seen: Write, cls: str) -> None:
    scene = scene_of(map_of(thing("one", cls, (0.1, 0.06, 0.2)), seen("one", (0, 0, 0.1))))
    assert scene.body("one").graspable


def test_a_pose_without_rotation_is_not_rotated(map_of: Read, thing: Write) -> None:
    place = 'Individual: place\n    Types: knowrob:RotationMatrix3D\n    Facts: knowrob:translation "1 2 0.3"'
    semantic_map = map_of(thing("bed1", "Bed-PieceOfFurniture", (2, 1, 0.6), "pose place"), place)
    assert semantic_map.objects[0].pose == Pose((1.0, 2.0, 0.3))
    assert [d.code for d in semantic_map.diagnostics] == []


@pytest.mark.parametrize("size", [(0.1, 0.1, 0.1), (0.1, 0.05, 0.1)])
def test_an_object_sunk_into_a_table_is_reported_with_the_height_at_which_it_stands(
    size: tuple[float, ...], map_of: Read, thing: Write, seen: Write
) -> None:
    found: list[Diagnostic] = []
    table = thing("table1", "Table-PieceOfFurniture", (1, 1, 0.7)), seen("table1", (0, 0, 0.35))
    cup = thing("cup1", "Cup", size), seen("cup1", (0, 0, 0.7))
    scene_of(map_of(*table, *cup), found)
    (told,) = found
    assert told.code == "M015"
    assert "0.050 m inside table1" in told.message
    assert "z = 0.750, cup1 stands on table1" in (told.help or "")


def test_a_size_may_be_one_literal_and_a_length_may_have_a_unit(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("box1", "Box-Container", (None, None, None), 'boundingBoxSize "0.1 0.2 0.3"'),
        thing(
            "box2", "Box-Container", (0.1, 0.2, None), 'heightOfObject "25"^^<http://qudt.org/vocab/unit#Centimeter>'
        ),
        seen("box1", (0, 0, 0)),
        seen("box2", (0, 0, 0)),
    )
    assert [box.size for box in semantic_map.objects] == [(0.1, 0.2, 0.3), (0.1, 0.2, 0.25)]


def test_numbers_of_a_map_may_be_in_any_unit_of_their_dimension(map_of: Read, thing: Write, seen: Write) -> None:
    box = thing("box1", "Box-Container", (0.1, 0.2, None), f'heightOfObject "1.5"^^<{UNIT}Foot>')
    semantic_map = map_of(box, seen("box1", (0, 0, 0)).replace("m03 0.0", f'm03 "35"^^<{UNIT}Centimeter>'))
    (box1,) = semantic_map.objects
    assert box1.size == (0.1, 0.2, 0.4572)
    assert box1.pose is not None
    assert box1.pose.position == (0.35, 0, 0)


def test_a_number_in_a_unit_of_another_dimension_is_left_out(map_of: Read, thing: Write, seen: Write) -> None:
    box = thing("box1", "Box-Container", (0.1, 0.2, None), f'heightOfObject "25"^^<{UNIT}Kilogram>')
    semantic_map = map_of(box, seen("box1", (0, 0, 0)), ignore_unread=True)
    (box1,), (wrong, *_) = semantic_map.objects, semantic_map.diagnostics
    assert box1.size is None or box1.size[2] != 25
    assert (wrong.code, wrong.severity) == ("M030", Severity.WARNING)
    assert wrong.message == "heightOfObject is left out: Kilogram is measured in kg, not in m"


def test_a_number_in_an_unknown_unit_is_read_without_it(map_of: Read, thing: Write, seen: Write) -> None:
    box = thing("box1", "Box-Container", (0.1, 0.2, None), f'heightOfObject "0.3"^^<{UNIT}Cubit>')
    semantic_map = map_of(box, seen("box1", (0, 0, 0)), ignore_unread=True)
    assert semantic_map.objects[0].size == (0.1, 0.2, 0.3)
    assert [one.code for one in semantic_map.diagnostics] == ["M030"]


def test_two_objects_of_one_local_name_get_unique_names(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("box1", "Box-Container", BOX),
        thing("<http://example.org/other.owl#box1>", "Box-Container", BOX),
        seen("box1", (0, 0, 0)),
    )
    assert [box.name for box in semantic_map.objects] == ["box1", "box1_2"]


@settings(max_examples=examples(50))
@given(st.lists(st.floats(-2, 2), min_size=9, max_size=9))
def test_any_matrix_is_repaired_to_a_rotation(entries: list[float]) -> None:
    found: list[Diagnostic] = []
    rotation = rigid(np.array(entries).reshape(3, 3), "matrix", None, found)
    assert np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


def test_a_reflection_keeps_the_front_and_the_top_of_a_thing() -> None:
    found: list[Diagnostic] = []
    mirrored = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    rotation = rigid(mirrored, "matrix", None, found)
    assert np.allclose(rotation[:, [0, 2]], mirrored[:, [0, 2]])
    assert [d.code for d in found] == ["M001"]


MAPS = (
    "environments/ias_hospital_room@re_stack.owl.in",
    "environments/ias_hospital_room_with_objects@re_stack.owl.in",
    "environments/ias_semantic_map@hydro.owl",
    "environments/map_hospital_room@re_stack.owl.in",
    "objects/object_model@re_stack.owl.in",
)


def read(corpus: Path, name: str) -> tuple[SemanticMap, dict[str, Any]]:
    truth = json.loads((corpus / "truth" / f"map_{Path(name).name}.json").read_text())
    return read_map(load(corpus / name)), truth["objects"]


def by_old_or_new_name(truth: dict[str, Any], iri: str) -> dict[str, Any] | None:
    """Find an object of the truth, whose IRIs may have the vocabulary's old namespace."""
    found: dict[str, Any] | None = truth.get(iri) or truth.get(
        iri.replace("http://knowrob.org/", "http://ias.cs.tum.edu/")
    )
    return found


@pytest.mark.parametrize("name", MAPS)
def test_every_posed_thing_of_the_truth_is_read_where_it_is(corpus: Path, name: str) -> None:
    semantic_map, truth = read(corpus, name)
    compared = 0
    for thing in semantic_map.objects:
        expected = by_old_or_new_name(truth, thing.iri)
        if expected is None or "translation" not in expected:
            continue
        assert thing.pose is not None, f"{thing.name} has no pose"
        assert np.allclose(thing.pose.position, expected["translation"], atol=1e-6), thing.name
        if not expected["pose_anomalies"]:
            quaternion = np.array(expected["quaternion_xyzw"])
            same = abs(float(np.dot(thing.pose.orientation, quaternion / np.linalg.norm(quaternion))))
            assert same == pytest.approx(1.0, abs=1e-5), thing.name
        compared += 1
    assert compared == sum("translation" in thing for thing in truth.values())


@pytest.mark.parametrize("name", MAPS)
def test_sizes_types_parts_and_hinges_match_the_truth(corpus: Path, name: str) -> None:
    semantic_map, truth = read(corpus, name)
    turned = " ".join(d.message for d in semantic_map.diagnostics if d.code == "M021")
    for thing in semantic_map.objects:
        expected = by_old_or_new_name(truth, thing.iri)
        if expected is None:
            continue
        stated = [expected["dimensions"].get(extent) for extent in EXTENTS]
        assert list(stated_size(semantic_map.ontology, thing.iri, [])) == stated, thing.name
        assert [cls.rsplit("#")[-1] for cls in thing.types] == expected["types"], thing.name
        parts = {part.rsplit("#")[-1] for part in thing.parts}
        assert thing.name in turned or parts == {part.rsplit("#")[-1] for part in expected["parts"]}
        assert len(thing.hinged_to) == len(expected["hingedTo"])


@pytest.mark.parametrize("name", MAPS)
def test_rotations_are_rigid(corpus: Path, name: str) -> None:
    semantic_map, _ = read(corpus, name)
    for pose in [thing.pose for thing in semantic_map.objects if thing.pose]:
        assert np.linalg.det(pose.matrix()[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("name", some(MAPS, every=3))
def test_a_real_map_becomes_a_world_with_a_start_pose(corpus: Path, name: str) -> None:
    semantic_map, _ = read(corpus, name)
    scene = scene_of(semantic_map)
    world = PlanningWorld(scene)
    assert world.names() == tuple(thing.name for thing in semantic_map.objects if thing.pose)
    assert next(default_starts(scene, 0.35), None) is not None
    world.close()


def test_the_reflections_of_the_kitchen_are_repaired_and_noted(corpus: Path) -> None:
    semantic_map, truth = read(corpus, "environments/ias_semantic_map@hydro.owl")
    repaired = [d for d in semantic_map.diagnostics if d.code == "M001"]
    anomalies = [thing for thing in truth.values() if thing.get("pose_anomalies")]
    assert len(repaired) == len(anomalies) == 15


def test_the_closed_cabinet_of_the_hospital_room_is_hollow_and_reported(corpus: Path) -> None:
    semantic_map, _ = read(corpus, "environments/ias_hospital_room@re_stack.owl.in")
    found: list[Any] = []
    scene = scene_of(semantic_map, found)
    assert [d.code for d in found] == ["M016", "M013"]
    assert scene.body("bottle1").size == (0.07, 0.07, 0.24), "the default size of a drinking bottle"
    assert scene.body("Room7635").shape == "room"
    assert isinstance(scene.body("bed1").pose, Pose)


def test_an_object_in_a_drawer_of_a_solid_chest_can_be_reached(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("chest1", "Cupboard", (0.6, 0.8, 0.9), "properPhysicalParts drawer1"),
        thing("drawer1", "Drawer", (0.58, 0.7, 0.25)),
        thing("cup1", "Cup", (0.07, 0.07, 0.1)),
        *(seen(name, place) for name, place in (("chest1", (2, 0, 0.45)), ("drawer1", (2, 0, 0.7)))),
        seen("cup1", (2, 0, 0.64)),
    )
    found: list[Diagnostic] = []
    scene_of(semantic_map, found)
    assert [d.code for d in found if d.code in ("M013", "M014")] == ["M013"]


def test_a_thing_may_state_its_size_translation_and_heading_itself(map_of: Read) -> None:
    bed = 'boundingBoxSize "2 1 0.6", knowrob:translation "1 2 0.3", knowrob:heading 90'
    text = f"Individual: bed1\n    Types: knowrob:Bed-PieceOfFurniture\n    Facts: knowrob:{bed}"
    cup = (
        'Individual: cup1\n    Types: knowrob:Cup\n    Facts: knowrob:relativeTo bed1, knowrob:translation "0.5 0 0.35"'
    )
    things = {thing.name: thing for thing in map_of(text, cup).objects}
    assert things["bed1"].size == (2, 1, 0.6)
    assert things["cup1"].pose is not None
    assert things["cup1"].pose.position == pytest.approx((1, 2.5, 0.65))
