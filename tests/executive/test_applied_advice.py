"""The advice of a failed run as data: applied to the map, the run gets past its failure."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from executive.options.running import RunSettings
from executive.runs.options import Outcome
from executive.runs.plan_run import run_plan_file
from planlang.advice import Change
from planlang.diagnostics import BadInput
from planlang.files import Bundled

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


@pytest.mark.parametrize(("text", "why"), [("{}", "it states no changes"), ("[1]", "1 is no change"), ("no", "JSON")])
def test_a_file_that_advises_nothing_is_refused_before_the_run(tmp_path: Path, text: str, why: str) -> None:
    (tmp_path / "advice.json").write_text(text)
    with pytest.raises(BadInput, match="C025 no changes to apply") as refused:
        run_plan_file(RunSettings(recipe="serve_a_drink", apply=tmp_path / "advice.json"))
    assert why in str(refused.value) or why == "JSON"


def test_an_option_that_is_advised_counts_unless_it_is_given(tmp_path: Path) -> None:
    (tmp_path / "advice.json").write_text('[{"option": "start", "value": [9.0, 9.0, 0.0]}]')
    with pytest.raises(BadInput, match="X007"):
        run_plan_file(RunSettings(recipe="serve_a_drink", apply=tmp_path / "advice.json"))
