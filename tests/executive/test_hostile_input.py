"""Bad input as a hostile user would give it: each ends in a diagnostic or a typed failure, never in a traceback."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from executive.cli.app import app
from planlang.files import bundled

RECIPE = (bundled("recipes") / "serve_a_drink.omn").read_text(encoding="utf-8")
MAP = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")
ROBOT = (bundled("ontologies") / "robots" / "amigo.omn").read_text(encoding="utf-8")
URDF = (bundled("ontologies") / "robots" / "amigo.urdf").read_text(encoding="utf-8")

RDF = 'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#" xmlns:rdfs="http://www.w3.org/2000/01/rdf-schema#"'


def owl(declarations: str, text: str) -> str:
    """An RDF/XML file with a document type and one label."""
    label = f'<rdf:Description rdf:about="http://example.org/#a"><rdfs:label>{text}</rdfs:label></rdf:Description>'
    return f'<?xml version="1.0"?>\n<!DOCTYPE rdf:RDF [{declarations}]>\n<rdf:RDF {RDF}>{label}</rdf:RDF>'


BOMB = '<!ENTITY a0 "lol">' + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))

RECIPES = {
    "empty file": ("", "O002"),
    "truncated XML": (f'<?xml version="1.0"?>\n<rdf:RDF {RDF}>\n  <rdf:Description', "O005"),
    "entity bomb": (owl(BOMB, "&a11;"), "O008"),
    "external entity": (owl('<!ENTITY s SYSTEM "file:///etc/hostname">', "&s;"), "O009"),
    "truncated Manchester": (RECIPE[: RECIPE.index("Class: ServeADrink") + 60], "O020"),
    "no sub-actions": (re.sub(r".*subAction.*\n", "", RECIPE), "R001"),
    "cyclic": (
        RECIPE.replace(
            "occursBeforeInOrdering ReachToHandoverPose, knowrob:occursAfterInOrdering HandOverBottle",
            "occursBeforeInOrdering ReachToHandoverPose, knowrob:occursAfterInOrdering MoveBaseToGraspPose",
        ),
        "R012",
    ),
}


def answer(*arguments: str | Path) -> dict[str, Any]:
    """The command's answer as JSON, with its exit code checked to be the process's."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"], prog_name="planlang")
    found: dict[str, Any] = json.loads(result.stdout)
    assert found["exit_code"] == result.exit_code
    assert "Traceback" not in result.stdout + result.stderr
    return found


def errors(found: dict[str, Any]) -> list[str]:
    """Codes of the errors in an answer."""
    return [d["code"] for d in found["diagnostics"] if d["severity"] == "error"]


def without(text: str, name: str) -> str:
    """A map without a thing, its pose and its perception."""
    frames = text.split("\n\n")
    return "\n\n".join(f for f in frames if not re.match(rf"Individual: (perception_|pose_)?{name}\b", f))


@pytest.mark.parametrize("kind", RECIPES)
def test_a_bad_recipe_is_refused_with_a_diagnostic_at_its_place(kind: str, tmp_path: Path) -> None:
    text, code = RECIPES[kind]
    path = tmp_path / "recipe.owl"
    path.write_text(text, encoding="utf-8")
    for command in ("check", "compile"):
        found = answer(command, path)
        assert (found["exit_code"], errors(found)[0]) == (2, code)
        span = found["diagnostics"][-1]["span"]
        assert span["file"] == str(path)


def test_an_import_from_the_network_is_left_out_with_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "recipe.omn"
    path.write_text(RECIPE.replace("    Import: ", "    Import: <http://example.org/x.owl>\n    Import: ", 1))
    found = answer("check", path)
    assert found["exit_code"] == 0
    warned = [d for d in found["diagnostics"] if d["code"] == "O031"]
    assert len(warned) == 1
    assert "http://example.org/x.owl" in warned[0]["message"]


def test_a_robot_without_a_gripper_lacks_a_capability(tmp_path: Path) -> None:
    urdf, robot = tmp_path / "handless.urdf", tmp_path / "handless.omn"
    urdf.write_text(re.sub(r'(<joint name="finger[^"]*" type=")revolute"', r'\1fixed"', URDF))
    robot.write_text(without(without(ROBOT, "right_gripper"), "left_gripper"))
    found = answer("run", "serve_a_drink", "--robot", robot, "--urdf", urdf)
    assert (found["exit_code"], found["failure"]) == (3, ["MissingCapability"])
    assert "MissingCapability: capability GripperMotionCapability: " in found["outcome"]


@pytest.mark.parametrize(
    ("text", "failure"),
    [
        (without(MAP, "bottle1"), "ObjectUnresolvable"),
        (without(MAP, "patient1"), "ObjectUnresolvable"),
        (MAP.replace("knowrob:m03 -2.72", "knowrob:m03 -12.72"), "ObjectUnreachable"),
        (re.sub(r"(depth|width)OfObject 0\.065", r"\1OfObject 0.365", MAP), "ObjectUnreachable"),
    ],
    ids=["no bottle", "no patient", "bottle outside the room", "bottle wider than the hand"],
)
def test_a_map_that_does_not_fit_the_recipe_ends_in_a_typed_failure(text: str, failure: str, tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    path.write_text(text, encoding="utf-8")
    found = answer("run", "serve_a_drink", "--environment", path)
    assert (found["exit_code"], found["failure"][0]) == (1, failure)
    assert "serve_a_drink" in found["outcome"], "the failure says where in the plan it arose"


def test_a_bottle_of_size_0_has_the_default_size_of_its_class(tmp_path: Path) -> None:
    path = tmp_path / "map.omn"
    start = MAP.index("Individual: bottle1")
    path.write_text(MAP[:start] + re.sub(r"OfObject [\d.]+", "OfObject 0.0", MAP[start:], count=3))
    found = answer("run", "serve_a_drink", "--environment", path)
    assert found["exit_code"] == 0
    assert found["final_state"] == ["bottle1: held by patient1"]
    assert [d["code"] for d in found["diagnostics"]] == ["M005"]


@pytest.mark.parametrize(
    ("option", "code"),
    [("glass=bottle1", "X004"), ("bottle=bottle7", "X005"), ("bottle=bed1", "X006")],
)
def test_a_parameter_is_set_only_to_a_fitting_thing_of_the_map(option: str, code: str) -> None:
    found = answer("run", "serve_a_drink", "--set", option)
    assert (found["exit_code"], errors(found)) == (2, [code])


def test_a_plan_that_cannot_be_imported_is_bad_input_at_its_line(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("import planlang\n\nplanlang.no_such_thing\n")
    found = answer("run", path, "--robot", "amigo", "--environment", "hospital_room")
    assert (found["exit_code"], errors(found)) == (2, ["X001"])
    assert found["diagnostics"][0]["span"]["line"] == 3


def test_a_plan_file_without_a_plan_is_bad_input(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("import planlang\n")
    found = answer("run", path, "--robot", "amigo", "--environment", "hospital_room")
    assert (found["exit_code"], errors(found)) == (2, ["X002"])


def test_a_start_in_a_wall_ends_in_a_typed_failure_or_a_diagnostic() -> None:
    found = answer("run", "serve_a_drink", "--start", "40,0,0")
    assert found["exit_code"] in (1, 2)
    assert found["failure"] if found["exit_code"] == 1 else errors(found)
