"""Plan files: which plan is run with which parameters, and what it takes of a robot."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from executive.maps import SemanticMap, read_map
from executive.maps.environments import default_environment, environments_with
from executive.robots import Availability, FindingKind, Missing
from executive.runs.importing import import_plan
from executive.runs.options import Outcome, RunOptions
from executive.runs.parameters import bound_parameters
from executive.runs.plan_files import (
    Needs,
    assess,
    main_plan,
    needs_of,
    required_of_plan,
)
from executive.runs.plan_run import run_plan_file
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.files import Bundled, bundled
from planlang.ontology import load

CHOSEN = "the environment visiting_hours is chosen, as hospital_room has no cup2"

SOURCE = """
from planlang import plan

@plan("http://example.org/kitchen.owl#FillGlass")
async def fill_glass() -> None: ...

@plan("http://example.org/kitchen.owl#ServeGlass")
async def serve_glass() -> None: ...
"""


def plan_named(folder: Path, task: str | None) -> str:
    """Name of the plan that is run for a task."""
    path = folder / "kitchen.py"
    path.write_text(SOURCE, encoding="utf-8")
    return main_plan(import_plan(path), task).name


@pytest.mark.parametrize("task", ["fill_glass", "FillGlass", "http://example.org/kitchen.owl#FillGlass"])
def test_task_is_a_name_or_an_iri(tmp_path: Path, task: str) -> None:
    assert plan_named(tmp_path, task) == "fill_glass"


def test_without_a_task_the_last_plan_is_run(tmp_path: Path) -> None:
    assert plan_named(tmp_path, None) == "serve_glass"


def test_task_that_is_not_in_the_plan_is_refused_and_nothing_else_is_run(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        plan_named(tmp_path, "FillCup")
    (found,) = caught.value.diagnostics
    assert (found.code, found.help) == ("R001", "this file defines fill_glass, serve_glass")


PARAMETERS = """
from planlang import Object, Person, a_person, an_object, plan

ROOM = "http://planlang.org/kb/hospital_room.owl#"

@plan("http://example.org/kitchen.owl#Serve")
async def serve(
    *,
    bottle: Object = an_object("DrinkingBottle", ROOM + "bottle1"),
    any_bottle: Object = an_object("DrinkingBottle"),
    patient: Person = a_person("Patient", ROOM + "patient1"),
) -> None: ...
"""


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> SemanticMap:
    """The bundled room with a cup2, a bottle2 and a visitor1 where the bottle and the patient are."""
    text = (bundled("ontologies") / "environments" / "hospital_room.omn").read_text(encoding="utf-8")

    def copied(name: str, new: str, kind: str, other: str) -> str:
        heads = tuple(f"Individual: {before}{name}\n" for before in ("", "perception_", "pose_"))
        blocks = [block for block in text.split("\n\n") if any(head in block for head in heads)]
        return "\n\n".join(blocks).replace(name, new).replace(f"knowrob:{kind}\n", f"knowrob:{other}\n")

    more = [
        copied("bottle1", "cup2", "DrinkingBottle", "Cup"),
        copied("bottle1", "bottle2", "DrinkingBottle", "DrinkingBottle"),
        copied("patient1", "visitor1", "Patient", "Person"),
    ]
    path = tmp_path_factory.mktemp("room") / "room.omn"
    path.write_text("\n\n".join([text, *more]), encoding="utf-8")
    return read_map(load(path))


def bound(folder: Path, room: SemanticMap, **bindings: str) -> tuple[dict[str, str], list[Diagnostic]]:
    """Return what the parameters are bound to, and warnings."""
    path = folder / "serve.py"
    path.write_text(PARAMETERS, encoding="utf-8")
    found: list[Diagnostic] = []
    parameters = bound_parameters(main_plan(import_plan(path), None), bindings, room, found)
    return {name: f"{thing.type} {thing.name}" for name, thing in parameters.items()}, found


@pytest.mark.parametrize("name", ["bottle2", "http://planlang.org/kb/hospital_room.owl#bottle2"])
def test_a_parameter_is_bound_by_local_name_or_iri(tmp_path: Path, room: SemanticMap, name: str) -> None:
    parameters, found = bound(tmp_path, room, bottle=name, any_bottle=name)
    assert parameters["bottle"] == parameters["any_bottle"] == "DrinkingBottle bottle2"
    assert found == []


def test_a_thing_of_a_class_beside_that_of_the_recipes_individual_will_do_with_a_warning(
    tmp_path: Path, room: SemanticMap
) -> None:
    parameters, found = bound(tmp_path, room, bottle="cup2", patient="visitor1")
    assert (parameters["bottle"], parameters["patient"]) == ("Cup cup2", "Person visitor1")
    assert [(str(one.severity.value), one.code) for one in found] == [("warning", "X006")] * 2


@pytest.mark.parametrize(
    ("bindings", "code", "said"),
    [
        (
            {"botle": "bottle2"},
            "X004",
            "did you mean --set bottle=bottle2? its parameters: bottle, any_bottle, patient",
        ),
        (
            {"bottle": "botle1"},
            "X005",
            "did you mean --set bottle=bottle1? bottle may be bottle1, cup2, bottle2; the map also has room1, bed1,"
            " patient1, bedside_table1, cabinet1, cabinet2, chair1, door1, visitor1",
        ),
        ({"any_bottle": "cup2"}, "X006", "any_bottle may be bottle1, bottle2"),
        ({"patient": "bed1"}, "X006", "patient may be patient1, visitor1"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(
    tmp_path: Path, room: SemanticMap, bindings: dict[str, str], code: str, said: str
) -> None:
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, **bindings)
    assert [(one.code, one.help) for one in caught.value.diagnostics] == [(code, said)]


def test_of_a_thing_that_another_bundled_environment_has_that_is_told(tmp_path: Path) -> None:
    room = read_map(load(bundled("ontologies") / "environments" / "hospital_room.omn"))
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, bottle="cup2", patient="visitor7")
    cup, visitor = (one.help or "" for one in caught.value.diagnostics)
    there = cup.partition("; cup2 is in a bundled environment: --environment ")[2].split(" or ")
    assert {"visiting_hours", "ward_office"} <= {*there}
    assert "--environment" not in visitor


def test_a_thing_without_a_place_is_not_said_to_be_missing(tmp_path: Path, room: SemanticMap) -> None:
    with pytest.raises(BadInput) as caught:
        bound(tmp_path, room, bottle="hospital1")
    assert [one.message for one in caught.value.diagnostics] == ["'hospital1' has no pose in the map"]


@pytest.mark.parametrize(
    ("recipe", "things", "environment", "told"),
    [
        ("serve_a_drink", [], "hospital_room", []),
        ("serve_a_drink", ["bottle1"], "hospital_room", []),
        ("pass_a_drink", [], "dining_room", []),
        (
            "pass_a_drink",
            ["visitor1"],
            "visiting_hours",
            ["the environment visiting_hours is chosen, as dining_room has no visitor1"],
        ),
        (
            "serve_a_drink",
            ["cup2", "patient1"],
            "visiting_hours",
            ["the environment visiting_hours is chosen, as hospital_room has no cup2"],
        ),
        ("serve_a_drink", ["cup2", "nobody"], "hospital_room", []),
    ],
)
def test_the_default_environment_is_that_of_the_recipe_or_the_only_one_that_has_what_is_named(
    recipe: str, things: list[str], environment: str, told: list[str]
) -> None:
    notes: list[Diagnostic] = []
    assert default_environment(Bundled.RECIPE.find(recipe), things, notes) == environment
    assert [one.message for one in notes] == told


HEAD = """
from functools import partial
import planlang
from planlang import action, action as act, at_location, par, perform, plan, try_in_order

KITCHEN = "http://example.org/kitchen.owl#"
CLOSING = action("ClosingAGripper")

@plan
async def grasp(hard: bool = False) -> None:
    await perform(CLOSING)

@plan
async def reach() -> None:
    await perform(action("Reaching"))

@plan
async def look() -> None:
    await perform(planlang.action("LookingForSomething"))
"""


FILLING = "Pouring", "http://example.org/kitchen.owl#Care"


def needs(folder: Path, *body: str, before: str = "") -> Needs:
    """Return what a plan with these lines needs."""
    path = folder / "kitchen.py"
    lines = "".join(f"    {line}\n" for line in body)
    path.write_text(f"{HEAD}{before}\n@plan\nasync def serve() -> None:\n{lines}", encoding="utf-8")
    module = import_plan(path)
    return needs_of(module, main_plan(module, None))


def told(found: Needs, *unable: str) -> tuple[list[str], list[tuple[str, str]]]:
    """Return what a robot lacks that cannot do some classes of actions, and the alternatives that it cannot do."""

    def lacking(actions: Iterable[str]) -> tuple[Missing, ...]:
        return tuple(
            Missing(name, FindingKind.CAPABILITY, Availability.MISSING, (name,), "no")
            for name in actions
            if name in unable
        )

    assessment = assess(found, lacking)
    infeasible = [(alternative.name, why.name) for alternative, why in assessment.infeasible]
    return [missing.name for missing in assessment.missing], infeasible


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (["await perform(action('Reaching'))"], ["Reaching"]),
        (["await perform(planlang.action('Reaching'))"], ["Reaching"]),
        (["await perform(act('Reaching'))"], ["Reaching"]),
        (["await perform(action(KITCHEN + 'Pouring'))"], ["http://example.org/kitchen.owl#Pouring"]),
        (["await perform(action(KITCHEN + 'Fill', below='Pouring'))"], ["Pouring"]),
        (["await perform(action(KITCHEN + 'Fill', below=('Pouring', KITCHEN + 'Care')))"], [*FILLING]),
        (["await grasp()", "await look()"], ["ClosingAGripper", "LookingForSomething"]),
        (["await par(grasp, partial(look))"], ["ClosingAGripper", "LookingForSomething"]),
        (["await at_location(KITCHEN, reach)"], ["Translation-LocationChange", "Reaching"]),
        (["await planlang.at_location(KITCHEN, lambda: reach())"], ["Translation-LocationChange", "Reaching"]),
        (["await perform(action('GraspingSomething'), otherwise=grasp)"], ["GraspingSomething", "ClosingAGripper"]),
        (["async def inner() -> None:", "    await look()", "await par(inner)"], ["LookingForSomething"]),
        (["async def unused() -> None:", "    await look()", "await grasp()"], ["ClosingAGripper"]),
        (["wanted = action('Reaching')", "await perform(wanted)"], ["Reaching"]),
        (["seen = await perform(action('Perceiving'))"], ["Perceiving"]),
        (["if KITCHEN:", "    await look()", "else:", "    await serve()"], ["LookingForSomething"]),
    ],
)
def test_actions_are_those_of_what_the_plan_names(tmp_path: Path, body: list[str], expected: list[str]) -> None:
    found = needs(tmp_path, *body)
    assert sorted(found.actions) == sorted(expected)
    assert found.choices == ()


@pytest.mark.parametrize(
    "line",
    [
        "await try_in_order(grasp, look)",
        "await planlang.try_in_order(partial(grasp, hard=True), look)",
        "await perform(action('PurposefulAction'), otherwise=partial(try_in_order, grasp, look))",
        "await try_in_order(first=grasp, second=look)",
    ],
)
def test_one_feasible_alternative_is_enough(tmp_path: Path, line: str) -> None:
    found = needs(tmp_path, line)
    assert told(found) == ([], [])
    assert told(found, "ClosingAGripper") == ([], [("grasp", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("look", "LookingForSomething")])
    assert told(found, "ClosingAGripper", "LookingForSomething") == (["ClosingAGripper", "LookingForSomething"], [])


def test_a_process_module_is_needed_for_what_no_branch_of_the_plan_does_instead(tmp_path: Path) -> None:
    found = needs(
        tmp_path,
        "await perform(action('GraspingSomething'), otherwise=grasp)",
        "await par(partial(perform, action('Pouring'), otherwise=reach))",
        "await perform(action('Stirring'))",
    )
    assert sorted(found.modular) == ["ClosingAGripper", "Reaching", "Stirring"]


def test_local_branches_are_alternatives_too(tmp_path: Path) -> None:
    found = needs(
        tmp_path,
        "async def by_hand() -> None:",
        "    await grasp()",
        "by_eye = partial(look)",
        "await try_in_order(by_hand, by_eye)",
    )
    assert told(found, "ClosingAGripper") == ([], [("by_hand", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("by_eye", "LookingForSomething")])


def test_what_is_needed_beside_a_choice_stays_needed(tmp_path: Path) -> None:
    found = needs(tmp_path, "await try_in_order(grasp, look)", "await grasp()")
    assert told(found, "ClosingAGripper") == (["ClosingAGripper"], [("grasp", "ClosingAGripper")])


def test_choices_may_be_nested(tmp_path: Path) -> None:
    found = needs(tmp_path, "await try_in_order(either, look)", before="""
@plan
async def either() -> None:
    await try_in_order(grasp, reach)
""")  # fmt: skip
    assert told(found, "ClosingAGripper") == ([], [("grasp", "ClosingAGripper")])
    assert told(found, "ClosingAGripper", "Reaching") == ([], [("either", "ClosingAGripper")])
    assert told(found, "ClosingAGripper", "LookingForSomething") == (
        [],
        [("grasp", "ClosingAGripper"), ("look", "LookingForSomething")],
    )


def test_plans_that_are_not_called_are_not_needed(tmp_path: Path) -> None:
    assert told(needs(tmp_path, "await look()"), "ClosingAGripper", "Reaching") == ([], [])


def test_plans_that_call_each_other_are_followed_once(tmp_path: Path) -> None:
    found = needs(tmp_path, "await again()", before="""
@plan
async def again() -> None:
    await serve()
    await grasp()
""")  # fmt: skip
    assert found.actions == ("ClosingAGripper",)


def test_what_a_robot_may_lack_is_a_warning_and_refuses_nothing() -> None:
    unknown = Missing(
        "http://example.org#Juggling", FindingKind.CAPABILITY, Availability.UNKNOWN, ("Reaching",), "nobody knows"
    )
    assessment = assess(Needs(("Reaching",)), lambda actions: (unknown,))
    assert (assessment.missing, assessment.unknown) == ((), (unknown,))
    (warning,) = assessment.notes(None)
    assert (warning.code, warning.severity.value) == ("X009", "warning")
    assert "Juggling" in warning.message


ONTOLOGIES = bundled("ontologies")
AMIGO = RunOptions(
    robot=ONTOLOGIES / "robots" / "amigo.omn", environment=ONTOLOGIES / "environments" / "hospital_room.omn"
)
LOOKING = """
Prefix: : <http://example.org/looking.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/looking.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: bottle
    Types: knowrob:DrinkingBottle
Class: Search
    SubClassOf: knowrob:Action, knowrob:subAction some Look
Class: Look
    SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value bottle
"""


@pytest.mark.parametrize("is_plan", [False, True], ids=["recipe", "plan"])
def test_a_step_without_process_module_is_refused_before_the_robot_is_bound(is_plan: bool, tmp_path: Path) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING.replace("LookingForSomething", "Mixing"))
    absent = tmp_path / "robot.omn"  # never read
    options = replace(AMIGO, robot=absent, plan=plan) if is_plan else replace(AMIGO, robot=absent, recipe=recipe)
    refused = run_plan_file(options)
    assert (refused.outcome, refused.failures) == (Outcome.LACKS_CAPABILITY, ("ActionUnresolvable",))
    assert refused.message.startswith("ActionUnresolvable: action ")
    assert "no process module is registered" in refused.message
    assert "--modules FILE.py" in refused.message


def test_an_action_of_the_library_in_a_plan_by_hand_is_refused_with_its_recipe(tmp_path: Path) -> None:
    plan = tmp_path / "take.py"
    body = 'await perform(action("PickingUpAnObject"))'
    plan.write_text(f"from planlang import action, perform, plan\n\n@plan\nasync def take():\n    {body}\n", "utf-8")
    refused = run_plan_file(replace(AMIGO, robot=tmp_path / "absent.omn", plan=plan))
    assert "PickingUpAnObject (pick_up)" in refused.message


SCANNER = "\n    SubClassOf: srdl2-comp:dependsOnComponent some srdl2-comp:Tilting2DLaserScanner\n"


def compiled(recipe: Path, text: str) -> Path:
    """The plan of a recipe, which is written, too."""
    recipe.write_text(text, encoding="utf-8")
    plan = recipe.with_name("search.py")
    plan.write_text(compile_recipe(recipe).source, encoding="utf-8")
    return plan


@pytest.mark.long
@pytest.mark.parametrize("cls", ["Search", "Look"], ids=["of the task", "of a step"])
def test_a_plan_edited_or_not_is_refused_like_its_recipe_for_what_only_that_says(cls: str, tmp_path: Path) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING.replace(f"Class: {cls}", f"Class: {cls}{SCANNER}"))
    refused = run_plan_file(replace(AMIGO, recipe=recipe))
    assert (refused.outcome, refused.failures) == (Outcome.LACKS_CAPABILITY, ("MissingCapability",))
    assert "component Tilting2DLaserScanner: amigo has none" in refused.message
    assert run_plan_file(replace(AMIGO, plan=plan)).message == refused.message
    plan.write_text(plan.read_text(encoding="utf-8") + "\n# looked at\n", encoding="utf-8")
    assert run_plan_file(replace(AMIGO, plan=plan)).message == refused.message


@pytest.mark.parametrize(("now", "code"), [(LOOKING + "\n", "C009"), (LOOKING + "(", "C011"), (None, "C011")])
def test_of_a_recipe_that_is_gone_or_has_changed_a_warning_says_that_its_requirements_are_not_known(
    now: str | None, code: str, tmp_path: Path
) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING)
    if now is None:
        recipe.unlink()
    else:
        recipe.write_text(now, encoding="utf-8")
    found: list[Diagnostic] = []
    assert required_of_plan(plan, main_plan(import_plan(plan), None), found) is None
    assert [(one.severity, one.code, str(one.span)) for one in found] == [(Severity.WARNING, code, f"{plan}:1:1")]


def test_a_plan_that_a_person_wrote_has_no_recipe_and_no_warning(tmp_path: Path) -> None:
    plan = tmp_path / "wait.py"
    plan.write_text("from planlang import plan\n\n\n@plan\nasync def rest() -> None:\n    pass\n")
    found: list[Diagnostic] = []
    assert required_of_plan(plan, main_plan(import_plan(plan), None), found) is None
    assert not found


def test_what_only_adds_things_to_a_kitchen_that_is_not_bundled_is_not_offered() -> None:
    found = environments_with(["milk1"])
    assert "pancake_kitchen" in found
    assert "iai_kitchen_milk" not in found


EARLIER = """
from functools import partial
from planlang import Recovery, an_object, action, at_location, a_location, perform, plan

@plan("http://example.org/kitchen.owl#Fetch")
async def fetch() -> None:
    await at_location(a_location(near=an_object("Cup")), body, recoveries=[Recovery()])
    await perform(action("Reaching"), **{"until": None})

async def body() -> None:
    await with_own(partial(perform, again=True))

async def with_own(perform) -> None:
    await perform(1, 2, 3)
"""


@pytest.mark.parametrize("is_compiled", [True, False])
def test_a_plan_that_calls_the_language_as_an_earlier_version_did_is_refused_before_it_runs(
    tmp_path: Path, *, is_compiled: bool
) -> None:
    path = tmp_path / "fetch.py"
    origin = '"""Fetch.\n\nCompiled by planlang 0.0.9 from fetch.omn (sha256 0123456789abcdef), task Fetch.\n"""'
    path.write_text(origin * is_compiled + EARLIER)
    with pytest.raises(BadInput) as caught:
        import_plan(path)
    found = caught.value.diagnostics
    line = EARLIER[: EARLIER.index("at_location(a_loc")].count("\n") + 1 + 3 * is_compiled
    assert [(one.code, one.message.split()[0], one.span and one.span.line) for one in found] == [
        ("X001", "at_location", line),
        ("X001", "Recovery", line),
    ]
    advice = f"an earlier version compiled this plan: compile it again, planlang compile fetch.omn -o {path}"
    assert {one.help for one in found} == {advice if is_compiled else None}


def test_a_plan_may_raise_errors_of_the_language(tmp_path: Path) -> None:
    path = tmp_path / "refuse.py"
    errors = "PlanStructureError, RunError, DeadlockError, StepLimit"
    path.write_text(f"from planlang import {errors}\nasync def refuse() -> None:\n")
    with path.open("a") as file:
        file.writelines(f"    raise {name}('nothing to do')\n" for name in errors.split(", "))
    assert import_plan(path).__name__ == "planlang_run_refuse"


def test_an_empty_superclass_is_refused_by_the_plan_and_not_by_its_reader(tmp_path: Path) -> None:
    path = tmp_path / "empty.py"
    path.write_text(
        "from planlang import action, perform, plan\n@plan\nasync def go() -> None:\n"
        '    await perform(action("http://example.org/kitchen.owl#Stir", below=""))\n'
    )
    module = import_plan(path)
    assert needs_of(module, main_plan(module, None))
