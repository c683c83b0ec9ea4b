"""Location scopes: which steps belong to the place where a base motion leads, and what order that adds.

A step belongs to the last base motion before it. If it is unordered with the next one it is put before it when it has
a location or an object, and stays outside otherwise. A scope is one unit: what is outside comes before or after all
of it, which may add orders; they are returned so that nothing is added silently.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import networkx as nx

from planlang.recipe.actions import Movers
from planlang.recipe.graph import closed, order_graph, reduced, sorted_nodes


@dataclass(frozen=True, slots=True)
class Unit:
    """One step, or a base motion (``base``) with the steps of its scope; ``steps`` leaves out the base motion."""

    base: str | None
    steps: tuple[str, ...]

    def members(self) -> tuple[str, ...]:
        """All steps of the unit, the base motion first."""
        return (self.base, *self.steps) if self.base else self.steps


@dataclass(frozen=True, slots=True)
class Scoping:
    """Units in the order of the file, the graph of their indices, and the orders that were added among steps.

    From ``added`` and the stated orders all orders of the scoped plan follow.
    """

    units: tuple[Unit, ...]
    graph: nx.DiGraph
    added: tuple[tuple[str, str], ...]


def scoping(graph: nx.DiGraph, movers: Movers, placed: frozenset[str]) -> Scoping:
    """Group the steps of an acyclic graph whose movers are totally ordered.

    ``placed`` are the steps that have a location or an object.
    """
    closure = closed(graph)
    ordered: list[str] = sorted_nodes(graph)
    moving = [step for step in ordered if step in movers.opening | movers.ending]
    added = _put_before_next_motion(closure, moving, movers, placed)
    closure = closed(order_graph(graph.nodes, [*graph.edges, *added]))
    scope_of: dict[str, str | None] = {
        step: _scope(closure, moving, movers, step) for step in graph.nodes if step not in moving
    }
    units: list[Unit] = []
    for step in graph.nodes:
        if step in movers.opening:
            units.append(Unit(step, tuple(inner for inner in graph.nodes if scope_of.get(inner) == step)))
        elif step in moving or scope_of[step] is None:
            units.append(Unit(None, (step,)))
    unit_of = {member: index for index, unit in enumerate(units) for member in unit.members()}
    unit_graph = order_graph(range(len(units)), {(unit_of[a], unit_of[b]): None for a, b in closure.edges})
    unit_graph.remove_edges_from([(index, index) for index in list(unit_graph.nodes)])
    together = [
        (a, b) for first, second in unit_graph.edges for a in units[first].members() for b in units[second].members()
    ]
    scoped = reduced(order_graph(graph.nodes, [*closure.edges, *together]))
    stated = closed(graph)
    new = tuple((a, b) for a, b in scoped.edges if not stated.has_edge(a, b))
    return Scoping(tuple(units), unit_graph, new)


def _put_before_next_motion(
    closure: nx.DiGraph, moving: list[str], movers: Movers, placed: frozenset[str]
) -> list[tuple[str, str]]:
    added = []
    for base, following in pairwise(moving):
        if base not in movers.opening:
            continue
        for step in closure.nodes:
            is_between = closure.has_edge(base, step) and not closure.has_edge(following, step)
            if step in placed and step not in moving and is_between and not closure.has_edge(step, following):
                added.append((step, following))
    return added


def _scope(closure: nx.DiGraph, moving: list[str], movers: Movers, step: str) -> str | None:
    before = [base for base in moving if closure.has_edge(base, step)]
    if not before or before[-1] not in movers.opening:
        return None
    following = moving[len(before) :]
    if following and not closure.has_edge(step, following[0]):
        return None
    return before[-1]
