"""A run gives up by itself, says what it did last, and says how it is given more."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import executive.runs.allowance as allowances
from executive.locations.search_count import SEARCHES, SearchCount
from executive.options.running import RunSettings
from executive.runs.allowance import Allowance
from planlang.designators import a_location, an_object
from planlang.failures import BudgetExceeded
from planlang.language.source import PlanSource
from tests.support.cli_runs import invoke

HERE = a_location(in_reach_of=an_object("Cup"))
PLAN = """
from planlang import perform, plan
from planlang.designators import action


@plan
async def to_and_fro() -> None:
    while True:
        await perform(action("Translation-LocationChange", x=0.5, y=0.0, yaw=0.0), name="go")
        await perform(action("Translation-LocationChange", x=-0.5, y=0.0, yaw=0.0), name="come")
"""


def allowance(**settings: Any) -> Allowance:
    return Allowance.of(PlanSource(PLAN, "plan.py"), {}, 0, RunSettings(**settings))


def test_a_run_may_use_more_for_each_step_of_its_plan_and_for_patience() -> None:
    plain, patient = allowance(), allowance(patience=2.0)
    assert plain.seconds >= 600.0
    assert patient.attempts == 2 * plain.attempts
    assert patient.searches == 2 * (plain.searches or 0)


def test_a_plan_that_goes_on_for_ever_gives_up_with_what_it_did_last_and_how_it_is_given_more(tmp_path: Path) -> None:
    (tmp_path / "plan.py").write_text(PLAN)
    words = (tmp_path / "plan.py", "--robot", "amigo", "--environment", "hospital_room")
    ended = invoke("run", *words, "--patience", "0.1", "--trace", tmp_path / "run.jsonl")
    assert "BudgetExceeded: the budget of 72 s and 10 attempts is used up, last by " in ended.stdout, ended.output
    assert "note X043 the run gives up after 72 s of plan time, 10 further attempts or 22 searches" in ended.output
    assert "--patience 0.2 lets it take twice as much of each" in ended.output
    assert ended.exit_code == 1
    assert "equal to the end" in invoke("replay", tmp_path / "run.jsonl", tmp_path / "plan.py").stdout


def test_one_search_too_many_says_what_was_searched_for_last() -> None:
    count = SearchCount(most=2)
    count.begin(HERE)
    count.begin(HERE)
    with pytest.raises(BudgetExceeded, match=re.escape(f"2 {SEARCHES} are used up, the last for {HERE}")):
        count.begin(HERE)
    count.allow(1)
    count.begin(HERE)
    assert count.used == 3


def test_a_run_without_searches_left_puts_down_what_it_holds_gives_up_and_is_repeated_exactly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(allowances, "MOST_SEARCHES", 1)
    monkeypatch.setattr(allowances, "SEARCHES_PER_STEP", 0)
    trace = tmp_path / "run.jsonl"
    ended = invoke("run", "serve_a_drink", "--trace", trace)
    assert f"1 {SEARCHES} are used up, the last for in_reach_of(bottle1)" in ended.output, ended.output
    assert "bottle1 was put down on" in ended.output
    assert "X043" in ended.output
    assert "equal to the end" in invoke("replay", trace).stdout
