"""Steps that overlap: which of their beginnings and ends wait for which.

Steps that overlap run side by side. What a relation says about their beginnings and ends
(:meth:`planlang.recipe.model.Allen.endpoints`) becomes gates: a step begins, or counts as ended, only after the events
that it has to wait for. Two that begin or end together each tell that they are ready, and wait for the other.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from planlang.compiler.tree import Event, Gate, Node
from planlang.designators import local_name
from planlang.recipe.model import End, Recipe
from planlang.recipe.order.graph import Precedence

BEGINS, ENDS = "begins", "ends"
READY_TO_BEGIN, READY_TO_END = "is ready to begin", "is ready to end"

_READY = {BEGINS: READY_TO_BEGIN, ENDS: READY_TO_END}


@dataclass(slots=True)
class _Point:
    """The beginning or the end of a step: what it waits for, and what happens together with it."""

    waits: dict[Event, None] = field(default_factory=dict)
    together: dict[Event, None] = field(default_factory=dict)


class Overlaps:
    """The gates of the steps of one recipe; ``order`` is that of its steps (IRIs)."""

    def __init__(self, recipe: Recipe, order: Precedence[str]) -> None:
        self._points: dict[tuple[str, str], _Point] = {}
        self._told: set[Event] = set()
        self._said: dict[str, str] = {}
        """Of a step what the recipe says about how it overlaps others, in words."""
        known = {step.iri for step in recipe.steps}
        for overlap in recipe.overlaps:
            said = f"{overlap.relation.value} {local_name(overlap.second)}"
            self._said[overlap.first] = ", ".join(filter(None, (self._said.get(overlap.first), said)))
            points = {
                End.FIRST_BEGINS: (overlap.first, BEGINS),
                End.FIRST_ENDS: (overlap.first, ENDS),
                End.SECOND_BEGINS: (overlap.second, BEGINS),
                End.SECOND_ENDS: (overlap.second, ENDS),
            }
            if {overlap.first, overlap.second} <= known:
                for one, sign, other in overlap.relation.endpoints():
                    self._relate(points[one], sign, points[other], order)
            elif recipe.iri in (overlap.first, overlap.second):
                for one, sign, other in overlap.relation.endpoints():
                    if sign == "=":
                        self._with_recipe(recipe, points[one], points[other], order)

    def gated(self, step: str, node: Node) -> Node:
        """The node of a step behind its gates; as it is if nothing overlaps the step."""
        if not self._points and not self._told:
            return node
        opens, closes = self._gates(step, BEGINS), self._gates(step, ENDS)
        return Gate(local_name(step), opens, node, closes, self._said.get(step, "")) if opens or closes else node

    def _gates(self, step: str, moment: str) -> tuple[Event | tuple[Event, ...], ...]:
        """First wait, then meet those that are ready, then tell."""
        point = self._points.get((step, moment), _Point())
        gates: list[Event | tuple[Event, ...]] = []
        if point.waits:
            gates.append(tuple(point.waits))
        if point.together:
            gates += [Event(step, _READY[moment]), tuple(point.together)]
        if Event(step, moment) in self._told:
            gates.append(Event(step, moment))
        return tuple(gates)

    def _relate(self, one: tuple[str, str], sign: str, other: tuple[str, str], order: Precedence[str]) -> None:
        if one[0] == other[0] or order.ordered(one[0], other[0]):
            return
        if sign == "=":
            for mine, theirs in ((one, other), (other, one)):
                self._point(mine).together[Event(theirs[0], _READY[theirs[1]])] = None
        else:
            event = Event(*one)
            self._told.add(event)
            self._point(other).waits[event] = None

    def _with_recipe(
        self, recipe: Recipe, one: tuple[str, str], other: tuple[str, str], order: Precedence[str]
    ) -> None:
        """A step that begins with the recipe begins before any other; one that ends with it ends after any other."""
        step, moment = one if other[0] == recipe.iri else other
        for another in recipe.steps:
            if another.iri == step or order.ordered(step, another.iri):
                continue
            if moment == BEGINS and not order.earlier(another.iri):
                self._relate((step, BEGINS), "<", (another.iri, BEGINS), order)
            elif moment == ENDS and not order.later(another.iri):
                self._relate((another.iri, ENDS), "<", (step, ENDS), order)

    def _point(self, point: tuple[str, str]) -> _Point:
        return self._points.setdefault(point, _Point())
