"""The whole way: drink served by a process, worlds that are not as the map says, places watched while things move."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.runs.options import Outcome, RunResult
from executive.runs.plan_run import run_plan_file
from planlang import now, perform, pursue, sleep, wait_for
from planlang.designators import Location, a_device, a_location, a_person, a_posture, action, an_object, located
from planlang.geometry import Pose
from planlang.language.conditions import holds
from planlang.protocols import Solution
from sim import Body, Scene
from tests.executive.conftest import BUNDLED, THE_BOTTLE, WARD, MakeStage, Stage, stand
from tests.executive.modules.test_navigation import to
from tests.support.detections import recognise

CHECKOUT = Path(__file__).resolve().parents[2]
STILL_HELD = "bottle1: still held by robot, in the right hand"


def planlang(*arguments: str | Path, folder: Path) -> dict[str, Any]:
    """Run the command in a folder; its answer as JSON."""
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    command = [sys.executable, "-m", "executive", *map(str, arguments), "--json"]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)
    assert "Traceback" not in ended.stderr, ended.stderr
    answer: dict[str, Any] = json.loads(ended.stdout)
    assert answer["exit_code"] == ended.returncode
    return answer


@pytest.mark.long
def test_a_recipe_and_its_plan_serve_the_drink_alike_and_leave_their_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer = planlang("run", "serve_a_drink", "--trace", "run.jsonl", "--picture", "scene.png", folder=tmp_path)
    assert answer["exit_code"] == 0, answer["message"]
    assert answer["final_state"] == ["bottle1: held by patient1"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.jsonl", "scene.png"]
    records = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert records[0]["event"] == "header"
    assert all(before["step"] <= after["step"] for before, after in pairwise(records))
    assert (tmp_path / "scene.png").read_bytes().startswith(b"\x89PNG")
    assert b"written by planlang" in (tmp_path / "scene.png").read_bytes()[:100], "so that the next run may replace it"

    monkeypatch.chdir(tmp_path)
    invoke = partial(CliRunner().invoke, app, prog_name="planlang")
    assert invoke(["compile", "serve_a_drink", "-o", "plan.py"]).exit_code == 0
    command = "run plan.py --robot amigo --environment hospital_room --picture scene.png --trace run.jsonl --json"
    assert json.loads(invoke(command.split()).stdout)["final_state"] == answer["final_state"]
    older = (tmp_path / "run.jsonl.old").read_bytes()
    assert older == (tmp_path / "run.jsonl").read_bytes(), "the older trace is kept, and equal"


IN_THE_BACKGROUND = ("sh", "-c", 'trap "" INT; exec "$@"', "sh")
"""Starts a command as a shell script does that puts it into the background: SIGINT is ignored."""


@pytest.mark.long
@pytest.mark.parametrize(
    ("number", "code", "started_by"),
    [
        (signal.SIGTERM, 143, IN_THE_BACKGROUND),
        (signal.SIGTERM, 143, ()),
        (signal.SIGINT, 130, ()),
        (signal.SIGHUP, 129, IN_THE_BACKGROUND),
        (signal.SIGHUP, 129, ()),
    ],
)
def test_a_signal_ends_a_run_with_cleanup_a_complete_trace_and_valid_files(
    number: int, code: int, started_by: tuple[str, ...], tmp_path: Path
) -> None:
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("whoever runs the tests ignores this signal (nohup), and so does what they start")
    run = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--trace", "run.jsonl", "--picture", "s.png"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        [*started_by, *run], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "MoveBaseToGraspPose" in line:
                process.send_signal(number)
                break
        _, rest = process.communicate()
    assert process.returncode == code
    assert "Traceback" not in rest
    records = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    ended = {record["node"] for record in records if record["event"] == "ended"}
    started = {record["node"] for record in records if record["event"] == "started"}
    assert started - ended == set(), "no task is left open"
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.jsonl", "s.png"]


Run = Callable[[Callable[[Scene], Scene]], tuple[RunResult, list[dict[str, Any]]]]


@pytest.fixture
def run_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the bundled plan in a truth that differs from the map; its result and its trace."""

    def run(change: Callable[[Scene], Scene]) -> tuple[RunResult, list[dict[str, Any]]]:
        monkeypatch.setattr("executive.runs.true_world.real_scene", lambda scene, seed, robot_in: change(scene))
        result = run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl"))
        return result, [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]

    return run


def without(scene: Scene, name: str) -> Scene:
    """The scene without a body."""
    return replace(scene, bodies=tuple(body for body in scene.bodies if body.name != name))


def with_body(scene: Scene, name: str, pose: Pose, size: tuple[float, float, float]) -> Scene:
    """The scene with one more box."""
    return replace(scene, bodies=(*scene.bodies, Body(name, pose, size)))


@pytest.mark.long
def test_a_bottle_on_another_table_is_looked_for_there_and_served(run_in: Run) -> None:
    on_the_bedside_table = {"bottle1": Pose((2.7, 1.335, 0.7))}
    result, trace = run_in(lambda scene: scene.with_poses(on_the_bedside_table))
    assert (result.outcome, result.final_state[0]) == (Outcome.DONE, "bottle1: held by patient1")
    assert any(record["event"] == "belief" and record["change"] == "not_seen" for record in trace)


@pytest.mark.long
def test_without_the_patient_the_bottle_is_put_down_once_they_were_looked_for_in_vain(run_in: Run) -> None:
    result, _ = run_in(lambda scene: without(scene, "patient1"))
    assert (result.outcome, result.final_state) == (
        Outcome.FAILED,
        ("bottle1: at rest on bedside_table1",),
    )
    assert result.failures == ("ObjectNowhereToBeFound", "ObjectNotFound")
    assert "nowhere to be found: patient1" in result.message


@pytest.mark.long
def test_a_doll_in_the_place_of_the_patient_is_not_taken_for_them(run_in: Run) -> None:
    def with_doll(scene: Scene) -> Scene:
        """A doll in the patient's place, which is smaller."""
        bodies = (replace(body, shape="box") if body.name == "patient1" else body for body in scene.bodies)
        doll = replace(scene, bodies=tuple(bodies))
        low = replace(doll.body("patient1"), size=(1.5, 0.4, 0.3), pose=Pose((2.15, 0.6, 0.7), (0.0, 0.0, 1.0, 0.0)))
        return replace(doll, bodies=tuple(low if body.name == "patient1" else body for body in doll.bodies))

    result, _ = run_in(with_doll)
    assert (result.outcome, result.final_state) == (
        Outcome.FAILED,
        ("bottle1: at rest on bedside_table1",),
    )
    assert result.failures[0] == "ObjectNowhereToBeFound"
    assert "nowhere to be found: patient1" in result.message


@pytest.mark.long
def test_a_chair_pushed_into_the_way_is_driven_around(run_in: Run) -> None:
    pushed = {"chair1": Pose((-1.0, -0.4, 0.425))}
    result, trace = run_in(lambda scene: scene.with_poses(pushed))
    assert result.final_state == ("bottle1: held by patient1",)
    felt_or_seen = [r for r in trace if r["event"] == "belief" and r.get("name") == "chair1"]
    assert felt_or_seen, "the robot knows where the chair is"


@pytest.mark.long
def test_a_low_frame_around_the_bottle_that_no_map_shows_is_told_by_its_place(run_in: Run) -> None:
    def framed(scene: Scene) -> Scene:
        x, y, _ = scene.body("bottle1").pose.position
        for name, dx, dy, size in (
            ("frame left", 0.0, 0.07, (0.3, 0.01, 0.12)),
            ("frame right", 0.0, -0.07, (0.3, 0.01, 0.12)),
            ("frame front", 0.15, 0.0, (0.01, 0.15, 0.12)),
        ):
            scene = with_body(scene, name, Pose((x + dx, y + dy, 0.86)), size)
        return scene

    result, _ = run_in(framed)
    assert result.outcome is Outcome.FAILED
    assert "blocked by something unknown at -2.5" in result.message
    assert result.final_state == ("bottle1: at rest on cabinet1",)


@pytest.mark.long
def test_a_barrier_across_the_room_that_no_map_shows_is_told_by_its_place(run_in: Run) -> None:
    result, _ = run_in(lambda scene: with_body(scene, "barrier", Pose((-1.2, 0.0, 0.5)), (0.05, 5.0, 1.0)))
    assert result.outcome is Outcome.FAILED
    assert "NavigationGoalNotReached" in result.failures
    assert "blocked by something unknown at -1.17" in result.message


THE_CABINET, THE_BED = an_object("Cabinet-PieceOfFurniture"), an_object("Bed-PieceOfFurniture")


@pytest.mark.long
@pytest.mark.parametrize(
    "location",
    [
        a_location(near=THE_BED),
        a_location(in_reach_of=a_person("Patient"), near=THE_BED),
        a_location(visible_from=THE_BOTTLE, within=1.5, near=THE_CABINET),
        a_location(left_of=THE_BOTTLE),
        a_location(in_reach_of=a_location(above=THE_BED)),
    ],
    ids=str,
)
def test_a_place_that_stops_holding_as_the_robot_drives_away_fires(location: Location, ward: Stage) -> None:
    place = next(ward.resolver.bases(location)).base
    stand(ward, place)

    async def plan() -> tuple[bool, tuple[float, float, float], float]:
        here = holds(location)
        before = here.value
        await pursue(partial(wait_for, ~here), partial(perform, to(-1.0, 4.0)))
        return before, ward.truth.configuration().base, now()

    before, base, when = ward.run(plan)
    assert before, "the place holds where the robot stands"
    assert base[:2] != pytest.approx((-1.0, 4.0)), "the watch ended the drive before it was over"
    assert 0 < when < 10
    assert ward.resolver.satisfies(location, ward.platform.base()) is None


def test_a_thing_that_is_seen_elsewhere_is_no_longer_where_it_was(ward: Stage) -> None:
    log: list[tuple[float, bool, bool]] = []

    async def plan() -> None:
        on, near = holds(a_location(on=THE_CABINET), THE_BOTTLE), holds(a_location(near=THE_BOTTLE, within=2.0))
        log.append((now(), on.value, near.value))
        await pursue(partial(wait_for, ~on), perceive)
        log.append((now(), on.value, near.value))

    async def perceive() -> None:
        await sleep(1.5)
        recognise(ward.belief, "bottle", Pose((1.5, 3.0, 0.1)), 1.0)
        await sleep(9)

    ward.run(plan)
    assert log[0] == (0, True, True)
    assert log[1][1:] == (False, False)
    assert log[1][0] == pytest.approx(1.5, abs=0.1)


@pytest.mark.long
def test_a_hand_that_is_taken_away_is_no_longer_over_the_bed(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    over = a_location(above=THE_BED)
    solution = next(stage.resolver.bases(a_location(in_reach_of=over)))
    stand(stage, solution.base)
    device = a_device("LeftArm" if solution.detail["arm"] == "left" else "RightArm")

    async def plan() -> tuple[bool, bool, bool]:
        at = holds(over, device)
        before = at.value
        await perform(action("Reaching", to_location=over, device_used=device))
        there = at.value
        await pursue(
            partial(wait_for, ~at),
            partial(perform, action("Reaching", to_location=a_posture("carrying"), device_used=device)),
        )
        return before, there, at.value

    assert stage.run(plan) == (False, True, False)


def test_a_place_is_judged_once_while_nothing_moves_and_again_after_that(
    ward: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    location = a_location(in_reach_of=a_person("Patient"))
    base = next(ward.resolver.bases(location)).base
    stand(ward, base)
    here, judged = located(location), list[Location]()
    judge = ward.resolver.satisfies

    def counted(asked: Location, there: tuple[float, float, float]) -> Solution | None:
        judged.append(asked)
        return judge(asked, there)

    monkeypatch.setattr(ward.resolver, "satisfies", counted)
    assert all(ward.executive.holds(here) for _ in range(30))
    assert len(judged) == 1
    ward.belief.bump("bed", Pose((-2.5, 0.05, 0.275), (0.0, 0.0, 1.0, 0.0)))
    ward.executive.holds(here)
    assert len(judged) == 2
    stand(ward, (base[0] + 2.0, base[1], base[2]))
    assert not ward.executive.holds(here)
    assert len(judged) == 3
