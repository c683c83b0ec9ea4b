"""Diagnostics about plan files: each code at its exact line; and every code about files has a file."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from typer.testing import CliRunner

from executive.cli.app import app
from planlang.diagnostics import CODES

HERE = Path(__file__).parent
ABOUT_OPTIONS = {"C001", "C004", "C005", "C006", "C008", "C010", "C012", "C013", "C014", "C015", "C016",
                 "P008", "P009", "P010", "P011", "X003", "X004", "X005", "X006", "X007", "X009", "X010", "X012",
                 "X023", "X024", "X025", "X026", "X027"}  # fmt: skip
"""Codes about what was asked for, not about a file's content; tests/executive triggers them."""


@pytest.mark.parametrize(
    ("command", "name", "severity", "line"),
    [
        ("check", "C002_syntax_error.plan", "error", 6),
        ("check", "C003_no_plan.plan", "error", 1),
        ("compile", "C007_plan.plan", "error", 1),
        ("check", "C009_changed_recipe.plan", "error", 1),
        ("check", "C011_recipe_gone.plan", "warning", 1),
        ("run", "X001_cannot_be_imported.plan", "error", 6),
        ("run", "X002_defines_no_plan.plan", "error", 1),
    ],
)
def test_a_plan_file_has_its_diagnostic_at_its_line(command: str, name: str, severity: str, line: int) -> None:
    options = ["--robot", "amigo", "--environment", "hospital_room"] if command == "run" else []
    result = CliRunner().invoke(app, [command, str(HERE / name), *options, "--json"])
    (found,) = json.loads(result.stdout)["diagnostics"]
    assert (found["severity"], found["code"]) == (severity, name.split("_")[0])
    assert (found["span"]["file"], found["span"]["line"]) == (str(HERE / name), line)
    assert result.exit_code == (2 if severity == "error" else 0)


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("X020_no_json.jsonl", 3),
        ("X020_backwards.jsonl", 4),
        ("X020_no_trace.jsonl", 1),
        ("X021_ended.jsonl", 1),
        ("X022_other_plan.jsonl", 1),
    ],
)
def test_a_trace_that_cannot_be_resumed_has_its_diagnostic_at_its_line(name: str, line: int) -> None:
    result = CliRunner().invoke(app, ["run", "--resume", str(HERE / name), "--trace", os.devnull, "--json"])
    found = json.loads(result.stdout)["diagnostics"]
    assert {(one["severity"], one["code"]) for one in found} == {("error", name.split("_")[0])}
    assert (found[0]["span"]["file"], found[0]["span"]["line"]) == (str(HERE / name), line)
    assert result.exit_code == 2


def test_a_file_of_process_modules_has_its_diagnostic_at_its_line() -> None:
    name = str(HERE / "X011_cannot_be_imported.module")
    result = CliRunner().invoke(app, ["run", "serve_a_drink", "--modules", name, "--json"])
    (found,) = json.loads(result.stdout)["diagnostics"]
    assert (found["code"], found["span"]["file"], found["span"]["line"]) == ("X011", name, 4)


def test_every_code_about_a_file_has_a_file_that_triggers_it() -> None:
    files = {path.name.split("_")[0] for path in HERE.iterdir()}
    assert sorted(set(CODES) - files - ABOUT_OPTIONS) == []
