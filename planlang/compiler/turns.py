"""Where a step that holds resources lets another one go first: once a thing is in its hand.

Between fetching a thing and bringing it, the robot may do something else with its other hand. Not so while a step works
with its hand at a place, as in pouring, which no node between two of its steps interrupts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

from planlang.compiler.tree import Achieve, Again, Call, Function, Handle, Node, Series, Turn


class Turns:
    """The plan functions of steps that hold resources in turns."""

    def __init__(self) -> None:
        self.bodies: dict[str, Series] = {}
        """Recipe (IRI) -> its body, once that is built: those of callees come first."""
        self._recipes: set[str] = set()

    def among(self, recipes: Iterable[str]) -> bool:
        """Check whether others may go first in one of the recipes of a step (IRIs) that holds resources.

        Notes where: after each of its steps but the last one that takes a thing in the hand, and inside that step.
        """
        found = [self._has(recipe) for recipe in recipes]
        return any(found)

    def _has(self, recipe: str) -> bool:
        gaining = _gaining(self.bodies[recipe]) if recipe in self.bodies else []
        if gaining:
            self._recipes.add(recipe)
            self.among(chain.from_iterable(map(_called, gaining)))
        return bool(gaining)

    def added(self, function: Function) -> Function:
        """Write into a function where others may go first."""
        if function.iri not in self._recipes:
            return function
        gaining = _gaining(function.body)
        nodes = chain.from_iterable((node, Turn()) if node in gaining else (node,) for node in function.body.nodes)
        return replace(function, body=Series(tuple(nodes)))


def _gaining(body: Series) -> list[Node]:
    """List the steps of a series, but for the last one, after which a thing is in the hand."""
    return [node for node in body.nodes[:-1] if any(map(_is_held_after, _within(node)))]


def _is_held_after(node: Node) -> bool:
    return isinstance(node, Achieve) and node.condition.predicate == "holding"


def _called(node: Node) -> Iterator[str]:
    """Yield the recipes (IRIs) that the step of a node calls."""
    for one in _within(node):
        if isinstance(one, Call):
            yield from (call.recipe for call in one.calls)


def _within(node: Node) -> Iterator[Node]:
    """Yield a node and what it surrounds, if that is a single step."""
    yield node
    if isinstance(node, (Again, Handle, Achieve)):
        yield from _within(node.body)
