"""The goals of a recipe are what its steps bring about, as far as no later step may change it."""

from __future__ import annotations

from pathlib import Path

import pytest

from planlang.compiler import compile_recipe
from planlang.files import bundled
from planlang.ontology import load
from planlang.recipe.goals import declared_goals

HEAD = """
Prefix: : <http://example.org/doors.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/doors.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: cabinet1
    Types: knowrob:Cabinet-PieceOfFurniture
Class: Open
    SubClassOf: knowrob:OpeningAContainerArtifact, knowrob:objectActedOn value cabinet1
Class: Close
    SubClassOf: knowrob:ClosingAContainerArtifact, knowrob:objectActedOn value cabinet1
"""
ORDERED = """
Class: Task
    SubClassOf: knowrob:Action, knowrob:subAction some Open, knowrob:subAction some Close,
        knowrob:orderingConstraints value order
Individual: order
    Types: knowrob:PartialOrdering-Strict
    Facts: knowrob:occursBeforeInOrdering {first}, knowrob:occursAfterInOrdering {second}
"""
UNORDERED = """
Class: Task
    SubClassOf: knowrob:Action, knowrob:subAction some Open, knowrob:subAction some Close
"""


@pytest.mark.parametrize(
    ("name", "goals"),
    [
        ("serve_a_drink", ["bottle1 held by patient1"]),
        ("wipe_table", ["table1 is Clean"]),
        ("carry_the_tray", ["tray1 on or in tea_table1"]),
        ("stir_soup", ["pot1 is Mixed", "spoon1 on counter1"]),
        ("fetch_from_cabinet", ["bottle1 held by robot", "cabinet1 closed"]),
        ("push_the_cup", []),
    ],
)
def test_a_bundled_recipe_declares_what_lasts_of_its_effects(name: str, goals: list[str]) -> None:
    file = bundled("recipes") / f"{name}.omn"
    made = compile_recipe(file)
    assert [goal.text for goal in declared_goals(load(file), made.recipes, lambda what: what)] == goals


@pytest.mark.parametrize(
    ("task", "goals"),
    [
        (ORDERED.format(first="Open", second="Close"), ["cabinet1 closed"]),
        (ORDERED.format(first="Close", second="Open"), ["cabinet1 open"]),
        (UNORDERED, []),
    ],
)
def test_what_a_later_step_may_undo_is_no_goal(tmp_path: Path, task: str, goals: list[str]) -> None:
    file = tmp_path / "doors.omn"
    file.write_text(HEAD + task)
    made = compile_recipe(file)
    assert [goal.text for goal in declared_goals(load(file), made.recipes, lambda what: what)] == goals


def test_a_thing_that_stands_for_nothing_in_a_run_has_no_goal() -> None:
    file = bundled("recipes") / "serve_a_drink.omn"
    assert declared_goals(load(file), compile_recipe(file).recipes, lambda what: None) == ()
