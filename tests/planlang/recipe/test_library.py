"""Recipes of the library perform actions for which a file states no recipe."""

import re
from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.failures import ManipulationGoalNotReached, ObjectNotFound
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


STANDARD = re.compile(r"^Class: (\S+)\n    Annotations: [^\n]*standardRecipeOf", re.MULTILINE)
LIBRARY = sorted((bundled("recipes") / "library").glob("*.omn"))
TASKS = [(file, task) for file in LIBRARY for task in STANDARD.findall(file.read_text(encoding="utf-8"))]


@pytest.mark.parametrize(("file", "task"), TASKS, ids=[task for _, task in TASKS])
def test_every_recipe_of_the_library_compiles_by_itself(file: Path, task: str) -> None:
    found = {one.code for one in compile_recipe(file, task=task).diagnostics}
    assert found <= {"R062"}, "what is wanted, and where, is for whoever performs it to say"


@pytest.mark.parametrize(
    ("stated", "expected"),
    [
        ("toLocation value bed1", {"transport", "fetch", "deliver_to_place"}),
        ("recipient value patient1", {"bring", "fetch", "deliver_to_person"}),
        ("toLocation value bed1, knowrob:recipient value patient1", {"bring_within_reach", "set_down_within_reach"}),
    ],
)
def test_what_is_stated_of_transporting_says_which_recipe_is_meant(
    tmp_path: Path, stated: str, expected: set[str]
) -> None:
    text = FETCH.replace("PickingUpAnObject", "TransportingAnObject").replace(
        "value bottle1", f"value bottle1, knowrob:{stated}"
    )
    text += (
        "Individual: bed1\n    Types: knowrob:Bed-PieceOfFurniture\nIndividual: patient1\n    Types: knowrob:Patient\n"
    )
    made = compile_recipe(recipe(tmp_path, text))
    assert expected <= set(made.functions)
    others = {"transport", "bring", "bring_within_reach", "deliver_to_place", "deliver_to_person"} - expected
    assert not others & set(made.functions)
    assert run_plan(compiled(recipe(tmp_path, text)), script=Script()).failure is None


def test_what_is_put_on_a_thing_is_reached_where_it_is_put(tmp_path: Path) -> None:
    text = FETCH.replace("PickingUpAnObject", "TransportingAnObject").replace(
        "value bottle1", "value bottle1, knowrob:toLocation value bed1"
    )
    text += "Individual: bed1\n    Types: knowrob:Bed-PieceOfFurniture\n"
    assert "reaching=(resting_on(put_down_to_location), pre_grasp)" in compile_recipe(recipe(tmp_path, text)).source


def test_actions_of_soma_are_performed_as_those_of_knowrob(tmp_path: Path) -> None:
    text = FETCH.replace("knowrob:PickingUpAnObject", "<http://www.ease-crc.org/ont/SOMA.owl#Fetching>")
    made = compile_recipe(recipe(tmp_path, text))
    assert "fetch" in made.functions
    assert not any(one.code == "R021" for one in made.diagnostics)


def test_recoveries_that_several_steps_share_stand_in_the_plan_once() -> None:
    source = compile_recipe(bundled("recipes") / "stir_soup.omn").source
    assert source.count("fetch_again(stirring_tool, fetch_thing)") == 1
    assert source.count("recoveries=recoveries,") == 4


@pytest.mark.parametrize("step", ["HoldToolOver", "LowerTool", "GoRound", "TakeToolOut"])
def test_each_step_that_shares_recoveries_has_all_of_their_attempts(step: str) -> None:
    script = Script().performs("ITaSCMotion", "GoRound").on(step, fails=ObjectNotFound, times=3)
    run = run_plan(compiled("stir_soup"), script=script)
    assert run.failure is None
    assert run.attempts(step) == 4


def test_a_thing_that_does_not_arrive_where_it_is_pushed_to_is_no_success() -> None:
    script = Script().on("PushIt", fails=ManipulationGoalNotReached)
    run = run_plan(compiled("push_the_cup"), script=script)
    assert run.failed_with("PushTheCup", ManipulationGoalNotReached)
    assert run_plan(compiled("push_the_cup"), script=Script().performs("PushIt")).failure is None
