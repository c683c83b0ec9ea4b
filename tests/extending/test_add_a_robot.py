"""Add a robot without changing planlang: a URDF with a robot file (TOML), and a self-model (OWL) if wanted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app

URDF = """<robot name="cart">
<link name="base"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.5 0.5 0.5"/></geometry></collision></link>
<link name="camera"/>
<joint name="mast" type="fixed"><parent link="base"/><child link="camera"/><origin xyz="0.2 0 1.1"/></joint>
</robot>"""
ROBOT_FILE = """
name = "cart"
urdf = "cart.urdf"
[base]
radius = 0.36
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""
CAMERA = """
[camera]
link = "camera"
forward = [1, 0, 0]
up = [0, 0, 1]
"""
SELF_MODEL = """
Prefix: : <http://example.org/cart.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Prefix: cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Ontology: <http://example.org/cart.owl>
    Import: <http://knowrob.org/kb/srdl2.owl>

Class: Cart
    SubClassOf: knowrob:Robot, cap:hasCapability some cap:BaseMotionCapability
Individual: cart1
    Types: Cart
    Facts: comp:subComponent wheels, comp:subComponent eye
Individual: wheels
    Types: comp:MobileBase, comp:WheeledBase
Individual: eye
    Types: comp:Camera
    Facts: comp:urdfName "camera"
"""
DRIVE = """
from planlang import *


@plan("http://example.org/#drive")
async def drive() -> None:
    await perform(action("Translation-LocationChange", to_location=a_location({relation}=an_object("DrinkingBottle"))))
"""
LOOK = '    await perform(action("LookingForSomething", object_acted_on=an_object("DrinkingBottle")))\n'


def answer(*arguments: str | Path) -> dict[str, Any]:
    """The command's answer as JSON."""
    result = CliRunner().invoke(app, [*map(str, arguments), "--json"])
    assert "Traceback" not in result.output, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


@pytest.fixture
def garage(tmp_path: Path) -> Path:
    """A folder with the URDF of a cart and plans."""
    (tmp_path / "cart.urdf").write_text(URDF)
    (tmp_path / "drive.py").write_text(DRIVE.format(relation="in_front_of"))
    (tmp_path / "look.py").write_text(DRIVE.format(relation="visible_from") + LOOK)
    return tmp_path


def run(plan: Path, robot: Path) -> dict[str, Any]:
    """The answer of a run in the bundled room."""
    return answer("run", plan, "--robot", robot, "--environment", "hospital_room")


def test_a_urdf_alone_is_a_robot_that_stands_where_it_is_and_says_what_is_assumed(garage: Path) -> None:
    found = run(garage / "drive.py", garage / "cart.urdf")
    assert (found["exit_code"], found["failure"]["class"]) == (3, "MissingCapability")
    assert "the base of cart is fixed" in found["message"]
    assert "planlang robot make" in found["diagnostics"][0]["help"]
    missing = [one["message"] for one in found["diagnostics"] if one["code"] == "B016"]
    assert any("[arms.arm] missing" in one for one in missing)


def test_a_robot_file_is_made_from_the_urdf_and_completed(garage: Path) -> None:
    made = answer("robot", "make", garage / "cart.urdf", "-o", garage / "cart.toml")
    assert (made["exit_code"], made["output"]) == (0, str(garage / "cart.toml"))
    text = (garage / "cart.toml").read_text()
    assert "fixed = true" in text
    (garage / "cart.toml").write_text(text.replace("fixed = true", "fixed = false"))
    assert run(garage / "drive.py", garage / "cart.toml")["exit_code"] == 0
    again = answer("robot", "make", garage / "cart.urdf", "-o", garage / "cart.toml")
    assert [one["code"] for one in again["diagnostics"]] == ["C005"], "what a person has completed is not replaced"


def test_a_robot_file_with_a_name_a_urdf_and_a_base_is_a_robot_that_drives(garage: Path) -> None:
    (garage / "cart.toml").write_text(ROBOT_FILE)
    assert run(garage / "drive.py", garage / "cart.toml")["exit_code"] == 0
    found = answer("robot", "inspect", garage / "cart.toml")
    assert (found["exit_code"], found["missing"][0]) == (3, "arms")
    blind = run(garage / "look.py", garage / "cart.toml")
    assert blind["failure"]["class"] == "MissingCapability"


def test_a_camera_in_the_robot_file_is_turned_by_the_base_where_there_is_no_neck(garage: Path) -> None:
    (garage / "cart.toml").write_text(ROBOT_FILE + CAMERA)
    found = run(garage / "look.py", garage / "cart.toml")
    assert found["exit_code"] == 0, found


def test_a_self_model_says_what_the_robot_can_do_and_is_believed(garage: Path) -> None:
    (garage / "cart.toml").write_text('self_model = "cart.omn"\n' + ROBOT_FILE + CAMERA)
    (garage / "cart.omn").write_text(SELF_MODEL)
    assert run(garage / "drive.py", garage / "cart.toml")["exit_code"] == 0
    found = run(garage / "look.py", garage / "cart.toml")
    assert (found["exit_code"], found["failure"]["class"]) == (3, "MissingCapability")
    assert "ObjectRecognition" in found["message"], "the self-model claims to drive, not to recognise things"
