"""``planlang new``: what it writes runs as it is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from executive.cli.app import app

FIRST_RUNS = {
    "recipe": ("run", "mine.omn", "--robot", "amigo", "--environment", "kitchenette"),
    "map": ("locate", "in reach of cup1", "--robot", "amigo", "--environment", "mine.omn"),
    "plan": ("run", "mine.py", "--robot", "amigo", "--environment", "hospital_room"),
    "module": ("match", "serve_a_drink", "--robot", "amigo", "--modules", "mine.py"),
    "robot": ("robot", "inspect", "mine.toml"),
}


def planlang(*words: str) -> Any:
    return CliRunner().invoke(app, words, prog_name="planlang")


@pytest.mark.parametrize(
    "kind",  # the map of what a new robot reaches takes a minute, a first run of a recipe seconds
    [pytest.param(kind, marks=pytest.mark.long) if kind in ("robot", "recipe") else kind for kind in FIRST_RUNS],
)
def test_a_template_runs_as_it_is(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert planlang("new", kind, "mine").exit_code == 0
    done = planlang(*FIRST_RUNS[kind])
    assert done.exit_code == 0, done.output
    assert not [path for path in tmp_path.iterdir() if "template" in path.read_text("utf-8").lower()]


@pytest.mark.long
def test_the_tests_of_a_project_and_of_a_plan_pass(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert planlang("new", "project", "bring_cup").exit_code == 0
    assert planlang("new", "plan", "grasp_it", "--folder", "bring_cup").exit_code == 0
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"],
        cwd="bring_cup",
        capture_output=True,
        text=True,
        check=False,
    )
    assert "4 passed" in ended.stdout, ended.stdout


@pytest.mark.long
def test_a_project_reaches_its_goal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    planlang("new", "project", "bring_cup")
    monkeypatch.chdir(tmp_path / "bring_cup")
    run = planlang("run", "bring_cup.omn", "--robot", "amigo", "--environment", "room.omn")
    assert "cup1: at rest on cabinet1" in run.output


def test_nothing_of_a_user_is_overwritten(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("test_mine.py").write_text("mine")
    refused = planlang("new", "plan", "mine")
    assert refused.exit_code == 2
    assert "C005" in refused.output
    assert [path.name for path in tmp_path.iterdir()] == ["test_mine.py"]
    assert planlang("new", "plan", "mine", "--force").exit_code == 0


def test_a_name_that_cannot_be_a_function_gets_a_proposal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    refused = planlang("new", "recipe", "My Task!")
    assert refused.exit_code == 2
    assert "C034" in refused.output
    assert "my_task" in refused.output
