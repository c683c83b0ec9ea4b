"""From an order to constructs: what is one after another, side by side, or a partial order of its own."""

from __future__ import annotations

from collections.abc import Sequence

import networkx as nx

from planlang.compiler.naming import Names, snake_case
from planlang.compiler.tree import Node, Parallel, PartialOrder, Series
from planlang.recipe.order.decomposition import Parallel as ParallelPart
from planlang.recipe.order.decomposition import Part, Prime, Serial, decomposed

MOST_NESTED = 3
"""How deep constructs stand in each other: what is nested deeper is one partial order, which says the same."""

LONGEST_NAME = 50
"""Characters in the name of a branch of several steps."""


def structured(small: nx.DiGraph, nodes: Sequence[Node], names: Sequence[str]) -> Series:
    """Nodes in the order of a reduced graph of their indices; ``names`` are what branches are called by.

    The constructs allow exactly the orders that the graph allows.
    """
    return _Structure(small, nodes, names).series(decomposed(small, MOST_NESTED + 1))


class _Structure:
    def __init__(self, small: nx.DiGraph, nodes: Sequence[Node], names: Sequence[str]) -> None:
        self._small = small
        self._nodes = nodes
        known = Names()
        self._names = [known.claim(snake_case(name), is_key=True) for name in names]
        self._known = known

    def series(self, part: Part | None) -> Series:
        """The statements of a whole order."""
        if part is None:
            return Series(())
        node = self._node(part, 0)
        return node if isinstance(node, Series) else Series((node,))

    def _node(self, part: Part, depth: int) -> Node:
        if isinstance(part, int):
            return self._nodes[part]
        if depth > MOST_NESTED and not all(isinstance(inner, int) for inner in part.parts):
            return self._flat(part)
        match part:
            case Serial(parts):
                return Series(tuple(self._node(inner, depth + 1) for inner in parts))
            case ParallelPart(parts):
                return Parallel(tuple((self._name(inner), self._node(inner, depth + 1)) for inner in parts))
            case Prime(parts, orderings):
                names = [self._name(inner) for inner in parts]
                branches = tuple(zip(names, (self._node(inner, depth + 1) for inner in parts), strict=True))
                return PartialOrder(branches, tuple((names[a], names[b]) for a, b in orderings))
        raise TypeError(f"no part of an order: {part}")

    def _flat(self, part: Part) -> Node:
        """All leaves of a part in one construct."""
        leaves = sorted(_leaves(part))
        inside = frozenset(leaves)
        branches = tuple((self._names[leaf], self._nodes[leaf]) for leaf in leaves)
        pairs = [(a, b) for a in leaves for b in sorted(self._small.successors(a)) if b in inside]
        if not pairs:
            return Parallel(branches)
        return PartialOrder(branches, tuple((self._names[a], self._names[b]) for a, b in pairs))

    def _name(self, part: Part) -> str:
        """The name of a branch: of its step, or made of the names of its first and last ones."""
        if isinstance(part, int):
            return self._names[part]
        leaves = _leaves(part)
        first, last = self._names[leaves[0]], self._names[leaves[-1]]
        if isinstance(part, Serial):
            name = f"{first}_then_{last}" if len(leaves) == 2 else f"{first}_to_{last}"
        else:
            name = f"{first}_and_{last}" if len(leaves) == 2 else f"{first}_and_others"
        return self._known.claim(name if len(name) <= LONGEST_NAME else f"{first}_and_more", is_key=True)


def _leaves(part: Part) -> list[int]:
    """The leaves of a part, in the order of its parts."""
    found: list[int] = []
    waiting = [part]
    while waiting:
        one = waiting.pop()
        if isinstance(one, int):
            found.append(one)
        else:
            waiting += reversed(one.parts)
    return found
