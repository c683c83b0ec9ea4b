"""Traces that an older planlang wrote are read as before; runs are not repeated by them.

Those in the folder schema_4 were written by the commit before schema 5: ``planlang run serve_a_drink --seed 3``, and a
plan that looks for the bottle of the hospital room with Amigo and does not see it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from planlang.experience import read_narrative
from planlang.experience.poses import read_poses
from planlang.runs import DamagedTrace, Past, RecordedRun, Repetition
from planlang.runs.codec import OLDEST, SCHEMA
from tests.executive.conftest import Served
from tests.support.cli_runs import invoke

OLD = Path(__file__).parent / "schema_4"
SERVED, FAILED = OLD / "served.jsonl", OLD / "failed.jsonl"


def answer(*words: str | Path) -> dict[str, Any]:
    """Return what the command answers, as JSON."""
    found: dict[str, Any] = json.loads(invoke(*words, "--json").stdout)
    return found


def shown(trace: Path) -> str:
    """Return what show prints of a trace, without its path."""
    return invoke("show", trace).output.replace(str(trace), "TRACE")


def left_in(trace: Path) -> Iterator[dict[str, Any]]:
    """Yield the states that completed steps left."""
    records = (line.record for line in RecordedRun.read(trace).lines)
    return (record["left"] for record in records if record["event"] == "completed" and "left" in record)


def what_and_when(pose: Any) -> tuple[Any, ...]:
    """Return what a pose is of and when, without its numbers."""
    return pose.step, pose.frame, pose.child, pose.by


def test_show_tells_the_same_of_an_older_trace_and_of_one_of_the_same_run_now(served: Served) -> None:
    assert RecordedRun.read(SERVED).header["schema"] == OLDEST < SCHEMA
    older = shown(SERVED).replace("arm left", "left arm").replace("by room1", "by a wall of room1")
    assert older == shown(served.trace), "its messages word the arm and the wall as then"


def test_show_names_why_a_run_of_an_older_trace_failed() -> None:
    assert "bottle1" in shown(FAILED)
    assert RecordedRun.read(FAILED).outcome == "failed"


@pytest.mark.parametrize("trace", [SERVED, FAILED], ids=["served", "failed"])
def test_the_page_of_an_older_trace_is_without_the_world_and_says_why(trace: Path, tmp_path: Path) -> None:
    page = tmp_path / "run.html"
    found = answer("report", trace, "--output", page)
    assert (found["exit_code"], found["repeated"], page.exists()) == (0, False, True)
    if trace is SERVED:  # the other plan is not there, which is said first
        assert f"schema {OLDEST}" in found["missing"][0]


def test_the_experience_of_an_older_trace_is_that_of_the_same_run_now(served: Served, tmp_path: Path) -> None:
    poses, activities = [], []
    for name, trace in (("old", SERVED), ("new", served.trace)):
        found = answer("export", trace, "--to", "neem", "-o", tmp_path / name, "--began", "2026-11-23T14:00:00Z")
        assert found["exit_code"] == 0
        poses.append(read_poses((tmp_path / name / "poses.jsonl").read_text().splitlines(keepends=True))[1])
        activities.append(
            len(read_narrative((tmp_path / name / "narrative.ttl").read_bytes(), "narrative.ttl").activities)
        )
    # The older trace came from another processor: vector instructions differ in the last digits of a pose.
    # What a person has taken was believed on the furniture below; now it is where it was let go.
    assert [what_and_when(pose) for pose in poses[0]] == [what_and_when(pose) for pose in poses[1]]
    held = max(one.step for one in poses[1] if one.child == "bottle1" and one.frame != "map")
    for old, new in zip(*poses, strict=True):
        if new.child == "bottle1" and new.step > held:
            continue
        assert (*new.position, *new.orientation) == pytest.approx((*old.position, *old.orientation), abs=1e-9)
    assert 0 < activities[0] == activities[1] - 1, (
        "handing over has a construct of its own now, to open doors before it"
    )


@pytest.mark.parametrize(
    "words", [("run", "--resume"), ("run", "--world-as-left", "--resume"), ("replay",)], ids=" ".join
)
def test_a_run_is_not_repeated_by_an_older_trace(words: tuple[str, ...], tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    trace.write_text("".join(SERVED.read_text().splitlines(keepends=True)[:120]))
    found = answer(*words, trace)
    (told,) = found["diagnostics"]
    version = RecordedRun.read(SERVED).header["versions"]["planlang"]
    assert (found["exit_code"], told["code"], told["span"]["line"]) == (2, "X033", 1)
    assert f"planlang {version} wrote this trace with schema {OLDEST}" in told["message"]
    assert f"repeats only schema {SCHEMA}" in told["message"]
    assert told["help"]


def test_no_record_of_an_older_schema_is_repeated_by_the_library_either() -> None:
    recorded = RecordedRun.read(SERVED)
    for repeats in (Past, Repetition):
        with pytest.raises(DamagedTrace, match=f"only a trace of schema {SCHEMA}"):
            repeats(recorded)


def test_a_state_that_was_left_is_told_as_what_differs_from_the_start(served: Served) -> None:
    first, *_, last = left_in(served.trace)
    assert set(first) == {"base", "belief"}, "nothing was created, mixed or leaned"
    assert {"held", "known", "moves"} <= set(first["belief"])
    assert not {"dropped", "gone", "made", "unknown"} & set(first["belief"])
    assert last["belief"]["taken"] == ["bottle1"]


def test_a_new_trace_is_no_longer_than_an_older_one_of_the_same_run(served: Served) -> None:
    assert served.trace.stat().st_size <= 1.05 * SERVED.stat().st_size
