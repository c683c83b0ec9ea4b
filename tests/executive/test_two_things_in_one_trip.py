"""Two unordered transports share a trip where the robot has two hands; tests/executive/two_things has the flat."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.files import bundled

FLAT = Path(__file__).with_name("two_things")
BOTH = ("can1: at rest on table1", "cup1: at rest on table1")


def options(robot: str, folder: Path) -> RunOptions:
    """Bring a cup and a can from the counter to a table at the other end of the flat."""
    return RunOptions(
        recipe=FLAT / "bring_both.omn",
        robot=bundled("ontologies") / "robots" / robot,
        environment=FLAT / "flat.omn",
        trace=folder / "run.jsonl",
    )


def happened(trace: Path) -> list[str]:
    """What was believed to be grasped and released, in order."""
    events = map(json.loads, trace.read_text(encoding="utf-8").splitlines())
    changes = (event["change"] for event in events if event["event"] == "belief" and "change" in event)
    return [change for change in changes if change in ("grasped", "released", "lost")]


@pytest.mark.parametrize(
    ("robot", "seconds"),
    [pytest.param("amigo.omn", 160, id="amigo"), pytest.param("pr2.toml", 101, id="pr2", marks=pytest.mark.pr2)],
)
def test_two_things_are_fetched_before_one_is_brought(robot: str, seconds: float, tmp_path: Path) -> None:
    """One after the other they take Amigo 172 s, and PR2 127 s."""
    run = run_plan_file(options(robot, tmp_path))
    assert run.final_state == BOTH, run.message
    assert happened(tmp_path / "run.jsonl") == ["grasped", "grasped", "released", "released"]
    assert run.duration < seconds


@pytest.mark.long
def test_a_run_that_ends_with_a_thing_in_each_hand_is_resumed(tmp_path: Path) -> None:
    whole = options("amigo.omn", tmp_path)
    run_plan_file(whole)
    lines = (tmp_path / "run.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    second = [number for number, line in enumerate(lines) if '"grasped"' in line][1]
    (tmp_path / "cut.jsonl").write_text("".join(lines[: second + 200]), encoding="utf-8")
    resumed = run_plan_file(replace(whole, resume=tmp_path / "cut.jsonl", trace=tmp_path / "resumed.jsonl"))
    assert resumed.final_state == BOTH, resumed.message
