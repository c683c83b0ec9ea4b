"""The whole way, as a process of its own: recipe in, drink served, files left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


def planlang(*arguments: str | Path, folder: Path) -> dict[str, Any]:
    """Run the command in a folder; its answer as JSON."""
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    command = [sys.executable, "-m", "executive", *map(str, arguments), "--json"]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, env=environment)
    assert "Traceback" not in ended.stderr, ended.stderr
    answer: dict[str, Any] = json.loads(ended.stdout)
    assert answer["exit_code"] == ended.returncode
    return answer


def test_a_recipe_and_its_plan_serve_the_drink_alike_and_leave_their_files(tmp_path: Path) -> None:
    answer = planlang("run", "serve_a_drink", "--trace", "run.jsonl", "--picture", "scene.png", folder=tmp_path)
    assert answer["exit_code"] == 0, answer["outcome"]
    assert answer["final_state"] == ["bottle1: held by patient1"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.jsonl", "scene.png"]
    records = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    assert records[0]["event"] == "header"
    assert all(before["step"] <= after["step"] for before, after in pairwise(records))
    assert (tmp_path / "scene.png").read_bytes().startswith(b"\x89PNG")
    assert b"written by planlang" in (tmp_path / "scene.png").read_bytes()[:100], "so that the next run may replace it"

    assert planlang("compile", "serve_a_drink", "-o", "plan.py", folder=tmp_path)["exit_code"] == 0
    options = ("--robot", "amigo", "--environment", "hospital_room", "--picture", "scene.png")
    of_plan = planlang("run", "plan.py", *options, "--trace", "run.jsonl", folder=tmp_path)
    assert of_plan["final_state"] == answer["final_state"]
    older = (tmp_path / "run.jsonl.old").read_bytes()
    assert older == (tmp_path / "run.jsonl").read_bytes(), "the older trace is kept, and equal"


def test_roboearths_own_recipe_robot_and_map_put_the_bottle_on_the_bed(corpus: Path, tmp_path: Path) -> None:
    answer = planlang(
        "run",
        corpus / "recipes" / "serve_drink@knowrob_hydro_2014-11.owl",
        "--robot",
        corpus / "robots" / "amigo@hydro.owl",
        "--environment",
        corpus / "environments" / "map_hospital_room@re_stack.owl.in",
        folder=tmp_path,
    )
    assert answer["exit_code"] == 0, answer["outcome"]
    assert answer["final_state"] == ["bottle1: at rest on bed1"]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)])
def test_a_signal_ends_a_run_with_cleanup_a_complete_trace_and_valid_files(
    number: int, code: int, tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "executive", "run", "serve_a_drink", "--trace", "run.jsonl", "--picture", "s.png"]
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if "Reaching" in line:
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
