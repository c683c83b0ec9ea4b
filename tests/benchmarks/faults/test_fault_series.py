"""The series of faults: its worlds, what is kept of a run, and the tables that are made of them."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from executive.robots import bind_robot
from executive.sweeps import run as sweep
from executive.sweeps.files import read_sweep
from planlang.faults.kinds import KINDS, kind_of
from tests.benchmarks.faults.__main__ import main
from tests.benchmarks.faults.cameras import robot_with
from tests.benchmarks.faults.senses import Carried, carried_by, chain_of
from tests.benchmarks.faults.series import BURNT, CELLS, WHAT, cells_of, worlds_of
from tests.benchmarks.faults.table import tables
from tests.benchmarks.homes import series as homes

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def test_each_kind_that_a_robot_makes_good_has_a_task_in_which_it_is_stated():
    stated = {cell.kind for cell in CELLS if cell.kind}
    assert stated == {str(kind) for kind in KINDS if kind.recovers}


def test_worlds_with_recoveries_and_without_have_the_same_seeds_and_rates():
    worlds = worlds_of(cells_of(["amigo"]), 7)
    assert Counter((world["rate"], world["bare"]) for world in worlds) == {
        (rate, bare): 300 for rate in (0.0, 0.1, 0.2) for bare in (False, True)
    }
    seeds = {bare: [w["seed"] for w in worlds if w["bare"] is bare and w["rate"] == 0.1] for bare in (False, True)}
    assert seeds[False] == seeds[True] == list(range(7, 307))


def test_a_series_that_is_cut_short_has_had_every_row_of_its_tables():
    worlds, cells = worlds_of(CELLS, 1), len(CELLS)
    assert len({world["world"].rpartition(" ")[0] for world in worlds[:cells]}) == cells
    assert [world["world"] for world in worlds_of(CELLS, 1, most=1)] == [world["world"] for world in worlds[:cells]]


def test_a_share_of_a_series_has_worlds_of_all_rows():
    worlds = worlds_of(CELLS, 1, share=0.1)
    assert Counter(world["part"] for world in worlds) == {
        "amigo": 180,
        "pr2": 20,
        "tasks": 36,
        "alike": 36,
        "kinds": 120,
    }


def test_seeds_of_faults_follow_from_the_commit_and_are_not_those_of_homes():
    seeds = homes.acceptance_series(COMMIT, 300, BURNT, WHAT)
    assert min(seeds) >= homes.ACCEPTANCE
    assert seeds != homes.acceptance_series(COMMIT, 300)


def test_what_is_no_part_is_refused(capsys: pytest.CaptureFixture[str]):
    assert main(["--only", "door:stick"]) == 2
    assert "there is no door:stick; there are " in capsys.readouterr().err


def test_the_command_of_a_world_repeats_it():
    [world] = worlds_of(cells_of(["door:stops"]), 3, most=1)
    assert world["repeat"] == (
        "planlang run fetch_from_cabinet --robot amigo --goal 'bottle1 held by robot' --goal 'cabinet_door1 closed' "
        "--seed 3 --fault door:stops@2"
    )


def test_no_reading_carries_what_a_person_does_not_do_or_what_is_no_thing():
    never = {str(kind) for kind in KINDS if carried_by(kind) is Carried.NEVER}
    assert never == {"person:refuses", "person:hesitates", "camera:ghost"}


def test_the_chain_of_a_recorded_failure_has_the_classes_of_its_causes():
    failure = {"type": "planlang.failures.ObjectUnfetchable", "cause": {"type": "GraspMissed", "cause": None}}
    assert list(chain_of(failure)) == ["ObjectUnfetchable", "GraspMissed"]


def test_robots_whose_cameras_err_have_a_file_with_that_noise():
    robot = bind_robot(robot_with("amigo", "10 mm"))
    assert robot.camera is not None
    noise = robot.camera.noise
    assert (noise.position, round(math.degrees(noise.angle), 1), noise.misses) == (0.01, 2.0, 0.1)
    assert robot_with("amigo", "exact") == "amigo"


# Tables


def row(number: int, **more: Any) -> dict[str, Any]:
    fault = {"kind": "door:stuck", "time": 1.0, "carried": 1.0, "noticed": 1.5, "failure": ["ContainerStuck"]}
    return {
        "world": f"kinds door:stuck amigo {number}", "task": "fetch", "robot": "amigo",
        "camera": "exact", "rate": 0.0, "bare": False,
        "kind": "door:stuck", "outcome": "done", "claimed": True, "reached": True, "failure": [], "message": "done",
        "faults": [fault], "duration": 30.0, "cpu": 4.0, "repeat": "planlang run", **more,
    }  # fmt: skip


def cells(rows: list[dict[str, Any]], start: str) -> list[str]:
    line = next(line for line in tables(rows) if line.startswith(start))
    return [cell.strip() for cell in line.split("|")[1:-1]]


def test_a_kind_counts_what_was_recovered_noticed_and_named_where_it_happened():
    late = {"kind": "door:stuck", "time": 1.0, "carried": 1.0, "noticed": 9.0, "failure": ["ObjectNotFound"]}
    rows = [
        row(1),
        row(2, faults=[late], claimed=False, reached=False, outcome="failed", failure=["ObjectNotFound"]),
        row(3, faults=[]),
    ]
    found = cells(rows, "| `door:stuck`")
    assert found[1:7] == ["fetch", "2 of 3", "1 of 2 (9 to 91 %)", "1 of 2 (9 to 91 %)", "0", "0"]
    assert found[8:10] == ["1 of 2 (9 to 91 %)", "0 of 1 (0 to 79 %)"]
    assert any(line.startswith("| another cause named | fetch: door:stuck |") for line in tables(rows))


def test_what_no_sense_carries_is_counted_apart():
    fault = {"kind": "person:refuses", "time": 1.0, "carried": None, "noticed": 17.0, "failure": ["HandoverNotTaken"]}
    found = cells([row(1, kind="person:refuses", faults=[fault])], "| `person:refuses`")
    assert found[4:8] == ["-", "0", "1", "16.0"]


def test_what_was_not_noticed_and_did_no_harm_is_counted():
    fault = {"kind": "door:stuck", "time": 1.0, "carried": 1.0, "noticed": None, "failure": []}
    failed = row(2, faults=[fault], claimed=False, reached=False, outcome="failed", failure=["ObjectNotFound"])
    assert cells([row(1, faults=[fault]), failed], "| `door:stuck`")[4:6] == ["0 of 2 (0 to 66 %)", "1"]


def test_false_successes_things_held_in_vain_and_mute_runs_are_listed_with_their_commands():
    wrong = [
        row(1, reached=False),
        row(2, in_vain=["bottle1"]),
        row(3, outcome="crashed", claimed=None, reached=None, failure=["OutOfTime"]),
    ]
    text = "\n".join(tables(wrong))
    assert [text.count(f"| {what} | fetch") for what in ("false success", "held in vain", "mute")] == [1, 1, 1]
    assert cells(wrong, "| `door:stuck`")[-3:] == ["1", "1", "1"]


def test_rates_are_rows_of_their_own_with_recoveries_and_without():
    rows = [row(number, kind=None, task="serve", rate=0.1, bare=bare) for number in (1, 2) for bare in (False, True)]
    assert cells(rows, "| serve | amigo | exact | 0.1 | yes")[5:9] == [
        "2",
        "2 of 2 (34 to 100 %)",
        "1.00",
        "2 of 2 (34 to 100 %)",
    ]
    assert cells(rows, "| serve | amigo | exact | 0.1 | no")[5] == "2"


# Runs


def stand_in(world: dict[str, Any]) -> dict[str, Any]:
    """Return a row without a run; the job of the test below."""
    return {"outcome": "done", "claimed": True, "reached": True}


def test_rows_say_what_was_run_and_how_it_is_repeated(tmp_path: Path):
    worlds = worlds_of(cells_of(["tray"]), 1, most=1)
    [one, _] = sweep(worlds, f"{__name__}:stand_in", processes=1, out=tmp_path / "rows.jsonl")
    assert (one["task"], one["robot"], one["rate"], one["seed"]) == ("tray", "amigo", 0.0, 1)
    assert "--set tray=tray2" in one["repeat"]
    assert len(read_sweep(tmp_path / "rows.jsonl").rows) == 2


@pytest.mark.long
def test_a_missed_grasp_is_noticed_when_the_fingers_have_closed_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    rows = tmp_path / "rows.jsonl"
    words = ["--only", "gripper:misses", "--jobs", "1", "--out", str(rows)]
    assert main(words) == 0
    [one] = read_sweep(rows).rows
    [fault] = one["faults"]
    assert one["reached"]
    assert fault["kind"] == "gripper:misses"
    assert fault["time"] < fault["carried"] <= fault["noticed"] <= fault["carried"] + 1
    assert kind_of("gripper", "misses").shows[0] in fault["failure"]  # type: ignore[union-attr]
    said = capsys.readouterr().out
    assert main(words) == 0  # all rows are there
    assert capsys.readouterr().out.splitlines()[-1] == said.splitlines()[-1]
