"""A compiled plan allows exactly the orders that its recipe allows."""

from itertools import pairwise
from typing import Any

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planlang.compiler.emit import emit
from planlang.compiler.lowering import Lowering
from planlang.ontology import Ontology, load
from planlang.recipe import Actions, Ordering, Parameter, Place, Recipe, RecipeSet, Source, Step, Thing
from planlang.recipe.actions import Movers
from planlang.recipe.model import Kind
from planlang.recipe.order import Precedence, order_graph
from planlang.recipe.scopes import scoping

BASE = "http://planlang.org/test#"
KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
BOTTLE = Thing(Kind.OBJECT, "DrinkingBottle", BASE + "bottle1", KNOWROB + "DrinkingBottle")
LARGEST = 7

Vocabulary = tuple[Ontology, Actions]


@pytest.fixture(scope="module")
def vocabulary(tmp_path_factory: pytest.TempPathFactory) -> Vocabulary:
    """Steps that look (look0, look1, ...) and steps that drive (drive0, ...)."""
    lines = [f"Prefix: : <{BASE}>", f"Prefix: k: <{KNOWROB}>", "Ontology: <http://planlang.org/test>"]
    for number in range(LARGEST):
        lines += [f"Class: look{number} SubClassOf: k:LookingForSomething"]
        lines += [f"Class: drive{number} SubClassOf: k:Translation-LocationChange"]
    path = tmp_path_factory.mktemp("orders") / "steps.omn"
    path.write_text("\n".join(lines), encoding="utf-8")
    ontology = load(path)
    return ontology, Actions(ontology)


@st.composite
def orders(draw: st.DrawFn) -> tuple[int, list[tuple[int, int]]]:
    size = draw(st.integers(1, LARGEST))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    return size, draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []


def compiled(vocabulary: Vocabulary, steps: list[Step], pairs: list[tuple[str, str]]) -> str:
    """The source of a recipe with these steps, ordered by pairs of local names."""
    ontology, actions = vocabulary
    orderings = tuple(Ordering(BASE + a, BASE + b) for a, b in pairs)
    recipe = Recipe(BASE + "Task", "PurposefulAction", tuple(steps), orderings)
    recipes = RecipeSet(recipe.iri, {recipe.iri: recipe}, Source("test.omn", "0" * 64))
    return emit(Lowering(ontology, recipes, actions).tree(), recipes, "0")[0]


def look(name: str, *parameters: Parameter) -> Step:
    return Step(BASE + name, "LookingForSomething", parameters, (), KNOWROB + "LookingForSomething")


def drive(name: str) -> Step:
    place = Place(f"{BASE}{name}_place", (("in_reach_of", BOTTLE),))
    navigation = "Translation-LocationChange"
    return Step(BASE + name, navigation, (Parameter("toLocation", place),), (), KNOWROB + navigation)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=orders())
def test_plan_orders_steps_exactly_as_the_recipe_does(
    read_plan: type[Any], vocabulary: Vocabulary, order: tuple[int, list[tuple[int, int]]]
) -> None:
    size, edges = order
    names = [f"look{number}" for number in range(size)]
    pairs = [(names[a], names[b]) for a, b in edges]
    happening = read_plan(compiled(vocabulary, [look(name) for name in names], pairs)).orders("task")
    closure = nx.transitive_closure_dag(order_graph(names, pairs))
    assert sorted(happening.steps) == names
    assert happening.before == set(closure.edges)


@st.composite
def moving_orders(draw: st.DrawFn) -> tuple[nx.DiGraph, list[str], frozenset[str]]:
    """A random order, some of whose steps move the base and are totally ordered, and which steps have an object."""
    size, pairs = draw(orders())
    names = [f"{draw(st.sampled_from(['look', 'drive']))}{number}" for number in range(size)]
    graph = order_graph(names, [(names[a], names[b]) for a, b in pairs])
    ordered = list(nx.lexicographical_topological_sort(graph, key=names.index))
    moving = [name for name in ordered if name.startswith("drive")]
    graph.add_edges_from(pairwise(moving))
    return graph, moving, frozenset(name for name in names if name.startswith("look") and draw(st.booleans()))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(case=moving_orders())
def test_scopes_add_only_the_orders_that_they_tell(
    read_plan: type[Any], vocabulary: Vocabulary, case: tuple[nx.DiGraph, list[str], frozenset[str]]
) -> None:
    graph, moving, placed = case
    steps = [
        drive(name) if name in moving else look(name, *([Parameter("objectActedOn", BOTTLE)] if name in placed else []))
        for name in graph.nodes
    ]
    happening = read_plan(compiled(vocabulary, steps, list(graph.edges))).orders("task")
    added = scoping(Precedence(graph.nodes, graph.edges), Movers(frozenset(moving)), placed).added
    expected = nx.transitive_closure_dag(order_graph(graph.nodes, [*graph.edges, *added]))
    assert sorted(map(step_of, happening.steps)) == sorted(graph.nodes)
    assert {(step_of(a), step_of(b)) for a, b in happening.before} == set(expected.edges)
    assert not any(nx.has_path(graph, before, after) for before, after in added)


def step_of(name: str) -> str:
    """The step that a happening in a plan stands for: to be at a place is to have driven there."""
    return name.removeprefix("at ").removesuffix("_place")


@settings(max_examples=100, deadline=None)
@given(case=moving_orders())
def test_a_step_is_in_the_scope_of_the_last_base_motion_before_it(
    case: tuple[nx.DiGraph, list[str], frozenset[str]],
) -> None:
    graph, moving, placed = case
    closure = nx.transitive_closure_dag(graph)
    for unit in scoping(Precedence(graph.nodes, graph.edges), Movers(frozenset(moving)), placed).units:
        for step in unit.steps:
            if unit.base is not None:
                assert closure.has_edge(unit.base, step)
                later = moving[moving.index(unit.base) + 1 :]
                assert not any(closure.has_edge(other, step) for other in later)
