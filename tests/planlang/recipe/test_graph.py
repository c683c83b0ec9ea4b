"""Orders as graphs, with networkx as the oracle; checks, run in an order that makes suppressing true; R046."""

from __future__ import annotations

import importlib
import pkgutil
import random
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

import planlang.compiler
import planlang.recipe
from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.diagnostics import CODES, Diagnostic, Rename, Severity
from planlang.recipe import reading
from planlang.recipe.checks import Check
from planlang.recipe.order.decomposition import Parallel, Part, Prime, Serial, decomposed
from planlang.recipe.order.graph import (
    Precedence,
    order_graph,
    shortest_cycle,
)


@st.composite
def partial_orders(draw: st.DrawFn) -> nx.DiGraph:
    """Up to seven nodes in any order, with edges that follow one hidden linear order."""
    size = draw(st.integers(1, 7))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    edges = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return order_graph(range(size), edges)


@given(partial_orders())
def test_the_reduction_is_that_of_networkx(graph: nx.DiGraph) -> None:
    order: Precedence[int] = Precedence(graph)
    assert set(order.reduction()) == set(nx.transitive_reduction(graph).edges)
    assert order.size_of_reduction() == len(set(order.reduction()))


@given(partial_orders())
def test_precedence_answers_as_the_closure_does(graph: nx.DiGraph) -> None:
    order: Precedence[int] = Precedence(graph)
    closure = nx.transitive_closure_dag(graph)
    assert order.number_of_pairs() == closure.number_of_edges()
    for one in graph.nodes:
        assert set(order.members(order.later(one))) == set(closure.successors(one))
        assert set(order.members(order.earlier(one))) == set(closure.predecessors(one))
        assert all(order.before(one, other) == closure.has_edge(one, other) for other in graph.nodes)


def test_a_cycle_is_no_order() -> None:
    with pytest.raises(ValueError, match="cycle"):
        Precedence(order_graph("AB", [("A", "B"), ("B", "A")]))


@st.composite
def any_graphs(draw: st.DrawFn) -> nx.DiGraph:
    size = draw(st.integers(1, 7))
    node = st.integers(0, size - 1)
    return order_graph(range(size), draw(st.lists(st.tuples(node, node), max_size=14)))


@given(any_graphs())
def test_no_cycle_is_shorter_than_the_one_shown(graph: nx.DiGraph) -> None:
    found = shortest_cycle(graph)
    lengths = [len(cycle) for cycle in nx.simple_cycles(graph)]
    assert (len(found) if found else None) == min(lengths, default=None)
    if found:
        assert all(graph.has_edge(a, b) for a, b in zip(found, (*found[1:], found[0]), strict=True))


def test_one_long_cycle_is_found_in_time_linear_in_its_length() -> None:
    size = 20_000
    graph = order_graph(range(size), [(node, (node + 1) % size) for node in range(size)])
    assert shortest_cycle(graph) == tuple(range(size))


@given(partial_orders())
def test_the_linear_extension_keeps_file_order_among_the_ready_ones(graph: nx.DiGraph) -> None:
    done: set[int] = set()
    for node in Precedence(graph).extension:
        ready = [other for other in graph.nodes if other not in done and set(graph.predecessors(other)) <= done]
        assert node == ready[0]
        done.add(node)


def test_shortest_cycle_is_shown_from_its_first_node() -> None:
    graph = order_graph("ABCD", [("A", "B"), ("B", "D"), ("D", "C"), ("B", "C"), ("C", "A")])
    assert shortest_cycle(graph) == ("A", "B", "C")


def test_a_step_before_itself_is_the_shortest_cycle() -> None:
    assert shortest_cycle(order_graph("AB", [("A", "B"), ("B", "A"), ("B", "B")])) == ("B",)


@given(partial_orders())
def test_acyclic_orders_have_no_shortest_cycle(graph: nx.DiGraph) -> None:
    assert shortest_cycle(graph) is None


@pytest.mark.parametrize("edges", [[], [("A", "B")]])
def test_orderings_of_strangers_are_left_out(edges: list[tuple[str, str]]) -> None:
    graph = order_graph("AB", [*edges, ("A", "Z"), ("Z", "B")])
    assert list(graph.edges) == edges


Order = tuple[list[int], set[tuple[int, int]]]


def reduced(graph: nx.DiGraph) -> nx.DiGraph:
    order: Precedence[int] = Precedence(graph)
    return order_graph(graph.nodes, order.reduction())


def order_of(part: Part) -> Order:
    """Leaves and all pairs of them that a part puts in order."""
    if isinstance(part, int):
        return [part], set()
    found = [order_of(inner) for inner in part.parts]
    numbers = range(len(found))
    if isinstance(part, Serial):
        between = [(a, b) for a in numbers for b in numbers if a < b]
    elif isinstance(part, Prime):
        between = list(nx.transitive_closure_dag(order_graph(numbers, part.orderings)).edges)
    else:
        between = []
    pairs = {pair for _, inside in found for pair in inside}
    pairs |= {(x, y) for a, b in between for x in found[a][0] for y in found[b][0]}
    return [leaf for leaves, _ in found for leaf in leaves], pairs


def has_prime(part: Part) -> bool:
    return not isinstance(part, int) and (isinstance(part, Prime) or any(map(has_prime, part.parts)))


def series_parallel(rng: random.Random, leaves: list[int]) -> Order:
    """A random series-parallel order."""
    if len(leaves) == 1:
        return leaves, set()
    cut = rng.randint(1, len(leaves) - 1)
    (first, one), (second, other) = series_parallel(rng, leaves[:cut]), series_parallel(rng, leaves[cut:])
    across = {(a, b) for a in first for b in second} if rng.random() < 0.5 else set()
    return leaves, one | other | across


@st.composite
def any_orders(draw: st.DrawFn) -> nx.DiGraph:
    size = draw(st.integers(1, 12))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    return order_graph(range(size), draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else [])


@given(any_orders())
def test_decomposition_says_exactly_the_order(graph: nx.DiGraph) -> None:
    part = decomposed(reduced(graph))
    assert part is not None
    leaves, pairs = order_of(part)
    assert sorted(leaves) == list(graph.nodes)
    assert pairs == set(nx.transitive_closure_dag(graph).edges)


@given(st.integers(0, 2**32), st.integers(1, 40))
def test_series_parallel_orders_have_no_prime_part(seed: int, size: int) -> None:
    rng = random.Random(seed)
    leaves = list(range(size))
    rng.shuffle(leaves)
    _, pairs = series_parallel(rng, leaves)
    part = decomposed(reduced(order_graph(range(size), pairs)))
    assert part is not None
    assert not has_prime(part)
    assert order_of(part)[1] == pairs


def test_an_n_is_prime() -> None:
    part = decomposed(order_graph(range(4), [(0, 2), (1, 2), (1, 3)]))
    assert part == Prime((0, 1, 2, 3), ((0, 2), (1, 2), (1, 3)))


def test_a_prime_part_stands_inside_of_series_and_parallel() -> None:
    n = [(1, 3), (2, 3), (2, 4)]
    graph = order_graph(range(7), [*n, (3, 5), (4, 5), (0, 1), (0, 2)])
    part = decomposed(reduced(graph))
    assert part == Parallel((Serial((0, Prime((1, 2, 3, 4), ((0, 2), (1, 2), (1, 3))), 5)), 6))


@pytest.mark.parametrize("size", [1, 2, 3000])
def test_chains_and_antichains_are_one_part(size: int) -> None:
    chain = decomposed(order_graph(range(size), [(node, node + 1) for node in range(size - 1)]))
    free = decomposed(order_graph(range(size), []))
    assert chain == (0 if size == 1 else Serial(tuple(range(size))))
    assert free == (0 if size == 1 else Parallel(tuple(range(size))))


def test_nothing_has_no_decomposition() -> None:
    assert decomposed(nx.DiGraph()) is None


@given(any_orders(), st.integers(0, 3))
def test_splitting_no_deeper_says_the_same_order(graph: nx.DiGraph, deepest: int) -> None:
    part = decomposed(reduced(graph), deepest)
    assert part is not None
    leaves, pairs = order_of(part)
    assert sorted(leaves) == list(graph.nodes)
    assert pairs == set(nx.transitive_closure_dag(graph).edges)


RUN = {name: value for name, value in vars(reading).items() if name.isupper() and isinstance(value, tuple)}
"""The lists of checks that reading a recipe goes through."""


def modules(package: ModuleType) -> Iterator[ModuleType]:
    for found in pkgutil.walk_packages(package.__path__, package.__name__ + "."):
        yield importlib.import_module(found.name)


def declared() -> list[Check[..., object]]:
    """All checks of recipe and compiler, each once."""
    inside = [*modules(planlang.recipe), *modules(planlang.compiler)]
    found = {id(value): value for module in inside for value in vars(module).values() if isinstance(value, Check)}
    return list(found.values())


def test_every_code_of_recipes_is_declared_by_exactly_one_check() -> None:
    codes = Counter(code for one in declared() for code in one.codes)
    assert codes == {code: 1 for code in CODES if code.startswith("R")}


def test_a_check_is_suppressed_only_by_codes_that_another_one_reports() -> None:
    codes = {code for one in declared() for code in one.codes}
    for one in declared():
        assert one.unless <= codes - set(one.codes), one.codes


@pytest.mark.parametrize("name", RUN)
def test_a_check_runs_after_those_that_suppress_it(name: str) -> None:
    reported = {code for one in reading.FILE_CHECKS for code in one.codes} if name != "FILE_CHECKS" else set()
    if name in ("ORDERED_STEPS", "FINITE_STATE"):
        reported |= {code for one in reading.ANY_RECIPE for code in one.codes}
    for one in RUN[name]:
        assert one.unless <= reported, one.codes
        reported |= set(one.codes)


def test_every_check_of_a_recipe_runs() -> None:
    listed = {id(one) for checks in RUN.values() for one in checks}
    called = {"R001", "R030", "R041", "R043", "R058"}
    """First codes of those that are called where they make or choose something, not only judge."""
    assert {one.codes[0] for one in declared() if id(one) not in listed} == called


RECIPE = """
Prefix: : <http://example.org/fly.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: srdl2-cap: <http://knowrob.org/kb/srdl2-cap.owl#>
Prefix: srdl2-comp: <http://knowrob.org/kb/srdl2-comp.owl#>
Ontology: <http://example.org/fly.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Class: Watch
    SubClassOf: knowrob:Action, knowrob:subAction some Look, {required}
Class: Look
    SubClassOf: knowrob:LookingForSomething
"""


@pytest.fixture
def said(tmp_path: Path, request: pytest.FixtureRequest) -> Diagnostic:
    """What is said of one requirement that nothing defines."""
    kind = "cap:dependsOnCapability" if "Capab" in request.param else "comp:dependsOnComponent"
    space = kind.partition(":")[0]
    path = tmp_path / "watch.omn"
    path.write_text(RECIPE.format(required=f"srdl2-{kind} some srdl2-{space}:{request.param}"), encoding="utf-8")
    (found,) = (one for one in compile_recipe(path).diagnostics if one.code == "R046")
    return found


@pytest.mark.parametrize(
    "said", ["FlyingCapability", "FlyingCapabilty", "PushingCapability", "FlyingComponent"], indirect=True
)
def test_names_that_are_alike_only_in_what_all_of_them_end_with_are_not_taken_for_each_other(said: Diagnostic) -> None:
    assert said.suggestion is None
    assert said.help == "import the file that defines it, or correct the name"


@pytest.mark.parametrize(
    ("said", "meant", "is_sure"),
    [
        ("ArmMotnCapability", "ArmMotionCapability", True),
        ("GraspCapability", "GraspingCapability", False),
        ("NavigatingComponnt", "NavigationComponent", True),
        ("Tilting2DLaserScan", "Tilting2DLaserScanner", True),
    ],
    indirect=["said"],
)
def test_a_name_that_is_like_another_in_what_tells_it_apart_is_a_guess(
    said: Diagnostic, meant: str, is_sure: bool
) -> None:
    assert isinstance(said.suggestion, Rename)
    assert (local_name(said.suggestion.meant), said.suggestion.is_sure) == (meant, is_sure)


@pytest.mark.parametrize("said", ["FlyingCapability"], indirect=True)
def test_whether_a_robot_has_what_nothing_defines_is_not_known(said: Diagnostic) -> None:
    assert (said.severity, "no robot" in said.message) == (Severity.WARNING, False)
    assert said.message == "`Watch` depends on `FlyingCapability`, which is not defined"
