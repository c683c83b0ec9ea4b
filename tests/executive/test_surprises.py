"""The bundled plan in worlds that are not as the map says: it copes, or fails by name."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.runs.plan_run import Outcome, RunOptions, RunResult, run_plan_file
from planlang.files import bundled
from planlang.geometry import Pose
from sim import Body, Scene

BUNDLED = RunOptions(
    recipe=bundled("recipes") / "serve_a_drink.omn",
    robot=bundled("ontologies") / "robots" / "amigo.omn",
    environment=bundled("ontologies") / "environments" / "hospital_room.omn",
)
Run = Callable[[Callable[[Scene], Scene]], tuple[RunResult, list[dict[str, Any]]]]


@pytest.fixture
def run_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs the bundled plan in a truth that differs from the map; its result and its trace."""

    def run(change: Callable[[Scene], Scene]) -> tuple[RunResult, list[dict[str, Any]]]:
        monkeypatch.setattr("executive.runs.plan_run.real_scene", lambda scene, seed, robot_in: change(scene))
        result = run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl"))
        return result, [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]

    return run


def without(scene: Scene, name: str) -> Scene:
    """The scene without a body."""
    return replace(scene, bodies=tuple(body for body in scene.bodies if body.name != name))


def with_body(scene: Scene, name: str, pose: Pose, size: tuple[float, float, float]) -> Scene:
    """The scene with one more box."""
    return replace(scene, bodies=(*scene.bodies, Body(name, pose, size)))


def test_a_bottle_on_another_table_is_nowhere_to_be_found(run_in: Run) -> None:
    on_the_bedside_table = {"bottle1": Pose((2.7, 1.335, 0.7))}
    result, trace = run_in(lambda scene: scene.with_poses(on_the_bedside_table))
    assert (result.outcome, result.final_state) == (Outcome.FAILED, ("bottle1: at rest on bedside_table1",))
    assert result.failure[:2] == ("ObjectNowhereToBeFound", "ObjectNotFound")
    assert "bottle1" in result.message
    looked = [record for record in trace if record["event"] == "belief" and record["change"] == "not_seen"]
    assert len({tuple(record["base"]) for record in looked}) >= 3, "it was looked for from several places"


def test_without_the_patient_the_bottle_stays_in_the_gripper_while_they_are_looked_for(run_in: Run) -> None:
    result, _ = run_in(lambda scene: without(scene, "patient1"))
    assert (result.outcome, result.final_state) == (Outcome.FAILED, ("bottle1: held by robot",))
    assert result.failure == ("ObjectNowhereToBeFound", "ObjectNotFound")
    assert "what patient1" in result.message


def test_a_patient_who_does_not_take_it_leaves_the_bottle_in_the_gripper(run_in: Run) -> None:
    def asleep(scene: Scene) -> Scene:
        """A doll in the patient's place."""
        bodies = (replace(body, shape="box") if body.name == "patient1" else body for body in scene.bodies)
        doll = replace(scene, bodies=tuple(bodies))
        low = replace(doll.body("patient1"), size=(1.5, 0.5, 0.3), pose=Pose((2.15, 0.6, 0.7), (0.0, 0.0, 1.0, 0.0)))
        return replace(doll, bodies=tuple(low if body.name == "patient1" else body for body in doll.bodies))

    result, _ = run_in(asleep)
    assert (result.outcome, result.final_state) == (Outcome.FAILED, ("bottle1: held by robot",))
    assert result.failure[0] == "HandoverNotTaken"
    assert "what bottle1, recipient patient1" in result.message


def test_a_chair_pushed_into_the_way_is_driven_around(run_in: Run) -> None:
    pushed = {"chair1": Pose((-1.0, -0.4, 0.425))}
    result, trace = run_in(lambda scene: scene.with_poses(pushed))
    assert result.final_state == ("bottle1: held by patient1",)
    felt_or_seen = [r for r in trace if r["event"] == "belief" and r.get("name") == "chair1"]
    assert felt_or_seen, "the robot knows where the chair is"


def test_a_low_frame_around_the_bottle_that_no_map_shows_is_named(run_in: Run) -> None:
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
    assert "frame" in result.message, "what was in the way is named"
    assert result.final_state == ("bottle1: at rest on cabinet1",)


def test_a_barrier_across_the_room_that_no_map_shows_is_named(run_in: Run) -> None:
    result, _ = run_in(lambda scene: with_body(scene, "barrier", Pose((-1.2, 0.0, 0.5)), (0.05, 5.0, 1.0)))
    assert result.outcome is Outcome.FAILED
    assert "NavigationGoalNotReached" in result.failure
    assert "barrier" in result.message
