"""``planlang compile --merge``: what a person edited survives a change of the recipe."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.files import bundled

EDIT = ("look_from_another_place(bottle), retries=3", "look_from_another_place(bottle), retries=9")
CHANGE = ("bring the bottle close to the robot", "hold the bottle close")


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "serve.omn"
    path.write_text((bundled("recipes") / "serve_a_drink.omn").read_text(encoding="utf-8"), encoding="utf-8")
    return path


@pytest.fixture
def plan(recipe: Path) -> Path:
    path = recipe.with_name("serve.py")
    assert run("compile", recipe, "-o", path)[0] == 0
    return path


def run(*words: object) -> tuple[int, dict[str, Any]]:
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    return result.exit_code, json.loads(result.stdout)


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_edits_and_changes_of_the_recipe_are_both_in_the_merged_plan(recipe: Path, plan: Path) -> None:
    change(plan, *EDIT)
    edited = plan.read_bytes()
    change(recipe, *CHANGE)
    code, _ = run("compile", recipe, "-o", plan, "--merge")
    text = plan.read_text(encoding="utf-8")
    assert (code, EDIT[1] in text, CHANGE[1] in text, CHANGE[0] in text) == (0, True, True, False)
    assert plan.with_name("serve.py.orig").read_bytes() == edited
    code, answer = run("check", plan)
    assert (code, answer["state"]) == (0, "an edited plan")
    assert [line for line in answer["edits"].splitlines() if line.startswith("+ ")] == [
        line for line in answer["edits"].splitlines() if EDIT[1] in line
    ]


def test_merging_goes_on_with_every_change_of_the_recipe(recipe: Path, plan: Path) -> None:
    change(plan, *EDIT)
    for old, new in ((CHANGE[0], "first"), ("first", "second"), ("second", "third")):
        change(recipe, old, new)
        assert run("compile", recipe, "-o", plan, "--merge")[0] == 0
    text = plan.read_text(encoding="utf-8")
    assert (EDIT[1] in text, "third" in text) == (True, True)


def test_check_shows_apart_what_a_person_edited_and_what_the_recipe_changed(recipe: Path, plan: Path) -> None:
    change(plan, *EDIT)
    change(recipe, *CHANGE)
    _, answer = run("check", plan)
    assert EDIT[1] in answer["edits"]
    assert CHANGE[1] not in answer["edits"]
    assert CHANGE[1] in answer["difference"]
    assert "retries=9" not in answer["difference"]
    (told,) = (one for one in answer["diagnostics"] if one["code"] == "C009")
    assert told["help"].endswith("--merge keeps the edits")


def test_a_conflict_is_marked_as_git_marks_it_and_the_exit_code_is_1(recipe: Path, plan: Path) -> None:
    change(plan, f"# {CHANGE[0]}", "# as I like it")
    change(recipe, *CHANGE)
    edited = plan.read_bytes()
    code, answer = run("compile", recipe, "-o", plan, "--merge")
    lines = plan.read_text(encoding="utf-8").splitlines()
    start = lines.index("<<<<<<< serve.py as edited")
    assert lines[start + 1 : start + 5] == [
        "    # as I like it",
        "=======",
        f"    # {CHANGE[1]}",
        ">>>>>>> what serve.omn compiles to now",
    ]
    (told,) = (one for one in answer["diagnostics"] if one["code"] == "C023")
    assert (code, told["span"]["line"]) == (1, start + 1)
    assert plan.with_name("serve.py.orig").read_bytes() == edited
    for words in (("check", plan), ("compile", recipe, "-o", plan, "--merge")):  # nothing goes on until it is resolved
        code, answer = run(*words)
        assert (code, [one["code"] for one in answer["diagnostics"]]) == (2, ["C023"])


def test_without_its_base_an_edited_plan_is_not_merged_and_stays(recipe: Path, plan: Path) -> None:
    change(plan, *EDIT)
    change(recipe, *CHANGE)
    plan.with_name("serve.py.base").unlink()
    before = plan.read_bytes()
    code, answer = run("compile", recipe, "-o", plan, "--merge")
    assert (code, answer["diagnostics"][0]["code"], plan.read_bytes()) == (2, "C023", before)


def test_a_base_is_not_needed_while_the_recipe_is_the_same(recipe: Path, plan: Path) -> None:
    change(plan, *EDIT)
    plan.with_name("serve.py.base").unlink()
    before = plan.read_bytes()
    assert run("compile", recipe, "-o", plan, "--merge")[0] == 0
    assert plan.read_bytes() == before
    assert plan.with_name("serve.py.base").exists()


def test_an_unedited_plan_becomes_the_new_one_and_ends_of_lines_stay(recipe: Path, plan: Path) -> None:
    plan.write_bytes(plan.read_bytes().replace(b"\n", b"\r\n"))
    change(recipe, *CHANGE)
    assert run("compile", recipe, "-o", plan, "--merge")[0] == 0
    content = plan.read_bytes()
    assert content.count(b"\r\n") == content.count(b"\n")
    assert content.replace(b"\r\n", b"\n") == plan.with_name("serve.py.base").read_bytes()


def test_a_foreign_file_of_the_name_of_the_base_is_kept(recipe: Path, tmp_path: Path) -> None:
    foreign = tmp_path / "mine.py.base"
    foreign.write_text("mine", encoding="utf-8")
    code, answer = run("compile", recipe, "-o", tmp_path / "mine.py")
    assert (code, answer["diagnostics"][0]["code"], foreign.read_text(encoding="utf-8")) == (2, "C005", "mine")
    assert not (tmp_path / "mine.py").exists()


@pytest.mark.parametrize("words", [("--merge",), ("--merge", "--force", "-o", "x.py")])
def test_merging_needs_a_plan_and_excludes_overwriting(recipe: Path, words: tuple[str, ...]) -> None:
    assert CliRunner().invoke(app, ["compile", str(recipe), *words]).exit_code == 2
