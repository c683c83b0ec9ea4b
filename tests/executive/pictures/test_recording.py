"""Recordings: what is kept, and a file that the viewer's own tool accepts."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli import app as cli
from executive.pictures.drawn import drawn_in
from planlang import extras
from planlang.files import Bundled
from planlang.outputs import is_replaceable
from sim import CameraModel, PyBulletWorld, RobotBody, Scene
from tests.executive.conftest import Served

PLAN = """from planlang import action, perform, plan


@plan("http://example.org/park#Park")
async def park() -> None:
    await perform(action("MoveBaseToGraspPose", below="Translation-LocationChange", x=0.5, y=0.0, yaw=0.0))
"""


def test_without_the_package_a_recording_is_bad_input_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    (problem,) = extras.no_recorder()
    assert (problem.code, problem.help) == ("C012", "pip install 'rerun-sdk>=0.32', or leave out record")


def test_what_is_drawn_is_known_without_the_viewer() -> None:
    code = "import sys, executive.pictures.drawn; sys.exit('rerun' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the recording and the trace of a run in which a first base pose does not do."""
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    folder = tmp_path_factory.mktemp("recorded")
    words = ("run", "serve_a_drink", "--seed", "3", "--trace", folder / "run.jsonl", "--record", folder / "run.rrd")
    result = CliRunner().invoke(cli.app, [str(word) for word in words], prog_name="planlang")
    assert result.exit_code == 0, result.output
    return folder


def viewer(*words: str | Path) -> subprocess.CompletedProcess[str]:
    """What the viewer's own command answers."""
    command = shutil.which("rerun", path=str(Path(sys.executable).parent))
    assert command, "the package brings its command"
    return subprocess.run([command, "rrd", *map(str, words)], capture_output=True, text=True, check=False)


def test_a_recording_passes_the_viewers_verification_and_is_small(recorded: Path) -> None:
    verified = viewer("verify", recorded / "run.rrd")
    assert verified.returncode == 0, verified.stderr
    assert (recorded / "run.rrd").stat().st_size < 2_000_000


def test_a_recording_has_lanes_graphs_truth_belief_and_candidates(recorded: Path) -> None:
    printed = viewer("print", "-vvv", recorded / "run.rrd").stdout
    entities = {line.split(" - ")[1].strip() for line in printed.splitlines() if line.startswith("Chunk(")}
    assert {
        *(
            "/truth/bodies/bottle1",
            "/truth/bodies/patient1\\ limb4",
            "/truth/robot/grippoint_right",
            "/truth/bodies/room1",
        ),
        *("/belief/bodies/bottle1", "/belief/bodies/bedside_table1"),
        *("/candidates/base\\ poses/accepted", "/candidates/base\\ poses/out\\ of\\ reach"),
        *("/lanes/plan/00", "/lanes/failures", "/lanes/resources/base", "/lanes/resources/module_arm"),
        *("/plan", "/recipe", "/events"),
    } <= entities
    assert "ApproachBottle: ManipulationGoalInCollision" in printed
    assert "plan time" in printed


@pytest.mark.long
def test_a_recorded_run_has_the_trace_of_one_that_is_not(recorded: Path, served: Served) -> None:
    assert served.trace.read_bytes() == (recorded / "run.jsonl").read_bytes()


def test_a_recording_of_an_earlier_run_is_overwritten_and_other_files_are_not(recorded: Path, tmp_path: Path) -> None:
    assert is_replaceable(recorded / "run.rrd")
    (tmp_path / "other.rrd").write_bytes(b"RRF2" + bytes(400))
    assert not is_replaceable(tmp_path / "other.rrd")


def test_a_plan_that_is_a_file_is_recorded_without_a_recipe(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    plan = tmp_path / "plan.py"
    plan.write_text(PLAN)
    words = ("run", plan, "--robot", "amigo", "--environment", "hospital_room", "--record", tmp_path / "run.rrd")
    result = CliRunner().invoke(cli.app, [str(word) for word in words], prog_name="planlang")
    assert result.exit_code == 0, result.output
    printed = viewer("print", tmp_path / "run.rrd").stdout
    assert "/lanes/plan/01" in printed
    assert " - /recipe" not in printed


def test_the_events_of_a_failed_run_end_with_the_failure_and_its_causes(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="the extra [record] is not installed")
    tower, recording = tmp_path / "tower.omn", tmp_path / "run.rrd"
    tower.write_text(Bundled.ENVIRONMENT.find("hospital_room").read_text().replace("m23 0.9,", "m23 2.3,"))
    words = ("run", "serve_a_drink", "--robot", "amigo", "--environment", tower, "--record", recording)
    result = CliRunner().invoke(cli.app, [str(word) for word in words], prog_name="planlang")
    assert result.exit_code == 1, result.output
    assert viewer("verify", recording).returncode == 0
    printed = viewer("print", "-vvv", "--entity", "/events", recording).stdout
    begins = [
        printed.index(text)
        for text in (
            "the recovery gives up",
            "ObjectUnreachable: the object",
            "  because of LocationUnresolvable: no place",
        )
    ]
    assert begins == sorted(begins)


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
