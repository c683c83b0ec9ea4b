"""``planlang new``: what it writes runs as it is."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

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


NO_NAMES = {
    "all": (
        "class",
        "async",
        "print",
        "some",
        "random",
        "pytest",
        "planlang",
        "__init__",
        "9x",
        "é",
        "",
        "a b",
        "x" * 300,
    ),
    "plan": ("grasp", "partial", "perform", "plan"),
    "recipe": ("take_first", "close_the_cabinet"),
    "map": ("cup1", "cabinet1"),
    "module": ("whistling", "sleep"),
    "project": ("class",),
    "robot": ("import",),
}


@pytest.mark.parametrize("kind", [kind for kind in NO_NAMES if kind != "all"])
def test_no_template_is_written_under_a_name_that_would_break_it(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in (*NO_NAMES["all"], *NO_NAMES[kind]):
        refused = planlang("new", kind, name)
        assert (refused.exit_code, "C0" in refused.stderr, "help:" in refused.stderr) == (2, True, True), refused.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", ["plan", "module"])
def test_what_is_written_under_a_proposed_name_is_python(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("class", "9x", "grasp", "sleep"):
        told = planlang("new", kind, name)
        written = name
        if told.exit_code == 2:
            written = told.stderr.partition("for example ")[2].split()[0]
            assert planlang("new", kind, written).exit_code == 0
        compile(Path(f"{written}.py").read_text("utf-8"), written, "exec")


def test_a_folder_that_is_a_file_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("mine")
    for folder in ("file", "file/below"):
        refused = planlang("new", "plan", "mine", "--folder", folder)
        assert (refused.exit_code, "is a file, not a folder" in refused.stderr) == (2, True), refused.output
