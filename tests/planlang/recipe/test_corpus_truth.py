"""Real recipes of dialects D1 and D1f say what an independent RDF script found in them."""

import json
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from planlang.designators import local_name
from planlang.ontology import Ontology, expand, load
from planlang.recipe import Actions, Recipe, stated_tasks
from planlang.recipe.graph import closed, recipe_graph, reduced, total_order
from planlang.recipe.reading import read_recipe_of

FILES = {
    "recipes/serve_drink@knowrob_hydro_2014-11.owl": 2,
    "recipes/serve_drink@re_stack.owl": 2,
    "recipes/serve_drink_new@re_stack.owl": 1,
    "recipes/pancake-making@hydro.owl": 1,
    "recipes/pancake-making@groovy_2011-08.owl.in": 1,
    "recipes/pancake-making-constr@hydro.owl": 1,
    "recipes/pouring@hydro.owl": 1,
    "recipes/ChocolateCakeBaking@2011-03.owl": 8,
    "ontologies/knowrob@hydro.owl": 10,
    "ontologies/knowrob@2011-09_ias.owl": 10,
}


@cache
def opened(path: Path) -> tuple[Ontology, Actions]:
    ontology = load(path)
    return ontology, Actions(ontology)


def truth(corpus: Path, file: str) -> list[dict[str, Any]]:
    folder, name = file.split("/")
    prefix = "ONT_" if folder == "ontologies" else ""
    tasks = json.loads((corpus / "truth" / f"{prefix}{name}.json").read_text(encoding="utf-8"))["tasks"]
    return [task for task in tasks if any(d.startswith("subAction") and "subClassOf" in d for d in task["dialect"])]


def canonical(iri: str) -> str:
    return iri.replace("http://ias.cs.tum.edu/kb/knowrob.owl#", expand("Action").removesuffix("Action"))


def names(pairs: list[list[str]]) -> set[tuple[str, str]]:
    return {(canonical(a), canonical(b)) for a, b in pairs}


def recipes(corpus: Path, file: str) -> list[tuple[Recipe, dict[str, Any]]]:
    _, actions = opened(corpus / file)
    return [(read_recipe_of(actions, canonical(task["task"])), task) for task in truth(corpus, file)]


@pytest.mark.parametrize("file", FILES)
def test_tasks_of_the_file_are_found(corpus: Path, file: str) -> None:
    _, actions = opened(corpus / file)
    expected = {canonical(task["task"]) for task in truth(corpus, file)}
    assert len(expected) == FILES[file]
    assert set(stated_tasks(actions)) == expected


@pytest.mark.parametrize("file", FILES)
def test_steps_are_the_sub_actions_that_are_defined(corpus: Path, file: str) -> None:
    for recipe, task in recipes(corpus, file):
        undefined = {action for action, facts in task["actions"].items() if facts.get("defined_in", "") is None}
        assert {step.iri for step in recipe.steps} == set(map(canonical, set(task["subactions"]) - undefined))


@pytest.mark.parametrize("file", FILES)
def test_orderings_are_the_asserted_constraints(corpus: Path, file: str) -> None:
    for recipe, task in recipes(corpus, file):
        assert {(o.before, o.after) for o in recipe.orderings} == names(task["constraints"])


@pytest.mark.parametrize("file", FILES)
def test_reduction_and_total_order_agree(corpus: Path, file: str) -> None:
    for recipe, task in recipes(corpus, file):
        stated = {step.iri for step in recipe.steps}
        if {canonical(name) for name in task["subactions"]} != stated or not names(task["constraints"]) <= {
            (a, b) for a in stated for b in stated
        }:
            continue  # orders what is no step: judged elsewhere
        graph = recipe_graph(recipe)
        assert set(reduced(graph).edges) == names(task["transitive_reduction"])
        assert closed(graph).number_of_edges() == task["closure_pairs"]
        assert (total_order(graph) is not None) == task["total_order"]
        if task["total_order"]:
            assert total_order(graph) == tuple(map(canonical, task["order"]))


@pytest.mark.parametrize("file", FILES)
def test_labels_and_dialects_agree(corpus: Path, file: str) -> None:
    for recipe, task in recipes(corpus, file):
        if file.startswith("recipes/"):  # classes of the vocabulary have labels of our own
            assert [recipe.label] == (task["label"] or [None])
        assert recipe.dialect == ("D1" if "intersectionOf" in task["dialect"][0] else "D1f")


@pytest.mark.parametrize("file", [file for file in FILES if "serve_drink" in file])
def test_parameters_of_steps_are_what_the_file_fills_in(corpus: Path, file: str) -> None:
    for recipe, task in recipes(corpus, file):
        for step in recipe.steps:
            expected = {
                (p["property"].replace("bodyPartsUsed", "deviceUsed"), local_name(p["value"]["iri"]))
                for p in task["actions"][step.iri]["params"]
            }
            found = {(p.property, getattr(p.filler, "name", None) or local_name(p.filler.iri)) for p in step.parameters}
            assert found == expected
