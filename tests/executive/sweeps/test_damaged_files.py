"""A file of a sweep whose entries have other types is refused with its line, by every command that reads one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app

HEADER: dict[str, Any] = {
    "sweep": "written by planlang",
    "version": "0.1.0",
    "job": "executive.sweeps.world_run:ended",
    "about": {"arguments": "serve_a_drink"},
    "shard": [1, 1],
    "worlds_sha256": "0" * 64,
    "worlds": [1, 2],
}
ROWS: list[dict[str, Any]] = [
    {"world": 1, "repeat": "planlang run x --seed 1", "outcome": "done", "failure": [], "message": "", "duration": 3.5},
    {
        "world": 2,
        "repeat": "planlang run x --seed 2",
        "outcome": "failed",
        "failure": ["A"],
        "message": "b",
        "reached": False,
    },
]
VARIED = {**HEADER, "about": {"variants": {"a": {"b": "c"}}}, "worlds": ["a 1", "a 2"]}
OF_VARIANTS = [{**row, "world": f"a {row['world']}", "variant": "a", "seed": row["world"], "b": "c"} for row in ROWS]
ODD: list[Any] = [None, True, -1, 10**400, "x", [1], {"a": 1}]


@pytest.mark.parametrize("sound", [[HEADER, *ROWS], [VARIED, *OF_VARIANTS]], ids=["plain", "variants"])
@pytest.mark.parametrize("line", [0, 1, 2])
def test_any_entry_may_have_another_type_or_be_missing(line: int, sound: list[dict[str, Any]], tmp_path: Path) -> None:
    path = tmp_path / "sweep.jsonl"
    for key in sound[line]:
        changes = [{**sound[line], key: odd} for odd in ODD]
        changes.append({name: value for name, value in sound[line].items() if name != key})
        for changed in changes:
            path.write_text("".join(json.dumps(one) + "\n" for one in (*sound[:line], changed, *sound[line + 1 :])))
            for words in (
                ("sweep-table", path, "--csv", tmp_path / "a.csv", "--force"),
                ("sweep-table", path, path),
                ("sweep-merge", path, "--out", tmp_path / "b.jsonl", "--force"),
            ):
                done = CliRunner().invoke(app, [str(word) for word in words], prog_name="planlang")
                assert done.exit_code in (0, 1, 2, 3), (changed, done.output)
                assert done.exit_code != 2 or "sweep.jsonl:" in done.stderr, (changed, done.output)


def test_a_row_tells_what_its_entry_has_to_be(tmp_path: Path) -> None:
    path = tmp_path / "sweep.jsonl"
    path.write_text("".join(json.dumps(one) + "\n" for one in (HEADER, {**ROWS[0], "duration": "long"})))
    done = CliRunner().invoke(app, ["sweep-table", str(path)], prog_name="planlang")
    assert "sweep.jsonl:2:1: error C030 this line of a sweep is damaged: duration has to be a number" in done.stderr
