"""The goals that a run states stay with it: when it is resumed, explained, or counted in a file for JUnit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.support.cli_runs import answer, invoke
from tests.support.table_room import ROOM

PLAN = """
from planlang import perform, plan, sleep
from planlang.designators import action, an_object

CAN = an_object("DrinkingCan", "http://example.org/room.owl#can1")


@plan
async def look() -> None:
    await perform(action("LookingForSomething", object_acted_on=CAN))
    await sleep(1.0)
    await perform(action("LookingForSomething", object_acted_on=CAN), name="look again")
"""
TWIN = [
    "Individual: can2",
    "    Types: knowrob:DrinkingCan",
    '    Facts: knowrob:translation "1.85 -0.3 0.805", knowrob:boundingBoxSize "0.066 0.066 0.13"',
]
RUN = ("look.py", "--robot", "amigo", "--environment", "room.omn")
HOLDS, FAILS = ("--goal", "can1 on table1"), ("--goal", "can1 in cabinet1")
SAID = "the plan says done; in the world can1 is on table1"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with a plan, and with a room."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "room.omn").write_text(ROOM, encoding="utf-8")
    (tmp_path / "twins.omn").write_text("\n".join([ROOM, *TWIN]), encoding="utf-8")
    (tmp_path / "look.py").write_text(PLAN, encoding="utf-8")
    return tmp_path


def test_a_resumed_run_has_the_goals_of_its_trace(folder: Path) -> None:
    whole = answer("run", *RUN, *HOLDS, *FAILS, "--trace", "run.jsonl")
    assert [one["holds"] for one in whole["goals"]] == [True, False]
    lines = (folder / "run.jsonl").read_text().splitlines(keepends=True)
    (folder / "run.jsonl").write_text("".join(lines[: len(lines) // 2]))
    resumed = answer("run", *RUN, "--resume", "run.jsonl")
    assert (resumed["goals"], resumed["message"], resumed["exit_code"]) == (whole["goals"], SAID, 1)


def test_the_reason_why_a_run_failed_is_the_goal_that_does_not_hold() -> None:
    assert answer("run", *RUN, *FAILS, "--trace", "run.jsonl")["exit_code"] == 1
    found = answer("why", "run.jsonl", "look.py", *RUN[1:], "--budget", "1", "--processes", "1")
    assert found["failure"] == SAID


def test_a_world_whose_goal_does_not_hold_is_a_failure_for_junit_although_the_plan_says_done(folder: Path) -> None:
    invoke("sweep", *RUN, *FAILS, "--first", "0", "--worlds", "1", "--processes", "1", "--junit", "junit.xml")
    (case,) = ElementTree.parse(folder / "junit.xml").getroot().iter("testcase")
    assert [one.get("message") for one in case.iter("failure")] == [SAID]


@pytest.mark.parametrize(("goal", "holds"), [("can1 on table1", True), ("2 DrinkingCan on table1", True)])
def test_goals_are_decided_in_the_world_that_is_stated_with_its_twins(goal: str, holds: bool) -> None:
    found = answer("run", *RUN, "--world", "twins.omn", "--goal", goal, "--trace", "run.jsonl")
    assert [one["holds"] for one in found["goals"]] == [holds]
    assert "equal to the end" in invoke("replay", "run.jsonl", "look.py").stdout
