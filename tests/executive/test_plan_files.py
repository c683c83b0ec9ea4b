"""Plan files: which plan is run with which parameters, and what it takes of a robot."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest
from loaded_plans import loaded, needs

from executive.maps import SemanticMap, read_map
from executive.maps.environments import default_environment, environments_with
from executive.robots import Availability, FindingKind, Missing
from executive.runs.options import Outcome, RunOptions
from executive.runs.parameters import bound_parameters
from executive.runs.plan_files import (
    assess,
    main_plan,
    recipe_of_plan,
)
from executive.runs.plan_run import run_plan_file
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.files import Bundled, bundled
from planlang.language.plan_text import Needs
from planlang.language.source import PlanSource
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
    return main_plan(loaded(path), task).name


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
    parameters = bound_parameters(main_plan(loaded(path), None), bindings, room, found)
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
            'did you mean set={"bottle": "bottle2"}? its parameters: bottle, any_bottle, patient',
        ),
        (
            {"bottle": "botle1"},
            "X005",
            'did you mean set={"bottle": "bottle1"}? bottle may be bottle1, cup2, bottle2; the map also has room1, '
            "bed1, patient1, bedside_table1, cabinet1, cabinet2, chair1, door1, visitor1",
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
    there = cup.partition("; cup2 is in a bundled environment: environment=")[2].split(" or ")
    assert {"visiting_hours", "ward_office"} <= {*there}
    assert "environment=" not in visitor


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
    "line",
    [
        "await try_in_order(grasp, look)",
        "await planlang.try_in_order(partial(grasp, hard=True), look)",
        "await perform(action('PurposefulAction'), otherwise=partial(try_in_order, grasp, look))",
        "await try_in_order(first=grasp, second=look)",
    ],
)
def test_one_feasible_alternative_is_enough(line: str) -> None:
    found = needs(line)
    assert told(found) == ([], [])
    assert told(found, "ClosingAGripper") == ([], [("grasp", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("look", "LookingForSomething")])
    assert told(found, "ClosingAGripper", "LookingForSomething") == (["ClosingAGripper", "LookingForSomething"], [])


def test_local_branches_are_alternatives_too() -> None:
    found = needs(
        "async def by_hand() -> None:",
        "    await grasp()",
        "by_eye = partial(look)",
        "await try_in_order(by_hand, by_eye)",
    )
    assert told(found, "ClosingAGripper") == ([], [("by_hand", "ClosingAGripper")])
    assert told(found, "LookingForSomething") == ([], [("by_eye", "LookingForSomething")])


def test_what_is_needed_beside_a_choice_stays_needed() -> None:
    found = needs("await try_in_order(grasp, look)", "await grasp()")
    assert told(found, "ClosingAGripper") == (["ClosingAGripper"], [("grasp", "ClosingAGripper")])


def test_choices_may_be_nested() -> None:
    found = needs("await try_in_order(either, look)", before="""
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


def test_plans_that_are_not_called_are_not_needed() -> None:
    assert told(needs("await look()"), "ClosingAGripper", "Reaching") == ([], [])


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
    robot = tmp_path / "robot.omn"
    robot.touch()  # never read
    refused = run_plan_file(replace(AMIGO, robot=robot, recipe=plan if is_plan else recipe))
    assert (refused.outcome, refused.failures) == (Outcome.LACKS_CAPABILITY, ("ActionUnresolvable",))
    assert refused.message.startswith("ActionUnresolvable: action ")
    assert "no process module is registered" in refused.message
    assert "modules=FILE.py" in refused.message


def test_an_action_of_the_library_in_a_plan_by_hand_is_refused_with_its_recipe(tmp_path: Path) -> None:
    plan = tmp_path / "take.py"
    body = 'await perform(action("PickingUpAnObject"))'
    plan.write_text(f"from planlang import action, perform, plan\n\n@plan\nasync def take():\n    {body}\n", "utf-8")
    (robot := tmp_path / "robot.omn").touch()  # never read
    refused = run_plan_file(replace(AMIGO, robot=robot, recipe=plan))
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
    assert run_plan_file(replace(AMIGO, recipe=plan)).message == refused.message
    plan.write_text(plan.read_text(encoding="utf-8") + "\n# looked at\n", encoding="utf-8")
    assert run_plan_file(replace(AMIGO, recipe=plan)).message == refused.message


@pytest.mark.parametrize(("now", "code"), [(LOOKING + "\n", "C009"), (LOOKING + "(", "C011"), (None, "C011")])
def test_of_a_recipe_that_is_gone_or_has_changed_a_warning_says_that_what_it_requires_and_declares_is_not_known(
    now: str | None, code: str, tmp_path: Path
) -> None:
    recipe = tmp_path / "looking.omn"
    plan = compiled(recipe, LOOKING)
    if now is None:
        recipe.unlink()
    else:
        recipe.write_text(now, encoding="utf-8")
    found: list[Diagnostic] = []
    assert recipe_of_plan(PlanSource.read(plan), found) is None
    assert [(one.severity, one.code, str(one.span)) for one in found] == [(Severity.WARNING, code, f"{plan}:1:1")]


def test_a_plan_that_a_person_wrote_has_no_recipe_and_no_warning(tmp_path: Path) -> None:
    plan = tmp_path / "wait.py"
    plan.write_text("from planlang import plan\n\n\n@plan\nasync def rest() -> None:\n    pass\n")
    found: list[Diagnostic] = []
    assert recipe_of_plan(PlanSource.read(plan), found) is None
    assert not found


def test_what_only_adds_things_to_a_kitchen_that_is_not_bundled_is_not_offered() -> None:
    found = environments_with(["milk1"])
    assert "pancake_kitchen" in found
    assert "iai_kitchen_milk" not in found
