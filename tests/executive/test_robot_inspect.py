"""``planlang robot inspect``."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pybullet_data
import pytest
from PIL import Image
from robot_files import cart_in
from typer.testing import CliRunner, Result

from executive.cli.app import app
from executive.runs.assembly import mapped


def inspected(*arguments: str | Path) -> Result:
    return CliRunner().invoke(app, ["robot", "inspect", *map(str, arguments)], prog_name="planlang")


def test_it_tells_chains_limits_postures_and_draws_what_the_arms_reach(tmp_path: Path) -> None:
    result = inspected("amigo", "--picture", tmp_path / "reach.png")
    assert result.exit_code == 0, result.output
    for said in ("spindle_joint", "0.090 ..    0.400", "arm left", "carrying:", "reaches, of poses", "missing"):
        assert said in result.stdout
    pixels = np.asarray(Image.open(tmp_path / "reach.png").convert("RGB"))
    yellow = (pixels[..., 0] > 150) & (pixels[..., 2] < 110)
    blue = (pixels[..., 2] > 120) & (pixels[..., 0] < 110) & (pixels[..., 1] < 140)
    assert yellow.sum() > 100, "places that are reached with many headings"
    assert blue.sum() > 1000, "places that are reached with few"


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
    for entity in ("reach/left/side", "reach/right/top", "world/robot/base_plate"):
        assert entity in printed


def test_without_the_package_a_recording_is_refused_with_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("executive.pictures.recording.find_spec", lambda name: None)
    result = inspected("amigo", "--record", tmp_path / "reach.rrd")
    assert result.exit_code == 2
    assert "pip install 'planlang[record]'" in result.output


def test_maps_are_built_with_a_line_each_also_where_stderr_is_no_terminal() -> None:
    said: list[str] = []
    mapped(said.append, 2, 6, "left, side")
    assert said == ["building reachability maps, once for this robot: 2 of 6 done, left, side"]
