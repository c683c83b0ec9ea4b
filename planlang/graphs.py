"""networkx, imported when a graph is first used.

The import takes over a tenth of a second, and few recipes need it: those with states, overlaps, data flow or a cycle,
and drawings; of runs, those in which several detections have the same nearest thing, or goals are of things alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    if name.startswith("__"):  # an import from here asks whether this is a package
        raise AttributeError(name)
    return getattr(import_module("networkx"), name)  # late, as said above


def assigned(costs: Sequence[Mapping[str, float]]) -> list[str | None]:
    """Choose a name from each table of costs, none twice: from as many as possible, with the least sum of costs."""
    nx = import_module("networkx")
    graph = nx.Graph()
    graph.add_weighted_edges_from((row, name, cost) for row, one in enumerate(costs) for name, cost in one.items())
    found = {one: other for pair in nx.min_weight_matching(graph) for one, other in (pair, pair[::-1])}
    return [found.get(row) for row in range(len(costs))]
