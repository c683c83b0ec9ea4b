"""The table of a sweep: outcomes with their intervals, causes by how often they occur."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from executive.sweeps.table import causes, csv_text, shares, table
from planlang.proportions import wilson


def row(world: int, outcome: str, *failure: str, message: str = "", **more: Any) -> dict[str, Any]:
    repeat = f"planlang run pour --seed {world}"
    return {"world": world, "repeat": repeat, "outcome": outcome, "failure": list(failure), "message": message, **more}


ROWS = [
    row(1, "done", message="done", duration=10.0),
    row(2, "failed", "GraspMissed", message="GraspMissed: 3 mm too far. It was seen.\n  why", duration=1.0),
    row(3, "done", message="done", duration=30.0),
    row(4, "crashed", "ProcessEnded", "Killed", message="2 processes in a row ended without an answer"),
    row(5, "failed", "GraspMissed", message="GraspMissed: 4.5 mm too far. It was felt.", duration=1.0),
    row(6, "done", message="done", duration=20.0, reached=False),
]


@pytest.mark.parametrize(
    ("count", "total", "low", "high"), [(0, 10, 0.0, 0.2775), (9, 10, 0.5958, 0.9821), (480, 500, 0.9390, 0.9740)]
)
def test_intervals_are_wilsons(count: int, total: int, low: float, high: float) -> None:
    assert wilson(count, total) == pytest.approx((low, high), abs=1e-4)


def test_each_world_counts_as_one_outcome_and_a_false_success_as_none() -> None:
    counts = {one.outcome: one.count for one in shares(ROWS)}
    assert counts == {"reached": 2, "failed": 2, "crashed": 1, "false success": 1}


def test_causes_are_ranked_and_messages_that_differ_in_numbers_are_one() -> None:
    first, *others = causes(ROWS)
    assert (first.name, first.sentence, first.count) == ("GraspMissed", "3 mm too far", 2)
    assert first.repeat == "planlang run pour --seed 2"
    assert [(one.name, one.count) for one in others] == [("ProcessEnded < Killed", 1), ("false success", 1)]


def test_the_table_tells_how_long_the_plans_took_and_how_to_repeat_failures() -> None:
    text = table(ROWS, 8)
    assert text.startswith("6 of 8 worlds\nreached                   2   33.3 %  (95 %: 9.7 to 70.0 %)\n")
    assert "median 20.0 s, 95 % within 30.0 s" in text
    assert "      2  GraspMissed: 3 mm too far\n         planlang run pour --seed 2\n" in text
    assert table([]).startswith("0 worlds\n")


def test_the_table_says_how_many_faults_happened_in_a_run_and_of_those_that_were_stated() -> None:
    fired = {"time": 1.0, "fault": "arm.left:stalls", "kind": "arm:stalls", "opportunity": 3}
    told = [
        {"fired": [fired, fired], "never": [], "stated": 1, "opportunities": 20},
        {"fired": [], "never": ["arm:stalls@1"], "stated": 1, "opportunities": 9},
    ]
    rows = [row(world, "done", message="done", faults=one) for world, one in enumerate(told, start=1)]
    assert "1.00 faults a run, at 14.5 opportunities; of 2 that were stated, 1 happened\n" in table(rows) + "\n"
    drawn = [{**one, "faults": {**one["faults"], "stated": 0, "never": []}} for one in rows]
    assert "1.00 faults a run, at 14.5 opportunities\n" in table(drawn) + "\n"
    assert "opportunities" not in table(ROWS)


def test_rows_as_csv_have_a_column_for_each_key() -> None:
    read = list(csv.DictReader(io.StringIO(csv_text([*ROWS, {"world": 7, "tilts": {"cup": 1.0}}]))))
    assert [one["world"] for one in read] == list("1234567")
    assert (read[1]["failure"], read[5]["reached"], read[6]["outcome"]) == ("GraspMissed", "False", "")
    assert "tilts" not in read[0]
