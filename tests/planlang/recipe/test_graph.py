"""Orders as graphs: closure, reduction, shortest cycles; networkx is the oracle."""

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.recipe.order import (
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
