"""Features of objects, from published models and from boxes."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.in_hand import STOWED, grip_of
from executive.maps.object_models import Blade, ObjectModels, Thing
from executive.robots import bind_robot
from planlang.designators import an_object
from planlang.motion_constraints import a_feature
from planlang.ontology import Ontology, load

CAD = "http://knowrob.org/kb/knowrob-cad.owl#"
SPATULAS = "http://knowrob.org/kb/spatula-features.owl#"
Write = Callable[..., str]
Read = Callable[..., SemanticMap]
LEVEL = np.array([0.0, 0.0, 1.0])


def model(corpus: Path, name: str) -> Ontology:
    return load(corpus / "objects" / f"{name}@hydro.owl")


def placed(ontology: Ontology, iri: str, *path: str) -> tuple[str, tuple[float, ...], tuple[float, ...]] | None:
    """Kind, position and direction, rounded, of the feature at the end of a path."""
    thing = Thing(iri, (0.3, 0.3, 0.2), LEVEL)
    found = ObjectModels(ontology).grounded(a_feature(of=an_object("Thing"), path=path), thing)
    if found is None or found.kind is None or found.position is None:
        return None
    return found.kind.name, *(tuple(round(one, 4) for one in each or ()) for each in (found.position, found.direction))


def test_the_features_of_pouring_are_the_cap_and_the_largest_plane_that_points_up(corpus: Path) -> None:
    mix, maker = model(corpus, "mondamin-pancake-mix"), model(corpus, "pancake-maker")
    bottle = f"{CAD}mondamin-pancake-mix_obt15qOO"
    assert placed(mix, bottle, "BottleCap", "ObjectMainAxis") == ("LINE", (0.0, 0.0, 0.097), (0.0, 0.0, 0.009))
    assert placed(mix, bottle, "BottleCap", "CenterOfObject") == ("POINT", (0.0, 0.0, 0.097), ())
    assert placed(maker, f"{CAD}pancake-maker_zvH1ax5o", "SupportingPlane") == (
        "PLANE", (0.0, 0.0, 0.0), (-0.0082, -0.0047, 1.0)
    )  # fmt: skip


def test_of_nested_parts_the_one_nearest_to_the_whole_is_used(corpus: Path) -> None:
    spatulas = model(corpus, "spatula-features")
    pancake, left, right = (
        f"{SPATULAS}{name}" for name in ("Pancake_PjkWnkr1", "Spatula_LvaYsvy6", "Spatula_Rkpqmqf1")
    )
    assert placed(spatulas, pancake, "FlatPhysicalSurface") == ("PLANE", (0.0, 0.0, 0.0), (0.0, 0.0, 0.1))
    assert placed(spatulas, pancake, "FlatPhysicalSurface", "RightSide") == (
        "PLANE",
        (0.0, -0.07, 0.0),
        (0.0, 0.0, 0.1),
    )
    assert placed(spatulas, left, "BladeOfADevice", "FrontSide") == ("LINE", (0.0, 0.0, 0.0475), (0.0, 0.125, 0.0))
    assert placed(spatulas, left, "Handle") == ("LINE", (0.0, 0.0, 0.0), (0.0, 0.0, 0.125))
    assert placed(spatulas, right, "Handle") is None


def test_an_object_without_a_model_has_the_features_of_its_box(corpus: Path) -> None:
    spatulas = model(corpus, "spatula-features")
    assert placed(spatulas, "http://example.org/cup1", "MouthOfVessel") == ("LINE", (0.0, 0.0, 0.1), (0.0, 0.0, 1.0))
    assert placed(spatulas, "http://example.org/cup1", "SupportingPlane") == ("PLANE", (0.0, 0.0, 0.1), (0.0, 0.0, 1.0))
    assert placed(spatulas, "http://example.org/cup1", "Handle") is None


@pytest.mark.parametrize(("palm", "side"), [(0.1, -1.0), (-0.1, 1.0)])
@pytest.mark.parametrize("up", [LEVEL, -LEVEL])
def test_the_flat_side_of_an_object_held_in_its_middle_faces_away_from_the_palm(
    corpus: Path, palm: float, side: float, up: np.ndarray
) -> None:
    models, flat = ObjectModels(model(corpus, "spatula-features")), a_feature(of=an_object("Thing"), path=("FlatSide",))
    sponge = Thing("http://example.org/sponge1", (0.1, 0.065, 0.045), up, 0.0, np.zeros(3), palm * LEVEL)
    found = models.grounded(flat, sponge)
    assert found is not None
    assert found.direction == (0.0, 0.0, side)


def test_the_box_of_a_tool_ends_at_the_front_of_its_blade(corpus: Path) -> None:
    blade = Blade.of(model(corpus, "spatula-features"), f"{SPATULAS}Spatula_LvaYsvy6")
    assert blade is not None
    size, centre = blade.box((0.345, 0.08, 0.02))
    assert size == pytest.approx((0.02, 0.08, 0.345))
    assert centre[2] + size[2] / 2 == pytest.approx(0.0475)
    assert centre[0] - size[0] / 2 == pytest.approx(-0.001)  # the blade, 2 mm thick, is the lower side


@pytest.fixture
def kitchen(corpus: Path, tmp_path: Path) -> SemanticMap:
    """A map of a table that imports the models of spatulas and a pancake."""
    table = tmp_path / "table.omn"
    table.write_text(
        "Prefix: : <http://example.org/t.owl#>\nPrefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
        "Ontology: <http://example.org/t.owl>\n    Import: <package://models/spatula-features.owl>\n"
        "Individual: table1\n    Types: knowrob:KitchenTable\n    Facts: knowrob:depthOfObject 1.0,"
        " knowrob:widthOfObject 1.0, knowrob:heightOfObject 0.7, knowrob:orientation p\n"
        'Individual: p\n    Types: knowrob:RotationMatrix3D\n    Facts: knowrob:translation "0 0 0.35",'
        ' knowrob:quaternion "0 0 0 1"\n',
        encoding="utf-8",
    )
    return read_map(load(table, folders=[corpus / "objects"]))


def test_parts_of_models_are_not_objects_of_a_map(kitchen: SemanticMap) -> None:
    names = {"Pancake_PjkWnkr1", "Spatula_LvaYsvy6", "Spatula_Rkpqmqf1", "table1"}
    assert {thing.name for thing in kitchen.objects} == names


def test_a_spatula_points_along_the_approach_with_its_blade_in_the_closing_plane(kitchen: SemanticMap) -> None:
    arm, spatula = bind_robot("amigo").arms[0], kitchen.find("Spatula_LvaYsvy6")
    assert spatula is not None
    pose = grip_of(arm, spatula, kitchen)
    approach, closing = np.array(arm.approach), np.array(arm.closing)
    assert pose.position == pytest.approx(0.3 * approach, abs=1e-9)
    assert pose.rotation[:, 2] == pytest.approx(approach, abs=1e-9)
    assert pose.rotation[:, 0] == pytest.approx(np.cross(approach, closing), abs=1e-9)


def test_objects_in_hands_have_no_place_in_the_scene(kitchen: SemanticMap) -> None:
    scene = scene_of(kitchen)
    assert scene.body("Spatula_LvaYsvy6").pose == STOWED
    assert max(map(abs, scene.bounds)) < 3.0


def test_a_direction_with_an_invalid_number_is_reported_and_left_out(map_of: Read, thing: Write, seen: Write) -> None:
    parts = """
Individual: axis1
    Types: knowrob:Cone
    Facts: knowrob:longitudinalDirection up1, knowrob:areaOfObject "large"
Individual: up1
    Types: knowrob:Vector
    Facts: knowrob:vectorX 0.5, knowrob:vectorY "0;5", knowrob:vectorZ 1.0
"""
    tool = thing("tool1", "Tool", (0.1, 0.1, 0.2), "properPhysicalParts axis1"), seen("tool1", (0, 0, 0.1))
    semantic_map = map_of(*tool, parts)
    told = [(one.code, one.message) for one in semantic_map.diagnostics if one.code != "M004"]
    assert ("M002", "vectorY of up1 is left out: not a number: '0;5'") in told
    assert ("M002", "areaOfObject of axis1 is left out: not a number: 'large'") in told
    tool1 = semantic_map.find("tool1")
    assert tool1
    assert placed(semantic_map.ontology, tool1.iri, "Cone") == ("POINT", (0.0, 0.0, 0.0), ())
