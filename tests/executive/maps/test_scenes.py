"""Scenes of semantic maps: shapes, movable objects, supports, and start poses."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from executive.maps import SemanticMap, default_starts, read_map, scene_of, support_of
from planlang.diagnostics import Diagnostic
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.geometry.shapes import footprint
from planlang.ontology import load
from sim import Body, Scene
from sim.people import figure_of, reach_from

Read = Callable[..., SemanticMap]
Write = Callable[..., str]


@pytest.fixture(scope="module")
def room() -> Scene:
    """The bundled hospital room."""
    return scene_of(read_map(load(bundled("ontologies") / "environments" / "hospital_room.omn")))


def test_the_hospital_room_needs_no_repair() -> None:
    ontology = load(bundled("ontologies") / "environments" / "hospital_room.omn")
    semantic_map = read_map(ontology)
    found: list[Diagnostic] = []
    scene_of(semantic_map, found)
    assert [*ontology.diagnostics, *semantic_map.diagnostics, *found] == []


def test_the_hospital_room_has_a_person_a_room_and_a_bottle_that_can_be_taken(room: Scene) -> None:
    shapes = {body.name: body.shape for body in room.bodies}
    assert (shapes["room1"], shapes["patient1"], shapes["bottle1"], shapes["bed1"]) == (
        "room",
        "person",
        "cylinder",
        "box",
    )
    assert [body.name for body in room.bodies if body.graspable] == ["bottle1"]
    assert [body.name for body in room.bodies if body.movable] == ["bedside_table1", "bottle1", "chair1"]
    assert room.bounds == (-3.0, -2.5, 3.0, 2.5)


def test_everything_in_the_hospital_room_stands_on_something(room: Scene) -> None:
    supports = {body.name: support_of(room, body.name) for body in room.bodies if body.shape not in ("room", "marker")}
    assert supports.pop("bottle1") == "cabinet1"
    assert supports.pop("patient1") == "bed1"
    assert set(supports.values()) == {"floor"}


def test_nothing_in_the_hospital_room_penetrates_a_wall(room: Scene) -> None:
    x_min, y_min, x_max, y_max = room.bounds
    for body in room.bodies:
        outline = footprint(body.pose, body.size)
        assert (outline >= (x_min - 1e-6, y_min - 1e-6)).all(), body.name
        assert (outline <= (x_max + 1e-6, y_max + 1e-6)).all(), body.name


def test_the_patient_sits_facing_the_foot_of_the_bed_and_reaches_the_free_side(room: Scene) -> None:
    patient, bed = room.body("patient1"), room.body("bed1")
    reach = reach_from(figure_of(patient), patient.pose)
    assert np.allclose(reach.facing, bed.pose.matrix()[:3, 0], atol=1e-6)
    free_side = bed.pose.position[1] - bed.size[1] / 2
    assert reach.contains((reach.shoulders[1][0] - 0.35, free_side + 0.05, reach.shoulders[1][2]))


def test_a_round_vessel_is_a_cylinder_and_a_long_one_a_box(map_of: Read, thing: Write, seen: Write) -> None:
    scene = scene_of(
        map_of(
            thing("cup1", "Cup", (0.08, 0.08, 0.1)),
            thing("bottle1", "DrinkingBottle", (0.05, 0.1, 0.2)),
            seen("cup1", (0, 0, 0.05)),
            seen("bottle1", (1, 0, 0.1)),
        )
    )
    assert [body.shape for body in scene.bodies] == ["cylinder", "box"]


def test_parts_and_hinged_things_stay_where_they_are(map_of: Read, thing: Write, seen: Write) -> None:
    scene = scene_of(
        map_of(
            thing("cabinet1", "Cabinet-PieceOfFurniture", (0.4, 0.8, 0.8), "properPhysicalParts knob1"),
            thing("knob1", "SpatialThing-Localized", (0.05, 0.05, 0.05)),
            thing("lid1", "SpatialThing-Localized", (0.05, 0.05, 0.05), "hingedTo cabinet1"),
            thing("ball1", "SpatialThing-Localized", (0.05, 0.05, 0.05)),
            *(seen(name, (i, 0, 0.4)) for i, name in enumerate(("cabinet1", "knob1", "lid1", "ball1"))),
        )
    )
    assert [body.name for body in scene.bodies if body.movable] == ["ball1"]


def test_handles_of_movable_objects_belong_to_their_bodies_and_those_of_furniture_do_not(
    map_of: Read, thing: Write, seen: Write
) -> None:
    things = {"pot": "StoveTopCookingPot", "stool": "Stool", "tray": "Tray"}
    scene = scene_of(
        map_of(
            *(thing(one, cls, (0.3, 0.3, 0.3), f"properPhysicalParts {one}_handle") for one, cls in things.items()),
            *(thing(f"{one}_handle", "Handle", (0.1, 0.05, 0.02)) for one in things),
            *(seen(one, (x, 0, 0.15)) for x, one in enumerate(things)),
            *(seen(f"{one}_handle", (x, 0.2, 0.25)) for x, one in enumerate(things)),
        )
    )
    assert {body.name for body in scene.bodies} == {"pot", "stool", "tray", "stool_handle"}
    assert [one.pose.position for one in scene.body("pot").handles] == [pytest.approx((0.0, 0.2, 0.1))]
    assert {body.name: body.hands for body in scene.bodies if body.graspable} == {"pot": 1, "tray": 2}


def test_a_thing_may_sink_two_centimetres_into_its_support() -> None:
    table = Body("table", Pose((0, 0, 0.35)), (1, 1, 0.7))
    for sunk, support in ((0.0, "table"), (0.019, "table"), (-0.02, "table"), (0.03, None), (-0.05, None)):
        cup = Body("cup", Pose((0.3, 0, 0.75 - sunk)), (0.08, 0.08, 0.1), movable=True)
        assert support_of(Scene((table, cup)), "cup") == support, f"sunk by {sunk}"


def test_the_support_is_the_highest_surface_below() -> None:
    tray = Body("tray", Pose((0, 0, 0.71)), (0.4, 0.3, 0.02))
    table = Body("table", Pose((0, 0, 0.35)), (1, 1, 0.7))
    cup = Body("cup", Pose((0, 0, 0.77)), (0.08, 0.08, 0.1))
    assert support_of(Scene((table, tray, cup)), "cup") == "tray"
    assert support_of(Scene((table, tray, cup)), "cup", {"cup": Pose((0.4, 0, 0.75))}) == "table"


BOXES = {
    "tray": ("Tray", (0.5, 0.4, 0.04), (0, 0, 0.02)),
    "bowl": ("Bowl-Eating", (0.16, 0.16, 0.06), (0.15, 0, 0.07)),
    "apple": ("FoodOrDrink", (0.07, 0.07, 0.07), (0.15, 0, 0.135)),
    "cup": ("Cup", (0.08, 0.08, 0.1), (-0.1, 0.05, 0.09)),
    "board": ("CuttingBoard", (0.55, 0.1, 0.02), (0, -0.13, 0.05)),
}
"""Class, extents and position of things stacked as solid boxes."""


def test_what_the_map_states_at_the_height_of_a_rim_stands_on_the_floor_inside_with_all_on_it(
    map_of: Read, thing: Write, seen: Write
) -> None:
    found: list[Diagnostic] = []
    things = [thing(name, cls, size) for name, (cls, size, _) in BOXES.items()]
    scene = scene_of(map_of(*things, *(seen(name, place) for name, (_, _, place) in BOXES.items())), found)
    lowest = {body.name: body.pose.position[2] - body.size[2] / 2 for body in scene.bodies}
    wall = {body.name: body.wall for body in scene.bodies}
    on_tray, in_bowl = wall["tray"], wall["tray"] + wall["bowl"]
    expected = {"tray": 0.0, "bowl": on_tray, "apple": in_bowl, "cup": on_tray, "board": 0.04}  # which is too long
    assert lowest == pytest.approx(expected)
    assert [support_of(scene, name) for name in ("bowl", "apple", "cup", "board")] == ["tray", "bowl", "tray", "tray"]
    assert [note.message.split(",")[0] for note in found if note.code == "M013"] == [
        "bowl",
        "apple inside bowl",
    ]


def test_the_robot_starts_at_the_free_pose_nearest_the_centre(room: Scene) -> None:
    assert next(default_starts(room, 0.333)) == (0.0, 0.0, 0.0)
    table = Body("table", Pose((0.0, 0.0, 0.35)), (0.8, 1.2, 0.7))
    start = next(default_starts(replace(room, bodies=(*room.bodies, table)), 0.333))
    assert start == (-0.85, 0.0, 0.0)


def test_a_crowded_room_has_no_start_pose() -> None:
    walls = Body("room", Pose((0, 0, 1)), (1.0, 1.0, 2.0), "room")
    assert next(default_starts(Scene((walls,), (-0.5, -0.5, 0.5, 0.5)), 0.4)) == (0.0, 0.0, 0.0)
    assert next(default_starts(Scene((walls,), (-0.5, -0.5, 0.5, 0.5)), 0.45), None) is None


def test_the_robot_starts_under_lamps_above_its_head() -> None:
    lamp = Body("lamp", Pose((0, 0, 2.4)), (1.0, 1.0, 0.2))
    assert next(default_starts(Scene((lamp,), (-2, -2, 2, 2)), 0.4)) == (0.0, 0.0, 0.0)


def test_start_poses_of_a_vast_map_are_searched_near_its_centre_only() -> None:
    far = Body("far", Pose((3e6, 0, 0.5)), (1.0, 1.0, 1.0))
    near = Body("near", Pose((-3e6, 0, 0.5)), (1.0, 1.0, 1.0))
    assert next(default_starts(Scene((far, near), (-3e6, -5, 3e6, 5)), 0.4)) == (0.0, 0.0, 0.0)


def test_a_start_may_be_farther_away_than_a_small_room_is_wide() -> None:
    hall = Body("hall", Pose((0, 0, 0.5)), (30.0, 30.0, 1.0))
    start = next(default_starts(Scene((hall,), (-20, -20, 20, 20)), 0.4))
    assert start == (-15.5, 0.0, 0.0)
