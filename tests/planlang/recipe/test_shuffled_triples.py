"""A recipe means the same whatever the order of its triples."""

import random
from dataclasses import fields, is_dataclass
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import pytest

from planlang.compiler import compile_recipe
from planlang.compiler.compile import canonical
from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import BNode, Literal, Term, Triple, load
from planlang.recipe import Actions, read_recipe, stated_tasks
from planlang.recipe.order import recipe_order
from planlang.recipe.tasks import read_recipe_of

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


@pytest.mark.parametrize("seed", range(8))
def test_pick_up_carry_put_down_in_any_order_of_triples(statements: list[Triple], tmp_path: Path, seed: int) -> None:
    shuffled = list(statements)
    random.Random(seed).shuffle(shuffled)
    path = tmp_path / "shuffled.owl"
    path.write_text(written(shuffled), encoding="utf-8")
    ontology = load(path)
    recipe = read_recipe_of(Actions(ontology), TASK)
    order = [local_name(step) for step in recipe_order(recipe).extension]
    assert order == ["PickingUpAnObject", "CarryingWhileLocomoting", "PuttingDownAnObject"]
    source = compile_recipe(path, task="PuttingSomethingSomewhere", allow_abstract=True).source
    calls = [line.strip() for line in source.split("async def putting_something_somewhere")[1].splitlines()[2:]]
    assert calls == [
        'await perform_or(action("PickingUpAnObject"), picking_up_an_object)',
        'await perform(action("CarryingWhileLocomoting"), name="CarryingWhileLocomoting")',
        'await perform_or(action("PuttingDownAnObject"), putting_down_an_object)',
    ]


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


REAL = (
    "ChocolateCakeBaking@2011-03.owl",
    "GetFromRefrigerator@2010-11.owl",
    "acat-adt_example_pipetting@master.owl",
    "exploration-recipe@hydro.owl",
    "make_pancakes@hydro.owl",
    "object-search-recipe@hydro.owl",
    "pancake-making-constr@hydro.owl",
    "pancake-making@groovy_2011-08.owl.in",
    "pancake-making@hydro.owl",
    "pancake@kinetic.owl",
    "pouring@hydro.owl",
    "serve_drink@knowrob_hydro_2014-11.owl",
    "serve_drink@re_stack.owl",
    "serve_drink_new@re_stack.owl",
)


@pytest.mark.parametrize("name", REAL)
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
            recipes = read_recipe(actions, task, allow_abstract=True).recipes
            assert recipes is not None
            found.append((seed, task, without_spans(list(canonical(recipes).recipes.values()))))
    first = {task: recipes for seed, task, recipes in found if seed == 0}
    assert first
    for seed, task, recipes in found:
        assert recipes == first[task], (seed, task)
