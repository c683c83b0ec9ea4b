"""Where a step that holds resources lets another one go first: once it has in its hand all that it takes.

Between fetching a thing and bringing it, the robot may do something else with its other hand. Not so if the step needs
that hand for a second thing, nor while it works at a place, as in pouring, which no node between two of its steps
interrupts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain

from planlang.compiler.tree import Achieve, Again, Call, Function, Handle, Node, Series, Turn, inside


class Turns:
    """The plan functions of steps that hold resources in turns."""

    def __init__(self) -> None:
        self.bodies: dict[str, Series] = {}
        """Recipe (IRI) -> its body, once that is built: those of callees come first."""
        self._recipes: set[str] = set()

    def among(self, recipes: Iterable[str]) -> bool:
        """Check whether others may go first in one of the recipes of a step (IRIs) that holds resources.

        Notes where: after its step that takes a thing in the hand, if that is not its last, and no other one does so,
        and inside that step.
        """
        found = [self._has(recipe) for recipe in recipes]
        return any(found)

    def _has(self, recipe: str) -> bool:
        gaining = self._gaining(recipe)
        if gaining is None:
            return False
        self._recipes.add(recipe)
        self.among(_called(gaining))
        return True

    def added(self, function: Function) -> Function:
        """Write into a function where others may go first."""
        if function.iri not in self._recipes:
            return function
        gaining = self._gaining(function.iri)
        turn = Turn(gaining.name if isinstance(gaining, Again) else None)
        nodes = chain.from_iterable((node, turn) if node is gaining else (node,) for node in function.body.nodes)
        return replace(function, body=Series(tuple(nodes)))

    def _gaining(self, recipe: str) -> Node | None:
        """Find the step of a recipe after which all that it takes is in the hand; None if no other follows it."""
        nodes = self.bodies[recipe].nodes if recipe in self.bodies else ()
        taking = [node for node in nodes if self._takes(node)]
        is_one = len(taking) == 1 and taking[0] is not nodes[-1] and any(map(_is_held_after, _within(taking[0])))
        return taking[0] if is_one else None

    def _takes(self, node: Node) -> bool:
        """Check whether a thing is in the hand after a node, or after one of the steps below it."""
        called = [call.recipe for call in node.calls] if isinstance(node, Call) else []
        below = (*inside(node), *(self.bodies[recipe] for recipe in called if recipe in self.bodies))
        return _is_held_after(node) or any(map(self._takes, below))


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
