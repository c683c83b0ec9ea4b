"""The dependency graph of a recipe: closure, reduction, cycles, total orders and blocks."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

import networkx as nx

from planlang.recipe.model import Recipe

Node = TypeVar("Node", bound=Hashable)


def order_graph(nodes: Iterable[Node], orderings: Iterable[tuple[Node, Node]]) -> nx.DiGraph:
    """A graph with the nodes in the given order and an edge before -> after for each ordering among them."""
    graph = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from((before, after) for before, after in orderings if before in graph and after in graph)
    return graph


def recipe_graph(recipe: Recipe) -> nx.DiGraph:
    """The graph of a recipe: its steps (IRIs) in file order, an edge for each ordering among them."""
    return order_graph(
        (step.iri for step in recipe.steps),
        ((ordering.before, ordering.after) for ordering in recipe.orderings),
    )


def shortest_cycle(graph: nx.DiGraph) -> tuple[Node, ...] | None:
    """A shortest cycle, without its repeated end; among equals the one found from the earliest node.

    Only nodes of non-trivial strongly connected components are searched, breadth first: O(n * m) at worst.
    """
    best: list[Node] | None = None
    order = {node: index for index, node in enumerate(graph.nodes)}
    cyclic = [
        component
        for component in nx.strongly_connected_components(graph)
        if len(component) > 1 or any(graph.has_edge(node, node) for node in component)
    ]
    for node in sorted((node for component in cyclic for node in component), key=order.__getitem__):
        if graph.has_edge(node, node):
            return (node,)
        for successor in graph.successors(node):
            try:
                path = nx.shortest_path(graph, successor, node)
            except nx.NetworkXNoPath:
                continue
            if best is None or len(path) < len(best):
                best = [node, *path[:-1]]
    return tuple(best) if best else None


def reduced(graph: nx.DiGraph) -> nx.DiGraph:
    """The transitive reduction of an acyclic graph; nodes and edges in the order of its nodes."""
    return _in_node_order(graph, nx.transitive_reduction(graph))


def closed(graph: nx.DiGraph) -> nx.DiGraph:
    """The transitive closure of an acyclic graph; nodes and edges in the order of its nodes."""
    return _in_node_order(graph, nx.transitive_closure_dag(graph))


def _in_node_order(graph: nx.DiGraph, edges: nx.DiGraph) -> nx.DiGraph:
    """The edges sorted by the nodes of ``graph``: networkx goes through sets, whose order changes from run to run."""
    order = {node: index for index, node in enumerate(graph.nodes)}
    result = nx.DiGraph()
    result.add_nodes_from(graph.nodes)
    result.add_edges_from((a, b) for a in graph.nodes for b in sorted(edges.successors(a), key=order.__getitem__))
    return result


def sorted_nodes(graph: nx.DiGraph) -> list[Node]:
    """The linear extension that keeps as close to node order as the graph allows."""
    order = {node: index for index, node in enumerate(graph.nodes)}
    return list(nx.lexicographical_topological_sort(graph, key=order.__getitem__))


def total_order(graph: nx.DiGraph) -> tuple[Node, ...] | None:
    """The only linear extension of an acyclic graph, or None if there are several."""
    nodes: list[Node] = sorted_nodes(graph)
    if all(graph.has_edge(a, b) for a, b in pairwise(nodes)):
        return tuple(nodes)
    return None


def blocks(graph: nx.DiGraph) -> list[list[Node]]:
    """Split an acyclic graph into the longest series of blocks such that all of one come before all of the next.

    The blocks are the connected components of incomparability; within a block nodes keep their order in the graph.
    """
    closure = closed(graph)
    remaining: Sequence[Node] = sorted_nodes(graph)
    series: list[list[Node]] = []
    block: list[Node] = []
    for index, node in enumerate(remaining):
        block.append(node)
        later = remaining[index + 1 :]
        if all(closure.has_edge(a, b) for a in block for b in later):
            series.append(block)
            block = []
    order = {node: index for index, node in enumerate(graph.nodes)}
    return [sorted(nodes, key=order.__getitem__) for nodes in series]
