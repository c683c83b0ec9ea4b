"""Orderings that a recipe does not state but probably means, such as picking up before delivering.

They are suggested, never added: an order comes from the recipe or not at all.
"""

from __future__ import annotations

from collections.abc import Iterator

import networkx as nx

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, warning
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import closed, order_graph, recipe_graph, reduced
from planlang.recipe.model import Place, Recipe, Step, Thing

ACQUIRES = ("GraspingSomething", "PickingUpAnObject", "TakingSomething")
DELIVERS = ("PuttingDownAnObject", "PuttingSomethingSomewhere", "HandingOverAnObject")
LETS_GO = ("ReleasingGraspOfSomething", "OpeningAGripper")
MOVES_THE_OBJECT = ("CarryingWhileLocomoting", "LoweringAnObject", "LiftingAnObject")


def check_wisdom(actions: Actions, recipe: Recipe) -> Iterator[Diagnostic]:
    """A warning for each ordering that is missing and probably meant; the orders of the recipe are acyclic.

    Suggestions never contradict the recipe or each other, and none follows from the others.
    """
    stated = recipe_graph(recipe)
    closure = closed(stated)
    wished = nx.DiGraph(closure)
    suggested: dict[tuple[str, str], str] = {}
    steps = list(recipe.steps)
    for first in steps:
        for second in steps:
            why = _why(actions, recipe, first, second) if first is not second else None
            if why is None or wished.has_edge(first.iri, second.iri) or nx.has_path(wished, second.iri, first.iri):
                continue
            wished.add_edge(first.iri, second.iri)
            suggested[first.iri, second.iri] = why
    kept = reduced(order_graph(stated.nodes, wished.edges))
    for before, after in kept.edges:
        if (before, after) in suggested and not closure.has_edge(before, after):
            message = f"nothing puts `{local_name(before)}` before `{local_name(after)}`: {suggested[before, after]}"
            yield warning("R042", message, recipe.step(after).span, ordering_to_write(recipe, before, after))


def _why(actions: Actions, recipe: Recipe, first: Step, second: Step) -> str | None:
    """Why the first step should come before the second; None if there is no reason."""
    acquires = actions.is_a(first, *ACQUIRES)
    is_base = actions.is_base_motion(first)
    if acquires and actions.is_a(second, *DELIVERS, *MOVES_THE_OBJECT):
        return "an object is picked up before it is carried or handed on"
    if acquires and actions.is_a(second, *LETS_GO):
        return "an object is grasped before it is let go"
    if actions.is_a(first, *MOVES_THE_OBJECT) and actions.is_a(second, "PuttingDownAnObject", *LETS_GO):
        return "an object is moved before it is let go"
    if acquires and actions.is_base_motion(second) and not _related(first, second):
        return "an object is picked up before it is carried away"
    if is_base and _related(first, second) and not actions.is_base_motion(second):
        return "the base goes there before the hand reaches there"
    if actions.is_a(first, "Reaching"):
        if actions.is_a(second, *ACQUIRES) and not _has(actions, recipe, *DELIVERS, *LETS_GO):
            return "the hand reaches for an object before it takes it"
        if actions.is_a(second, *LETS_GO) and _has(actions, recipe, *ACQUIRES):
            return "the hand reaches where the object goes before it lets go"
    if actions.is_a(first, "ClosingADoor", "OpeningADoor") and actions.is_a(second, "ReleasingGraspOfSomething"):
        return "a handle is moved before it is let go"
    if actions.is_a(first, "OpeningAGripper") and actions.is_a(second, "ClosingAGripper"):
        return "a gripper is opened before it is closed on something" if actions.is_a(recipe, *ACQUIRES) else None
    if actions.is_a(first, "ClosingAGripper") and actions.is_a(second, "OpeningAGripper"):
        return None if actions.is_a(recipe, *ACQUIRES) else "a gripper is closed on something before it lets go"
    return None


def _has(actions: Actions, recipe: Recipe, *classes: str) -> bool:
    return any(actions.is_a(step, *classes) for step in recipe.steps)


def _related(first: Step, second: Step) -> bool:
    """True if the two steps are about the same thing or place."""
    return not _about(first).isdisjoint(_about(second))


def _about(step: Step) -> set[str]:
    found: set[str] = set()

    def visit(filler: object) -> None:
        if isinstance(filler, Thing):
            found.add(filler.iri or filler.stated)
        elif isinstance(filler, Place):
            found.add(filler.iri)
            for _, reference in filler.relations:
                visit(reference)

    for parameter in step.parameters:
        if parameter.property in ("objectActedOn", "toLocation"):
            visit(parameter.filler)
    return found
