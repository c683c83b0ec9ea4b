"""The dependency graph of a recipe: its orderings as edges, cycles, reduction, closure, total orders."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from itertools import pairwise
from typing import TypeVar

import networkx as nx

from planlang.recipe.model import Recipe
from planlang.recipe.precedence import Precedence

Node = TypeVar("Node", bound=Hashable)


def order_graph(nodes: Iterable[Node], orderings: Iterable[tuple[Node, Node]]) -> nx.DiGraph:
    """A graph with the nodes in the given order and an edge before -> after for each ordering among them."""
    graph = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from((before, after) for before, after in orderings if before in graph and after in graph)
    return graph


def recipe_graph(recipe: Recipe) -> nx.DiGraph:
    """The graph of a recipe: its steps (IRIs) in file order, an edge for each ordering among them.

    It is made once and cannot be changed.
    """
    if "graph" not in recipe.derived:
        pairs = ((ordering.before, ordering.after) for ordering in recipe.orderings)
        recipe.derived["graph"] = nx.freeze(order_graph((step.iri for step in recipe.steps), pairs))
    return recipe.derived["graph"]


def recipe_order(recipe: Recipe) -> Precedence[str]:
    """The order that the graph of a recipe stands for. Raises ValueError if it has a cycle. Worked out once."""
    if "order" not in recipe.derived:
        pairs = ((ordering.before, ordering.after) for ordering in recipe.orderings)
        recipe.derived["order"] = Precedence.of((step.iri for step in recipe.steps), pairs)
    order: Precedence[str] = recipe.derived["order"]
    return order


def recipe_cycle(recipe: Recipe) -> tuple[str, ...] | None:
    """A shortest cycle of the graph of a recipe; None if its orders can be followed. Searched once."""
    if "cycle" not in recipe.derived:
        try:
            recipe_order(recipe)
            recipe.derived["cycle"] = None
        except ValueError:
            recipe.derived["cycle"] = shortest_cycle(recipe_graph(recipe))
    cycle: tuple[str, ...] | None = recipe.derived["cycle"]
    return cycle


def shortest_cycle(graph: nx.DiGraph) -> tuple[Node, ...] | None:
    """A shortest cycle, without its repeated end; among equals the one found from the earliest node.

    Breadth first from each node that is on a cycle, no farther than the shortest cycle known; a node is taken out when
    all cycles through it are known, and with it what then leads nowhere. O(n * m) at worst, O(m) for one long cycle.
    """
    for node in graph.nodes:
        if graph.has_edge(node, node):
            return (node,)
    on_cycles = {node for part in nx.strongly_connected_components(graph) if len(part) > 1 for node in part}
    after = {node: {other: None for other in graph.successors(node) if other in on_cycles} for node in on_cycles}
    before = {node: {other: None for other in graph.predecessors(node) if other in on_cycles} for node in on_cycles}
    best: tuple[Node, ...] | None = None
    for node in graph.nodes:
        if node in after:
            found = _cycle_through(node, after, len(best) - 1 if best else len(after))
            best = found or best
            _take_out(node, after, before)
    return best


Links = dict[Node, dict[Node, None]]


def _cycle_through(start: Node, after: Links[Node], longest: int) -> tuple[Node, ...] | None:
    """A shortest way from a node back to it, of at most ``longest`` nodes."""
    came_from: dict[Node, Node] = {}
    front = [start]
    for _ in range(longest):
        reached: list[Node] = []
        for node in front:
            for other in after[node]:
                if other == start:
                    path = [node]
                    while path[-1] != start:
                        path.append(came_from[path[-1]])
                    return tuple(reversed(path))
                if other not in came_from:
                    came_from[other] = node
                    reached.append(other)
        front = reached
    return None


def _take_out(node: Node, after: Links[Node], before: Links[Node]) -> None:
    """Remove a node, and all that is then on no cycle because nothing leads to it or away from it."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        if one not in after:
            continue
        for forward, backward in ((after, before), (before, after)):
            for other in forward.pop(one):
                if other in backward:
                    del backward[other][one]
                    if not backward[other]:
                        waiting.append(other)


def reduced(graph: nx.DiGraph) -> nx.DiGraph:
    """The transitive reduction of an acyclic graph; nodes and edges in the order of its nodes."""
    order: Precedence[Hashable] = Precedence(graph)
    return order_graph(graph.nodes, order.reduction())


def closed(graph: nx.DiGraph) -> nx.DiGraph:
    """The transitive closure of an acyclic graph; nodes and edges in the order of its nodes.

    For drawing and for small graphs: to ask what comes before what a :class:`Precedence` takes far less room.
    """
    order: Precedence[Hashable] = Precedence(graph)
    rank = {node: index for index, node in enumerate(graph.nodes)}
    return order_graph(
        graph.nodes,
        ((a, b) for a in graph.nodes for b in sorted(order.members(order.later(a)), key=rank.__getitem__)),
    )


def sorted_nodes(graph: nx.DiGraph) -> list[Node]:
    """The linear extension that keeps as close to node order as the graph allows."""
    order: Precedence[Node] = Precedence(graph)
    return list(order.extension)


def total_order(graph: nx.DiGraph) -> tuple[Node, ...] | None:
    """The only linear extension of an acyclic graph, or None if there are several."""
    nodes: list[Node] = sorted_nodes(graph)
    if all(graph.has_edge(a, b) for a, b in pairwise(nodes)):
        return tuple(nodes)
    return None
