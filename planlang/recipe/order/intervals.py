"""Consequences of orders and overlaps of steps, by the beginnings and ends of intervals.

Each step is two points, its beginning before its end. Every relation is a set of ``<`` and ``=`` between points
(:meth:`planlang.recipe.model.Allen.endpoints`), an order is "end < beginning", and no step begins before the recipe or
ends after it. The statements hold together exactly if no cycle of the graph of these has a ``<`` in it (P. van Beek,
1992, for the relations that have no "or" in them).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import networkx as nx

from planlang.recipe.model import End, Ordering, Overlap, Recipe


class Point(NamedTuple):
    """The beginning or the end of a step (IRI)."""

    step: str
    is_end: bool


class Intervals:
    """The points of the steps of a recipe and of the recipe itself, in one graph."""

    def __init__(self, recipe: Recipe) -> None:
        self._steps = [step.iri for step in recipe.steps]
        self._graph = nx.DiGraph()
        known = {recipe.iri, *self._steps}
        for name in (*self._steps, recipe.iri):
            self._add(Point(name, False), Point(name, True), None, is_strict=True)
        for name in self._steps:
            self._add(Point(recipe.iri, False), Point(name, False), None)
            self._add(Point(name, True), Point(recipe.iri, True), None)
        for ordering in recipe.orderings:
            if {ordering.before, ordering.after} <= known - {recipe.iri}:
                self._add(Point(ordering.before, True), Point(ordering.after, False), ordering, is_strict=True)
        for overlap in recipe.overlaps:
            if {overlap.first, overlap.second} <= known:
                self._overlap(overlap)

    def contradiction(self) -> tuple[Ordering | Overlap, ...]:
        """Statements that cannot hold together, each once; empty if all can."""
        for component in nx.strongly_connected_components(self._graph):
            inside = self._graph.subgraph(component)
            strict = sorted((a, b) for a, b, is_strict in inside.edges(data="strict") if is_strict)
            cycles = [nx.shortest_path(inside, b, a) for a, b in strict]
            if cycles:
                cycle = min(cycles, key=len)
                pairs = zip(cycle, [*cycle[1:], cycle[0]], strict=True)
                reasons = (self._graph.edges[a, b]["because"] for a, b in pairs)
                return tuple(dict.fromkeys(reason for reason in reasons if reason is not None))
        return ()

    def implied(self) -> Iterator[tuple[str, str]]:
        """Pairs (before, after) of steps of which one ends before the other begins, stated or not.

        Means nothing if there is a contradiction.
        """
        for first in self._steps:
            later = nx.descendants(self._graph, Point(first, True))
            yield from ((first, other) for other in self._steps if other != first and Point(other, False) in later)

    def _overlap(self, overlap: Overlap) -> None:
        points = {
            End.FIRST_BEGINS: Point(overlap.first, False),
            End.FIRST_ENDS: Point(overlap.first, True),
            End.SECOND_BEGINS: Point(overlap.second, False),
            End.SECOND_ENDS: Point(overlap.second, True),
        }
        for earlier, sign, later in overlap.relation.endpoints():
            self._add(points[earlier], points[later], overlap, is_strict=sign == "<")
            if sign == "=":
                self._add(points[later], points[earlier], overlap)

    def _add(
        self, earlier: Point, later: Point, because: Ordering | Overlap | None, *, is_strict: bool = False
    ) -> None:
        known = self._graph.get_edge_data(earlier, later)
        if known is None or (is_strict and not known["strict"]):
            self._graph.add_edge(earlier, later, strict=is_strict, because=because)


def implied_by_overlaps(recipe: Recipe) -> Iterable[tuple[str, str]]:
    """Return the orders of steps that only overlaps and orders together imply; none if they contradict each other."""
    if not recipe.overlaps:
        return ()
    intervals = Intervals(recipe)
    if intervals.contradiction():
        return ()
    graph = nx.DiGraph((ordering.before, ordering.after) for ordering in recipe.orderings)
    graph.add_nodes_from(step.iri for step in recipe.steps)
    return [pair for pair in intervals.implied() if not nx.has_path(graph, *pair)]
