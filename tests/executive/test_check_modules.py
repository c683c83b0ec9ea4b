"""``planlang check`` and ``compile`` know what process modules perform, and what of a module's classes is misspelt."""

from __future__ import annotations

import json
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from loaded_plans import loaded

from executive.cli.app import app
from executive.maps import read_map
from executive.runs.parameters import bound_parameters
from executive.runs.plan_files import main_plan
from planlang import registry
from planlang.compiler import compile_recipe
from planlang.diagnostics import Diagnostic
from planlang.files import bundled
from planlang.ontology import load

HEAD = """\
Prefix: : <http://planlang.org/test#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
    Import: <http://knowrob.org/kb/knowrob.owl>
"""
RECIPE = f"""{HEAD}
Class: Show SubClassOf: knowrob:PurposefulAction, knowrob:subAction some JuggleThreeBalls
Class: Juggling SubClassOf: knowrob:PurposefulAction
Class: JuggleThreeBalls SubClassOf: Juggling
"""
MODULE = """\
from planlang import process_module

@process_module
class Juggler:
    name = "juggling"
    actions = ("{action}",)
    failures = ()

    def __init__(self, platform):
        self.platform = platform

    def resources(self, action):
        return ()

    async def execute(self, action):
        return None
"""


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "show.omn"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def module(folder: Path, action: str) -> Path:
    path = folder / f"{action.lower()}_module.py"
    path.write_text(MODULE.format(action=action), encoding="utf-8")
    return path


def said(*words: object) -> dict[str, str | None]:
    result = CliRunner().invoke(app, [*map(str, words), "--json"])
    answer: dict[str, Any] = json.loads(result.stdout)
    return {one["code"]: one["help"] for one in answer["diagnostics"]}


@pytest.mark.parametrize("command", ["check", "compile"])
def test_a_class_that_a_named_module_performs_needs_nothing_else(recipe: Path, tmp_path: Path, command: str) -> None:
    assert "R021" in said(command, recipe)
    assert "R021" not in said(command, recipe, "--modules", module(tmp_path, "Juggling"))


def test_a_class_that_an_installed_package_performs_needs_nothing_else(
    recipe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "installed_juggler.py").write_text(MODULE.format(action="Juggling"), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    entry = EntryPoint("juggling", "installed_juggler:Juggler", registry.GROUP)
    monkeypatch.setattr(registry, "entry_points", lambda group: [entry] if group == registry.GROUP else [])
    assert "R021" not in said("check", recipe)


def test_a_misspelt_class_of_a_module_is_named(recipe: Path, tmp_path: Path) -> None:
    told = said("check", recipe, "--modules", module(tmp_path, "Jugling"))
    assert told["R021"] == "a process module performs `Jugling`: did you mean `Juggling` in its actions?"


def test_a_recipe_that_opens_a_refrigerator_opens_the_only_one_of_the_map(tmp_path: Path) -> None:
    path = tmp_path / "open.omn"
    path.write_text(
        f"{HEAD}\nClass: Show SubClassOf: knowrob:PurposefulAction,\n"
        "    knowrob:subAction some knowrob:OpeningARefrigerator\n",
        encoding="utf-8",
    )
    plan = tmp_path / "open.py"
    plan.write_text(compile_recipe(path).source, encoding="utf-8")
    room = tmp_path / "room.omn"
    room.write_text(
        f"{HEAD}Individual: fridge1\n    Types: knowrob:Refrigerator\n"
        "    Facts: knowrob:depthOfObject 0.6, knowrob:widthOfObject 0.6, knowrob:heightOfObject 1.5\n"
        "Individual: there\n    Types: knowrob:RotationMatrix3D\n"
        + "    Facts: "
        + ", ".join(f"knowrob:m{row}{column} {float(row == column)}" for row in range(4) for column in range(4))
        + "\nIndividual: seen\n    Types: knowrob:SemanticMapPerception\n"
        "    Facts: knowrob:objectActedOn fridge1, knowrob:eventOccursAt there\n",
        encoding="utf-8",
    )
    found: list[Diagnostic] = []
    bound = bound_parameters(main_plan(loaded(plan), None), {}, read_map(load(room)), found)
    assert [str(value) for value in bound.values()] == ["fridge1"]
    assert [one.code for one in found] == ["X028"]


def test_the_class_of_knowrob_that_begins_with_a_written_name_is_meant(tmp_path: Path) -> None:
    path = tmp_path / "lay.omn"
    path.write_text(
        f"{HEAD}Individual: table1 Types: knowrob:Table\n"
        "Class: Show SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Look\n"
        "Class: Look SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value table1\n",
        encoding="utf-8",
    )
    assert str(said("check", path)["R049"]).startswith("did you mean `Table-PieceOfFurniture`?")


@pytest.mark.parametrize(
    ("written", "meant"), [("ChestOfDrawers", "Dresser-PieceOfFurniture"), ("Corridor", "RoomInAConstruction")]
)
def test_the_class_that_everyday_words_call_so_is_meant(tmp_path: Path, written: str, meant: str) -> None:
    path = tmp_path / "lay.omn"
    path.write_text(
        f"{HEAD}Individual: there Types: knowrob:{written}\n"
        "Class: Show SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Look, knowrob:subAction some More\n"
        "Class: Look SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn value there\n"
        f"Class: More SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn some knowrob:{written}\n",
        encoding="utf-8",
    )
    found = said("check", path)
    assert str(found["R049"]).startswith(f"did you mean `{meant}`?")
    assert str(found["R033"]).startswith(f"did you mean `{meant}`?")


def test_a_task_that_states_no_target_is_not_named_but_the_step_that_needs_one(tmp_path: Path) -> None:
    text = (bundled("recipes") / "serve_a_drink.omn").read_text(encoding="utf-8")
    path = tmp_path / "serve.omn"
    path.write_text(text.replace(",\n        knowrob:toLocation value graspingPlace", ""), encoding="utf-8")
    (found,) = (one for one in compile_recipe(path).diagnostics if one.code == "R062")
    assert found.message.startswith("`MoveBaseToGraspPose` of `ServeADrink` states no toLocation")
    assert found.span is not None
    assert "Class: MoveBaseToGraspPose" in path.read_text(encoding="utf-8").splitlines()[found.span.line - 1]


def test_an_undefined_class_is_looked_for_among_all_classes_of_the_vocabulary(tmp_path: Path) -> None:
    path = tmp_path / "look.omn"
    path.write_text(
        f"{HEAD}Class: Show SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Look\n"
        "Class: Look SubClassOf: knowrob:LookingForSomething, knowrob:objectActedOn some knowrob:Table\n",
        encoding="utf-8",
    )
    assert said("check", path)["R033"] == "did you mean `Table-PieceOfFurniture`?"
