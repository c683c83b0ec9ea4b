"""Fixes for the diagnostics of a recipe, independent of the syntax of the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from operator import methodcaller
from typing import TypeVar

from planlang.designators import local_name
from planlang.diagnostics import Declaration, Diagnostic, Order, Rename, Severity, Span
from planlang.ontology import Ontology, Restriction
from planlang.ontology.terms import OWL
from planlang.recipe.actions import Actions, statements_for
from planlang.recipe.checks.orderings import constraints_of, follow_from_others
from planlang.recipe.checks.parameters import exchanged_pair, unused_designators
from planlang.recipe.checks.steps import unlisted_states
from planlang.recipe.fixes import Fix
from planlang.recipe.fixes.manchester_text import CannotEdit, Edit, ManchesterText, Place
from planlang.recipe.model import Recipe, RecipeSet, Step, Thing
from planlang.recipe.readers.partial_order import is_sub_action
from planlang.recipe.statements import Statements, is_word
from planlang.spelling import similar

_T = TypeVar("_T")

_ORDERS_UNKNOWN = frozenset({"R010", "R011", "R012", "R020"})
"""Codes of mistakes after which the stated orders are not known: an order may only seem to be missing."""


def propose_fixes(
    actions: Actions, recipes: RecipeSet | None, unrepaired: RecipeSet | None, diagnostics: tuple[Diagnostic, ...]
) -> list[Fix]:
    """Propose all fixes for a file, each once.

    ``unrepaired`` are the recipes before swapped fillers were corrected.
    """
    ontology = actions.ontology
    fixes = [
        Fix(problem.code, problem.message.replace(" is read as ", " becomes "), problem.span, None)
        for problem in diagnostics
        if problem.code == "O012" or (problem.code == "O013" and problem.severity is Severity.ERROR)
    ]
    fixes += [*declarations(diagnostics), *_kinds(ontology), *renames(ontology, diagnostics), *_unused(ontology)]
    if unrepaired is not None:
        for recipe in unrepaired.recipes.values():
            fixes += _exchanges(ontology, recipe)
            if recipes is not None:
                fixes += _bindings(ontology, recipe, recipes.recipes[recipe.iri])
    if recipes is not None:
        for recipe in recipes.recipes.values():
            statements = statements_for(actions, recipe.iri)
            fixes += _names(ontology, statements, recipe)
            fixes += _removals(ontology, statements, recipe)
            fixes += _states(ontology, statements, recipe)
        if _ORDERS_UNKNOWN.isdisjoint(problem.code for problem in diagnostics):
            fixes += _orders(actions, recipes, diagnostics)
    return list({(fix.code, fix.message): fix for fix in fixes}.values())


def _kinds(ontology: Ontology) -> Iterator[Fix]:
    """Replace `some` by `value` in restrictions to individuals, and `value` by `some` in those to classes."""
    main = str(ontology.documents[0].path)
    for predicate, kind, code in ((OWL.someValuesFrom, "value", "O042"), (OWL.hasValue, "some", "O043")):
        triples = [
            triple
            for triple in ontology.triples(p=predicate)
            if triple.span.file == main
            and isinstance(triple.object, str)
            and ontology.is_class(triple.object) == (kind == "some")
            and ontology.is_individual(triple.object) == (kind == "value")
        ]
        if triples:
            names = ", ".join(dict.fromkeys(f"`{local_name(str(triple.object))}`" for triple in triples))
            message = f"restrictions on {names} use {kind}"
            spans = [triple.span for triple in triples]

            def edit(text: ManchesterText, spans: list[Span] = spans, kind: str = kind) -> list[Edit]:
                return [one for span in spans for one in text.with_kind(span, kind)]

            yield Fix(code, message, spans[0], edit)


def renames(ontology: Ontology, diagnostics: tuple[Diagnostic, ...]) -> Iterator[Fix]:
    """Replace undefined names by similar ones, in all their mentions in the main document."""
    for problem in diagnostics:
        rename = problem.suggestion
        if isinstance(rename, Rename):
            triples = [*ontology.triples(o=rename.written), *ontology.triples(p=rename.written)]
            spans = sorted(
                {triple.span for triple in triples if problem.span and triple.span.file == problem.span.file}
            )

            def edit(text: ManchesterText, rename: Rename = rename, spans: list[Span] = spans) -> list[Edit]:
                return [one for span in spans for one in text.replaced(span, rename.written, rename.meant)]

            message = f"`{local_name(rename.written)}` becomes {rename}"
            yield Fix(problem.code, message, problem.span, edit, rename.is_sure)


def declarations(diagnostics: tuple[Diagnostic, ...]) -> Iterator[Fix]:
    """Write out undeclared entities of XML: those with one known value, and those whose value is a guess."""
    undeclared = [(one.suggestion, one) for one in diagnostics if isinstance(one.suggestion, Declaration)]
    for is_sure in (True, False):
        group = [(change, one) for change, one in undeclared if change.is_sure == is_sure]
        if group:
            names = ", ".join(f"`&{change.entity};`" for change, _ in group)
            yield Fix("O016", f"{names} written out", group[0][1].span, None, is_sure)


def _exchanges(ontology: Ontology, recipe: Recipe) -> Iterator[Fix]:
    """Swap fillers that were given for each other's property."""
    owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
    for owner in owners:
        pair = exchanged_pair(ontology, owner.parameters)
        if pair is not None:
            (first, a), (second, b) = pair
            message = f"{first.property} `{a.name}` and {second.property} `{b.name}` of `{owner.name}` are swapped"
            if first.span is not None and second.span is not None:
                yield Fix("R030", message, first.span, methodcaller("exchanged", first.span, second.span))


def _names(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """Rename ordered names that are not sub-actions, if only one sub-action is plausible."""
    stated = {one.iri: one for one in statements.sub_actions if one.iri is not None}
    undefined = [one for iri, one in stated.items() if not ontology.defined(iri)]
    strangers: dict[str, dict[Span, None]] = {}
    for ordering in recipe.orderings:
        for triple in ontology.triples(s=ordering.iri):
            if isinstance(triple.object, str) and triple.object in {ordering.before, ordering.after} - set(stated):
                strangers.setdefault(triple.object, {})[triple.span] = None
    by_name = {local_name(iri): one for iri, one in stated.items() if ontology.defined(iri)}
    for stranger, spans in strangers.items():
        short, mentions = local_name(stranger), list(spans)
        if ontology.defined(stranger):
            if len(undefined) == len(strangers) == 1:
                wrong = undefined[0]
                message = f"the sub-action `{local_name(wrong.iri or '')}` of `{recipe.name}` becomes `{short}`"
                yield Fix("R010", message, wrong.span, _renamed([wrong.span], mentions[0]), is_safe=False)
            continue
        similar_names = similar(short, by_name, n=2)
        if len(similar_names) == 1:
            message = f"`{short}` in the orderings of `{recipe.name}` becomes `{similar_names[0]}`"
            yield Fix("R010", message, min(mentions), _renamed(mentions, by_name[similar_names[0]].span))


def _renamed(places: list[Span], like: Span) -> Callable[[ManchesterText], list[Edit]]:
    return lambda text: [one for place in places for one in text.renamed(place, like)]


def _orders(actions: Actions, recipes: RecipeSet, diagnostics: tuple[Diagnostic, ...]) -> Iterator[Fix]:
    """Add suggested orderings; they are uncertain, because the file does not state them."""
    ontology = actions.ontology
    for problem in diagnostics:
        order = problem.suggestion
        if not isinstance(order, Order):
            continue
        statements = statements_for(actions, recipes.recipes[order.task].iri)
        heads = {one.iri: one.span for one in reversed(statements.sub_actions)}
        before, after = local_name(order.before), local_name(order.after)
        why = problem.message.partition(": ")[2] if problem.code == "R042" else problem.message
        suffix = base_suffix = re.sub(r"\W", "_", f"_{before}_{after}")
        number = 1
        while ontology.defined(statements.iri + suffix):
            number += 1
            suffix = f"{base_suffix}_{number}"
        place = _place(ontology, statements.iri, "orderingConstraints")
        ends = heads[order.before], heads[order.after]

        def edit(
            text: ManchesterText, place: Place | None = place, ends: tuple[Span, Span] = ends, suffix: str = suffix
        ) -> list[Edit]:
            return text.with_ordering(_listed(place), *ends, suffix)

        yield Fix(problem.code, f"`{before}` before `{after}`: {why}", problem.span, edit, is_safe=False)


def _place(ontology: Ontology, stating: str, *words: str) -> Place | None:
    """Position for a new restriction of a class: after the last one with one of the words, else after the sub-actions.

    None if no restrictions list sub-actions.
    """
    restrictions = ontology.restrictions(stating)
    subs = [one for one in restrictions if is_sub_action(one)]
    task = ontology.span(stating)
    if task is None or not subs:
        return None
    last = ([one for one in restrictions if is_word(one.property, *words)] or subs)[-1]
    return Place(task, subs[0].span, local_name(subs[0].property), last.span, last.form == "flat")


def _listed(place: _T | None) -> _T:
    if place is None:
        raise CannotEdit("the sub-actions are not listed in restrictions of a class")
    return place


def _states(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """Make sub-actions of states that are not listed as such although others are."""
    place = _place(ontology, statements.iri)
    for name, mention in unlisted_states(ontology, statements):
        message = f"the state `{local_name(name)}` becomes a sub-action of `{recipe.name}`"
        head, kind = ontology.span(name), "some" if ontology.is_class(name) else "value"

        def edit(text: ManchesterText, head: Span | None = head, kind: str = kind) -> list[Edit]:
            return text.with_sub_action(_listed(place), _listed(head), kind)

        yield Fix("R051", message, mention or recipe.span, edit)


def _bindings(ontology: Ontology, unrepaired: Recipe, repaired: Recipe) -> Iterator[Fix]:
    """Name the individuals that replaced things given by their class."""
    owners: tuple[tuple[Recipe | Step, Recipe | Step], ...] = (
        (unrepaired, repaired),
        *zip(unrepaired.steps, repaired.steps, strict=True),
    )
    for stated, bound in owners:
        if exchanged_pair(ontology, stated.parameters) is not None:
            continue
        for before, after in zip(stated.parameters, bound.parameters, strict=False):  # inherited ones come last
            thing, only, where = before.filler, after.filler, before.span
            if not isinstance(thing, Thing) or not isinstance(only, Thing) or thing.iri is not None or where is None:
                continue
            if only.iri is not None:

                def edit(
                    text: ManchesterText, at: Span = where, cls: str = thing.stated, name: str = only.iri
                ) -> list[Edit]:
                    return [*text.replaced(at, cls, name), *text.with_kind(at, "value")]

                message = f"{before.property} of `{stated.name}` becomes `{only.name}` instead of any `{thing.name}`"
                yield Fix("R034", message, where, edit, is_safe=False)


def _unused(ontology: Ontology) -> Iterator[Fix]:
    """Remove unused location designators and things; uncertain, because another file may use them."""
    for what, names in zip(("location designator", "thing"), unused_designators(ontology), strict=True):
        for name in names:
            span = ontology.span(name)
            if span is not None:
                message, edit = f"the unused {what} `{local_name(name)}` is removed", "without_individual"
                yield Fix("R039", message, span, methodcaller(edit, span, name), is_safe=False)


def _removals(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """Remove repeated sub-actions, constraints without effect, and all constraints of a recipe with states."""
    restrictions = ontology.restrictions(statements.iri)
    stated = {str(one.filler): one for one in restrictions if is_word(one.property, "orderingConstraints")}
    pairs: dict[str, set[tuple[str, str]]] = {}
    for ordering in statements.orderings:
        if ordering.iri in stated:
            pairs.setdefault(ordering.iri, set()).add((ordering.before, ordering.after))
    if statements.states is not None:
        for name in pairs:
            message = f"the constraint `{local_name(name)}` of states is removed"
            yield _removal("R057", message, ontology, stated[name])
    else:
        yield from _repeated(ontology, recipe, stated, pairs)
    yield from _twice(recipe, restrictions)


def _repeated(
    ontology: Ontology, recipe: Recipe, stated: dict[str, Restriction], pairs: dict[str, set[tuple[str, str]]]
) -> Iterator[Fix]:
    """Remove constraints that repeat others or follow from them."""
    stated_pairs: set[tuple[str, str]] = set()
    extra = follow_from_others(recipe)
    for ordering in constraints_of(recipe):
        own = pairs.pop(ordering.iri or "", set())
        if ordering.iri is None or not own:
            continue
        name = local_name(ordering.iri)
        if own <= stated_pairs:
            yield _removal("R013", f"the repeated `{name}` is removed", ontology, stated[ordering.iri])
        elif own <= extra:
            message = f"`{name}`, which follows from other orderings, is removed"
            yield _removal("R014", message, ontology, stated[ordering.iri])
        stated_pairs |= own


def _twice(recipe: Recipe, restrictions: tuple[Restriction, ...]) -> Iterator[Fix]:
    """Remove sub-actions and constraints that are named a second time."""
    seen: set[str] = set()
    for one in restrictions:
        is_constraint = is_word(one.property, "orderingConstraints")
        if not isinstance(one.filler, str) or not (is_constraint or is_sub_action(one)):
            continue
        if one.filler in seen and one.cardinality in (None, 1):
            code, what = ("R013", "constraint") if is_constraint else ("R024", "sub-action")
            message = f"the repeated {what} `{local_name(one.filler)}` of `{recipe.name}` is removed"
            yield Fix(code, message, one.span, methodcaller("without", one.span))
        seen.add(one.filler)


def _removal(code: str, message: str, ontology: Ontology, restriction: Restriction) -> Fix:
    """Fix that removes a restriction and, unless something else refers to it, the individual that it names."""
    name, span = restriction.filler, restriction.span
    head = ontology.span(name) if isinstance(name, str) else None
    is_used = sum(1 for _ in ontology.triples(o=name)) > 1  # by another task, too

    def edit(text: ManchesterText) -> list[Edit]:
        is_whole = head is not None and head.file == span.file and not is_used
        return [*text.without(span), *(text.without_individual(head, str(name)) if head and is_whole else ())]

    return Fix(code, message, span, edit)
