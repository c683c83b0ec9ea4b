"""What a run states goes wrong in its world: the robot finds out by its senses, and the run is repeated exactly."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import planlang
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.diagnostics import BadInput
from sim.truth import Truth
from tests.support.cli_runs import answer, invoke
from tests.support.scenarios import parsed

FILES = Path(__file__).resolve().parents[1] / "benchmarks" / "faults" / "files"


def happened(run: planlang.RunResult) -> list[str]:
    assert run.faults is not None
    return [one["kind"] for one in run.faults.fired]


@pytest.mark.parametrize(
    "fault",
    [
        "gripper:misses",
        "gripper:stays_closed",
        "arm:stalls@2",
        "base:blocked",
        "camera:blind",
        "person:refuses",
        "person:lets_go",
    ],
)
def test_a_drink_is_served_though_something_goes_wrong(fault: str) -> None:
    run = planlang.simulate("serve_a_drink", fault=fault)
    assert (happened(run), run.message) == ([fault.partition("@")[0]], "done")
    assert "bottle1: held by patient1" in run.final_state


def test_a_drink_is_served_though_the_hand_does_not_draw_back_from_it() -> None:
    run = planlang.simulate("serve_a_drink", seed=3, fault="arm:stalls@7")
    assert (happened(run), run.message) == (["arm:stalls"], "done")


def test_two_things_that_stand_in_the_way_one_after_the_other_each_stay_as_long_as_stated() -> None:
    words = ("serve_a_drink", "--environment", "hospital_room", "--robot", "amigo", "--fault", "base:blocked=20@1-2")
    standing: list[int] = []

    def watch(world: Truth) -> None:
        standing.append(sum(name.startswith("something") for name in world.names()))

    run = run_plan_file(RunOptions.of(parsed(words), watchers=(watch,)))
    assert (happened(run), run.message) == (["base:blocked"] * 2, "done")
    assert sum(standing) == pytest.approx(2 * 20 * 30, abs=5), "steps of the world, 30 a second"
    assert max(standing) == 2


@pytest.mark.long
def test_a_bottle_is_fetched_from_a_cupboard_though_its_door_falls_shut() -> None:
    run = planlang.simulate("fetch_from_cabinet", fault="door:falls_shut")
    assert (happened(run), run.message) == (["door:falls_shut"], "done")


@pytest.mark.long
def test_a_cup_that_rolls_away_from_where_it_was_put_is_put_there_again() -> None:
    where = FILES / "strewn_room.omn"
    run = planlang.simulate(FILES / "tidy_up.omn", robot="amigo", environment=where, fault="thing:rolls")
    assert run.faults is not None
    assert (happened(run), run.message) == (["thing:rolls"], "done")
    at = run.faults.fired[0]["time"]
    failed = next(one for one in run.trace if one["event"] == "ended" and "failure" in one)
    assert failed["failure"]["message"].startswith("cup1 is not where it was put, on sideboard1, but 0.")
    assert failed["step"] / 30 <= at + 1.0


@pytest.mark.long
def test_a_tray_that_slips_is_taken_up_again_and_put_down_once_more_where_its_arms_reach_no_place() -> None:
    words = ("carry_the_tray", "--set", "tray=tray2", "--fault", "thing:slips=3")
    run = run_plan_file(RunOptions.of(parsed(words)))
    assert (happened(run), run.message) == (["thing:slips"], "done")
    assert any(line.startswith("tray2: at rest on tea_table1") for line in run.final_state)


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "change"),
    [("door:stuck", "stuck"), ("door:stops", "stuck"), ("handle:comes_loose", "slipped off")],
)
def test_what_a_hand_feels_at_a_handle_is_believed_at_once(fault: str, change: str) -> None:
    run = planlang.simulate("fetch_from_cabinet", fault=fault)
    assert (happened(run), run.message) == ([fault], "done")
    steps = [one["step"] for one in run.trace if one["event"] == "fault" or one.get("change") == change]
    assert (len(steps), steps[-1] - steps[0] <= 3) == (2, True), "a tenth of a second"


def test_a_door_that_never_moves_ends_in_a_failure_that_says_so() -> None:
    run = planlang.simulate("fetch_from_cabinet", fault="door:jams")
    assert "ContainerStuck: cabinet_door1 is stuck" in run.message


def test_a_neck_that_is_stuck_for_ever_is_called_so_and_the_base_turns_instead() -> None:
    run = planlang.simulate("serve_a_drink", fault="head:stalls@always")
    assert run.message == "done"
    failed = [one["failure"]["message"] for one in run.trace if one["event"] == "ended" and "failure" in one]
    assert any(message.startswith("the neck is stuck: the neck did not arrive") for message in failed)


def test_a_base_that_drifts_has_done_so_once_it_stands() -> None:
    run = planlang.simulate("serve_a_drink", fault="base:drifts@1")
    assert run.faults is not None
    drive = next(one for one in run.trace if one["event"] == "started" and one.get("kind") == "perform")
    ended = next(one["step"] for one in run.trace if one["event"] == "ended" and one["node"] == drive["node"])
    assert run.faults.fired[0]["time"] == pytest.approx(ended / 30, abs=0.1)


def test_a_step_that_is_stated_to_fail_fails_in_a_world_as_in_a_script() -> None:
    run = planlang.simulate("serve_a_drink", fault="step.CloseGripper:fails=GraspMissed@1-2")
    assert happened(run) == ["step:fails"] * 2
    assert run.message == "done"


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("step.Reaching:fails=GraspMised", "did you mean GraspMissed"),
        ("step.Reaching:fails=GraspMissed@3s", "a step fails as it begins"),
        ("step.Reaching:fails=GraspMissed@2-", "of a step, state a number"),
    ],
)
def test_a_step_that_cannot_fail_as_stated_is_refused(fault: str, said: str) -> None:
    with pytest.raises(BadInput, match=said):
        planlang.simulate("serve_a_drink", fault=fault)


def test_a_fault_is_recorded_replayed_and_resumed_byte_for_byte(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    stated = ("--fault", "arm:stalls@2 gripper:misses", "--fault-rate", "0.05", "--seed", "3")
    found = answer("run", "serve_a_drink", *stated, "--trace", trace)
    lines = trace.read_text().splitlines(keepends=True)
    records = list(map(json.loads, lines))
    assert records[0]["faults"] == ["arm:stalls@2", "gripper:misses@1"]
    assert records[0]["fault_rate"] == 0.05
    recorded = [one["fault"] for one in records if one["event"] == "fault"]
    assert recorded == [one["fault"] for one in found["faults"]["fired"]]
    assert "equal to the end" in invoke("replay", trace).stdout
    cut = tmp_path / "cut.jsonl"
    cut.write_text("".join(lines[: len(lines) // 2]))
    assert answer("run", "--resume", cut)["faults"] == found["faults"]
    resumed = [line for line in cut.read_text().splitlines(keepends=True) if '"event": "resumed"' not in line]
    assert resumed == lines


def test_a_stated_fault_that_did_not_happen_is_a_warning_and_an_error_of_a_file(tmp_path: Path) -> None:
    run = planlang.simulate("serve_a_drink", fault="gripper:misses@9")
    assert [one.severity.value for one in run.diagnostics if one.code == "X040"] == ["warning"]
    file = tmp_path / "faults.toml"
    file.write_text('faults = "gripper:misses@9"\nexpect = "ObjectLost"\n')
    ended = invoke("run", "serve_a_drink", "--faults", file)
    assert "error X040 the fault gripper:misses@9 did not happen" in ended.stderr
    assert "error X042 the run was expected to end with ObjectLost, and ended with done" in ended.stderr
    assert ended.exit_code == 1


def test_an_expected_failure_is_a_success_of_its_file(tmp_path: Path) -> None:
    file = tmp_path / "faults.toml"
    file.write_text('faults = "person:is_gone"\nexpect = "ObjectNotFound"\n')
    assert invoke("run", "serve_a_drink", "--faults", file).exit_code == 0


def test_a_fault_of_what_is_not_there_is_refused() -> None:
    with pytest.raises(BadInput, match="did you mean patient1"):
        planlang.simulate("serve_a_drink", fault="person.patient2:refuses")
