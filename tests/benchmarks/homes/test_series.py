"""Series of homes: their seeds, their rows, and the tables that are made of them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

from executive.sweeps import run as sweep
from executive.sweeps.files import read_sweep
from tests.benchmarks.homes import series
from tests.benchmarks.homes.series import Case, NotAccepted
from tests.benchmarks.homes.table import BEGIN, END, documented, fisher, is_rightly_refused, tables

COMMIT = "0123456789abcdef0123456789abcdef01234567"


def test_acceptance_seeds_follow_from_the_commit_and_are_no_development_seeds():
    seeds = series.acceptance_series(COMMIT, 10)
    assert seeds == series.acceptance_series(COMMIT, 10)
    assert seeds != series.acceptance_series(COMMIT[::-1], 10)
    assert min(seeds) >= series.ACCEPTANCE > series.DEVELOPMENT


def test_a_burnt_series_is_not_accepted(tmp_path: Path):
    burnt = tmp_path / "burnt.json"
    first = series.acceptance_seed(COMMIT)
    burnt.write_text(json.dumps([{"first": first, "commit": COMMIT, "reason": "failures were read"}]))
    with pytest.raises(NotAccepted, match="failures were read"):
        series.acceptance_series(COMMIT, 10, burnt)


def test_a_product_that_is_not_committed_is_not_accepted(tmp_path: Path):
    def git(*words: str) -> None:
        subprocess.run(["git", "-c", "user.name=a", "-c", "user.email=a@b", *words], cwd=tmp_path, check=True)

    (tmp_path / "planlang").mkdir()
    (tmp_path / "planlang" / "a.py").write_text("a = 1\n")
    git("init", "-q")
    git("add", "-A")
    git("commit", "-qm", "a")
    assert len(series.commit_measured(tmp_path)) == 40
    (tmp_path / "planlang" / "a.py").write_text("a = 2\n")
    with pytest.raises(NotAccepted, match=r"planlang/a\.py"):
        series.commit_measured(tmp_path)


def stand_in(world: dict[str, Any]) -> dict[str, Any]:
    """Return a row without a run; the job of the test below."""
    return {key: world[key] for key in ("template", "seed", "robot", "displaced")} | {"outcome": "done"}


def test_a_series_that_was_killed_goes_on_and_counts_no_task_twice(tmp_path: Path):
    rows = tmp_path / "rows.jsonl"
    worlds = [case.world for case in series.cases(range(3), ["fetch", "beside"], ["amigo"], False)]
    sweep(worlds, f"{__name__}:stand_in", processes=1, out=rows)
    lines = rows.read_text().splitlines(keepends=True)
    rows.write_text("".join(lines[:4]) + lines[4][:20])  # three tasks are done, the fourth line is torn
    done: list[object] = []
    sweep(worlds, f"{__name__}:stand_in", processes=1, out=rows, told=lambda one: done.append(one.row["world"]))
    assert len(done) == 3
    assert [row["world"] for row in read_sweep(rows).rows] == [world["world"] for world in worlds]


def row(template: str, reached: bool, **more: Any) -> dict[str, Any]:
    """Return a row of a table."""
    case = Case(template, 0, "amigo")
    return {
        **case.world, "outcome": "done" if reached else "failed", "reached": reached, "harm": [], "cpu": 2.0,
        "failure": [] if reached else ["ObjectUnreachable"], "message": "" if reached else "cup1 is out of reach. So.",
        "leaves": {"open": [1, int(reached)], "close": [0, 0]}, **more,
    }  # fmt: skip


def test_a_table_counts_what_is_possible_false_successes_and_right_reasons():
    wide = {"answer": "impossible", "kind": "too wide", "thing": "cup1", "why": "", "open": []}
    rows = [
        row("fetch", True),
        row("fetch", False),
        row("fetch", False, outcome="done"),
        row("beside", False, witness=wide, message="ObjectUnreachable: cup1 is too wide for the hand"),
        row("beside", False, witness=wide),
        row("beside", False, witness=wide, message="cup1 is too wide", harm=["cup1 is on the floor"]),
    ]
    text = "\n".join(tables(rows))
    robot = next(line for line in text.splitlines() if "as its map" in line)
    cells = [cell.strip() for cell in robot.split("|")[1:-1]]
    assert cells == ["amigo", "as its map", "6", "1/3", "33% (6% to 79%)", "1/1", "1", "1/3", "-", "2.0"]
    assert "3/6" in text
    assert "too wide 3" in text
    assert [is_rightly_refused(one) for one in rows[3:]] == [True, False, False]
    assert "cup1 is out of reach" in text
    assert rows[1]["repeat"] in text


def test_the_lot_falls_on_reached_tasks_of_homes_as_their_maps_say_and_not_on_their_order():
    rows = [row("fetch", True, world=f"fetch {seed}") for seed in range(30)]
    others = [row("fetch", False, world="failed"), row("fetch", True, world="moved", displaced=True)]
    drawn = series.by_lot([*rows, *others], 10)
    assert len(drawn) == 10
    assert drawn == series.by_lot([*others, *reversed(rows)], 10)
    assert all(one["reached"] and not one["displaced"] for one in drawn)
    assert [one["world"] for one in drawn] != sorted(str(one["world"]) for one in drawn)


def test_the_witness_may_also_be_asked_of_what_failed_but_not_of_what_was_not_drawn():
    rows = [row("fetch", True, world="reached"), row("fetch", False, world="failed")]
    rows += [row("fetch", False, world="moved", displaced=True), row("fetch", False, world="none", outcome="not drawn")]
    assert [one["world"] for one in series.by_lot(rows, 10, failed=True)] == ["failed"]


def test_development_and_acceptance_are_compared_exactly():
    assert fisher((8, 10), (1, 6)) == pytest.approx(0.0350, abs=5e-4)  # of the literature: scipy.stats.fisher_exact
    assert fisher((90, 100), (90, 100)) == pytest.approx(1.0)
    rows = [row("fetch", True, series="development"), row("fetch", True, series="acceptance")]
    assert "p = 1.000" in "\n".join(tables(rows))


def test_the_table_is_written_between_the_markers_of_its_page():
    page = f"before\n{BEGIN}\nold\n{END}\nafter\n"
    assert documented(page, "new") == f"before\n{BEGIN}\n\nnew\n\n{END}\nafter\n"
    with pytest.raises(ValueError, match="lacks the lines"):
        documented("before\n", "new")
