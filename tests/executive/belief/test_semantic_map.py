"""Reading maps: which pose counts, how poses compose, how sizes are completed."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.belief import SemanticMap
from executive.belief.stated_values import rigid
from planlang.diagnostics import BadInput, Diagnostic, Severity

Read = Callable[..., SemanticMap]
Write = Callable[..., str]
BOX = (0.4, 0.8, 0.8)


def quarter_turn() -> tuple[float, ...]:
    return (0, -1, 0, 1, 0, 0, 0, 0, 1)


def test_the_latest_perception_says_where_a_thing_is(map_of: Read, thing: Write, seen: Write) -> None:
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


def test_of_two_perceptions_at_one_time_the_later_one_in_the_file_counts(
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


def test_all_bad_numbers_of_a_file_are_reported_at_once(map_of: Read, thing: Write, seen: Write) -> None:
    with pytest.raises(BadInput) as problem:
        map_of(
            thing("cabinet1", "Cabinet-PieceOfFurniture", (0.4, -1, 0.8)),
            thing("table1", "Table-PieceOfFurniture", (0.4, 1, 0.8)),
            seen("cabinet1", (1, 2, 0.4)),
            seen("table1", (1, 2, 0.4)).replace("m03 1.0", 'm03 "NaN"^^xsd:double'),
        )
    assert [d.code for d in problem.value.diagnostics if d.severity is Severity.ERROR] == ["M007", "M002"]


def test_a_thing_of_unknown_size_is_a_place(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(thing("thing1", "SpatialThing-Localized", (0.1, 0.1, None)), seen("thing1", (0, 0, 0)))
    assert semantic_map.objects[0].size is None
    assert [d.code for d in semantic_map.diagnostics] == ["M006"]


def test_a_missing_size_is_that_of_the_nearest_class_that_has_one(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(thing("bed1", "Bed-PieceOfFurniture", (1.9, 0, None)), seen("bed1", (0, 0, 0.3)))
    size = semantic_map.objects[0].size
    assert size
    assert size[0] == 1.9
    assert size[1] > 0.5
    assert size[2] > 0.3
    assert [d.code for d in semantic_map.diagnostics] == ["M005"]


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


def test_two_things_of_one_local_name_keep_names_of_their_own(map_of: Read, thing: Write, seen: Write) -> None:
    semantic_map = map_of(
        thing("box1", "Box-Container", BOX),
        thing("<http://example.org/other.owl#box1>", "Box-Container", BOX),
        seen("box1", (0, 0, 0)),
    )
    assert [box.name for box in semantic_map.objects] == ["box1", "box1_2"]


@settings(max_examples=50)
@given(st.lists(st.floats(-2, 2), min_size=9, max_size=9))
def test_whatever_the_matrix_a_rotation_comes_out(entries: list[float]) -> None:
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
