"""``--no-recoveries``: stated in the header of the trace, so that a run is replayed and resumed as it was."""

from __future__ import annotations

import json
from pathlib import Path

import planlang
from tests.support.cli_runs import answer, invoke

RECIPE = ("pass_a_drink", "--robot", "amigo", "--seed", "1")


def test_a_plan_ends_with_its_first_failure_and_is_replayed_without_recoveries(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    found = answer("run", *RECIPE, "--no-recoveries", "--trace", trace)
    records = [json.loads(line) for line in trace.read_text().splitlines()]
    assert records[0]["no_recoveries"] is True
    decisions = [one["decision"] for one in records if one["event"] == "recovery"]
    assert found["outcome"] == "failed"
    assert set(decisions) == {"none"}
    assert "equal to the end" in invoke("replay", trace).stdout
    cut = tmp_path / "cut.jsonl"
    cut.write_text("".join(f"{json.dumps(one)}\n" for one in records[: len(records) // 2]))
    resumed = answer("run", "--resume", cut)
    assert resumed["message"] == found["message"]
    assert json.loads(cut.read_text().splitlines()[0])["no_recoveries"] is True


def test_with_recoveries_the_header_states_nothing_and_more_is_tried() -> None:
    run = planlang.simulate("pass_a_drink", robot="amigo", seed=1)
    assert "no_recoveries" not in run.trace[0]
    decisions = {one["decision"] for one in run.trace if one["event"] == "recovery"}
    assert "retry" in decisions
