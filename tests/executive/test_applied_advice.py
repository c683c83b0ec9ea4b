"""The advice of a failed run as data: applied to the map, the run gets past its failure."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from executive.options.running import RunSettings
from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang.advice import Change
from planlang.diagnostics import BadInput
from planlang.files import Bundled
from tests.support.table_room import ROOM

HIGH = Change("translation", (-2.72, -0.8, 0.9), "bottle1")


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """The hospital room with the bottle 1.4 m over its cabinet."""
    bundled = (Bundled.ENVIRONMENT.folder / "hospital_room.omn").read_text(encoding="utf-8")
    assert bundled.count("knowrob:m23 0.9,") == 1
    (tmp_path / "high.omn").write_text(bundled.replace("knowrob:m23 0.9,", "knowrob:m23 2.3,"), encoding="utf-8")
    return tmp_path / "high.omn"


def test_a_run_whose_map_is_changed_as_its_failure_advises_is_done(room: Path, tmp_path: Path) -> None:
    failed = run_plan_file(RunSettings(recipe="serve_a_drink", environment=room))
    assert failed.failure is not None
    assert failed.failure.changes == (HIGH,)
    file = tmp_path / "failed.json"
    file.write_text(json.dumps(failed.as_json()), encoding="utf-8")
    done = run_plan_file(RunSettings(recipe="serve_a_drink", environment=room, apply=file))
    assert done.outcome is Outcome.DONE, done.message
    assert done.final_state == ("bottle1: held by patient1",)


def test_a_resumed_run_makes_the_changes_of_its_trace_by_itself(room: Path, tmp_path: Path) -> None:
    (tmp_path / "advice.json").write_text(json.dumps([HIGH.as_json()]))
    whole, cut = tmp_path / "whole.jsonl", tmp_path / "cut.jsonl"
    run_plan_file(RunSettings(recipe="serve_a_drink", environment=room, apply=tmp_path / "advice.json", trace=whole))
    lines = whole.read_text(encoding="utf-8").splitlines(keepends=True)
    cut.write_text("".join(lines[: len(lines) // 4]), encoding="utf-8")
    done = run_plan_file(RunSettings(environment=room, resume=cut))
    assert done.outcome is Outcome.DONE, done.message


def test_a_trace_that_states_changes_which_are_none_is_refused(room: Path, tmp_path: Path) -> None:
    whole = tmp_path / "whole.jsonl"
    run_plan_file(RunSettings(recipe="serve_a_drink", environment=room, trace=whole))
    header, *others = whole.read_text(encoding="utf-8").splitlines()
    damaged = [json.dumps({**json.loads(header), "applied": [1]}), *others[:20]]
    whole.write_text("\n".join(damaged), encoding="utf-8")
    with pytest.raises(BadInput, match="X020 the header is damaged: the changes of the map: 1 is no change"):
        run_plan_file(RunSettings(environment=room, resume=whole))


@pytest.mark.parametrize(("text", "why"), [("{}", "it states no changes"), ("[1]", "1 is no change"), ("no", "JSON")])
def test_a_file_that_advises_nothing_is_refused_before_the_run(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "advice.json").write_text(text)
    with pytest.raises(BadInput, match="C025 no changes to apply") as refused:
        run_plan_file(RunSettings(recipe="serve_a_drink", apply=tmp_path / "advice.json"))
    assert why in str(refused.value) or why == "JSON"


def test_an_option_that_is_advised_counts_instead_of_the_one_that_is_given(tmp_path: Path) -> None:
    (tmp_path / "advice.json").write_text('[{"option": "start", "value": [9.0, 9.0, 0.0]}]')
    with pytest.raises(BadInput, match="X007"):
        run_plan_file(RunSettings(recipe="serve_a_drink", start=(0.0, 0.0, 0.0), apply=tmp_path / "advice.json"))


FETCH = """
Prefix: : <http://example.org/fetch.owl#>
Prefix: room: <http://example.org/room.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/fetch.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: room:can1
    Types: knowrob:DrinkingCan
Class: Fetch
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some TakeIt
Class: TakeIt
    SubClassOf: knowrob:FetchingAnObject, knowrob:objectActedOn value room:can1
"""


def test_a_robot_that_does_not_drive_is_told_where_to_start(tmp_path: Path) -> None:
    panda = (Bundled.ROBOT.folder / "panda.toml").read_text(encoding="utf-8").replace("[base]", "[base]\nfixed = true")
    for name, text in {"room.omn": ROOM, "fetch.omn": FETCH, "panda.toml": panda}.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    far = RunSettings(
        recipe=tmp_path / "fetch.omn",
        environment=tmp_path / "room.omn",
        robot=tmp_path / "panda.toml",
        trust_map=True,
        start=(0.4, 1.8, 0.0),
        force=True,
    )
    failed = run_plan_file(far)
    assert failed.failure is not None
    (change,) = failed.failure.changes
    assert change.what == "start"
    assert "started at x = " in str(failed.failure)
    (tmp_path / "failed.json").write_text(json.dumps([change.as_json()]))
    done = run_plan_file(replace(far, apply=tmp_path / "failed.json"))
    assert done.outcome is Outcome.DONE, done.message
