"""Add a relation: one class in planlang/relations, and OWL, plans, phrases and `locate` have it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli.app import app
from planlang.compiler import compile_recipe
from planlang.designators import Relation, a_location, an_object
from planlang.phrases import Lexicon, read_location, write_location
from planlang.relations import RELATIONS, Meaning, RelationType, add
from planlang.relations.beside import Beside


class Across(Beside):
    """Before X, far enough for both to see each other as a whole."""

    name = "across_from"
    owl = "http://example.org/house#acrossFrom"
    forms = ("across from", "not out of the way of")
    of_base = Meaning("before X, 2 to 3 m away", (2.0, 3.0))
    directions = (0.0,)
    from_outside = True


ACROSS = Across()
RECIPE = """
Prefix: : <http://planlang.org/test#>
Prefix: house: <http://example.org/house#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/test>
Import: <http://knowrob.org/kb/knowrob.owl>

ObjectProperty: house:acrossFrom
Individual: bed
    Types: k:Bed-PieceOfFurniture
Individual: there
    Types: k:Point2D
    Facts: house:acrossFrom bed
Class: Wait
    SubClassOf: k:Translation-LocationChange, k:toLocation value there
Class: Visit
    SubClassOf: k:PurposefulAction, k:subAction some Wait
"""


@pytest.fixture
def across() -> Iterator[RelationType]:
    """The table with one more relation."""
    add(ACROSS)
    yield ACROSS
    del RELATIONS[ACROSS.name]


@pytest.mark.usefixtures("across")
def test_a_new_relation_is_written_in_python_and_in_phrases() -> None:
    bed = an_object("Bed-PieceOfFurniture")
    lexicon = Lexicon(classes={"bed": bed}, _written={bed: "bed"})
    location = a_location(across_from=bed, within=2.5)
    assert location.relations == (Relation("across_from", (bed,), within=2.5),)
    assert write_location(location, lexicon) == "at most 2.5 m across from the bed"
    assert read_location("at most 2.5 m across from the bed", lexicon) == location
    assert read_location("out of the way of the bed", lexicon).relations == (
        Relation("across_from", (bed,), negated=True),
    )


@pytest.mark.usefixtures("across")
def test_a_recipe_with_its_owl_property_compiles_to_a_plan_with_its_name(tmp_path: Path) -> None:
    recipe = tmp_path / "visit.omn"
    recipe.write_text(RECIPE, encoding="utf-8")
    source = compile_recipe(recipe).source
    assert 'there = a_location("there", across_from=bed)' in source


@pytest.mark.usefixtures("across")
def test_locate_finds_base_poses_in_it() -> None:
    where = ("--robot", "amigo", "--environment", "hospital_room", "--count", "1", "--json")
    result = CliRunner().invoke(app, ["locate", "across from cabinet2", *where])
    assert result.exit_code == 0, result.output
    (place,) = json.loads(result.stdout)["solutions"]
    near = CliRunner().invoke(app, ["locate", "at most 1.9 m across from cabinet2", *where])
    beside = json.loads(near.stdout)["solutions"][0]
    assert math.dist((place["x"], place["y"]), (beside["x"], beside["y"])) > 0.1
    refused = CliRunner().invoke(app, ["locate", "across from cabinet2", *where, "--of", "the bottle"])
    assert refused.exit_code == 2
    assert "means nothing for an object" in refused.stdout


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ({"forms": ("next to",)}, "'next to' of the relation beside means next_to"),
        ({"of_base": None}, "means nothing"),
        ({"forms": ()}, "at least one spoken form"),
        ({"of_base": Meaning("")}, "say its usual bounds"),
        ({"arity": 3}, "one thing or two"),
    ],
)
def test_a_class_that_cannot_work_is_refused_with_the_reason(words: dict[str, object], problem: str) -> None:
    stated = {"name": "beside", "owl": "b", "forms": ("at",), "of_base": ACROSS.of_base, **words}
    with pytest.raises(ValueError, match=problem):
        add(type("Wrong", (Beside,), stated)())
    assert "beside" not in RELATIONS
