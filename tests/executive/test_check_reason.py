"""``planlang check --reason``: what is told, as text and as JSON, and how the command ends."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.ontology.reasoning import missing

TOWELS = Path(__file__).resolve().parents[2] / "docs" / "examples" / "damp_towels.omn"
needs_reasoner = pytest.mark.skipif(missing() is not None, reason=str(missing()))


@pytest.mark.long
@needs_reasoner
def test_contradictions_end_the_command_with_bad_input() -> None:
    ended = CliRunner().invoke(app, ["check", str(TOWELS), "--reason", "--reasoner", "pellet", "--json"])
    told = json.loads(ended.stdout)
    assert ended.exit_code == 2
    assert (told["kind"], told["reasoner"], told["contradictions"]) == ("ontology", "pellet", 2)
    assert [one["code"] for one in told["diagnostics"]] == ["O062", "O060", "O061"]


@pytest.mark.long
@needs_reasoner
def test_a_recipe_without_contradictions_is_checked_as_before() -> None:
    ended = CliRunner().invoke(app, ["check", "serve_a_drink", "--reason"])
    assert ended.exit_code == 0
    assert "ServeADrink compiles\nHermiT: no contradiction in" in ended.stdout


def test_without_java_the_command_says_what_it_lacks(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    ended = CliRunner().invoke(app, ["check", "serve_a_drink", "--reason"])
    assert ended.exit_code == 3
    assert "O064" in ended.output
    assert "ServeADrink compiles" in ended.output


@pytest.mark.parametrize("words", [["--fix"], []])
def test_reasoning_is_for_one_file(words: list[str], tmp_path: Path) -> None:
    file = "serve_a_drink" if words else str(tmp_path)
    assert CliRunner().invoke(app, ["check", file, "--reason", *words]).exit_code == 2
