"""Real semantic maps, compared with what an independent script extracted from their RDF."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.belief import SemanticMap, default_starts, read_map, scene_of
from executive.belief.stated_values import EXTENTS, stated_size
from planlang.geometry import Pose
from planlang.ontology import load
from sim import PlanningWorld

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
    """The truth keeps the names of the files; the vocabulary's old namespace is read as the new one."""
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
def test_sizes_types_parts_and_hinges_are_those_of_the_truth(corpus: Path, name: str) -> None:
    semantic_map, truth = read(corpus, name)
    for thing in semantic_map.objects:
        expected = by_old_or_new_name(truth, thing.iri)
        if expected is None:
            continue
        stated = [expected["dimensions"].get(extent) for extent in EXTENTS]
        assert list(stated_size(semantic_map.ontology, thing.iri, [])) == stated, thing.name
        assert [cls.rsplit("#")[-1] for cls in thing.types] == expected["types"], thing.name
        assert {part.rsplit("#")[-1] for part in thing.parts} == {part.rsplit("#")[-1] for part in expected["parts"]}
        assert len(thing.hinged_to) == len(expected["hingedTo"])


@pytest.mark.parametrize("name", MAPS)
def test_rotations_that_were_read_are_rigid(corpus: Path, name: str) -> None:
    semantic_map, _ = read(corpus, name)
    for pose in [thing.pose for thing in semantic_map.objects if thing.pose]:
        assert np.linalg.det(pose.matrix()[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("name", MAPS)
def test_a_world_can_be_made_of_a_real_map_and_a_robot_finds_a_place_in_it(corpus: Path, name: str) -> None:
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


def test_what_lies_in_the_closed_cabinet_of_the_hospital_room_is_reported(corpus: Path) -> None:
    semantic_map, _ = read(corpus, "environments/ias_hospital_room@re_stack.owl.in")
    found: list[Any] = []
    scene = scene_of(semantic_map, found)
    assert [d.code for d in found] == ["M014"]
    assert scene.body("bottle1").size == (0.07, 0.07, 0.24), "the default size of a drinking bottle"
    assert scene.body("Room7635").shape == "room"
    assert isinstance(scene.body("bed1").pose, Pose)
