"""Advice that states a part of a recipe is written in the syntax of the recipe's file."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from planlang.diagnostics import Diagnostic
from planlang.ontology import load
from planlang.ontology.convert import Target, convert
from planlang.recipe.actions import Actions
from planlang.recipe.reading import read_recipe

RECIPE = """Prefix: : <http://example.org/serve.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/serve.owl>
Class: Serve
    SubClassOf: knowrob:PurposefulAction, knowrob:subAction some Take, knowrob:subAction some Put
Class: Take
    SubClassOf: knowrob:PickingUpAnObject, knowrob:objectActedOn value cup1
Class: Put
    SubClassOf: knowrob:PuttingSomethingSomewhere, knowrob:objectActedOn value cup1, knowrob:toLocation value table1
Individual: cup1
    Types: knowrob:Cup
Individual: table1
    Types: knowrob:Table-PieceOfFurniture
"""
ENDS = {Target.FUNCTIONAL: ")", Target.OWLXML: "</Ontology>", Target.RDFXML: "</rdf:RDF>"}


def missing_orders(path: Path) -> list[Diagnostic]:
    return [one for one in read_recipe(Actions(load(path))).diagnostics if one.code == "R042"]


@pytest.mark.parametrize("target", [*ENDS, Target.TURTLE])
def test_an_order_that_is_pasted_as_advised_is_the_missing_one(tmp_path: Path, target: Target) -> None:
    source, path = tmp_path / "serve.omn", tmp_path / "serve"
    source.write_text(RECIPE)
    text = convert(source, target).text
    if target is Target.TURTLE and "@prefix owl:" not in text:
        text = f"@prefix owl: <http://www.w3.org/2002/07/owl#> .\n{text}"
    path.write_text(text)
    (found,) = missing_orders(path)
    advised = re.match("add `(.*)` for `Serve`", found.help or "")
    assert advised is not None
    body, end, _ = text.rpartition(ENDS.get(target, "")) if target in ENDS else (text, "", "")
    path.write_text(f"{body}\n{advised[1]}\n{end}")
    assert missing_orders(path) == []


def test_advice_for_manchester_syntax_names_what_is_to_be_added(tmp_path: Path) -> None:
    path = tmp_path / "serve.omn"
    path.write_text(RECIPE)
    (found,) = missing_orders(path)
    assert (found.help or "").startswith("add `orderingConstraints value Serve_Take_Put` to `Serve` with `Individual:")
