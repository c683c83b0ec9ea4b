"""Graphs of orders as networkx, the oracle of tests, has them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import networkx as nx

from planlang.recipe import order


def order_graph(nodes: Iterable[Any], orderings: Iterable[tuple[Any, Any]]) -> nx.DiGraph:
    """Return the graph of an order."""
    return nx.DiGraph({node: list(after) for node, after in order.order_graph(nodes, orderings).items()})
