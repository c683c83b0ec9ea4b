"""Recordings: what is kept, and a file that the viewer's own tool accepts."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path
from typing import cast

import pytest

from executive.report import recording
from executive.report.recording import Recording
from executive.report.shapes import Shape, link_shapes
from planlang.diagnostics import BadInput
from planlang.protocols import Pose, World

BOTTLE = Shape("cylinder", (0.07, 0.07, 0.25))
BED = Shape("box", (2.0, 1.0, 0.6))


class Room:
    """A bed that stands, a bottle that moves along x, a robot's hand."""

    rate = 30
    time = 0

    def pose(self, name: str) -> Pose:
        return Pose((0.01 * self.time if name == "bottle 1" else 0.0, 0.0, 0.5))

    def link_pose(self, link: str) -> Pose:
        return Pose((0.0, 0.0, 1.0))


def test_without_the_package_a_recording_is_bad_input_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(recording, "find_spec", lambda name: None)
    with pytest.raises(BadInput, match=r"C012.*\n.*pip install 'planlang\[record\]'"):
        Recording(cast(World, Room()), {})


def test_importing_the_recorder_does_not_import_the_viewer() -> None:
    code = "import sys, executive.report.recording; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_saved_recording_passes_the_viewers_verification(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    room = Room()
    kept = Recording(cast(World, room), {"bottle 1": [BOTTLE], "bed1": [BED]}, {"hand": [Shape("sphere", (0.1,) * 3)]})
    for step in range(60):
        room.time = step
        kept.frame(step)
    kept.event(0, "serve_a_drink started")
    path = tmp_path / "run.rrd"
    kept.save(path)
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]

    rerun = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert rerun, "the package brings its command"
    verified = subprocess.run([rerun, "rrd", "verify", str(path)], capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stderr
    printed = subprocess.run([rerun, "rrd", "print", "-vvv", str(path)], capture_output=True, text=True, check=False)
    for entity in ("bodies/bottle\\ 1", "bodies/bed1/box", "robot/hand/sphere", "plan"):
        assert entity in printed.stdout
    assert recording.TIME_LINE in printed.stdout
    assert "serve_a_drink started" in printed.stdout


def test_primitives_of_links_are_read_with_their_place_and_colour(tmp_path: Path) -> None:
    urdf = tmp_path / "robot.urdf"
    urdf.write_text(
        """<robot name="r"><material name="red"><color rgba="1 0 0 1"/></material>
        <link name="arm"><visual><origin xyz="0 0 1" rpy="0 0 3.14159265"/>
          <geometry><cylinder radius="0.05" length="0.4"/></geometry><material name="red"/></visual></link>
        <link name="hand"><visual><geometry><mesh filename="hand.dae"/></geometry></visual>
          <collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision></link>
        <link name="frame"/></robot>"""
    )
    shapes = link_shapes(urdf)
    assert list(shapes) == ["arm", "hand"]
    (arm,) = shapes["arm"]
    assert (arm.kind, arm.size, arm.colour) == ("cylinder", (0.1, 0.1, 0.4), (255, 0, 0, 255))
    assert arm.pose.position == (0.0, 0.0, 1.0)
    assert arm.pose.yaw == pytest.approx(3.14159265)
    assert shapes["hand"][0].size == (0.1, 0.2, 0.3)
