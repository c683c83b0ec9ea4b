"""Checks of ordering constraints: complete, about sub-actions, acyclic, and stated once."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from difflib import get_close_matches

from planlang.designators import local_name, told_apart
from planlang.diagnostics import Diagnostic, Span, error, note
from planlang.ontology import Ontology
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.checks.misspellings import guess
from planlang.recipe.model import Ordering, Overlap, Reason, Recipe
from planlang.recipe.order import Intervals, Precedence, recipe_cycle, recipe_order
from planlang.recipe.statements import LooseEnd, Statements


@check("R011")
def incomplete_constraints(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report constraints and transitions that lack an end, or are not described at all."""
    for loose in checked.statements.loose:
        yield _incomplete(checked.ontology, checked.statements, loose)


@check("R015", unless=("R012",))
def contradictions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report orders and overlaps that cannot hold together."""
    recipe = checked.recipe
    found = Intervals(recipe).contradiction() if recipe.overlaps else ()
    if found:
        stated = ", ".join(_in_words(one) for one in found)
        spans = [one.span for one in found if one.span is not None]
        message = f"these cannot all hold in `{recipe.name}`: {stated}"
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
    known = [
        triple.subject
        for word in loose.missing
        for triple in ontology.triples(p=word)
        if isinstance(triple.subject, str)
    ]
    message = f"`{local_name(statements.iri)}` names `{name}`, which has neither {' nor '.join(loose.missing)}"
    meant = guess(loose.what, known)
    return error("R011", message, loose.span, f"did you mean {meant}?" if meant else f"add {both} to it", meant)


@check("R010")
def ordered_strangers(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report names that are ordered but no sub-actions, each once, at its first mention."""
    ontology, statements, recipe = checked.ontology, checked.statements, checked.recipe
    stated = dict.fromkeys(statements.names)
    undefined = [iri for iri in stated if not ontology.defined(iri)]
    mentions: dict[str, list[Ordering | Overlap]] = {}
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
        if undefined:
            other = local_name(undefined[0])
            guess = f"did you mean `{short}` as the sub-action instead of `{other}`, which is not defined?"
        elif similar := get_close_matches(short, [local_name(iri) for iri in stated], n=1):
            guess = f"did you mean `{similar[0]}`?"
        else:
            guess = f"add `subAction some {short}` to `{recipe.name}`, or remove these constraints"
        spans = [span for ordering in orderings for span in [_mention(ontology, ordering, name)] if span is not None]
        constraints = dict.fromkeys(_constraint(ordering) for ordering in orderings)
        message = f"`{short}` is ordered (by {', '.join(constraints)}) but is not a sub-action of `{recipe.name}`"
        yield error("R010", message, min(spans, default=recipe.span), guess)


def _constraint(one: Ordering | Overlap) -> str:
    """Return the constraint of an ordering or overlap, or its description in words."""
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
    """Report constraints that state the same order as an earlier one."""
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
    """Report how many constraints follow from the others, unless the file states all that follow."""
    recipe = checked.recipe
    order = _stated(recipe)
    extra = order.number_of_edges - order.size_of_reduction()
    if extra and order.number_of_pairs() != order.number_of_edges:
        message = f"redundant: {extra} of the {order.number_of_edges} orderings of `{recipe.name}` follow from others"
        yield note("R014", message, recipe.span, "remove them: the plan stays the same")


def _stated(recipe: Recipe) -> Precedence[str]:
    """Return the orders of steps that the file states explicitly; they are acyclic."""
    constraints = tuple(constraints_of(recipe))
    return recipe_order(replace(recipe, orderings=constraints) if len(constraints) < len(recipe.orderings) else recipe)


def follow_from_others(recipe: Recipe) -> frozenset[tuple[str, str]]:
    """Return the stated orders of steps (IRIs) that follow from other stated ones; none if all that follow are stated.

    Some tools state every order that follows; then none is redundant. The orders have to be acyclic, or the
    answer is none.
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
    """Return a help line with the ordering constraint to add, in Manchester syntax."""
    name = f"{recipe.name}_{local_name(before)}_{local_name(after)}"
    a, b = told_apart(before, after)
    facts = f"occursBeforeInOrdering {a}, occursAfterInOrdering {b}"
    return (
        f"add `orderingConstraints value {name}` to `{recipe.name}`"
        f" with `Individual: {name} Types: PartialOrdering-Strict Facts: {facts}`"
    )
