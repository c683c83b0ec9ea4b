"""Recordings: what is kept, and a file that the viewer's own tool accepts."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from executive.pictures import drawn
from executive.pictures.drawn import drawn_in, missing
from planlang.files import bundled
from planlang.geometry import Pose
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene


def test_without_the_package_a_recording_is_bad_input_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(drawn, "find_spec", lambda name: None)
    (problem,) = missing()
    assert (problem.code, problem.help) == ("C012", "pip install 'planlang[record]', or leave out --record")


def test_what_is_drawn_is_known_without_the_viewer() -> None:
    code = "import sys, executive.pictures.drawn; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_saved_recording_passes_the_viewers_verification(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    from executive.pictures import recording

    room = Scene(
        (
            Body("bottle 1", Pose((0.0, 0.0, 1.0)), (0.07, 0.07, 0.25), "cylinder", movable=True),
            Body("bed1", Pose((2.0, 0.0, 0.3)), (2.0, 1.0, 0.6)),
            Body("patient1", Pose((2.0, 0.0, 0.75)), (1.8, 0.6, 0.3), "person"),
        )
    )
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    world = PyBulletWorld(room, RobotBody(urdf, CameraModel("base_link")))
    kept = recording.Recording(world.rate, drawn_in(world))
    for step in range(60):
        world.set_pose("bottle 1", Pose((0.01 * step, 0.0, 1.0)))
        kept.frame(step)
    link = next(iter(world.robot.looks()))
    world.close()
    kept.event(0, "serve_a_drink started")
    path = tmp_path / "run.rrd"
    kept.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]

    rerun = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert rerun, "the package brings its command"
    verified = subprocess.run([rerun, "rrd", "verify", str(path)], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stderr
    printed = subprocess.run([rerun, "rrd", "print", "-vvv", str(path)], capture_output=True, text=True, check=False)
    for entity in ("bodies/bottle\\ 1", "bodies/patient1/limb", f"robot/{link}/", "plan"):
        assert entity in printed.stdout
    assert recording.TIME_LINE in printed.stdout
    assert "serve_a_drink started" in printed.stdout


def test_primitives_of_links_are_drawn_with_their_place_and_colour(tmp_path: Path) -> None:
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(
        """<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material>
        <link name="arm"><visual><origin xyz="0 0 1" rpy="0 0 3.14159265"/>
          <geometry><cylinder radius="0.05" length="0.4"/></geometry><material name="red"/></visual></link>
        <link name="hand"><visual><geometry><mesh filename="hand.dae"/></geometry></visual>
          <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision></link>
        <link name="frame"/>
        <joint name="wrist" type="fixed"><parent link="arm"/><child link="hand"/></joint>
        <joint name="mount" type="fixed"><parent link="hand"/><child link="frame"/></joint></robot>"""
    )
    world = PyBulletWorld(Scene(()), RobotBody(urdf, CameraModel("arm")))
    drawn = {thing.path[1]: thing.shapes for thing in drawn_in(world)}
    world.close()
    assert list(drawn) == ["arm", "hand"]
    (arm,) = drawn["arm"]
    assert (arm.kind, arm.size, arm.colour) == ("cylinder", (0.1, 0.1, 0.4), (255, 0, 0, 255))
    assert arm.pose.position == (0.0, 0.0, 1.0)
    assert arm.pose.yaw == pytest.approx(3.14159265)
    assert drawn["hand"][0].size == pytest.approx((0.1, 0.2, 0.3))
