"""``planlang sweep``: the worlds are those of ``planlang run --seed``, and it ends as it should."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

import planlang
from executive.cli.sweep import Counts
from executive.sweeps.files import read_sweep
from executive.sweeps.records import Done
from executive.sweeps.world_run import ended
from tests.support.cli_runs import invoke
from tests.support.refusals import refusal


@pytest.fixture(scope="module")
def drinks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep of one world that fails, made in Python."""
    out = tmp_path_factory.mktemp("sweep") / "drinks.jsonl"
    rows = planlang.sweep("pass_a_drink", 1, first=3, robot="panda", out=out, processes=1, unknown=["bottle1"])
    assert rows == list(read_sweep(out).rows)
    return out


@pytest.mark.long
def test_a_world_ends_as_the_run_that_its_command_repeats(drinks: Path) -> None:
    (row,) = read_sweep(drinks).rows
    words = shlex.split(row["repeat"])
    assert words == ["planlang", "run", "pass_a_drink", "--robot", "panda", "--unknown", "bottle1", "--seed", "3"]
    alone = json.loads(invoke(*words[1:], "--json").stdout)
    assert (row["message"], row["failure"][0]) == (alone["message"], alone["failure"]["class"])
    assert row["duration"] == pytest.approx(alone["duration"], abs=1e-3)
    options = {"recipe": "pass_a_drink", "robot": "panda", "unknown": ["bottle1"], "seed": 3}
    assert {"world": 3, "repeat": row["repeat"], **ended({"options": options})} == row


def test_the_same_command_goes_on_and_another_one_is_refused(drinks: Path) -> None:
    words = ["pass_a_drink", "--worlds", "1", "--first", "3", "--robot", "panda", "--unknown", "bottle1"]
    again = invoke("sweep", *words, "--out", drinks)
    (row,) = read_sweep(drinks).rows
    assert again.exit_code == (3 if row["outcome"] == "lacks a capability" else 1), again.stderr
    assert "1 of 1 worlds were done before" in again.stderr
    assert row["repeat"] in again.stdout
    other = invoke("sweep", *words, "--trust-map", "--out", drinks)
    assert other.exit_code == 2
    assert "C031" in other.stderr
    assert "--trust-map" in other.stderr


def test_tables_are_printed_again_merged_and_written_as_csv(drinks: Path, tmp_path: Path) -> None:
    shown = invoke("sweep-table", drinks, "--csv", tmp_path / "a.csv")
    merged = invoke("sweep-merge", drinks, "--out", tmp_path / "merged.jsonl")
    assert shown.stdout == merged.stdout
    assert (tmp_path / "merged.jsonl").read_bytes() == drinks.read_bytes()
    assert (tmp_path / "a.csv").read_text().startswith("world,repeat,outcome,failure")
    (tmp_path / "mine").write_text("notes")
    assert "C005" in invoke("sweep-merge", drinks, "--out", tmp_path / "mine").stderr
    lines = drinks.read_text().splitlines(keepends=True)
    (tmp_path / "none.jsonl").write_text(lines[0])
    missing = invoke("sweep-table", tmp_path / "none.jsonl")
    assert "C033 1 of 1 worlds are missing: 3" in missing.stderr
    assert missing.exit_code == 1


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["nowhere"], "C001 no such recipe"),
        (["serve_a_drink", "--robot", "nobody"], "nobody"),
        (["serve_a_drink", "--shard", "3/2"], "--shard 3/2 is not K/N"),
        (["serve_a_drink", "--start", "here"], "is not x,y,yaw"),
        (["serve_a_drink", "--out", "no/such/folder/rows"], "C004"),
        (["serve_a_drink", "--worlds", "0"], "--worlds"),
    ],
)
def test_what_is_wrong_for_all_worlds_is_said_before_the_first(words: list[str], reason: str) -> None:
    result = invoke("sweep", *words)
    assert result.exit_code == 2
    assert reason in result.stderr


def test_an_interrupted_sweep_shows_what_was_done_and_how_to_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, told: Callable[[Done], None], **more: object) -> None:
        told(Done({"world": 2, "outcome": "done"}, 1.0))
        raise KeyboardInterrupt

    monkeypatch.setattr("executive.commands.sweep.run", interrupted)
    result = invoke("sweep", "serve_a_drink", "--worlds", "9", "--shard", "2/2", "--out", tmp_path / "rows")
    assert result.exit_code == 130
    assert f"interrupted after 1 of 4 worlds, which {tmp_path / 'rows'} has: repeat" in result.stderr
    assert result.stdout.startswith("1 of 4 worlds\nreached                   1")


def test_mistakes_in_python_are_bad_input() -> None:
    with refusal("C040", naming="'here'"):
        planlang.sweep("serve_a_drink", 1, start="here")
    with refusal("C001", naming="nowhere"):
        planlang.sweep("nowhere", 1)


def test_progress_tells_the_rate_and_the_share_that_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    lines: list[object] = []
    times = iter([0.0, 0.0, 5.0, 20.0, 21.0])
    monkeypatch.setattr("executive.cli.sweep.time.monotonic", lambda: next(times))
    counts = Counts(103, lines.append, lambda *report: lines.append(report))
    counts.resumed([{"world": 1, "outcome": "done"}])
    for outcome in ("done", "crashed"):
        counts.count(Done({"outcome": outcome}, 0.6))
    assert lines == [
        "1 of 103 worlds were done before",
        ("1 of 103 worlds", 1 / 103),
        ("2 of 103 worlds, 2 reached; 12 a minute, 0.60 s of CPU each", 2 / 103),
        ("3 of 103 worlds, 2 reached, 1 crashed; 6 a minute, 0.60 s of CPU each", 3 / 103),
    ]
