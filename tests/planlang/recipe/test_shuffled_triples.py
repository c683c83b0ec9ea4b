"""A recipe is the same whatever the order in which its file states the triples."""

from __future__ import annotations

import ast
import random
from dataclasses import fields, is_dataclass
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pytest

from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import BNode, Literal, Term, Triple, load
from planlang.recipe import Actions, read_recipe, stated_tasks
from planlang.recipe.canonical import canonical as in_one_order
from planlang.recipe.order import recipe_order
from planlang.recipe.reading import read_recipe_of
from tests.support.corpus_recipes import RECIPES
from tests.support.examples import some

TASK = "http://knowrob.org/kb/knowrob.owl#PuttingSomethingSomewhere"


def written(triples: list[Triple]) -> str:
    """The triples as RDF/XML, one description each, in the order given."""
    lines = ['<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">']
    for triple in triples:
        name = local_name(triple.predicate)
        space = triple.predicate.removesuffix(name)
        subject = f"rdf:nodeID={quoteattr('n' + triple.subject.label)}" if isinstance(triple.subject, BNode) else ""
        subject = subject or f"rdf:about={quoteattr(str(triple.subject))}"
        inside = f"<x:{name} xmlns:x={quoteattr(space)}{_object(triple.object)}"
        lines.append(f"<rdf:Description {subject}>{inside.format(name=f'x:{name}')}</rdf:Description>")
    return "\n".join([*lines, "</rdf:RDF>"])


def _object(term: Term) -> str:
    if isinstance(term, BNode):
        return f" rdf:nodeID={quoteattr('n' + term.label)}/>"
    if isinstance(term, Literal):
        datatype = f" rdf:datatype={quoteattr(term.datatype)}" if term.datatype else ""
        return f"{datatype}>{escape(term.value)}</{{name}}>"
    return f" rdf:resource={quoteattr(term)}/>"


@pytest.fixture(scope="module", params=["knowrob@hydro.owl", "knowrob@2011-09_ias.owl"])
def statements(request: pytest.FixtureRequest, corpus: Path) -> list[Triple]:
    """Everything that is said about the task, what it consists of, and what orders that."""
    ontology = load(corpus / "ontologies" / request.param, builtin=False)
    found: dict[Triple, None] = {}
    todo: list[str | BNode] = [TASK]
    seen: set[str | BNode] = set()
    while todo:
        subject = todo.pop()
        if subject in seen:
            continue
        seen.add(subject)
        for triple in ontology.triples(s=subject):
            if triple.predicate.endswith("comment") or triple.predicate.endswith("disjointWith"):
                continue
            found[triple] = None
            if isinstance(triple.object, (str, BNode)):
                todo.append(triple.object)
    return list(found)


@pytest.mark.parametrize("seed", some(range(8)))
def test_pick_up_carry_put_down_in_any_order_of_triples(statements: list[Triple], tmp_path: Path, seed: int) -> None:
    shuffled = list(statements)
    random.Random(seed).shuffle(shuffled)
    path = tmp_path / "shuffled.owl"
    path.write_text(written(shuffled), encoding="utf-8")
    ontology = load(path)
    recipe = read_recipe_of(Actions(ontology), TASK)
    order = [local_name(step) for step in recipe_order(recipe).extension]
    assert order == ["PickingUpAnObject", "CarryingWhileLocomoting", "PuttingDownAnObject"]
    source = compile_recipe(path, task="PuttingSomethingSomewhere").source
    thing, place = (f"putting_something_somewhere_{name}" for name in ("object_acted_on", "to_location"))
    calls = ast.unparse(ast.parse(source).body[-1]).replace("'", '"').splitlines()[-4:]
    begins = [
        f'fetch_thing = partial(perform, action("PickingUpAnObject", object_acted_on={thing}),'
        f" otherwise=partial(picking_up_an_object, picking_up_an_object_object_acted_on={thing}),"
        f" until=holding({thing}), recoveries=",
        f'await perform(action("CarryingWhileLocomoting", to_location={place}),'
        f" otherwise=partial(carry, carry_to_location={place}), recoveries=",
        f'await perform(action("PuttingDownAnObject", object_acted_on={thing}, to_location={place}),'
        f" otherwise=partial(putting_down_an_object, putting_down_an_object_to_location={place},"
        f" putting_down_an_object_object_acted_on={thing}), recoveries=",
    ]
    calls = [call.strip() for call in calls if call.strip() != "await fetch_thing()"]
    assert [call[: len(begin)] for call, begin in zip(calls, begins, strict=True)] == begins


def without_spans(value: object) -> object:
    """The same without places in files and names of nameless nodes: what shuffled triples have in common."""
    if isinstance(value, Span):
        return None
    if is_dataclass(value) and not isinstance(value, type):
        compared = (one.name for one in fields(value) if one.compare)
        return (type(value).__name__, *(without_spans(getattr(value, name)) for name in compared))
    if isinstance(value, (tuple, list)):
        return tuple(map(without_spans, value))
    return value


@pytest.mark.parametrize("name", some(RECIPES[::-1], 8))
def test_a_real_recipe_is_the_same_in_any_order_of_its_triples(corpus: Path, tmp_path: Path, name: str) -> None:
    triples = list(load(corpus / "recipes" / name, builtin=False).triples())
    triples = [one for one in triples if not one.predicate.endswith("#imports")]
    found = []
    for seed in range(3):
        random.Random(seed).shuffle(triples)
        path = tmp_path / f"shuffled{seed}.owl"
        path.write_text(written(triples), encoding="utf-8")
        actions = Actions(load(path))
        for task in sorted(stated_tasks(actions)):
            recipes = read_recipe(actions, task).recipes
            assert recipes is not None
            found.append((seed, task, without_spans(list(in_one_order(recipes).recipes.values()))))
    first = {task: recipes for seed, task, recipes in found if seed == 0}
    assert first
    for seed, task, recipes in found:
        assert recipes == first[task], (seed, task)
