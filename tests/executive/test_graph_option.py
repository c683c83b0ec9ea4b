"""``planlang compile --graph``: which files it writes, and which it refuses to."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from executive.cli import app as cli


def compile_with(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli.app, ["compile", *map(str, arguments)], prog_name="planlang")


@pytest.mark.parametrize(
    ("name", "start"),
    [("g.svg", "<?xml"), ("g.SVG", "<?xml"), ("g.dot", "digraph"), ("g.mmd", "flowchart")],
)
def test_the_suffix_tells_the_format(name: str, start: str, tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / name)
    assert result.exit_code == 0
    assert (tmp_path / name).read_text(encoding="utf-8").startswith(start)
    assert result.stdout.startswith('"""Serve a drink.'), "the plan goes to stdout as without --graph"


@pytest.mark.parametrize("name", ["g.png", "graph", "g.svg.txt", "g.html"])
def test_an_unknown_suffix_is_refused_with_the_valid_ones_and_nothing_is_written(name: str, tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / name, "-o", tmp_path / "plan.py")
    assert result.exit_code == 2
    assert "error C014" in result.stderr
    assert f"unknown graph format {Path(name).suffix or name}" in result.stderr
    assert "known: .svg, .dot, .mmd" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_graph_may_not_overwrite_the_plan_or_the_recipe(tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / "x.svg", "-o", tmp_path / "x.svg")
    assert "would overwrite --output" in result.stderr


def test_a_recipe_with_errors_leaves_the_old_graph_as_it_was(tmp_path: Path) -> None:
    recipe, old = tmp_path / "r.omn", tmp_path / "g.svg"
    recipe.write_text("Ontology: <http://planlang.org/empty>\n")
    old.write_text("old")
    assert compile_with(recipe, "--graph", old).exit_code == 2
    assert old.read_text() == "old"


def test_the_answer_as_json_names_the_graph(tmp_path: Path) -> None:
    result = compile_with("serve_a_drink", "--graph", tmp_path / "g.mmd", "--json")
    assert json.loads(result.stdout)["graph"] == str(tmp_path / "g.mmd")
