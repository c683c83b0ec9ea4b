"""A compiled plan allows exactly the orders of its recipe: nothing lost, nothing added, whatever the order has."""

import json
import random
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import pytest
from examples import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from loaded_plans import read

from planlang import Action, Condition, Location, PlanFailure, VirtualHost, run, sleep
from planlang.compiler import compile_recipe
from planlang.compiler.compile import emit
from planlang.compiler.expressions import snake_case
from planlang.compiler.lowering import Lowering
from planlang.designators import local_name
from planlang.language.loading import load_plan
from planlang.ontology import Ontology, load
from planlang.outputs import DIGITS
from planlang.protocols import Solution
from planlang.recipe import Actions, Ordering, Parameter, Place, Recipe, RecipeSet, Source, Step, Thing
from planlang.recipe.actions import Movers
from planlang.recipe.canonical import canonical
from planlang.recipe.model import Kind
from planlang.recipe.order import Precedence, order_graph
from planlang.recipe.scopes import scoping
from planlang.testing import all_linear_extensions

BASE = "http://planlang.org/test#"
KNOWROB = "http://knowrob.org/kb/knowrob.owl#"
BOTTLE = Thing(Kind.OBJECT, "DrinkingBottle", BASE + "bottle1", KNOWROB + "DrinkingBottle")
FEW = 7

LooksAndDrives = tuple[Ontology, Actions]


@pytest.fixture(scope="module")
def looks_and_drives(tmp_path_factory: pytest.TempPathFactory) -> LooksAndDrives:
    """Steps that look (look0, look1, ...) and steps that drive (drive0, ...)."""
    lines = [f"Prefix: : <{BASE}>", f"Prefix: k: <{KNOWROB}>", "Ontology: <http://planlang.org/test>"]
    for number in range(FEW):
        lines += [f"Class: look{number} SubClassOf: k:LookingForSomething"]
        lines += [f"Class: drive{number} SubClassOf: k:Translation-LocationChange"]
    path = tmp_path_factory.mktemp("orders") / "steps.omn"
    path.write_text("\n".join(lines), encoding="utf-8")
    ontology = load(path)
    return ontology, Actions(ontology)


@st.composite
def small_orders(draw: st.DrawFn) -> tuple[int, list[tuple[int, int]]]:
    size = draw(st.integers(1, FEW))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    return size, draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []


def compiled(looks_and_drives: LooksAndDrives, steps: list[Step], pairs: list[tuple[str, str]]) -> str:
    """The source of a recipe with these steps, ordered by pairs of local names."""
    ontology, actions = looks_and_drives
    orderings = tuple(Ordering(BASE + a, BASE + b) for a, b in pairs)
    recipe = Recipe(BASE + "Task", "PurposefulAction", tuple(steps), orderings)
    recipes = RecipeSet(recipe.iri, {recipe.iri: recipe}, Source("test.omn", "0" * 64))
    return emit(Lowering(ontology, recipes, actions).tree(), recipes, "0")[0]


def look(name: str, *parameters: Parameter) -> Step:
    return Step(BASE + name, "LookingForSomething", parameters, (), KNOWROB + "LookingForSomething")


def drive(name: str) -> Step:
    place = Place(f"{BASE}{name}_place", (("in_reach_of", (BOTTLE,)),))
    navigation = "Translation-LocationChange"
    return Step(BASE + name, navigation, (Parameter("toLocation", place),), (), KNOWROB + navigation)


@settings(max_examples=examples(150), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=small_orders())
def test_plan_orders_steps_exactly_as_the_recipe_does(
    read_plan: type[Any], looks_and_drives: LooksAndDrives, order: tuple[int, list[tuple[int, int]]]
) -> None:
    size, edges = order
    names = [f"look{number}" for number in range(size)]
    pairs = [(names[a], names[b]) for a, b in edges]
    happening = read_plan(compiled(looks_and_drives, [look(name) for name in names], pairs)).orders("task")
    closure = nx.transitive_closure_dag(order_graph(names, pairs))
    assert sorted(happening.steps) == names
    assert happening.before == set(closure.edges)


@st.composite
def moving_orders(draw: st.DrawFn) -> tuple[nx.DiGraph, list[str], frozenset[str]]:
    """A random order, some of whose steps move the base and are totally ordered, and which steps have an object."""
    size, pairs = draw(small_orders())
    names = [f"{draw(st.sampled_from(['look', 'drive']))}{number}" for number in range(size)]
    graph = order_graph(names, [(names[a], names[b]) for a, b in pairs])
    ordered = list(nx.lexicographical_topological_sort(graph, key=names.index))
    moving = [name for name in ordered if name.startswith("drive")]
    graph.add_edges_from(pairwise(moving))
    return graph, moving, frozenset(name for name in names if name.startswith("look") and draw(st.booleans()))


@settings(max_examples=examples(150), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(case=moving_orders())
def test_scopes_add_only_the_orders_that_they_tell(
    read_plan: type[Any], looks_and_drives: LooksAndDrives, case: tuple[nx.DiGraph, list[str], frozenset[str]]
) -> None:
    graph, moving, placed = case
    steps = [
        drive(name) if name in moving else look(name, *([Parameter("objectActedOn", BOTTLE)] if name in placed else []))
        for name in graph.nodes
    ]
    happening = read_plan(compiled(looks_and_drives, steps, list(graph.edges))).orders("task")
    added = scoping(Precedence(graph.nodes, graph.edges), Movers(frozenset(moving)), placed).added
    expected = nx.transitive_closure_dag(order_graph(graph.nodes, [*graph.edges, *added]))
    assert sorted(map(step_of, happening.steps)) == sorted(graph.nodes)
    assert {(step_of(a), step_of(b)) for a, b in happening.before} == set(expected.edges)
    assert not any(nx.has_path(graph, before, after) for before, after in added)


def step_of(name: str) -> str:
    """The step that a happening in a plan stands for: to be at a place is to have driven there."""
    return name.removeprefix("at ").removesuffix("_place")


@settings(max_examples=examples(100), deadline=None)
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


LARGEST = 60
LONG = 1000.0
"""How long the step takes that others may have to wait for [s]; others take a second."""


@pytest.fixture(scope="module")
def vocabulary(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ontology, Actions]:
    """Steps s0, s1, ... that a process module performs."""
    lines = [f"Prefix: : <{BASE}>", f"Prefix: k: <{KNOWROB}>", "Ontology: <http://planlang.org/test>"]
    lines += [f"Class: s{number} SubClassOf: k:LookingForSomething" for number in range(LARGEST)]
    path = tmp_path_factory.mktemp("exact") / "steps.omn"
    path.write_text("\n".join(lines), encoding="utf-8")
    ontology = load(path)
    return ontology, Actions(ontology)


@st.composite
def orders(draw: st.DrawFn, largest: int = LARGEST) -> nx.DiGraph:
    """Random orders: series-parallel ones, sparse and dense ones of no form, and such side by side or in a row."""
    rng = random.Random(draw(st.integers(0, 2**32)))
    size = draw(st.integers(1, largest))
    names = [f"s{number}" for number in range(size)]
    hidden = rng.sample(names, size)
    edges = _edges(rng, hidden, draw(st.sampled_from(["series-parallel", "any", "mixed"])))
    return order_graph(names, rng.sample(edges, len(edges)))


def _edges(rng: random.Random, steps: list[str], form: str) -> list[tuple[str, str]]:
    if len(steps) == 1:
        return []
    if form == "any" or (form == "mixed" and len(steps) < 8):
        density = rng.choice([0.05, 0.15, 0.5])
        return [(a, b) for n, a in enumerate(steps) for b in steps[n + 1 :] if rng.random() < density]
    cut = rng.randint(1, len(steps) - 1)
    across = [(a, b) for a in steps[:cut] for b in steps[cut:]] if rng.random() < 0.5 else []
    return [*_edges(rng, steps[:cut], form), *_edges(rng, steps[cut:], form), *across]


def recipes_of(graph: nx.DiGraph) -> RecipeSet:
    steps = tuple(Step(BASE + name, BASE + name, (), (), KNOWROB + "LookingForSomething") for name in graph.nodes)
    orderings = tuple(Ordering(BASE + a, BASE + b) for a, b in graph.edges)
    recipe = Recipe(BASE + "Task", "PurposefulAction", steps, orderings)
    return RecipeSet(recipe.iri, {recipe.iri: recipe}, Source("test.omn", "0" * 64))


def source_of(vocabulary: tuple[Ontology, Actions], recipes: RecipeSet) -> str:
    ontology, actions = vocabulary
    found = canonical(recipes)
    return emit(Lowering(ontology, found, actions).tree(), found, "0")[0]


@dataclass(eq=False)
class Performer:
    """Performs one class of actions; it takes the time that its robot says."""

    robot: "Robot"
    name: str
    failures: tuple[type[Exception], ...] = (PlanFailure,)

    @property
    def actions(self) -> tuple[str, ...]:
        return (BASE + self.name,)

    def resources(self, action: Action) -> tuple[str, ...]:
        return ()

    async def execute(self, action: Action) -> None:
        self.robot.begun.append(self.name)
        await sleep(LONG if self.name == self.robot.slow else 1.0)
        self.robot.ended.append((self.name, tuple(self.robot.begun)))


@dataclass(eq=False)
class Robot:
    """Has a module for each step, so that nothing but the plan keeps a step from beginning."""

    steps: Sequence[str]
    slow: str
    begun: list[str] = field(default_factory=list)
    ended: list[tuple[str, tuple[str, ...]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.modules: Sequence[Any] = [Performer(self, name) for name in self.steps]

    def ancestors(self, action_type: str) -> Sequence[str]:
        return (action_type,)

    def revision(self) -> int:
        return 0

    def solutions(self, location: Location) -> Iterator[Solution]:
        yield from ()

    def holds(self, condition: Condition) -> bool:
        return False

    def before_retry(self) -> Iterable[Action]:
        return ()

    def held(self) -> Sequence[str]:
        return ()

    def releases(self, action: Action) -> bool:
        return False

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Nothing of its own to write."""


def waiting_for(source: str, steps: Sequence[str], slow: str, schedule: int) -> set[str]:
    """The steps that had not begun when the slow one ended."""
    robot = Robot(steps, slow)
    run(load_plan(read(source)).task, host=VirtualHost(), executive=robot, schedule=schedule)  # type: ignore[arg-type]
    assert sorted(robot.begun) == sorted(steps)
    begun = dict(robot.ended)[slow]
    return set(steps) - set(begun)


@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(graph=orders(), seed=st.integers(0, 1000))
def test_plan_allows_exactly_the_orders_of_the_recipe(
    read_plan: type[Any], vocabulary: tuple[Ontology, Actions], graph: nx.DiGraph, seed: int
) -> None:
    source = source_of(vocabulary, recipes_of(graph))
    closure = nx.transitive_closure_dag(graph)
    happening = read_plan(source).orders("task")
    assert sorted(happening.steps) == sorted(graph.nodes)
    assert happening.before == set(closure.edges)
    steps = list(graph.nodes)
    for slow in random.Random(seed).sample(steps, min(len(steps), 6)):
        assert waiting_for(source, steps, slow, seed) == set(closure.successors(slow))


@settings(max_examples=15, deadline=None)
@given(graph=orders(12), seed=st.integers(0, 1000))
def test_every_step_of_a_run_waits_for_exactly_what_the_recipe_says(
    vocabulary: tuple[Ontology, Actions], graph: nx.DiGraph, seed: int
) -> None:
    source = source_of(vocabulary, recipes_of(graph))
    closure = nx.transitive_closure_dag(graph)
    for slow in graph.nodes:
        for schedule in (seed, seed + 1, seed + 2):
            assert waiting_for(source, list(graph.nodes), slow, schedule) == set(closure.successors(slow))


@settings(max_examples=examples(60), deadline=None)
@given(graph=orders(), seed=st.integers(0, 2**32))
def test_shuffled_statements_change_no_byte(vocabulary: tuple[Ontology, Actions], graph: nx.DiGraph, seed: int) -> None:
    rng = random.Random(seed)
    recipes = recipes_of(graph)
    steps = tuple(rng.sample(recipes.main.steps, len(recipes.main.steps)))
    orderings = tuple(rng.sample(recipes.main.orderings, len(recipes.main.orderings)))
    shuffled = replace(recipes.main, steps=steps, orderings=orderings)
    other = RecipeSet(recipes.task, {recipes.task: shuffled}, recipes.source)
    assert source_of(vocabulary, other) == source_of(vocabulary, recipes)


def triples_of(graph: nx.DiGraph) -> list[str]:
    """The recipe in N-Triples; what one blank node says stays together only by its name."""
    rdf, rdfs, owl = (
        "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
        "http://www.w3.org/2000/01/rdf-schema#",
        "http://www.w3.org/2002/07/owl#",
    )
    task = f"<{BASE}Task>"
    lines = [f"{task} <{rdf}type> <{owl}Class> .", f"{task} <{rdfs}subClassOf> <{KNOWROB}PurposefulAction> ."]

    def restriction(label: str, name: str, kind: str, filler: str) -> list[str]:
        return [
            f"{task} <{rdfs}subClassOf> _:{label} .",
            f"_:{label} <{rdf}type> <{owl}Restriction> .",
            f"_:{label} <{owl}onProperty> <{KNOWROB}{name}> .",
            f"_:{label} <{owl}{kind}> <{BASE}{filler}> .",
        ]

    for name in graph.nodes:
        lines += [f"<{BASE}{name}> <{rdf}type> <{owl}Class> ."]
        lines += [f"<{BASE}{name}> <{rdfs}subClassOf> <{KNOWROB}LookingForSomething> ."]
        lines += restriction(f"r{name}", "subAction", "someValuesFrom", name)
    for number, (a, b) in enumerate(graph.edges):
        lines += restriction(f"o{number}", "orderingConstraints", "hasValue", f"O{number}")
        lines += [f"<{BASE}O{number}> <{rdf}type> <{KNOWROB}PartialOrdering-Strict> ."]
        lines += [f"<{BASE}O{number}> <{KNOWROB}occursBeforeInOrdering> <{BASE}{a}> ."]
        lines += [f"<{BASE}O{number}> <{KNOWROB}occursAfterInOrdering> <{BASE}{b}> ."]
    return lines


@settings(max_examples=6, deadline=None)
@given(graph=orders(14), seed=st.integers(0, 2**32))
def test_shuffled_triples_of_a_file_change_nothing_but_its_digest(
    tmp_path_factory: pytest.TempPathFactory, graph: nx.DiGraph, seed: int
) -> None:
    lines = triples_of(graph)
    folder = tmp_path_factory.mktemp("triples")
    sources = []
    for text in (lines, random.Random(seed).sample(lines, len(lines))):
        path: Path = folder / "task.nt"
        path.write_text("\n".join(text), encoding="utf-8")
        plan = compile_recipe(path)
        sources.append(plan.source.replace(plan.recipes.source.sha256[:DIGITS], "-"))
        assert [local_name(step.iri) for step in plan.recipes.main.steps] == sorted(
            graph.nodes, key=lambda name: int(name[1:])
        )
    assert sources[0] == sources[1]


FILES = {
    "ChocolateCakeBaking@2011-03.owl": 8,
    "GetFromRefrigerator@2010-11.owl": 1,
    "make_pancakes@hydro.owl": 1,
    "pancake-making-constr@hydro.owl": 1,
    "pancake-making@groovy_2011-08.owl.in": 1,
    "pancake-making@hydro.owl": 1,
    "pouring@hydro.owl": 1,
    "serve_drink@knowrob_hydro_2014-11.owl": 2,
    "serve_drink_new@re_stack.owl": 1,
}
"""Recipes of ordered steps without errors, and how many tasks they state; that of re_stack/serve_drink has errors."""


@pytest.mark.parametrize("file", FILES)
def test_plan_has_as_many_linear_extensions_as_the_recipe(corpus: Path, file: str, read_plan: type[Any]) -> None:
    truth = json.loads((corpus / "truth" / f"{file}.json").read_text(encoding="utf-8"))
    assert len(truth["tasks"]) == FILES[file]
    for task in truth["tasks"]:
        name = local_name(task["task"])
        plan = compile_recipe(corpus / "recipes" / file, task=name, scopes=False, data_flow=False)
        happening = read_plan(plan.source, calls_are_steps=True).orders(snake_case(name))
        number = Counter(happening.steps)
        steps = [f"{step} {count}" for step in number for count in range(number[step])]
        assert len(steps) == task["n_subactions"]
        assert max(number.values()) == 1, "steps of one name cannot be told apart"
        orders = {(f"{a} 0", f"{b} 0") for a, b in happening.before}
        assert all_linear_extensions(steps, orders, limit=1).total == task["linear_extensions"]
