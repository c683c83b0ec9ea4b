"""Orders as graphs: closure, reduction, shortest cycles, blocks."""

from itertools import pairwise, permutations

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.recipe.graph import blocks, closed, order_graph, reduced, shortest_cycle, sorted_nodes, total_order


@st.composite
def partial_orders(draw: st.DrawFn) -> nx.DiGraph:
    """Up to seven nodes in any order, with edges that follow one hidden linear order."""
    size = draw(st.integers(1, 7))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    edges = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return order_graph(range(size), edges)


@given(partial_orders())
def test_reduction_has_the_same_closure_and_no_edge_to_spare(graph: nx.DiGraph) -> None:
    small = reduced(graph)
    assert set(closed(small).edges) == set(closed(graph).edges)
    for edge in list(small.edges):
        fewer = nx.DiGraph(small)
        fewer.remove_edge(*edge)
        assert set(closed(fewer).edges) != set(closed(graph).edges)


@given(partial_orders())
def test_blocks_are_in_series_and_cannot_be_split(graph: nx.DiGraph) -> None:
    series = blocks(graph)
    closure = closed(graph)
    assert sorted(node for block in series for node in block) == sorted(graph.nodes)
    for first, second in pairwise(series):
        assert all(closure.has_edge(a, b) for a in first for b in second)
    for block in series:
        incomparable = nx.Graph()
        incomparable.add_nodes_from(block)
        pairs = permutations(block, 2)
        incomparable.add_edges_from(
            (a, b) for a, b in pairs if not closure.has_edge(a, b) and not closure.has_edge(b, a)
        )
        assert nx.is_connected(incomparable)


@given(partial_orders())
def test_total_order_is_found_exactly_when_there_is_one_linear_extension(graph: nx.DiGraph) -> None:
    extensions = list(nx.all_topological_sorts(graph)) if graph.number_of_nodes() < 6 else None
    if extensions is not None:
        only = tuple(extensions[0]) if len(extensions) == 1 else None
        assert total_order(graph) == only


@given(partial_orders())
def test_sorted_nodes_keep_file_order_among_the_ready_ones(graph: nx.DiGraph) -> None:
    done: set[int] = set()
    for node in sorted_nodes(graph):
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
