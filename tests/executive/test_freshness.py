"""``planlang check PLAN``: what has changed since a plan was compiled, and how a fresh compile differs from it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from executive.cli.app import app
from planlang.files import bundled


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    """A copy of the bundled recipe under a name of its own."""
    path = tmp_path / "serve.omn"
    path.write_text((bundled("recipes") / "serve_a_drink.omn").read_text(encoding="utf-8"), encoding="utf-8")
    return path


def compiled(recipe: Path, *options: str) -> Path:
    plan = recipe.with_suffix(".py")
    assert CliRunner().invoke(app, ["compile", str(recipe), "-o", str(plan), *options]).exit_code == 0
    return plan


def checked(plan: Path) -> tuple[str, list[str], str, int]:
    """State, codes, difference and exit code."""
    result = CliRunner().invoke(app, ["check", str(plan), "--json"])
    answer: dict[str, Any] = json.loads(result.stdout)
    codes = [found["code"] for found in answer["diagnostics"]]
    return answer["state"], codes, answer["difference"], result.exit_code


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize("options", [(), ("--no-scopes",), ("--no-dataflow",)])
def test_an_untouched_plan_is_what_its_recipe_compiles_to_with_its_options(
    recipe: Path, options: tuple[str, ...]
) -> None:
    plan = compiled(recipe, *options)
    assert checked(plan) == ("what serve.omn compiles to", [], "", 0)


def test_a_changed_recipe_shows_what_would_differ(recipe: Path) -> None:
    plan = compiled(recipe)
    change(recipe, "bring the bottle close to the robot", "hold the bottle close")
    state, codes, difference, code = checked(plan)
    assert (state, codes, code) == ("out of date", ["C009"], 2)
    assert "-    # bring the bottle close to the robot\n+    # hold the bottle close\n" in difference


def test_a_changed_recipe_beside_the_plan_counts_and_not_a_bundled_one_of_its_name(recipe: Path) -> None:
    plan = compiled(recipe.rename(recipe.with_name("serve_a_drink.omn")))
    assert checked(plan)[1:] == ([], "", 0)
    change(plan.with_suffix(".omn"), "bring the bottle close to the robot", "hold the bottle close")
    state, codes, _, code = checked(plan)
    assert (state, codes, code) == ("out of date", ["C009"], 2)


def test_an_edited_plan_of_a_changed_recipe_is_told_as_both(recipe: Path) -> None:
    plan = compiled(recipe)
    change(recipe, "bring the bottle close to the robot", "hold the bottle close")
    change(plan, "attempts=5", "attempts=7")
    assert checked(plan)[1] == ["C009", "C010"]
    result = CliRunner().invoke(app, ["compile", str(recipe), "-o", str(plan)])
    assert (result.exit_code, "C005" in result.stderr) == (2, True)


def test_an_edited_plan_shows_its_edits(recipe: Path) -> None:
    plan = compiled(recipe)
    change(plan, "attempts=2", "attempts=9")
    state, codes, difference, code = checked(plan)
    assert (state, codes, code) == ("an edited plan", ["C010"], 0)
    assert next(line for line in difference.splitlines() if "attempts=9" in line).startswith("-")


def test_another_compiler_is_told_from_an_edit(recipe: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = compiled(recipe)
    monkeypatch.setattr("planlang.compiler.compile.installed_version", lambda: "9.9.9")
    state, codes, difference, code = checked(plan)
    assert (state, codes, code) == ("out of date", ["C006"], 0)
    assert "+Compiled by planlang 9.9.9 from serve.omn" in difference


def test_a_recipe_that_no_longer_compiles_leaves_its_plan_out_of_date(recipe: Path) -> None:
    plan = compiled(recipe)
    change(recipe, "knowrob:subAction some GraspBottle,", "knowrob:subAction some GrapsBottle,")
    assert checked(plan) == ("out of date", ["C009"], "", 2)


def test_the_difference_is_printed_for_people(recipe: Path) -> None:
    plan = compiled(recipe)
    change(recipe, "bring the bottle close to the robot", "hold the bottle close")
    said = CliRunner().invoke(app, ["check", str(plan)]).stdout
    assert f"{plan}: out of date\n--- {plan}\n+++ what serve.omn compiles to now\n" in said
