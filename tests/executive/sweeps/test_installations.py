"""Worlds run with the planlang of another interpreter, or it is said before the first why they cannot."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

import planlang
from executive.sweeps import run
from executive.sweeps.files import read_sweep
from executive.sweeps.installations import check_options, installation
from tests.support.refusals import refusal


def interpreter(folder: Path, text: str = f'exec "{sys.executable}" "$@"') -> Path:
    """An interpreter with another path."""
    folder.mkdir(exist_ok=True)
    python = folder / "python"
    python.write_text(f"#!/bin/sh\n{text}\n")
    python.chmod(0o755)
    return python


@pytest.fixture
def other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Another interpreter, whose modules are its own although ``PYTHONPATH`` has some of the same names."""
    wrong = tmp_path / "modules" / "executive"
    wrong.mkdir(parents=True)
    (wrong / "__init__.py").write_text("raise ZeroDivisionError('the module of somebody else')")
    monkeypatch.setenv("PYTHONPATH", str(wrong.parent))
    return interpreter(tmp_path / "env")


def test_a_variant_runs_with_its_own_interpreter_and_its_file_and_commands_name_it(other: Path, tmp_path: Path) -> None:
    out = tmp_path / "rows"
    variant = {"panda": {"robot": "panda"}, "again": {"robot": "panda", "schedule": 1}}
    found = planlang.compare("pass_a_drink", 1, python=other, variant=variant, output=out, processes=1)
    first, _ = found.rows
    assert [row["outcome"] for row in found.rows] == ["lacks a capability"] * 2
    assert first["repeat"] == f"{other} -m executive run pass_a_drink --robot panda --seed 1"
    about = read_sweep(out).header["about"]
    assert about["again: planlang"]["version"] == planlang.__version__
    assert len(about["again: planlang"]["sha256"]) == 64


def test_an_interpreter_without_planlang_is_refused_with_the_reason(tmp_path: Path) -> None:
    with refusal("C035", naming="no such interpreter"):
        installation(tmp_path / "none")
    old = interpreter(tmp_path / "old", "echo \"ModuleNotFoundError: No module named 'executive'\" >&2; exit 1")
    with refusal("C035", naming="has no planlang, or one that is too old: ModuleNotFoundError"):
        installation(old)
    said = json.dumps({"version": "9.0", "sha256": "", "options": ["recipe"], "speaks": ["q"]})
    with refusal("C035", naming="planlang 9.0, whose processes cannot talk"):
        installation(interpreter(tmp_path / "new", f"echo '{said}'"))


def test_an_option_that_the_other_planlang_does_not_know_is_named(other: Path) -> None:
    found = installation(other)
    check_options(found, {"no_recoveries": True, "recipe": "serve_a_drink"})
    less = type(found)(found.python, "0.0", "", frozenset({"recipe"}))
    with refusal("C035", naming="does not know no_recoveries"):
        check_options(less, {"no_recoveries": True, "recipe": "serve_a_drink"})


def test_a_cluster_has_one_planlang() -> None:
    with refusal("C040", naming="on"):
        run([{"world": 1, "python": sys.executable}], "math:sqrt", "dask")
