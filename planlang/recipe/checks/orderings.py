"""Checks of orders: constraints must be complete, refer to sub-actions, be acyclic and stated once.

Orders that are probably missing, such as picking up before delivering, are suggested but never added: all orders of a
plan come from the recipe.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

from planlang.closure import grouped, leads_to
from planlang.designators import local_name, local_part, told_apart
from planlang.diagnostics import Diagnostic, Order, Span, error, note, warning
from planlang.kept import kept
from planlang.ontology import BNode, Ontology, Triple, expand
from planlang.ontology.documents import Syntax
from planlang.ontology.terms import OWL, PREFIXES, RDF, RDFS
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.checks.joints import joints
from planlang.recipe.guesses import guess
from planlang.recipe.model import Ordering, Overlap, Reason, Recipe, Step
from planlang.recipe.order import Intervals, Precedence, recipe_cycle, recipe_order
from planlang.recipe.preconditions import Preconditions, iris_in
from planlang.recipe.statements import LooseEnd, Statements
from planlang.records import dataclass
from planlang.spelling import Spellings


@check("R011")
def incomplete_constraints(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report constraints and transitions that lack an end, or have no description at all."""
    for loose in checked.statements.loose:
        yield _incomplete(checked.ontology, checked.statements, loose)


@check("R015", unless=("R012",))
def contradictions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report orders and overlaps that contradict each other."""
    recipe = checked.recipe
    conflicting = Intervals(recipe).contradiction() if recipe.overlaps or recipe.phases else ()
    if conflicting:
        stated = ", ".join(_in_words(one) for one in conflicting)
        spans = [one.span for one in conflicting if one.span is not None]
        message = f"contradiction in `{recipe.name}`: {stated}"
        yield error("R015", message, max(spans, default=recipe.span), "remove one of them")


def _in_words(one: Ordering | Overlap) -> str:
    if isinstance(one, Ordering):
        return f"`{local_name(one.before)}` before `{local_name(one.after)}`"
    return f"`{local_name(one.first)}` {one.relation.value} `{local_name(one.second)}`"


def _incomplete(ontology: Ontology, statements: Statements, loose: LooseEnd) -> Diagnostic:
    name = local_name(loose.what)
    both = " and ".join(loose.missing)
    if len(loose.missing) < 2:
        return error("R011", f"the constraint `{name}` has no {both}", loose.span, f"add {both} to it")
    named = {one.filler for one in ontology.restrictions(statements.iri)}
    named.update(triple.object for triple in ontology.triples(s=statements.iri))
    described = [triple.subject for triple in ontology.using(*loose.missing)]
    candidates = [name for name in described if isinstance(name, str) and name not in named]
    message = f"`{local_name(statements.iri)}` names `{name}`, which has neither {' nor '.join(loose.missing)}"
    suggestion = guess(loose.what, candidates)
    return error(
        "R011", message, loose.span, f"did you mean {suggestion}?" if suggestion else f"add {both} to it", suggestion
    )


@check("R010")
def ordered_strangers(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report names that are ordered but are not sub-actions, each once, at its first mention."""
    ontology, statements, recipe = checked.ontology, checked.statements, checked.recipe
    stated = dict.fromkeys((*statements.names, *statements.phases))
    members = {one.iri: sub.iri or "" for sub in statements.sub_actions for _, one in sub.alternatives}
    undefined = [
        sub.iri for sub in statements.sub_actions if sub.iri and not (sub.alternatives or ontology.defined(sub.iri))
    ]
    mentions: dict[str, list[Ordering | Overlap]] = {}
    names = Spellings(map(local_name, statements.names))
    for ordering in recipe.orderings:
        for name in (ordering.before, ordering.after):
            if name not in stated:
                mentions.setdefault(name, []).append(ordering)
    for overlap in recipe.overlaps:
        for name in (overlap.first, overlap.second):
            if name not in stated and name != recipe.iri:
                mentions.setdefault(name, []).append(overlap)
    for name, orderings in mentions.items():
        short = local_name(name)
        if name in members:
            guess = f"it is an alternative of the step `{local_name(members[name])}`, of which only one is performed"
        elif undefined:
            other = local_name(undefined[0])
            guess = f"did you mean `{short}` as the sub-action instead of `{other}`, which is not defined?"
        elif similar_names := names.similar(short):
            guess = f"did you mean `{similar_names[0]}`?"
        else:
            guess = f"add `subAction some {short}` to `{recipe.name}`, or remove these constraints"
        spans = [span for ordering in orderings for span in [_mention(ontology, ordering, name)] if span is not None]
        constraints = dict.fromkeys(_constraint(ordering) for ordering in orderings)
        message = f"`{short}` is ordered (by {', '.join(constraints)}) but is not a sub-action of `{recipe.name}`"
        yield error("R010", message, min(spans, default=recipe.span), guess)


def _constraint(one: Ordering | Overlap) -> str:
    """Name of an ordering's or overlap's constraint, or its description."""
    return local_name(one.iri) if isinstance(one, Ordering) and one.iri is not None else _in_words(one)


def _mention(ontology: Ontology, one: Ordering | Overlap, name: str) -> Span | None:
    if isinstance(one, Ordering) and one.iri is not None:
        for triple in ontology.triples(s=one.iri):
            if triple.object == name:
                return triple.span
    return one.span


@check("R012")
def cycles(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report a shortest cycle of the orders."""
    recipe = checked.recipe
    cycle = recipe_cycle(recipe)
    if cycle is None:
        return
    pairs = list(zip(cycle, (*cycle[1:], cycle[0]), strict=True))
    edges = [
        next(ordering for ordering in recipe.orderings if (ordering.before, ordering.after) == pair) for pair in pairs
    ]
    names = " < ".join(f"`{local_name(step)}`" for step in (*cycle, cycle[0]))
    where = [f"{_constraint(edge)} (line {edge.span.line})" for edge in edges if edge.span is not None]
    advice = f"remove one of these constraints: {', '.join(where)}" if where else "remove one of these constraints"
    spans = [edge.span for edge in edges if edge.span is not None]
    yield error("R012", f"cycle in ordering constraints: {names}", min(spans, default=recipe.span), advice)


@check("R013")
def repeated_constraints(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report constraints that repeat the order of an earlier one."""
    recipe = checked.recipe
    first: dict[tuple[str, str], Ordering] = {}
    for ordering in constraints_of(recipe):
        earlier = first.setdefault((ordering.before, ordering.after), ordering)
        if earlier is not ordering:
            message = (
                f"`{local_name(ordering.iri or '')}` repeats `{local_name(earlier.iri or '')}`:"
                f" `{local_name(ordering.before)}` < `{local_name(ordering.after)}`"
            )
            yield note("R013", message, ordering.span, "remove one of them")


def constraints_of(recipe: Recipe) -> Iterator[Ordering]:
    """Yield the orderings that the file states explicitly."""
    yield from (ordering for ordering in recipe.orderings if ordering.reason is Reason.CONSTRAINT)


@check("R014", unless=("R012",))
def redundant_constraints(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report how many constraints follow from others, unless the file states the whole transitive closure."""
    recipe = checked.recipe
    order = _stated(recipe)
    extra = order.number_of_edges - order.size_of_reduction()
    if extra and order.number_of_pairs() != order.number_of_edges:
        message = f"redundant: {extra} of the {order.number_of_edges} orderings of `{recipe.name}` follow from others"
        yield note("R014", message, recipe.span, "remove them; the plan stays the same")


def _stated(recipe: Recipe) -> Precedence[str]:
    """Partial order of the steps by the explicitly stated constraints, which must be acyclic."""
    constraints = tuple(constraints_of(recipe))
    return recipe_order(replace(recipe, orderings=constraints) if len(constraints) < len(recipe.orderings) else recipe)


def follow_from_others(recipe: Recipe) -> frozenset[tuple[str, str]]:
    """Stated orders of steps (IRIs) that follow from other stated ones; none if the constraints have a cycle.

    Some tools state the whole transitive closure; then none counts as redundant.
    """
    if recipe_cycle(recipe):
        return frozenset()
    order = _stated(recipe)
    if order.number_of_pairs() == order.number_of_edges:
        return frozenset()
    steps = {step.iri for step in recipe.steps}
    stated = {(one.before, one.after) for one in constraints_of(recipe)}
    return frozenset(pair for pair in stated if steps.issuperset(pair)).difference(order.reduction())


def ordering_to_write(recipe: Recipe, before: str, after: str) -> str:
    """Write the advice to add an ordering constraint, in the syntax of the recipe's file."""
    name = f"{recipe.name}_{local_name(before)}_{local_name(after)}"
    if recipe.syntax in _WRITTEN:
        from planlang.ontology.convert import Target, excerpt  # only for advice: all writers come with it

        own, node = f"{recipe.iri}_{local_name(before)}_{local_name(after)}", BNode("constraint")
        stated: list[tuple[str | BNode, str, str | BNode]] = [
            (recipe.iri, RDFS.subClassOf, node),
            (node, RDF.type, OWL.Restriction),
            (node, OWL.onProperty, expand("orderingConstraints")),
            (node, OWL.hasValue, own),
            (own, RDF.type, expand("PartialOrdering-Strict")),
            (own, expand("occursBeforeInOrdering"), before),
            (own, expand("occursAfterInOrdering"), after),
        ]
        prefixes = {**PREFIXES, "": recipe.iri.removesuffix(local_part(recipe.iri))}
        triples = [Triple(*terms, Span("")) for terms in stated]
        return f"add `{excerpt(triples, Target[recipe.syntax.name], prefixes)}` for `{recipe.name}`"
    a, b = told_apart(before, after)
    facts = f"occursBeforeInOrdering {a}, occursAfterInOrdering {b}"
    return (
        f"add `orderingConstraints value {name}` to `{recipe.name}`"
        f" with `Individual: {name} Types: PartialOrdering-Strict Facts: {facts}`"
    )


_WRITTEN = frozenset({Syntax.RDFXML, Syntax.TURTLE, Syntax.FUNCTIONAL, Syntax.OWLXML})
"""Syntaxes in which advice is written; it is in Manchester syntax otherwise."""

RECURSIVE = ("R022", "R023")
"""Codes of mistakes after which the recipes below a recipe cannot be followed."""

ORDERS_UNKNOWN = ("R010", "R011", "R020")
"""Codes of mistakes after which the stated orders are not known: an order may only seem to be missing."""

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
    "adds": ("AddingSth",),
    "mixes": ("Mixing", "Stirring"),
    "pours": ("FluidFlow-Translation",),
    "heats up": ("PreheatOven",),
    "operates": ("OperateOven",),
    "waits": ("Waiting",),
    "opens a gripper": ("OpeningAGripper",),
    "closes a gripper": ("ClosingAGripper",),
}
"""Role of a step -> classes of actions with this role."""
_CLASSES = {role: frozenset(map(expand, names)) for role, names in ROLES.items()}


WORK = (
    ("adds", "mixes", "ingredients are added before they are mixed"),
    ("picks up", "pours", "a vessel is picked up before something is poured out of it"),
    ("heats up", "delivers", "an oven is heated before something is put into it"),
    ("heats up", "operates", "an oven is heated before it is used"),
    ("delivers", "operates", "something is put into an oven before the oven is used"),
    ("heats up", "waits", "a process is started before the robot waits for it"),
    ("operates", "waits", "a process is started before the robot waits for it"),
    ("delivers", "waits", "an object is put in place before the robot waits"),
)
"""Roles of an earlier and of a later step, and the reason for this order."""


@dataclass(frozen=True, slots=True)
class _Facts:
    """Roles of a step, the things and places (IRIs) that it involves, and those of them that are its location."""

    roles: frozenset[str]
    about: frozenset[str]
    where: frozenset[str] = frozenset()


class _Whole(NamedTuple):
    """Roles of all steps of a recipe, and whether a gripper is opened to grasp, not to let go."""

    roles: list[str]
    grasps: bool


@check("R042", unless=(*RECURSIVE, "R012"))
def missing_orders(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report orderings that are probably missing."""
    recipe = checked.recipe
    for before, after, why in plausible(checked):
        message = f"`{local_name(before)}` should probably come before `{local_name(after)}`: {why}"
        advice = ordering_to_write(recipe, before, after)
        yield warning("R042", message, recipe.step(after).span, advice, Order(recipe.iri, before, after))


def plausible(checked: CheckedRecipe) -> tuple[tuple[str, str, str], ...]:
    """Result of :func:`plausible_orders`, which several checks need."""
    return _plausible(checked.recipe, checked.actions, checked.added)


@kept
def _plausible(
    recipe: Recipe, actions: Actions, added: tuple[tuple[str, str], ...]
) -> tuple[tuple[str, str, str], ...]:
    return tuple(plausible_orders(actions, recipe, added))


def plausible_orders(
    actions: Actions, recipe: Recipe, added: Sequence[tuple[str, str]] = ()
) -> Iterator[tuple[str, str, str]]:
    """Yield orderings that are probably missing: steps (IRIs) before and after, and the reason.

    The orders of the recipe must be acyclic; ``added`` are those of location scopes. Suggestions never contradict the
    recipe or each other, and none follows from the others.
    """
    if numbered := _by_number(recipe):
        stated = {(one.before, one.after) for one in recipe.orderings}
        missing = (pair for pair in pairwise(numbered) if pair not in stated)
        yield from ((before, after, "the steps are numbered in this order") for before, after in missing)
        return
    facts = {step.iri: _facts(actions, step) for step in recipe.steps}
    roles = [role for fact in facts.values() for role in fact.roles]
    # actions such as handing over let go by themselves: then a gripper is opened for the grasp
    whole = _Whole(roles, actions.is_a(recipe, *ROLES["acquires"]) or "delivers" in roles)
    active = [step.iri for step in recipe.steps if facts[step.iri].roles]
    if len(active) < 2:
        return
    order = recipe_order(recipe)

    def reason(first: str, second: str) -> str | None:
        return _why(facts[first], facts[second], whole)

    if joined := joints(actions, recipe, order, reason):
        yield from joined
        return
    rank = {iri: number for number, iri in enumerate(active)}
    users: dict[frozenset[str], int] = {}
    for iri in active:  # steps with equal roles are tested together, as bits
        users[facts[iri].roles] = users.get(facts[iri].roles, 0) | order.bit(iri)
    follows = grouped(order.reduction())
    suggested: dict[tuple[str, str], str] = {}
    for first in active:
        reasonable = sum(bits for roles, bits in users.items() if _may(facts[first].roles, roles, whole))
        unordered = reasonable & ~(order.later(first) | order.earlier(first) | order.bit(first))
        for second in sorted(order.members(unordered), key=rank.__getitem__):
            why = reason(first, second)
            if why is not None and not leads_to(follows, second, first):
                follows.setdefault(first, []).append(second)
                suggested[first, second] = why
    if not suggested:
        yield from joints(actions, recipe, order, reason, single=True)
        return
    # orders of location scopes are weak: the compiler derives them again once the suggestions are accepted
    wider = order.extended(suggested, weak=added)
    yield from (
        (before, after, suggested[before, after]) for before, after in wider.reduction() if (before, after) in suggested
    )


def _by_number(recipe: Recipe) -> list[str]:
    """Steps (IRIs) in the order of the numbers at the end of their names; none if the recipe orders them otherwise."""
    parts = {step.iri: re.fullmatch(r"(.*?)([0-9]{1,9})", step.name) for step in recipe.steps}
    by_number = {(part[1], int(part[2])): iri for iri, part in parts.items() if part is not None}
    if len({prefix for prefix, _ in by_number}) != 1 or len(by_number) < len(recipe.steps):
        return []
    steps = [by_number[key] for key in sorted(by_number)]
    stated = {(one.before, one.after) for one in recipe.orderings}
    return steps if stated <= set(pairwise(steps)) and not recipe.overlaps else []


def _may(first: frozenset[str], second: frozenset[str], whole: _Whole) -> bool:
    """True if steps with these roles should be ordered, at least if they involve the same object."""
    nothing, same = frozenset[str](), frozenset({""})
    return any(
        _why(_Facts(first, about, about), _Facts(second, about, about), whole) is not None for about in (nothing, same)
    )


def _why(first: _Facts, second: _Facts, whole: _Whole) -> str | None:
    """Reason why the first step should come before the second; None if there is none."""
    is_related = not first.about.isdisjoint(second.about)
    a, b = first.roles, second.roles
    if "acquires" in a:
        if b & {"delivers", "carries"}:
            return "an object is picked up before it is carried or delivered"
        if "lets go" in b:
            return "an object is grasped before it is released"
        if "moves the base" in b and not is_related:
            return "an object is picked up before it is carried away"
    for earlier, later, why in WORK:
        if earlier in a and later in b:
            return why
    if "opens a container" in a and b & {"picks up", "closes a container"}:
        return "a container is opened before something is taken out of it"
    if "picks up" in a and "closes a container" in b:
        return "something is taken out of a container before it is closed"
    if "carries" in a and b & {"lets go", "delivers"}:
        return "an object is moved before it is released"
    if "moves the base" in a and "moves the base" not in b and not first.where.isdisjoint(second.where or second.about):
        return "the base drives there before the hand reaches there"
    if "reaches" in a:
        if b & {"acquires", "moves a handle"} and not {"delivers", "lets go"} & set(whole.roles):
            return "the hand reaches for a thing before it grasps it"
        if "lets go" in b and "acquires" in whole.roles:
            return "the hand reaches the target before it releases the object"
    if "moves a handle" in a and "releases" in b:
        return "a handle is moved before it is released"
    if whole.roles.count("opens a gripper") == whole.roles.count("closes a gripper") == 1:
        if whole.grasps and "opens a gripper" in a and "closes a gripper" in b:
            return "a gripper is opened before it is closed on something"
        if not whole.grasps and "closes a gripper" in a and "opens a gripper" in b:
            return "a gripper is closed on something before it releases it"
    return None


_ABOUT = ("objectActedOn", "toLocation", "recipient")


def _facts(actions: Actions, step: Step) -> _Facts:
    above = {*actions.ontology.ancestors(step.action_class)}
    roles = {role for role, classes in _CLASSES.items() if not above.isdisjoint(classes)}
    if actions.is_base_motion(step):
        roles.add("moves the base")
    about = {name: frozenset(one for filler in step.fillers(name) for one in iris_in(filler)) for name in _ABOUT}
    where = about["toLocation"] | about["recipient"]
    return _Facts(frozenset(roles), about["objectActedOn"] | about["toLocation"], where)


@check("R040", unless=(*RECURSIVE, "R012"))
def unordered_base_motions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report consecutive base motions that are not ordered."""
    if not checked.file.scopes:
        return
    recipe = checked.recipe
    order = recipe_order(recipe)
    movers = checked.actions.movers(recipe, checked.file.recipes)
    moving = [step for step in order.extension if step in movers.opening | movers.ending]
    apart = [(first, second) for first, second in pairwise(moving) if not order.before(first, second)]
    suggested = [one[:2] for one in plausible(checked)] if apart else []
    wider = order.extended(suggested, weak=checked.added)
    for first, second in apart:
        one, other = told_apart(first, second)
        message = f"`{one}` and `{other}` both move the base, but are not ordered"
        is_implied = len(suggested) == 1 and wider.ordered(first, second)
        before, after = suggested[0] if is_implied else (first, second)
        advice = ordering_to_write(recipe, before, after)
        yield error("R040", message, recipe.step(second).span, advice, Order(recipe.iri, before, after))


@check("R047", unless=(*RECURSIVE, "R012", *ORDERS_UNKNOWN, "R040", "R042", "R045"))
def free_steps(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps without any order, if the orders have no other problem."""
    recipe = checked.recipe
    if len(recipe.steps) < 2:
        return
    related = {name for one in recipe.orderings for name in (one.before, one.after)}
    related |= {name for one in recipe.overlaps for name in (one.first, one.second)}
    free = [step for step in recipe.steps if step.iri not in related]
    if len(free) == len(recipe.steps):
        message = f"the {len(free)} steps of `{recipe.name}` are not ordered: any order is possible"
        yield note("R047", message, recipe.span, "add ordering constraints if this is not intended")
    elif free:
        names = ", ".join(f"`{step.name}`" for step in free)
        message = f"{names} of `{recipe.name}` {'are' if len(free) > 1 else 'is'} not ordered, unlike other steps"
        yield note("R047", message, free[0].span, "add ordering constraints if this is not intended")


@check("R067", unless=(*RECURSIVE, "R012", *ORDERS_UNKNOWN))
def late_preconditions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps that come before the steps that establish their preconditions."""
    recipe = checked.recipe
    order = recipe_order(recipe)
    if checked.added:
        order = order.extended(checked.added)
    for unmet in Preconditions(checked.actions, recipe).unmet(order.before):
        yield error("R067", str(unmet), recipe.step(unmet.step).span, unmet.advice)
