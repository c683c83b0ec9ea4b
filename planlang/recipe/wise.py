"""Orderings that a recipe does not state but probably means, such as picking up before delivering.

They are suggested, never added: an order comes from the recipe or not at all.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import networkx as nx

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Order, warning
from planlang.ontology import shorten
from planlang.recipe.actions import Actions
from planlang.recipe.check_orderings import ordering_to_write
from planlang.recipe.graph import order_graph, recipe_graph, recipe_order
from planlang.recipe.model import Filler, Place, Recipe, Step, Thing
from planlang.recipe.precedence import Precedence

ROLES: dict[str, tuple[str, ...]] = {
    "acquires": ("GraspingSomething", "PickingUpAnObject", "TakingSomething"),
    "delivers": ("PuttingDownAnObject", "PuttingSomethingSomewhere", "HandingOverAnObject"),
    "lets go": ("ReleasingGraspOfSomething", "OpeningAGripper"),
    "releases": ("ReleasingGraspOfSomething",),
    "carries": ("CarryingWhileLocomoting", "LoweringAnObject", "LiftingAnObject"),
    "reaches": ("Reaching",),
    "moves a handle": ("OpeningADoor", "ClosingADoor", "OpeningADrawer", "ClosingADrawer"),
    "picks up": ("PickingUpAnObject",),
    "opens a container": ("OpeningAContainerArtifact",),
    "closes a container": ("ClosingAContainerArtifact",),
    "opens a gripper": ("OpeningAGripper",),
    "closes a gripper": ("ClosingAGripper",),
}
"""What a step does, told by its action class."""

BASE = "moves the base"


@dataclass(frozen=True, slots=True)
class _Facts:
    """What a step does and which things and places (IRIs) it is about."""

    roles: frozenset[str]
    about: frozenset[str]


def check_wisdom(actions: Actions, recipe: Recipe, added: Sequence[tuple[str, str]] = ()) -> Iterator[Diagnostic]:
    """A warning for each ordering that is missing and probably meant; the orders of the recipe are acyclic.

    ``added`` are the orders that location scopes add.
    """
    for before, after, why in wise_orderings(actions, recipe, added):
        message = f"nothing puts `{local_name(before)}` before `{local_name(after)}`: {why}"
        advice = ordering_to_write(recipe, before, after)
        yield warning("R042", message, recipe.step(after).span, advice, Order(recipe.iri, before, after))


def wise_orderings(
    actions: Actions, recipe: Recipe, added: Sequence[tuple[str, str]] = ()
) -> Iterator[tuple[str, str, str]]:
    """The orderings that are missing and probably meant: steps (IRIs) before and after, and why.

    The orders of the recipe are acyclic; ``added`` come from elsewhere. Suggestions never contradict the recipe or each
    other, and none follows from the others.
    """
    facts = {step.iri: _facts(actions, step) for step in recipe.steps}
    all_roles = [role for fact in facts.values() for role in fact.roles]
    grasps = actions.is_a(recipe, *ROLES["acquires"])
    active = [step.iri for step in recipe.steps if facts[step.iri].roles]
    if len(active) < 2:
        return
    stated = recipe_graph(recipe)
    if added:
        stated = order_graph(stated.nodes, [*stated.edges, *added])
    order = recipe_order(recipe)
    rank = {iri: number for number, iri in enumerate(active)}
    users: dict[frozenset[str], int] = {}
    """The bits of the steps that do the same."""
    for iri in active:
        users[facts[iri].roles] = users.get(facts[iri].roles, 0) | order.bit(iri)
    wished = nx.DiGraph(stated)
    suggested: dict[tuple[str, str], str] = {}
    for first in active:
        reasonable = sum(bits for roles, bits in users.items() if _may(facts[first].roles, roles, all_roles, grasps))
        unordered = reasonable & ~(order.later(first) | order.earlier(first) | order.bit(first))
        for second in sorted(order.members(unordered), key=rank.__getitem__):
            why = _why(facts[first], facts[second], all_roles, grasps=grasps)
            if why is not None and not nx.has_path(wished, second, first):
                wished.add_edge(first, second)
                suggested[first, second] = why
    if suggested:
        wider: Precedence[str] = Precedence(wished)
        yield from (
            (before, after, suggested[before, after])
            for before, after in wider.reduction()
            if (before, after) in suggested
        )


def _may(first: frozenset[str], second: frozenset[str], all_roles: list[str], grasps: bool) -> bool:
    """True if steps that do this and that should be in order, at least when they are about the same."""
    nothing, same = frozenset[str](), frozenset({""})
    return any(
        _why(_Facts(first, about), _Facts(second, about), all_roles, grasps=grasps) is not None
        for about in (nothing, same)
    )


def _why(first: _Facts, second: _Facts, all_roles: list[str], *, grasps: bool) -> str | None:
    """Why the first step should come before the second; None if there is no reason.

    ``all_roles`` are the roles of all steps, ``grasps`` tells whether the recipe as a whole gets hold of something.
    """
    is_related = not first.about.isdisjoint(second.about)
    a, b = first.roles, second.roles
    if "acquires" in a:
        if b & {"delivers", "carries"}:
            return "an object is picked up before it is carried or handed on"
        if "lets go" in b:
            return "an object is grasped before it is let go"
        if BASE in b and not is_related:
            return "an object is picked up before it is carried away"
    if "opens a container" in a and b & {"picks up", "closes a container"}:
        return "a container is opened before something is taken out of it"
    if "picks up" in a and "closes a container" in b:
        return "something is taken out of a container before that is closed"
    if "carries" in a and b & {"lets go", "delivers"}:
        return "an object is moved before it is let go"
    if BASE in a and BASE not in b and is_related:
        return "the base goes there before the hand reaches there"
    if "reaches" in a:
        if b & {"acquires", "moves a handle"} and not {"delivers", "lets go"} & set(all_roles):
            return "the hand reaches for a thing before it takes hold of it"
        if "lets go" in b and "acquires" in all_roles:
            return "the hand reaches where the object goes before it lets go"
    if "moves a handle" in a and "releases" in b:
        return "a handle is moved before it is let go"
    if all_roles.count("opens a gripper") == all_roles.count("closes a gripper") == 1:
        if grasps and "opens a gripper" in a and "closes a gripper" in b:
            return "a gripper is opened before it is closed on something"
        if not grasps and "closes a gripper" in a and "opens a gripper" in b:
            return "a gripper is closed on something before it lets go"
    return None


def _facts(actions: Actions, step: Step) -> _Facts:
    above = {shorten(ancestor) for ancestor in actions.ontology.ancestors(step.action_class)}
    roles = {role for role, classes in ROLES.items() if not above.isdisjoint(classes)}
    if actions.is_base_motion(step):
        roles.add(BASE)
    about: set[str] = set()
    for parameter in step.parameters:
        if parameter.property in ("objectActedOn", "toLocation"):
            about.update(_named(parameter.filler))
    return _Facts(frozenset(roles), frozenset(about))


def _named(filler: Filler) -> Iterator[str]:
    if isinstance(filler, Thing):
        yield filler.iri or filler.stated
    elif isinstance(filler, Place):
        yield filler.iri
        for _, reference in filler.relations:
            yield from _named(reference)
