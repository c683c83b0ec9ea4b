"""``planlang check``: what --fix writes and never does, and what has changed since a plan was compiled."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from dropped_orders import twelve_steps, without

from executive.cli import app as cli
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
    change(plan, "retries=3", "retries=7")
    assert checked(plan)[1] == ["C009", "C010"]
    result = CliRunner().invoke(app, ["compile", str(recipe), "-o", str(plan)])
    assert (result.exit_code, "C005" in result.stderr) == (2, True)


def test_an_edited_plan_shows_its_edits(recipe: Path) -> None:
    plan = compiled(recipe)
    change(plan, "retries=2", "retries=9")
    state, codes, difference, code = checked(plan)
    assert (state, codes, code) == ("an edited plan", ["C010"], 0)
    assert difference == ""
    answer = json.loads(CliRunner().invoke(app, ["check", str(plan), "--json"]).stdout)
    assert next(line for line in answer["edits"].splitlines() if "retries=9" in line).startswith("+")


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


RECIPE = """\
Prefix: : <http://planlang.org/test#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>

Class: Serve
    SubClassOf:
        knowrob:PurposefulAction,
        knowrob:subAction some Grasp,
        knowrob:subAction some Look,
        knowrob:orderingConstraints value LookFirst

Individual: LookFirst
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering Look, knowrob:occursAfterInOrdering Grasp

Class: Look
    SubClassOf: knowrob:LookingForSomething

Class: Grasp
    SubClassOf:
        knowrob:ClosingAGripper,
        knowrob:objectActedOn value gripper1,
        knowrob:deviceUsed value bottle1

Individual: gripper1
    Types: knowrob:HolderGripper

Individual: bottle1
    Types: knowrob:DrinkingBottle
"""


def check(*arguments: str | Path) -> Result:
    return CliRunner().invoke(cli.app, ["check", *map(str, arguments)], prog_name="planlang")


@pytest.fixture
def broken_recipe(tmp_path: Path) -> Path:
    """A recipe with exchanged fillers."""
    path = tmp_path / "serve.owl.in"
    path.write_text(RECIPE, encoding="utf-8")
    return path


@pytest.fixture
def misnamed(tmp_path: Path) -> Path:
    """A recipe of which a sub-action has a name that nothing defines."""
    path = tmp_path / "misnamed.omn"
    path.write_text(RECIPE.replace("subAction some Grasp", "subAction some Clasp"), encoding="utf-8")
    return path


def test_a_fixed_copy_is_written_beside_the_recipe_and_the_difference_is_shown(broken_recipe: Path) -> None:
    result = check(broken_recipe, "--fix")
    assert result.exit_code == 0
    assert broken_recipe.read_text(encoding="utf-8") == RECIPE
    copy = broken_recipe.with_name("serve.fixed.owl.in")
    assert "knowrob:objectActedOn value bottle1" in copy.read_text(encoding="utf-8")
    assert f"--- {broken_recipe}\n+++ {copy}\n@@" in result.stdout
    assert "+        knowrob:deviceUsed value gripper1,\n" in result.stdout
    assert result.stdout.endswith(f"{copy}: Serve compiles\n")
    assert "R030" not in result.stderr


def test_a_copy_that_a_person_went_on_with_is_not_overwritten_unless_it_is_named(broken_recipe: Path) -> None:
    copy = broken_recipe.with_name("serve.fixed.owl.in")
    copy.write_text("mine")
    result = check(broken_recipe, "--fix")
    assert result.exit_code == 2
    assert "error C005" in result.stderr
    assert copy.read_text() == "mine"
    assert check(broken_recipe, "--fix", "-o", copy).exit_code == 2, "it has no mark of planlang"
    assert check(broken_recipe, "--fix", "-o", copy, "--force").exit_code == 0
    assert "Serve" in copy.read_text()
    assert check(broken_recipe, "--fix").exit_code == 0, "the same text again is no loss"


def test_the_recipe_itself_is_never_the_output(broken_recipe: Path) -> None:
    result = check(broken_recipe, "--fix", "-o", broken_recipe)
    assert result.exit_code == 2
    assert "would overwrite the recipe" in result.stderr
    assert broken_recipe.read_text(encoding="utf-8") == RECIPE


def test_what_is_not_safe_is_listed_with_how_to_accept_it(misnamed: Path) -> None:
    result = check(misnamed, "--fix")
    assert result.exit_code == 2, "the error remains"
    assert "note C016 uncertain, not applied: R010 the sub-action `Clasp` of `Serve` becomes `Grasp`" in result.stderr
    assert f"{misnamed}:8:32: note C016" in result.stderr
    assert "--accept R010 applies it" in result.stderr
    assert not misnamed.with_name("misnamed.fixed.omn").exists()


def test_what_is_accepted_is_done_and_what_that_uncovers_is_fixed_too(misnamed: Path, tmp_path: Path) -> None:
    result = check(misnamed, "--fix", "--accept", "R010", "-o", tmp_path / "new.omn", "--json")
    assert result.exit_code == 0
    answer = json.loads(result.stdout)
    assert [fix["code"] for fix in answer["fixes"]] == ["R010", "R030"]
    assert answer["fixed"] == str(tmp_path / "new.omn")
    assert check(tmp_path / "new.omn").exit_code == 0


def test_the_imports_of_a_recipe_are_found_when_the_copy_goes_elsewhere(broken_recipe: Path, tmp_path: Path) -> None:
    (tmp_path / "more.omn").write_text("Ontology: <http://planlang.org/more>\n")
    text = RECIPE.replace("planlang.org/test>\n\n", "planlang.org/test>\n    Import: <http://planlang.org/more>\n\n")
    broken_recipe.write_text(text)
    (tmp_path / "elsewhere").mkdir()
    result = check(broken_recipe, "--fix", "-o", tmp_path / "elsewhere" / "x.owl")
    assert result.exit_code == 0
    assert "O030" not in result.stderr


def test_a_recipe_without_mistakes_gets_no_copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = check("serve_a_drink", "--fix")
    assert result.exit_code == 0
    assert "nothing was fixed; ServeADrink compiles" in result.stdout
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("arguments", [["--accept", "R010"], ["-o", "x.omn"]], ids=" ".join)
def test_options_of_fix_without_fix_are_a_usage_error(arguments: list[str]) -> None:
    result = check("serve_a_drink", *arguments)
    assert result.exit_code == 2
    assert "need --fix" in result.stderr


def test_only_fixes_that_wait_for_acceptance_can_be_accepted(broken_recipe: Path) -> None:
    result = check(broken_recipe, "--fix", "--accept", "R999")
    assert result.exit_code == 2
    assert "error C015" in result.stderr
    assert "codes with uncertain fixes: O016, R010" in result.stderr
    assert "fixes of R013 are safe: --fix applies them" in check(broken_recipe, "--fix", "--accept", "R013").stderr
    assert "R012 has no fix: any constraint of the cycle" in check(broken_recipe, "--fix", "--accept", "R012").stderr


def test_a_plan_is_not_fixed(tmp_path: Path) -> None:
    path = tmp_path / "plan.py"
    path.write_text("from planlang import plan\n")
    assert "error C007" in check(path, "--fix").stderr


def test_a_folder_of_recipes_is_tabulated_task_by_task(tmp_path: Path, recipe: Path) -> None:
    text = recipe.read_text(encoding="utf-8")
    below = tmp_path / "below"
    below.mkdir()
    (below / "broken.omn").write_text(
        text.replace("subAction some GraspBottle", "subAction some Gone"), encoding="utf-8"
    )
    (below / "no_ontology.omn").write_text("Class: {", encoding="utf-8")
    result = CliRunner().invoke(app, ["check", str(tmp_path), "--json"])
    rows = json.loads(result.stdout)["recipes"]
    assert [(row["file"], row["task"], row["refused"] is None) for row in rows] == [
        ("serve.omn", "ServeADrink", True),
        ("below/broken.omn", "ServeADrink", False),
        ("below/no_ontology.omn", None, False),
    ]
    assert rows[1]["refused"].startswith("R020, line ")
    assert result.exit_code == 2
    assert "1 of 3 compile" in CliRunner().invoke(app, ["check", str(tmp_path)]).stdout


def test_a_map_in_a_folder_of_recipes_is_no_recipe_that_is_refused(tmp_path: Path) -> None:
    room = bundled("ontologies") / "environments" / "hospital_room.omn"
    (tmp_path / "room.omn").write_text(room.read_text(encoding="utf-8"), encoding="utf-8")
    result = CliRunner().invoke(app, ["check", str(tmp_path), "--json"])
    (row,) = json.loads(result.stdout)["recipes"]
    assert (result.exit_code, row["refused"]) == (0, None)
    assert row["map"].startswith("7 objects (1 graspable), 1 person, 1 room")


@pytest.mark.long
def test_maps_are_told_alike_whether_they_or_their_folder_are_named(corpus: Path) -> None:
    def answer(path: Path) -> dict[str, Any]:
        found: dict[str, Any] = json.loads(CliRunner().invoke(app, ["check", str(path), "--json"]).stdout)
        return found

    rows = answer(corpus / "environments")["recipes"]
    assert "map_hospital_room@re_stack.owl.in" in [row["file"] for row in rows]
    for row in rows:
        alone = answer(corpus / "environments" / row["file"])
        assert (row["refused"], alone["kind"]) == (None, "map"), row["file"]
        assert not {one["code"] for one in alone["diagnostics"]} & {"R001", "R058"}, row["file"]


def test_a_folder_without_recipes_is_an_error(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["check", str(tmp_path)])
    assert (result.exit_code, "no recipes in the folder" in result.stderr) == (2, True)


def test_a_map_is_told_as_what_it_holds() -> None:
    path = str(bundled("ontologies") / "environments" / "hospital_room.omn")
    answer = json.loads(CliRunner().invoke(app, ["check", path, "--json"]).stdout)
    assert (answer["exit_code"], answer["kind"]) == (0, "map")
    assert {kind: answer[kind] for kind in ("graspable", "persons", "rooms")} == {
        "graspable": 1,
        "persons": 1,
        "rooms": 1,
    }
    assert "a map of 7 objects (1 graspable), 1 person, 1 room" in CliRunner().invoke(app, ["check", path]).stdout


def test_an_error_in_a_map_is_told_and_not_that_it_is_no_recipe(tmp_path: Path) -> None:
    path = tmp_path / "room.omn"
    path.write_text(
        (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8"), encoding="utf-8"
    )
    change(path, "knowrob:m00 ", "knowrob:m01 ")
    result = CliRunner().invoke(app, ["check", str(path)])
    assert (result.exit_code, "M003" in result.stderr, "R001" in result.stderr) == (2, True, False)


def test_a_file_without_recipe_and_without_places_states_no_recipe(tmp_path: Path) -> None:
    path = tmp_path / "classes.omn"
    path.write_text("Ontology: <http://test/classes>\nClass: <http://test/classes#Thing>\n", encoding="utf-8")
    assert "R001" in CliRunner().invoke(app, ["check", str(path)]).stderr


def test_a_fix_that_would_do_harm_is_refused_and_says_what_to_write_instead(tmp_path: Path) -> None:
    path = tmp_path / "twelve.omn"
    path.write_text(
        without(twelve_steps(), ["GoToBottleThenOpenHand", "GoToPatientThenLookAtPatient"]), encoding="utf-8"
    )
    result = CliRunner().invoke(app, ["check", str(path), "--fix", "--accept", "R040", "--json"])
    answer = json.loads(result.stdout)
    (told,) = (one for one in answer["diagnostics"] if one["code"] == "C022")
    assert told["severity"] == "warning"
    assert "`GiveBottle` needs holding(bottle1), which `CloseHand`" in told["message"]
    assert (told["help"], told["span"]["file"]) == ("order `CloseHand` before `GiveBottle`", str(path))
    assert answer["fixed"] is None


def test_a_bundled_map_is_checked_by_its_name_and_its_contents_are_listed_on_request() -> None:
    shown = CliRunner().invoke(app, ["check", "hospital_room", "--verbose"]).stdout
    assert "  bottle1  DrinkingBottle  at " in shown
    assert "bottle1" not in CliRunner().invoke(app, ["check", "hospital_room"]).stdout


def test_a_folder_named_like_a_bundled_recipe_hides_it_from_no_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "wipe_table").mkdir()
    checked = CliRunner().invoke(app, ["check", "wipe_table"])
    assert checked.stdout.endswith("wipe_table.omn: CleanTheTable compiles\n")
    assert "the recipe CleanTheTable" in CliRunner().invoke(app, ["show", "wipe_table"]).stdout
    for command in ("check", "show", "compile"):
        stderr = CliRunner().invoke(app, [command, "wipe_table"]).stderr
        assert "note C001 wipe_table is a folder, too; this is the bundled recipe" in stderr, command
    assert "no recipes in the folder" in CliRunner().invoke(app, ["check", "wipe_table/"]).stderr


def test_the_difference_is_that_of_the_file_if_writing_it_anew_is_the_fix(tmp_path: Path) -> None:
    path = tmp_path / "given.owl"
    path.write_text((Path(__file__).parents[1] / "diagnostics" / "O012_wrong_namespace.owl").read_text())
    result = check(path, "--fix")
    assert any(line.startswith("-") and "subClassOf" in line for line in result.stdout.splitlines()), result.stdout
    assert (tmp_path / "given.fixed.owl").exists()
