"""Recoveries that go back: what a step has got hold of may be lost in any later one, until it is let go.

Then the step that got hold of it is run again, and after that the one in which it was lost.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from planlang.compiler.tree import Again, Handle, Node, Parallel, PartialOrder, Recover, Series
from planlang.recipe.model import Thing
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Keeping:
    """The things that the steps of a node get hold of, with the recoveries from its loss, and what they let go."""

    lasting: tuple[Recover, ...] = ()
    let_go: frozenset[Thing | None] = frozenset()
    """None for whatever is held."""
    name: str = ""
    """The name of running the first of these steps again."""
    once: bool = False
    """True if the node must not be run again."""

    def ends(self, recovery: Recover) -> bool:
        """Return True if the thing that a recovery is about is let go."""
        return not self.let_go.isdisjoint({recovery.about, None})

    def __or__(self, other: Keeping) -> Keeping:
        lasting, once = (*self.lasting, *other.lasting), self.once or other.once
        return Keeping(lasting, self.let_go | other.let_go, self.name or other.name, once)


def going_back(node: Node, keeping: Mapping[int, Keeping]) -> tuple[Node, Keeping]:
    """Return a node with its recoveries that go back, and what it still holds at its end.

    ``keeping`` is known of the nodes of steps, by identity. In a series a recovery is written around the node that gets
    hold of a thing and around each later one, up to the first that lets it go; then likewise in the series around.
    """
    match node:
        case Series(nodes):
            made, whole = _series([going_back(inner, keeping) for inner in nodes])
            return Series(made), whole
        case Parallel(branches):
            named, whole = _branches(branches, keeping)
            return Parallel(named), whole
        case PartialOrder(branches, orderings):
            named, whole = _branches(branches, keeping)
            return PartialOrder(named, orderings), whole
    return node, keeping.get(id(node), Keeping())


def _series(parts: Sequence[tuple[Node, Keeping]]) -> tuple[tuple[Node, ...], Keeping]:
    nodes, whole = [node for node, _ in parts], Keeping()
    for first, (node, keeping) in enumerate(parts):
        whole |= Keeping(let_go=keeping.let_go, name=keeping.name, once=keeping.once)
        later: dict[int, list[Recover]] = {}
        for recovery in () if keeping.once else keeping.lasting:
            ends = [number for number in range(first, len(parts)) if parts[number][1].ends(recovery)]
            for number in range(first + 1, ends[0] + 1 if ends else len(parts)):
                if not parts[number][1].once:
                    later.setdefault(number, []).append(replace(recovery, again=keeping.name))
            if not ends:
                whole |= Keeping((recovery,), name=keeping.name)
        # branches have the recoveries already
        if not isinstance(node, (Parallel, PartialOrder)) and not keeping.once:
            nodes[first] = _handled(nodes[first], keeping.lasting)
        if later:
            nodes[first] = Again(keeping.name, nodes[first])
        for number, recoveries in later.items():
            nodes[number] = _handled(nodes[number], recoveries)
    return tuple(nodes), whole


def _handled(node: Node, recoveries: Sequence[Recover]) -> Node:
    """Return a node with recoveries, each of which can let a failure pass to the next one for the same class."""
    for recovery in recoveries:
        if isinstance(node, Handle) and recovery.failure not in {other.failure for other in node.recoveries}:
            node = Handle(node.body, (*node.recoveries, recovery))
        else:
            node = Handle(node, (recovery,))
    return node


def _branches(
    branches: Sequence[tuple[str, Node]], keeping: Mapping[int, Keeping]
) -> tuple[tuple[tuple[str, Node], ...], Keeping]:
    made, whole = [], Keeping()
    for name, branch in branches:
        node, after = going_back(branch, keeping)
        made.append((name, node))
        whole |= after
    return tuple(made), whole
