"""Robots other than the bundled one: real descriptions without their meshes, an arm on a box, a box on wheels."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pybullet_data
import pytest
from click.testing import CliRunner, Result
from PIL import Image
from robot_files import BASE, PANDA_ARM, cart_in

from executive.cli.app import app
from executive.robots import bind_robot
from executive.robots.arms import with_carrying
from planlang.files import Bundled, bundled
from planlang.protocols import Configuration
from sim import PlanningWorld, Scene

ROOM = bundled("ontologies") / "environments" / "hospital_room.omn"

BOX = """<link name="base"><collision><origin xyz="0 0 0.25"/><geometry><box size="0.5 0.5 0.5"/></geometry></collision>
</link>"""
MOUNT = """<joint name="mount" type="fixed"><parent link="base"/><child link="panda_link0"/><origin xyz="0.1 0 0.55"/>
</joint>"""
"""Where the bundled Panda is: the reachability maps that came with planlang serve this one."""

REACH = """
from planlang import *
from planlang.designators import Object

BOTTLE = an_object("DrinkingBottle")


@plan("http://example.org/#reach")
async def reach(*, bottle: Object = BOTTLE) -> None:
    async def body() -> None:
        await perform(action("Reaching", to_location=a_posture("carrying")))
        await perform(action("OpeningAGripper"))
        await perform(action("ClosingAGripper"))

    await at_location(a_location(in_reach_of=(a_location(in_front_of=bottle),)), body)
"""
DRIVE = """
from planlang import *


@plan("http://example.org/#drive")
async def drive() -> None:
    await perform(action("Translation-LocationChange", to_location=a_location({relation}=an_object("DrinkingBottle"))))
"""


def run(*arguments: str | Path) -> dict[str, Any]:
    """The answer of ``planlang run`` as JSON, with its exit code checked to be the process's."""
    result = CliRunner().invoke(app, ["run", *map(str, arguments), "--json"], prog_name="planlang")
    found: dict[str, Any] = json.loads(result.stdout)
    assert found["exit_code"] == result.exit_code
    assert "Traceback" not in result.stdout + result.stderr
    return found


def serve_the_drink(corpus: Path, robot: str, urdf: Path) -> None:
    """Run the real recipe in the real room with a real robot."""
    found = run(
        corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl",
        *("--robot", corpus / "robots" / robot, "--urdf", urdf),
        *("--environment", corpus / "environments" / "map_hospital_room@re_stack.owl.in"),
    )
    assert found["exit_code"] == 0, found
    codes = [diagnostic["code"] for diagnostic in found["diagnostics"]]
    assert codes.count("B013") == 1
    assert "B010" in codes, "what is assumed about the robot is said"


@pytest.mark.long
@pytest.mark.parametrize("robot", ["amigo", "PR2"])
def test_real_robots_without_their_meshes_serve_the_drink(corpus: Path, robot: str) -> None:
    """Building maps of the PR2's arms takes a minute."""
    serve_the_drink(corpus, f"{robot}@hydro.owl", corpus / "robots" / f"{robot.lower()}@hydro.urdf")


@pytest.mark.long
def test_an_old_pr2_with_the_limits_of_newer_ones_needs_no_new_maps(corpus: Path, tmp_path: Path) -> None:
    text = (corpus / "robots" / "pr2@hydro.urdf").read_text()
    assert (text.count('"0.33"'), text.count('"-2.18"')) == (1, 2)
    (tmp_path / "pr2.urdf").write_text(text.replace('"0.33"', '"0.31"').replace('"-2.18"', '"-2.094"'))
    serve_the_drink(corpus, "PR2@hydro.owl", tmp_path / "pr2.urdf")


@pytest.mark.parametrize(
    "broken", ["", "<robot", "<robot/>", "<robot><link name='a'/><link name='b'/></robot>", "\0\1\2"]
)
def test_a_broken_urdf_ends_in_a_diagnostic(tmp_path: Path, broken: str) -> None:
    (tmp_path / "robot.urdf").write_text(broken)
    (tmp_path / "robot.toml").write_text(BASE)
    (tmp_path / "drive.py").write_text(DRIVE.format(relation="in_front_of"))
    found = run(tmp_path / "drive.py", "--robot", tmp_path / "robot.toml", "--environment", ROOM)
    assert found["exit_code"] == 2
    assert {d["code"] for d in found["diagnostics"] if d["severity"] == "error"} == {"B009"}


@pytest.fixture
def panda(tmp_path: Path) -> Path:
    """The robot file of an arm on a box: no torso, no neck, no camera, a finger that mimics the other."""
    folder = tmp_path / "panda"
    shutil.copytree(Path(pybullet_data.getDataPath()) / "franka_panda", folder)
    text = (folder / "panda.urdf").read_text()
    first = text.index('<link name="panda_link0"')
    (folder / "robot.urdf").write_text(text[:first] + BOX + MOUNT + text[first:])
    (folder / "robot.toml").write_text(BASE + PANDA_ARM)
    return folder / "robot.toml"


@pytest.mark.long
def test_an_arm_on_a_box_drives_to_where_it_reaches_the_bottle(panda: Path, tmp_path: Path) -> None:
    (tmp_path / "reach.py").write_text(REACH)
    found = run(tmp_path / "reach.py", "--robot", panda, "--environment", ROOM)
    assert found["exit_code"] == 1
    assert found["failure"]["class"] == "GraspMissed", "all goes well until the gripper closes on nothing"


@pytest.mark.long
def test_an_arm_without_camera_lacks_what_the_recipe_needs(panda: Path) -> None:
    recipe = bundled("recipes") / "serve_a_drink.omn"
    found = run(recipe, "--robot", panda, "--environment", ROOM)
    assert found["exit_code"] == 3
    found = run(recipe, "--robot", panda, "--environment", ROOM, "--force")
    assert found["exit_code"] == 1
    assert found["failure"]["class"] in ("ObjectNowhereToBeFound", "ObjectUnreachable")


def test_a_finger_that_mimics_another_is_not_commanded(panda: Path) -> None:
    gripper = bind_robot(panda).arms[0].gripper
    assert gripper
    assert gripper.joints == ("panda_finger_joint1",)
    assert dict(gripper.opened) == {"panda_finger_joint1": 0.04}


@pytest.mark.long
def test_a_posture_to_drive_in_is_found_level_narrow_and_free(panda: Path) -> None:
    bare = bind_robot(panda)
    robot = with_carrying(bare)
    assert with_carrying(bare).postures == robot.postures
    assert with_carrying(robot) is robot
    assert robot.diagnostics[-1].code == "B010"
    world = PlanningWorld(Scene(()), robot.body())
    assert world.contacts() == ()
    (arm,) = robot.arms
    tip = world.link_pose(arm.tip, Configuration((0.0, 0.0, 0.0), robot.postures["carrying"])).matrix()[:3, :3]
    assert abs((tip @ np.array(arm.approach))[2]) < 0.01
    assert abs((tip @ np.array(arm.closing))[2]) < 0.01
    assert max(radius for _, _, radius in world.silhouette()) < 0.6
    world.close()


def test_a_robot_without_arms_keeps_its_postures() -> None:
    robot = replace(bind_robot("amigo"), arms=(), postures={})
    assert with_carrying(robot) is robot


def cart(folder: Path, urdf: str, numbers: str = "") -> Path:
    """The robot file of a box on wheels."""
    (folder / "robot.urdf").write_text(f'<robot name="cart">{urdf}</robot>')
    (folder / "robot.toml").write_text(BASE + numbers)
    return folder / "robot.toml"


def test_what_has_no_camera_sees_from_nowhere(tmp_path: Path) -> None:
    (tmp_path / "drive.py").write_text(DRIVE.format(relation="visible_from"))
    found = run(tmp_path / "drive.py", "--robot", cart(tmp_path, BOX), "--environment", ROOM)
    assert (found["exit_code"], found["failure"]["class"]) == (1, "MissingCapability")


def inspected(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["robot", "inspect", *map(str, arguments)], prog_name="planlang")


def test_a_robot_on_a_mount_is_told_by_the_file_that_the_user_named() -> None:
    lines = inspected("panda").stdout.splitlines()
    assert lines[0] == f"panda ({Bundled.ROBOT.find('panda')})"
    assert "arm, from panda_link0 to panda_grasptarget" in lines
    (reach,) = (line for line in lines if line.startswith("  reach"))
    assert re.fullmatch(
        r"  reach, on a grid of 5 cm and 15 degrees: \S+ grasps from the side at \S+ m, \S+ tilted ones at \S+ m, "
        r"\S+ from above at \S+ m",
        reach,
    )


def test_it_tells_chains_limits_postures_and_draws_what_the_arms_reach(tmp_path: Path) -> None:
    result = inspected("amigo", "--picture", tmp_path / "reach.png")
    assert result.exit_code == 0, result.output
    for said in ("spindle_joint", "0.090 ..    0.400", "arm left", "carrying:", "grasps from the side", "missing"):
        assert said in result.stdout
    pixels = np.asarray(Image.open(tmp_path / "reach.png").convert("RGB"))
    yellow = (pixels[..., 0] > 150) & (pixels[..., 2] < 110)
    blue = (pixels[..., 2] > 120) & (pixels[..., 0] < 110) & (pixels[..., 1] < 140)
    assert yellow.sum() > 100, "places that are reached with many headings"
    assert blue.sum() > 1000, "places that are reached with few"
    orange = (np.abs(pixels.astype(int) - (235, 150, 60)) < 60).all(axis=2)
    assert orange.sum() > 1000, "the fingers of its hands"


def test_what_a_robot_lacks_is_listed(tmp_path: Path) -> None:
    result = inspected(cart_in(tmp_path), "--json")
    assert result.exit_code == 3, result.output
    missing = json.loads(result.stdout)["missing"]
    assert missing[0] == "arms"
    assert any("camera" in what for what in missing)
    assert any("torso" in what for what in missing)


def test_a_picture_of_no_arms_and_a_robot_that_is_not_there_are_refused(tmp_path: Path) -> None:
    result = inspected(cart_in(tmp_path), "--picture", tmp_path / "reach.png")
    assert (result.exit_code, (tmp_path / "reach.png").exists()) == (2, False)
    assert inspected("no_such_robot").exit_code == 2
    assert inspected("amigo", "--picture", tmp_path / "reach.jpg").exit_code == 2


def test_a_urdf_that_is_no_robots_is_refused() -> None:
    other = Path(pybullet_data.getDataPath()) / "franka_panda" / "panda.urdf"
    assert inspected("amigo", "--urdf", other).exit_code == 2


@pytest.mark.long
def test_a_recording_has_the_robot_and_a_cloud_for_each_arm_and_class_of_grasp(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    result = inspected("amigo", "--record", tmp_path / "reach.rrd")
    assert result.exit_code == 0, result.output
    command = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert command, "the package brings its command"
    verified = subprocess.run([command, "rrd", "verify", str(tmp_path / "reach.rrd")], capture_output=True, check=False)
    assert verified.returncode == 0, verified.stderr
    printed = subprocess.run(
        [command, "rrd", "print", "-vv", str(tmp_path / "reach.rrd")], capture_output=True, text=True, check=True
    ).stdout
    for entity in ("reach/left/side", "reach/right/top", "truth/robot/base_plate"):
        assert entity in printed


def test_without_the_package_a_recording_is_refused_with_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("planlang.extras.find_spec", lambda name: None)
    result = inspected("amigo", "--record", tmp_path / "reach.rrd")
    assert result.exit_code == 2
    assert "pip install 'rerun-sdk>=0.32'" in result.output
