"""Statements of a recipe that can be taken out, as it means the same without them."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.ontology import Ontology, Restriction
from planlang.recipe.check_orderings import constraints_of, follow_from_others
from planlang.recipe.fixes.edits import Edit, Editable, Fix
from planlang.recipe.model import Recipe
from planlang.recipe.readers.partial_order import is_sub_action
from planlang.recipe.statements import Statements, is_word


def removals(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """What may go: constraints that say nothing new, or nothing of a recipe of states, and repeated sub-actions."""
    restrictions = ontology.restrictions(statements.iri)
    stated = {str(one.filler): one for one in restrictions if is_word(one.property, "orderingConstraints")}
    pairs: dict[str, set[tuple[str, str]]] = {}
    for ordering in statements.orderings:
        if ordering.iri in stated:
            pairs.setdefault(ordering.iri, set()).add((ordering.before, ordering.after))
    if statements.is_finite_state:
        for name in pairs:
            message = f"the constraint `{local_name(name)}` of states is taken out"
            yield Fix("R057", message, stated[name].span, _without(ontology, stated[name]))
    else:
        yield from _repeated(ontology, recipe, stated, pairs)
    yield from _twice(recipe, restrictions)


def _repeated(
    ontology: Ontology, recipe: Recipe, stated: dict[str, Restriction], pairs: dict[str, set[tuple[str, str]]]
) -> Iterator[Fix]:
    said: set[tuple[str, str]] = set()
    extra = follow_from_others(recipe)
    for ordering in constraints_of(recipe):
        own = pairs.get(ordering.iri or "", set())
        if ordering.iri is None or not own:
            continue
        restriction = stated[ordering.iri]
        name = local_name(ordering.iri)
        if own <= said:
            yield Fix("R013", f"the repeated `{name}` is taken out", restriction.span, _without(ontology, restriction))
        elif own <= extra:
            message = f"`{name}`, which follows from other orderings, is taken out"
            yield Fix("R014", message, restriction.span, _without(ontology, restriction))
        said |= own
        pairs.pop(ordering.iri)


def _twice(recipe: Recipe, restrictions: tuple[Restriction, ...]) -> Iterator[Fix]:
    """Sub-actions and constraints that are named a second time."""
    seen: set[str] = set()
    for one in restrictions:
        is_constraint = is_word(one.property, "orderingConstraints")
        if not isinstance(one.filler, str) or not (is_constraint or is_sub_action(one)):
            continue
        if one.filler in seen and one.cardinality in (None, 1):
            code, what = ("R013", "constraint") if is_constraint else ("R024", "sub-action")
            message = f"the repeated {what} `{local_name(one.filler)}` of `{recipe.name}` is taken out"
            yield Fix(code, message, one.span, _taken_out(one.span))
        seen.add(one.filler)


def _taken_out(where: Span) -> Callable[[Editable], list[Edit]]:
    return lambda text: text.without(where)


def _without(ontology: Ontology, restriction: Restriction) -> Callable[[Editable], list[Edit]]:
    """Take out a restriction and, if nothing else names it, the individual that it names."""
    name = restriction.filler
    own = ontology.span(name) if isinstance(name, str) else None
    is_used = sum(1 for _ in ontology.triples(o=name)) > 1
    """Other tasks may name it, too."""

    def edit(text: Editable) -> list[Edit]:
        edits = text.without(restriction.span)
        if own is not None and own.file == restriction.span.file and not is_used:
            edits += text.without_individual(own, str(name))
        return edits

    return edit
