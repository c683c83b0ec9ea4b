"""Matching of recipes with robots: missing requirements, and why."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from executive.robots import FindingKind
from executive.robots.closed_world import ClosedWorld, cardinality
from executive.robots.matching import Possessions
from executive.robots.robot import Part, claims_of, parts_of, read_self_model
from executive.robots.tasks import Match, match
from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, load
from planlang.ontology.expression_text import expression_of, text_of
from planlang.ontology.expressions import Expression
from planlang.recipe import Actions, read_recipe
from tests.support.examples import some

RECIPES = {
    "serve_drink_hydro": "serve_drink@knowrob_hydro_2014-11.owl",
    "serve_drink_re_stack": "serve_drink@re_stack.owl",
}
ROWS = [
    ("amigo@re_stack.owl.in", "serve_drink_re_stack"),
    ("amigo@re_stack.owl.in", "serve_drink_hydro"),
    ("amigo@hydro.owl", "serve_drink_hydro"),
    ("PR2@hydro.owl", "serve_drink_hydro"),
    ("PR2@hydro.owl", "serve_drink_re_stack"),
    ("pioneer@hydro.owl", "serve_drink_hydro"),
    ("baxter@hydro.owl", "serve_drink_hydro"),
]
HEAD = """
Prefix: : <http://example.org/kitchen.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Prefix: unit: <http://qudt.org/vocab/unit#>
Prefix: xsd: <http://www.w3.org/2001/XMLSchema#>
Prefix: owl: <http://www.w3.org/2002/07/owl#>
Ontology: <http://example.org/kitchen.owl>
"""
KITCHEN = "http://example.org/kitchen.owl#"


def matched(recipe: Path, robot: Possessions, task: str | None = None) -> Match:
    ontology = load(recipe)
    recipes = read_recipe(Actions(ontology), task).recipes
    return match(ontology, recipes or KITCHEN + str(task), robot)


def modelled(path: Path) -> Possessions:
    model = read_self_model(load(path))
    return Possessions(model.name, parts_of(model), claims_of(model), model)


def written(folder: Path, text: str) -> Path:
    path = folder / "kitchen.omn"
    path.write_text(HEAD + text, encoding="utf-8")
    return path


# -- real files


@pytest.mark.parametrize(("robot", "recipe"), some(ROWS, every=4))
def test_real_robots_and_recipes_match_as_known(corpus: Path, robot: str, recipe: str) -> None:
    rows = json.loads((corpus / "truth" / "srdl_expected_serve_drink.json").read_text(encoding="utf-8"))
    (row,) = [row for row in rows if (row["robot_file"], row["recipe_set"]) == (robot.removesuffix(".in"), recipe)]
    found = matched(corpus / "recipes" / RECIPES[recipe], modelled(corpus / "robots" / robot), row["task"])
    told = found.as_json()
    assert {key: told[key] if key == "feasible" else sorted(told[key]) for key in row["closure"]} == {
        key: value if key == "feasible" else sorted(value) for key, value in row["closure"].items()
    }


def test_the_table_of_known_answers_is_compared_whole(corpus: Path) -> None:
    rows = json.loads((corpus / "truth" / "srdl_expected_serve_drink.json").read_text(encoding="utf-8"))
    known = [(row["robot_file"], row["recipe_set"]) for row in rows]
    assert sorted((robot.removesuffix(".in"), recipe) for robot, recipe in ROWS) == sorted(known)


# -- small worlds

TASK = """
Class: :Pouring
    SubClassOf: knowrob:Action, srdl2-cap:dependsOnCapability some :PouringCapability
Class: :PouringCapability
    SubClassOf: srdl2-cap:Capability{requires}
Class: :MakingTea
    SubClassOf: knowrob:Action, knowrob:subAction some :Pouring
"""
ROBOT = """
Class: :Cook
    SubClassOf: knowrob:Robot{claims}
Individual: :cook1
    Types: :Cook
    Facts: srdl2-comp:subComponent :left, srdl2-comp:subComponent :right, srdl2-comp:subComponent :eye
Class: :Spout
    SubClassOf: srdl2-comp:HardwareComponent
Class: :Kettle
    SubClassOf: :Spout
DataProperty: :litres
DataProperty: :length
ObjectProperty: :cleanedBy
Individual: :left
    Types: :Kettle
    Facts: :litres 1.5, :cleanedBy :right, :length "30"^^unit:Centimeter
Individual: :right
    Types: :Spout
    Facts: :litres 0.5
Individual: :eye
    Types: srdl2-comp:Camera
"""


def tea(folder: Path, requires: str = "", claims: str = "", more: str = "") -> Match:
    text = TASK.replace("{requires}", requires) + ROBOT.replace("{claims}", claims) + more
    path = written(folder, text)
    return matched(path, modelled(path), task="MakingTea")


def needing(component: str) -> str:
    return f", srdl2-comp:dependsOnComponent {component}"


CLAIM = ", srdl2-cap:hasCapability some :PouringCapability"


@pytest.mark.parametrize(
    ("requires", "claims", "feasible"),
    [
        ("", "", None),
        ("", CLAIM, True),
        (needing("some :Kettle"), "", True),
        (needing("some :Kettle"), CLAIM, True),
        (needing("some srdl2-comp:MobileBase"), CLAIM, False),
        (needing("some :NobodySaysWhatThatIs"), CLAIM, None),
        (needing("min 2 :Spout"), "", True),
        (needing("min 2 :Kettle"), "", False),
        (needing("max 1 :Kettle"), "", True),
        (needing("max 1 :Spout"), "", False),
        (needing("exactly 2 :Spout"), "", True),
        (needing("value :left"), "", True),
        (needing("some (:Spout and (:litres some xsd:decimal[>= 1.0]))"), "", True),
        (needing("some (:Spout and (:litres some xsd:decimal[> 1.5]))"), "", False),
        (needing("some (:Spout and not :Kettle)"), "", True),
        (needing("some (srdl2-comp:Camera and :Kettle)"), "", False),
        (needing("some (:Kettle or srdl2-comp:MobileBase)"), "", True),
        (needing("some (:cleanedBy some :Spout)"), "", True),
        (needing("some (:cleanedBy only :Kettle and :cleanedBy min 1 owl:Thing)"), "", False),
        (needing("some (:litres value 0.5)"), "", True),
        (needing("some (inverse :cleanedBy value :left)"), "", True),
        (needing("some {:right, :left}"), "", True),
        (needing('some (:length value "0.3"^^unit:Meter)'), "", True),
        (needing('some (:length value "0.3"^^unit:Kilogram)'), "", False),
        (needing("some (:length some unit:Inch)"), "", True),
        (needing("some (:length some xsd:double[>= 0.25])"), "", True),
        (needing("some (:length some xsd:double[>= 1.0])"), "", False),
        (needing("min 2 (:litres exactly 1)"), "", True),
        (", srdl2-cap:dependsOnCapability some srdl2-cap:BaseMotionCapability", "", False),
        (", srdl2-cap:dependsOnCapability some (:PouringCapability or srdl2-cap:HeadMotionCapability)", "", None),
    ],
)
def test_requirements_are_evaluated_against_the_parts_of_a_robot(
    tmp_path: Path, requires: str, claims: str, feasible: bool | None
) -> None:
    found = tea(tmp_path, requires, claims)
    assert found.feasible is feasible, "\n".join(found.lines())


def test_the_sub_actions_of_an_equivalent_class_are_required(tmp_path: Path) -> None:
    task = TASK.replace(
        "SubClassOf: knowrob:Action, knowrob:subAction", "EquivalentTo: knowrob:Action and knowrob:subAction"
    )
    path = written(tmp_path, task.replace("{requires}", "") + ROBOT.replace("{claims}", CLAIM))
    assert matched(path, modelled(path), "MakingTea").required(FindingKind.CAPABILITY)


def test_the_tree_says_which_step_needs_what_and_where_it_was_found(tmp_path: Path) -> None:
    lines = list(tea(tmp_path, needing("some :Kettle"), CLAIM).lines())
    assert lines[0] == "MakingTea - available"
    assert lines[1].startswith("`- Pouring")
    assert "capability PouringCapability - available: cook1 claims it" in lines[2]
    assert "component Kettle - available: left" in lines[3]
    assert "kitchen.omn:" in lines[3]


def test_of_alternatives_one_is_enough(tmp_path: Path) -> None:
    text = """
Class: :Boiling
    SubClassOf: knowrob:Action
Class: :BoilingOnGas
    SubClassOf: knowrob:Action, knowrob:subAction some :Pouring
Class: :BoilingOnRails
    SubClassOf: knowrob:Action, knowrob:subAction some knowrob:Translation-LocationChange
Class: :BoilingSomehow
    SubClassOf: :BoilingOnGas, :BoilingOnRails
Class: :Breakfast
    SubClassOf: knowrob:Action, knowrob:subAction some :BoilingSomehow
"""
    path = written(tmp_path, TASK.replace("{requires}", "") + ROBOT.replace("{claims}", CLAIM) + text)
    found = matched(path, modelled(path), task="Breakfast")
    assert found.feasible is True, "\n".join(found.lines())
    assert any("one of - available" in line for line in found.lines())


def test_of_a_union_of_actions_one_member_is_enough(tmp_path: Path) -> None:
    text = """
Class: :Driving
    SubClassOf: knowrob:Translation-LocationChange
Class: :Breakfast
    SubClassOf: knowrob:Action, knowrob:subAction some (:Driving or :Pouring)
"""
    path = written(tmp_path, TASK.replace("{requires}", "") + ROBOT.replace("{claims}", CLAIM) + text)
    found = matched(path, modelled(path), task="Breakfast")
    assert found.feasible is True, "\n".join(found.lines())
    lines = [line.strip(" |`-") for line in found.lines()]
    assert "one of - available" in lines
    assert any(line.startswith("Driving (Translation-LocationChange) - missing") for line in lines)


def test_a_robot_without_self_model_is_unknown_where_its_urdf_does_not_decide(tmp_path: Path) -> None:
    arm = Part("arm", frozenset({"http://knowrob.org/kb/srdl2-comp.owl#ArmComponent"}))
    bare = Possessions("bare", (arm,), {})
    software = written(tmp_path, TASK.replace("{requires}", needing("some srdl2-comp:ArmMotionController")))
    assert matched(software, bare, task="MakingTea").feasible is None
    shape = written(tmp_path, TASK.replace("{requires}", needing("some srdl2-comp:MobileBase")))
    assert matched(shape, bare, task="MakingTea").feasible is False


def test_circular_dependencies_do_not_make_a_capability_available(tmp_path: Path) -> None:
    circle = ", srdl2-cap:dependsOnCapability some :StirringCapability"
    other = """
Class: :StirringCapability
    SubClassOf: srdl2-cap:Capability, srdl2-cap:dependsOnCapability some :PouringCapability
"""
    assert tea(tmp_path, circle, "", other).feasible is False
    claimed = ", srdl2-cap:hasCapability some :StirringCapability"
    assert tea(tmp_path, circle, claimed, other).feasible is True


# -- expressions


def expressions(folder: Path, text: str) -> tuple[Ontology, ClosedWorld]:
    ontology = load(written(folder, ROBOT.replace("{claims}", "") + text))
    return ontology, ClosedWorld([ontology])


def test_individuals_are_classified_by_the_definition_of_a_class(tmp_path: Path) -> None:
    text = "Class: :Big\n    EquivalentTo: :Spout and (:litres some xsd:decimal[>= 1.0])\n"
    _, world = expressions(tmp_path, text)
    big = Expression("name", Span("kitchen.omn"), KITCHEN + "Big")
    assert world.satisfies(KITCHEN + "left", big) is True
    assert world.satisfies(KITCHEN + "right", big) is False


def test_expressions_are_written_in_manchester_syntax(tmp_path: Path) -> None:
    words = ":Spout and (:litres some xsd:decimal[>= 1.0]) and not (:cleanedBy only :Kettle)"
    ontology, _ = expressions(tmp_path, f"Class: :Odd\n    SubClassOf: {words}\n")
    (triple,) = [t for t in ontology.triples(KITCHEN + "Odd") if isinstance(t.object, BNode)]
    expression = expression_of(ontology, triple.object, triple.span)
    assert expression is not None
    told = text_of(expression)
    for word in ("Spout", "litres some", ">=", "not (", "only Kettle"):
        assert word in told


@pytest.mark.parametrize(
    ("kind", "number", "answers", "expected"),
    [
        ("min", 2, [True, True], True),
        ("min", 2, [True, None], None),
        ("min", 2, [True, False], False),
        ("max", 1, [True, None], None),
        ("max", 1, [True, True, None], False),
        ("exactly", 1, [True, None], None),
        ("exactly", 0, [], True),
    ],
)
def test_counts_are_unknown_only_if_the_unknown_decides(
    kind: str, number: int, answers: list[bool | None], expected: bool | None
) -> None:
    assert cardinality(kind, number, answers) is expected


# -- the command


def test_match_explains_and_ends_with_3_if_something_is_missing(tmp_path: Path) -> None:
    text = TASK.replace("{requires}", needing("some srdl2-comp:MobileBase"))
    path = written(tmp_path, text + ROBOT.replace("{claims}", CLAIM))
    result = CliRunner().invoke(app, ["match", str(path), "--robot", str(path), "--task", "MakingTea"])
    assert result.exit_code == 3, result.output
    assert "component MobileBase - missing: cook1 has none" in result.stdout
    told = CliRunner().invoke(app, ["match", str(path), "--robot", str(path), "--task", "MakingTea", "--json"])
    data = json.loads(told.stdout)
    assert (data["feasible"], data["missing_components"]) == (False, ["MobileBase"])
    assert data["explanation"]["requires"][0]["name"] == "Pouring (Action)"


STIRRING = """
Class: :Breakfast
    SubClassOf: knowrob:Action, knowrob:subAction some :Stirring, knowrob:subAction some :Pouring
Class: :Stirring
    SubClassOf: knowrob:PurposefulAction
"""
STIRRER = """
from planlang import process_module

@process_module
class Stirrer:
    name, actions, failures = "stirrer", ("Stirring",), ()

    def __init__(self, platform): ...
    def resources(self, action): return ()
    async def execute(self, action): ...
"""


def breakfast(folder: Path, *options: str, claims: str = CLAIM) -> tuple[int, dict[str, Any]]:
    path = written(folder, TASK.replace("{requires}", "") + ROBOT.replace("{claims}", claims) + STIRRING)
    asked = ["match", str(path), "--robot", str(path), "--task", "Breakfast", "--json", *options]
    result = CliRunner().invoke(app, asked)
    return result.exit_code, json.loads(result.stdout)


def test_an_undefined_step_is_unknown_and_named(tmp_path: Path) -> None:
    code, data = breakfast(tmp_path)
    assert (code, data["feasible"], data["unknown_steps"]) == (1, None, ["Stirring"])
    found = matched(tmp_path / "kitchen.omn", modelled(tmp_path / "kitchen.omn"), task="Breakfast")
    assert list(found.lines())[-1] == "nothing performs these steps or says what they require: Stirring"


def test_missing_outweighs_unknown(tmp_path: Path) -> None:
    moving = (
        TASK.replace("{requires}", needing("some srdl2-comp:MobileBase")) + ROBOT.replace("{claims}", "") + STIRRING
    )
    path = written(tmp_path, moving)
    found = matched(path, modelled(path), task="Breakfast")
    assert (found.feasible, found.unknown_steps()) == (False, ("Stirring",))


def test_a_step_is_known_if_a_module_performs_it_or_its_class_states_requirements(tmp_path: Path) -> None:
    module = tmp_path / "stirrer.py"
    module.write_text(STIRRER, encoding="utf-8")
    code, data = breakfast(tmp_path, "--modules", str(module))
    assert (code, data["feasible"], data["unknown_steps"]) == (0, True, [])
    path = written(tmp_path, TASK.replace("{requires}", "") + ROBOT.replace("{claims}", CLAIM))
    assert matched(path, modelled(path), task="Pouring").feasible is True


def test_a_known_alternative_outweighs_an_unknown_one(tmp_path: Path) -> None:
    text = """
Class: :Boiling
    SubClassOf: knowrob:Action, knowrob:subAction some :Pouring
Class: :Warming
    SubClassOf: knowrob:Action, knowrob:subAction some :Stirring
Class: :Heating
    SubClassOf: :Boiling, :Warming
Class: :Lunch
    SubClassOf: knowrob:Action, knowrob:subAction some :Heating
"""
    path = written(tmp_path, TASK.replace("{requires}", "") + ROBOT.replace("{claims}", CLAIM) + STIRRING + text)
    found = matched(path, modelled(path), task="Lunch")
    assert (found.feasible, found.unknown_steps()) == (True, ())


def test_every_step_of_the_exploration_recipe_is_known_and_the_pioneer_has_what_they_need(corpus: Path) -> None:
    found = matched(
        corpus / "recipes" / "exploration-recipe@hydro.owl", modelled(corpus / "robots" / "pioneer@hydro.owl")
    )
    assert (found.feasible, found.unknown_steps()) == (True, ())
    assert [step.kind for step in found.tree.below] == [FindingKind.ACTION] * 8


def test_match_accepts_an_action_class_of_the_vocabulary() -> None:
    for task, code in (
        ("PickingUpAnObject", 0),
        ("Reaching", 0),
        ("PuttingSomethingSomewhere", 0),
        ("Bottle", 2),
        ("NoSuchClass", 2),
    ):
        assert CliRunner().invoke(app, ["match", "serve_a_drink", "--task", task]).exit_code == code, task
    result = CliRunner().invoke(app, ["match", "serve_a_drink", "--task", "CuttingSomething", "--json"])
    assert (result.exit_code, json.loads(result.stdout)["unknown_steps"]) == (1, ["CuttingSomething"])


def test_match_of_the_bundled_recipe_and_robot_lacks_nothing() -> None:
    result = CliRunner().invoke(app, ["match", "serve_a_drink", "--json"])
    assert (result.exit_code, json.loads(result.stdout)["feasible"]) == (0, True)


@pytest.mark.parametrize("word", ["knowrob:dependsOnComponent", "<http://knowrob.org/kb/srdl2.owl#dependsOnComponent>"])
def test_requirement_properties_count_in_any_namespace(tmp_path: Path, word: str) -> None:
    text = TASK.replace("{requires}", needing("some srdl2-comp:MobileBase")).replace(
        "srdl2-comp:dependsOnComponent", word
    )
    path = written(tmp_path, text + ROBOT.replace("{claims}", CLAIM))
    assert word in path.read_text(encoding="utf-8")
    assert matched(path, modelled(path), task="MakingTea").feasible is False


@pytest.mark.parametrize(("needed", "code"), [("Tilting2DLaserScanner", 3), ("ArmComponent", 0)])
def test_run_refuses_a_robot_that_lacks_what_the_recipe_requires(tmp_path: Path, needed: str, code: int) -> None:
    parking = """
Class: :Park
    SubClassOf: knowrob:Action, knowrob:subAction some :Reach, srdl2-comp:dependsOnComponent some srdl2-comp:{needed}
Class: :Reach
    SubClassOf: knowrob:Reaching, knowrob:toLocation value :parking
Individual: :parking
    Types: knowrob:Point3D
"""
    path = written(tmp_path, parking.replace("{needed}", needed))
    result = CliRunner().invoke(app, ["run", str(path), "--robot", "amigo", "--environment", "hospital_room"])
    assert result.exit_code == code, result.output
    assert (f"component {needed}: amigo has none (required by Park > {needed})" in result.stdout) is bool(code)
