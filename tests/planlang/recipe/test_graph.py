"""Orders as graphs, with networkx as the oracle; checks, run in an order that makes suppressing true; R046."""

from __future__ import annotations

import importlib
import pkgutil
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
from planlang.diagnostics import Diagnostic, Rename, Severity
from planlang.recipe import reading
from planlang.recipe.checks import Check
from planlang.recipe.order import (
    Precedence,
    order_graph,
    shortest_cycle,
)
from tests.support.codes import CODES


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
    order: Precedence[int] = Precedence(graph.nodes, graph.edges)
    assert set(order.reduction()) == set(nx.transitive_reduction(graph).edges)
    assert order.size_of_reduction() == len(set(order.reduction()))


@given(partial_orders())
def test_precedence_answers_as_the_closure_does(graph: nx.DiGraph) -> None:
    order: Precedence[int] = Precedence(graph.nodes, graph.edges)
    closure = nx.transitive_closure_dag(graph)
    assert order.number_of_pairs() == closure.number_of_edges()
    for one in graph.nodes:
        assert set(order.members(order.later(one))) == set(closure.successors(one))
        assert set(order.members(order.earlier(one))) == set(closure.predecessors(one))
        assert all(order.before(one, other) == closure.has_edge(one, other) for other in graph.nodes)


def test_a_cycle_is_no_order() -> None:
    with pytest.raises(ValueError, match="cycle"):
        Precedence("AB", [("A", "B"), ("B", "A")])


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
    for node in Precedence(graph.nodes, graph.edges).extension:
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


RUN = {
    name: value
    for name, value in vars(reading).items()
    if name.isupper() and isinstance(value, tuple) and not isinstance(value[0], str)
}
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
    called = {"R001", "R030", "R041", "R043", "R058", "R061"}
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
    """Return what is said of one requirement that nothing defines."""
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
