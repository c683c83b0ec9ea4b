"""Settings of a run that stand in a file, numbers among them, and how long a run may take that waits."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app

RECIPE = """
Prefix: : <http://example.org/wait.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/wait.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Class: Rest
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Nap
Class: Nap
    SubClassOf: knowrob:WaitForPredefinedTimeInterval
"""


def rest(folder: Path, *arguments: str) -> dict[str, Any]:
    """Return what a run of the recipe answers."""
    (folder / "rest.omn").write_text(RECIPE, encoding="utf-8")
    where = ("--robot", "amigo", "--environment", "hospital_room", "--json")
    result = CliRunner().invoke(app, ["run", str(folder / "rest.omn"), *where, *arguments])
    found: dict[str, Any] = json.loads(result.stdout)
    return found


@pytest.mark.long
def test_a_run_that_waits_longer_than_its_budget_is_not_given_up(tmp_path: Path) -> None:
    (tmp_path / "rest.set").write_text("# how long\n\nNap.duration = 1300\n", encoding="utf-8")
    found = rest(tmp_path, "--set", f"@{tmp_path / 'rest.set'}")
    assert (found["exit_code"], found["duration"]) == (0, 1300.0), found


def test_a_line_that_sets_nothing_is_reported_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "rest.set").write_text("# how long\nNap.duration\n", encoding="utf-8")
    found = rest(tmp_path, "--set", f"@{tmp_path / 'rest.set'}")
    assert found["exit_code"] == 2
    assert [(one["code"], one["span"]["line"]) for one in found["diagnostics"]] == [("C018", 2)]


@pytest.mark.parametrize(("value", "code"), [("long", "X006"), ("-1", "X006"), ("inf", "X006")])
def test_a_duration_is_a_number_from_0_on(tmp_path: Path, value: str, code: str) -> None:
    found = rest(tmp_path, "--set", f"Nap.duration={value}")
    assert (found["exit_code"], found["diagnostics"][-1]["code"]) == (2, code)


def test_a_duration_that_nobody_states_has_to_be_set(tmp_path: Path) -> None:
    found = rest(tmp_path)
    assert (found["exit_code"], found["diagnostics"][-1]["code"]) == (2, "X014")
    assert "a number" in found["diagnostics"][-1]["help"]
