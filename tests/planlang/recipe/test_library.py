"""Recipes of the library perform actions for which a file states no recipe."""

from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.files import bundled
from planlang.testing import Script, compiled, run_plan

FETCH = """\
Prefix: : <http://example.org/fetch.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/fetch.owl>

Individual: bottle1
    Types: knowrob:DrinkingBottle

Class: Fetch
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some TakeBottle

Class: TakeBottle
    SubClassOf: knowrob:PickingUpAnObject, knowrob:objectActedOn value bottle1
"""


def recipe(folder: Path, text: str = FETCH) -> Path:
    path = folder / "fetch.omn"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_step_without_a_recipe_is_performed_by_that_of_the_library(tmp_path: Path) -> None:
    run = run_plan(compiled(recipe(tmp_path)), script=Script())
    assert run.failure is None
    names = [step.name for step in run.steps() if step.kind == "perform"]
    inside = ["Approach", "OpenGripper", "ReachForIt", "CloseGripper", "Lift", "Park"]
    assert [name for name in names if name in inside] == inside
    assert run.happened_before("ComeNear", "Approach")


def test_the_recipe_of_the_library_is_about_the_steps_own_thing(tmp_path: Path) -> None:
    seen: list[str] = []
    script = Script()
    script.on("ReachForIt", does=lambda belief, action: seen.append(str(action.get("to_location"))))
    assert run_plan(compiled(recipe(tmp_path)), script=script).failure is None
    assert seen == ["in_center_of(bottle1)"]


def test_a_recipe_of_the_file_is_nearer_than_that_of_the_library(tmp_path: Path) -> None:
    own = FETCH.replace(
        "knowrob:objectActedOn value bottle1", "knowrob:objectActedOn value bottle1, knowrob:subAction some Look"
    )
    source = compile_recipe(recipe(tmp_path, f"{own}\nClass: Look\n    SubClassOf: knowrob:Perceiving\n")).source
    assert "library.owl" not in source


def test_a_process_module_replaces_the_recipe_of_the_library(tmp_path: Path) -> None:
    run = run_plan(compiled(recipe(tmp_path)), script=Script().performs("TakeBottle"))
    assert run.failure is None
    assert not any(step.name == "Approach" for step in run.steps())


def test_steps_that_are_performed_by_the_library_need_no_order_among_base_motions(corpus: Path) -> None:
    plan = compile_recipe(corpus / "recipes" / "serve_drink_new@re_stack.owl")
    assert "R040" not in {one.code for one in plan.diagnostics}
    assert not any(one.code == "R021" for one in plan.diagnostics)


@pytest.mark.parametrize("file", sorted((bundled("recipes") / "library").glob("*.omn")), ids=lambda file: file.stem)
def test_every_recipe_of_the_library_compiles_by_itself(file: Path) -> None:
    if "subAction" in file.read_text(encoding="utf-8"):
        found = {one.code for one in compile_recipe(file).diagnostics}
        assert found <= {"R062"}, "what is wanted, and where, is for whoever performs it to say"
