"""Capabilities that action classes require, compared with what a bound robot has."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from executive.robots import FindingKind, Robot, bind_robot, missing_capabilities, requirements
from planlang.files import Bundled, bundled
from planlang.ontology import Ontology, expand, load

SERVING = ("Translation-LocationChange", "Reaching", "OpeningAGripper", "ClosingAGripper", "HandingOverAnObject")
LOOKING = "LookingForSomething"


@pytest.fixture(scope="module")
def vocabulary() -> Ontology:
    """The bundled vocabulary."""
    return load(bundled("ontologies") / "knowrob.omn")


def names(ontology: Ontology, robot: Robot, *actions: str) -> list[str]:
    return [missing.name for missing in missing_capabilities(ontology, map(expand, actions), robot)]


def test_amigo_lacks_nothing_for_serving(vocabulary: Ontology, amigo: Robot) -> None:
    assert names(vocabulary, amigo, *SERVING, LOOKING, "GraspingSomething", "PickingUpAnObject") == []


def test_a_robot_without_gripper_is_reported_with_what_it_lacks_and_why(vocabulary: Ontology, amigo: Robot) -> None:
    handless = replace(amigo, arms=tuple(replace(arm, gripper=None) for arm in amigo.arms))
    missing = missing_capabilities(vocabulary, map(expand, SERVING), handless)
    assert "GripperMotionCapability" in [one.name for one in missing]
    text = "; ".join(map(str, missing))
    assert "amigo has no gripper" in text
    assert "required by OpeningAGripper > GripperMotionCapability" in text


def test_a_robot_file_without_gripper_is_named_with_the_table_to_state(vocabulary: Ontology, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(re.sub(r"(?m)^\[arms\.arm\.gripper\]\n(.+\n)+", "", Bundled.ROBOT.find("panda").read_text()))
    missing = missing_capabilities(vocabulary, [expand("GraspingSomething")], bind_robot(file))
    assert any("mine.toml has no table [arms.arm.gripper]" in one.reason for one in missing)


def test_claims_do_not_replace_an_arm(vocabulary: Ontology, amigo: Robot) -> None:
    assert "ArmMotionCapability" in names(vocabulary, replace(amigo, arms=()), "Reaching")
    assert names(vocabulary, replace(amigo, arms=()), "Translation-LocationChange") == []


def test_a_claim_without_its_components_does_not_count(vocabulary: Ontology, amigo: Robot) -> None:
    blind = replace(amigo, parts=tuple(p for p in amigo.parts if not any("Recognition" in cls for cls in p.classes)))
    for action in (LOOKING, "PushingAnObject", "PushingMotion"):
        assert "ObjectRecognitionCapability" in names(vocabulary, blind, action)


def test_a_capability_without_claim_or_requirements_is_unknown(vocabulary: Ontology, amigo: Robot) -> None:
    nothing = replace(amigo, claims={}, parts=())
    found = missing_capabilities(vocabulary, [expand("Translation-LocationChange")], nothing)
    assert {one.kind for one in found} == {FindingKind.CAPABILITY, FindingKind.COMPONENT}


def test_requirements_include_dependencies_of_capabilities(vocabulary: Ontology) -> None:
    capabilities, components = requirements(vocabulary, [expand("GraspingSomething")])
    found = {iri.rsplit("#")[-1] for iri in capabilities}
    assert {"GraspingCapability", "ArmMotionCapability", "GripperMotionCapability"} <= found
    assert {"ArmComponent", "ManipulationEntity"} <= {iri.rsplit("#")[-1] for iri in components}


@pytest.mark.parametrize("name", ["amigo@hydro.owl", "amigo@re_stack.owl.in"])
def test_grasping_is_possible_for_real_robots_as_expected(corpus: Path, vocabulary: Ontology, name: str) -> None:
    table = json.loads((corpus / "truth" / "srdl_expected_serve_drink.json").read_text())
    expected = next(
        row["closure"]
        for row in table
        if row["robot_file"] == name.removesuffix(".in") and row["recipe_set"] == "serve_drink_hydro"
    )
    actions = [expand(a) for a in ("Translation-LocationChange", "Reaching", "OpeningAGripper", "GraspingSomething")]
    missing = missing_capabilities(vocabulary, actions, bind_robot(corpus / "robots" / name))
    assert {m.name for m in missing if m.kind is FindingKind.CAPABILITY} == set(expected["missing_capabilities"])
    assert {m.name for m in missing if m.kind is FindingKind.COMPONENT} == set(expected["missing_components"])
