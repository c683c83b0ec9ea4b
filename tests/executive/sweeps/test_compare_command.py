"""``planlang compare``, ``sweep --vary`` and ``sweep-table A B``: variants have the same worlds, and all is printed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import planlang
from executive.commands.sweep import swept
from executive.options.declaring import made
from executive.options.running import SweepOptions
from executive.sweeps.files import header_of, read_sweep, write_sweep
from executive.sweeps.records import Done
from tests.support.cli_runs import answer, invoke
from tests.support.refusals import refusal

LACKING = ("pass_a_drink", "--robot", "panda", "--worlds", "2", "--vary", "schedule=1,2")
"""Worlds that are refused, which takes no time."""


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("compared") / "rows.jsonl"
    result = invoke("compare", *LACKING, "--output", out, "--csv", out.with_suffix(".csv"))
    assert result.exit_code == 0, result.stderr
    assert result.stdout.startswith("variant     worlds  reached")
    return out


def test_the_file_has_each_world_with_each_variant_and_what_varies(compared: Path) -> None:
    sweep = read_sweep(compared)
    assert sweep.variants == {"schedule=1": {"schedule": "1"}, "schedule=2": {"schedule": "2"}}
    assert [row["world"] for row in sweep.rows] == ["schedule=1 1", "schedule=2 1", "schedule=1 2", "schedule=2 2"]
    assert [(row["variant"], row["seed"], row["schedule"]) for row in sweep.rows][1] == ("schedule=2", 1, "2")
    assert sweep.rows[1]["repeat"] == "planlang run pass_a_drink --robot panda --schedule 2 --seed 1"
    about = sweep.header["about"]
    assert about["schedule=1: content of robot"] == about["schedule=2: content of robot"]
    head = compared.with_suffix(".csv").read_text().partition("\n")[0]
    assert head.startswith("world,repeat,variant,seed,schedule,outcome")


def test_the_same_command_goes_on_and_other_variants_are_refused(compared: Path, tmp_path: Path) -> None:
    lines = compared.read_text().splitlines(keepends=True)
    rest = tmp_path / "rest.jsonl"
    rest.write_text("".join(lines[:3]))
    again = invoke("compare", *LACKING, "--output", rest)
    assert "2 of 4 worlds were done before" in again.stderr
    assert rest.read_bytes() == compared.read_bytes()
    other = invoke("compare", *LACKING[:-1], "schedule=1,3", "--output", rest)
    assert other.exit_code == 2
    assert "C031" in other.stderr


def test_a_sweep_with_variants_has_a_table_for_each_and_its_file_is_compared_too(compared: Path) -> None:
    swept = invoke("sweep", *LACKING, "--output", compared)
    assert "schedule=1: 2 worlds\nreached                   0" in swept.stdout
    assert "against" not in swept.stdout
    shown = invoke("sweep-table", compared)
    assert shown.stdout.startswith(swept.stdout.rstrip())
    assert "schedule=2 against schedule=1: no difference shown" in shown.stdout
    data = answer("sweep-table", compared)
    assert [one["name"] for one in data["variants"]] == ["schedule=1", "schedule=2"]
    assert data["pairs"][0]["n00"] == 2
    assert len(data["rows"]) == 4


def test_files_are_compared_as_variants_and_worlds_of_one_are_named(compared: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.jsonl"
    header = {**read_sweep(compared).header, "about": {}, "worlds": [1, 2, 3]}
    rows = [{"world": seed, "outcome": "failed"} for seed in (1, 2, 3)]
    plain.write_text("".join(f"{json.dumps(one)}\n" for one in (header, *rows)))
    shown = invoke("sweep-table", plain, compared, "--csv", tmp_path / "both.csv")
    assert shown.exit_code == 0
    assert f"{compared}: schedule=1 against {plain}: no difference shown" in shown.stdout
    assert f"1 world only of {plain}, not compared: 3" in shown.stdout
    assert (tmp_path / "both.csv").read_text().count("\n") > 7
    missing = invoke("sweep-table", plain, tmp_path / "none")
    assert missing.exit_code == 2


def test_an_interrupted_comparison_compares_what_was_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, told: Callable[[Done], None], **more: object) -> None:
        for name in ("schedule=1", "schedule=2"):
            told(Done({"world": f"{name} 1", "variant": name, "seed": 1, "outcome": "done"}, 1.0))
        raise KeyboardInterrupt

    monkeypatch.setattr("executive.commands.sweep.run", interrupted)
    result = invoke("compare", *LACKING, "--output", tmp_path / "rows")
    assert result.exit_code == 130
    assert f"interrupted after 2 of 4 worlds, which {tmp_path / 'rows'} has: repeat" in result.stderr
    assert "reached by both 1" in result.stdout


def test_an_interrupted_sweep_has_its_rows_in_the_order_of_the_worlds(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, told: Callable[[Done], None], **more: object) -> None:
        for seed, name in ((10, "schedule=1"), (2, "schedule=2"), (2, "schedule=1")):
            told(Done({"world": f"{name} {seed}", "variant": name, "seed": seed, "outcome": "done"}, 1.0))
        raise KeyboardInterrupt

    monkeypatch.setattr("executive.commands.sweep.run", interrupted)
    rows = json.loads(invoke("sweep", *LACKING, "--worlds", "10", "--json").stdout)["rows"]
    assert [row["world"] for row in rows] == ["schedule=1 2", "schedule=2 2", "schedule=1 10"]


def swept_rows(path: Path, reached: int) -> Path:
    """Write a sweep of 20 worlds of which the first ones were reached."""
    worlds = [{"world": seed} for seed in range(1, 21)]
    rows = [{**world, "outcome": "done" if world["world"] <= reached else "failed"} for world in worlds]
    write_sweep(path, header_of("job", {"call": path.name}, worlds, (1, 1)), rows)
    return path


@pytest.mark.parametrize(
    ("before", "after", "fails", "code"),
    [
        *((18, 8, fails, code) for fails, code in (("worse", 1), ("different", 1), (None, 0))),
        *((8, 18, fails, code) for fails, code in (("worse", 0), ("different", 1))),
        *((18, 16, fails, 0) for fails in ("worse", "different")),
    ],
)
def test_a_comparison_fails_only_if_it_shows_what_it_is_asked_for(
    tmp_path: Path, before: int, after: int, fails: str | None, code: int
) -> None:
    files = swept_rows(tmp_path / "before", before), swept_rows(tmp_path / "after", after)
    assert invoke("sweep-table", *files, *(("--fail-if", fails) if fails else ())).exit_code == code


def test_merged_shards_are_written_for_ci_and_as_a_page(tmp_path: Path) -> None:
    whole = read_sweep(swept_rows(tmp_path / "whole", 18))
    parts = [tmp_path / name for name in ("one", "two")]
    for number, part in enumerate(parts):
        write_sweep(part, {**whole.header, "shard": [number + 1, 2]}, whole.rows[number::2])
    files = {name: tmp_path / f"merged.{name}" for name in ("junit", "report", "csv", "plot")}
    files["plot"] = tmp_path / "merged.svg"
    words = [word for name, file in files.items() for word in (f"--{name}", file)]
    merged = invoke("sweep-merge", *parts, "--output", tmp_path / "merged", *words)
    assert merged.exit_code == 1, "not all worlds were reached"
    assert (tmp_path / "merged").read_bytes() == (tmp_path / "whole").read_bytes()
    assert 'tests="20" failures="2"' in files["junit"].read_text()
    assert all(file.stat().st_size for file in files.values())


def test_a_comparison_needs_two_variants() -> None:
    for words in ((), ("--vary", "robot=panda"), ("--variant", "a:")):
        result = invoke("compare", "pass_a_drink", *words)
        assert result.exit_code == 2
        assert "name two variants at least: --vary robot=amigo,pr2" in result.stderr
        assert "--variant 'mine: --robot my.toml'" in result.stderr
    with refusal("C040", naming='vary={"robot": ["amigo", "pr2"]}'):
        planlang.compare("pass_a_drink")


def test_what_is_wrong_with_a_variant_is_said_with_its_name() -> None:
    result = invoke("compare", "pass_a_drink", "--vary", "robot=panda,nobody")
    assert result.exit_code == 2
    assert "robot=nobody: " in result.stderr


def test_variants_that_choose_other_environments_are_warned_of() -> None:
    found: list[Any] = []

    def stop(diagnostics: Any) -> None:
        found.extend(diagnostics)
        raise KeyboardInterrupt

    options = made(SweepOptions, {"recipe": "serve_a_drink", "vary": {"bottle": ["bottle1", "bottle2"]}})
    with pytest.raises(KeyboardInterrupt):
        swept(options, announce=stop)
    assert [one.code for one in found] == ["X010", "C038"]
    assert "hospital_room, ward_office" in found[1].message


@pytest.mark.parametrize(
    "change",
    [{"variant": "other"}, {"variant": None}, {"seed": "1"}, {"seed": None}],
)
def test_a_row_without_a_variant_of_the_header_is_damaged(
    compared: Path, tmp_path: Path, change: dict[str, object]
) -> None:
    head, first, *rest = compared.read_text().splitlines(keepends=True)
    damaged = tmp_path / "damaged.jsonl"
    damaged.write_text("".join([head, json.dumps({**json.loads(first), **change}) + "\n", *rest]))
    result = invoke("sweep-table", damaged)
    assert result.exit_code == 2
    assert "damaged.jsonl:2:1: error C030" in result.stderr


def test_rows_and_comparison_in_python_are_those_of_the_command(compared: Path) -> None:
    found = planlang.compare("pass_a_drink", 2, robot="panda", vary={"schedule": [1, 2]}, output=compared)
    assert list(found.rows) == list(read_sweep(compared).rows)
    assert str(found) == "\n".join(invoke("compare", *LACKING, "--output", compared).stdout.splitlines())


@pytest.mark.parametrize("command", ["sweep", "compare"])
def test_where_the_cluster_is_lost_the_command_that_was_given_runs_the_rest(command: str, tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    lost = ("--on", "tcp://127.0.0.1:9", "--cluster-wait", "0")
    kept = invoke(command, *LACKING, *lost, "--output", tmp_path / "rows.jsonl")
    assert kept.exit_code == 2
    assert f"run the rest with planlang {command} pass_a_drink" in kept.stderr
    assert "--output FILE keeps what is done" in invoke(command, *LACKING, *lost).stderr
