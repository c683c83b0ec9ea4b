"""Which fixes a recipe needs: each told apart from its text edits, which a file's syntax makes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Order, Rename, Severity, Span
from planlang.ontology import Ontology
from planlang.ontology.terms import OWL
from planlang.recipe.actions import Actions
from planlang.recipe.fixes.edits import Anchors, CannotEdit, Edit, Editable, Fix
from planlang.recipe.fixes.removals import removals
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.reading import recipes_for
from planlang.recipe.repairs import exchanged_pair
from planlang.recipe.statements import Statements, SubAction, is_word

_ORDERS_UNKNOWN = frozenset({"R010", "R011", "R012", "R020"})
"""Codes of mistakes by which it is not known what the file orders: an order may only seem to be missing."""


def proposed(
    actions: Actions, recipes: RecipeSet | None, unrepaired: RecipeSet | None, diagnostics: tuple[Diagnostic, ...]
) -> list[Fix]:
    """All fixes that a file needs, as read.

    ``unrepaired`` are the recipes before exchanged fillers were taken the right way round.
    """
    ontology = actions.ontology
    fixes = [
        Fix(
            found.code,
            found.message.replace(" is read as ", " becomes "),
            found.span,
            lambda text: text.with_right_terms(),
        )
        for found in diagnostics
        if found.code == "O012" or (found.code == "O013" and found.severity is Severity.ERROR)
    ]
    fixes += _kinds(ontology)
    fixes += renames(ontology, diagnostics)
    broken = _ORDERS_UNKNOWN & {found.code for found in diagnostics}
    if unrepaired is not None:
        for recipe in unrepaired.recipes.values():
            fixes += _exchanges(ontology, recipe)
    if recipes is not None:
        for recipe in recipes.recipes.values():
            statements = actions.statements(recipes_for(actions, recipe.iri)[0][0])
            assert statements is not None
            fixes += _names(ontology, statements, recipe)
            fixes += removals(ontology, statements, recipe)
        if not broken:
            fixes += _orders(actions, recipes, diagnostics)
    return list({(fix.code, fix.message): fix for fix in fixes}.values())


def _kinds(ontology: Ontology) -> Iterator[Fix]:
    """Restrictions with the word for classes about an individual, and the other way round."""
    main = str(ontology.documents[0].path)
    for predicate, kind, code in ((OWL + "someValuesFrom", "value", "O042"), (OWL + "hasValue", "some", "O043")):
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
            message = f"restrictions become such with {kind} about {names}"
            yield Fix(code, message, triples[0].span, _with_kind([triple.span for triple in triples], kind))


def renames(ontology: Ontology, diagnostics: tuple[Diagnostic, ...]) -> Iterator[Fix]:
    """Names that nothing defines become those that are like them: all their mentions in the main document."""
    for found in diagnostics:
        rename = found.suggestion
        if isinstance(rename, Rename):
            triples = [*ontology.triples(o=rename.written), *ontology.triples(p=rename.written)]
            spans = sorted({triple.span for triple in triples if found.span and triple.span.file == found.span.file})
            message = f"`{local_name(rename.written)}` becomes {rename}"
            yield Fix(found.code, message, found.span, _replace(spans, rename), rename.is_sure)


def _exchanges(ontology: Ontology, recipe: Recipe) -> Iterator[Fix]:
    owners: tuple[Recipe | Step, ...] = (recipe, *recipe.steps)
    for owner in owners:
        pair = exchanged_pair(ontology, owner.parameters)
        if pair is None:
            continue
        (first, a), (second, b) = pair
        message = f"{first.property} `{a.name}` and {second.property} `{b.name}` of `{owner.name}` are exchanged"
        where, there = first.span, second.span
        if where is not None and there is not None:
            yield Fix("R030", message, where, _exchange(where, there))


def _names(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """Ordered names that are no sub-actions, where only one sub-action can be meant."""
    stated = {one.iri: one for one in statements.sub_actions if one.iri is not None}
    undefined = [one for iri, one in stated.items() if not ontology.defined(iri)]
    mentioned: dict[str, dict[Span, None]] = {}
    for ordering in recipe.orderings:
        for triple in ontology.triples(s=ordering.iri):
            if isinstance(triple.object, str) and triple.object in {ordering.before, ordering.after} - set(stated):
                mentioned.setdefault(triple.object, {})[triple.span] = None
    strangers = {name: list(spans) for name, spans in mentioned.items()}
    by_name = {local_name(iri): one for iri, one in stated.items() if ontology.defined(iri)}
    for stranger, mentions in strangers.items():
        short = local_name(stranger)
        if ontology.defined(stranger):
            if len(undefined) == len(strangers) == 1:
                wrong = undefined[0]
                message = f"the sub-action `{local_name(wrong.iri or '')}` of `{recipe.name}` becomes `{short}`"
                yield Fix("R010", message, wrong.span, _rename([wrong.span], mentions[0]), is_safe=False)
            continue
        similar = get_close_matches(short, by_name, n=2)
        if len(similar) == 1:
            message = f"`{short}` in the orderings of `{recipe.name}` becomes `{similar[0]}`"
            yield Fix("R010", message, min(mentions), _rename(mentions, by_name[similar[0]].span))


def _orders(actions: Actions, recipes: RecipeSet, diagnostics: tuple[Diagnostic, ...]) -> Iterator[Fix]:
    """Orderings that are missing: those that are wise are safe, of two others it is a guess which way round."""
    for found in diagnostics:
        if isinstance(found.suggestion, Order):
            anchors = _anchors(actions, recipes.recipes[found.suggestion.task], found.suggestion)
            if anchors is not None:
                before, after = local_name(found.suggestion.before), local_name(found.suggestion.after)
                why = found.message.partition(": ")[2] if found.code == "R042" else found.message
                message = f"`{before}` before `{after}`: {why}"
                yield Fix(found.code, message, found.span, _order(anchors), found.code == "R042")


def _anchors(actions: Actions, recipe: Recipe, order: Order) -> Anchors | None:
    """Where the file says what a new ordering refers to; None if it does not say it by sub-actions."""
    ontology = actions.ontology
    stating = recipes_for(actions, recipe.iri)[0][0]
    statements = actions.statements(stating)
    assert statements is not None
    stated: dict[str, SubAction] = {}
    for one in statements.sub_actions:
        if one.iri is not None:
            stated.setdefault(one.iri, one)
    restrictions = ontology.restrictions(stating)
    constraints = [one for one in restrictions if is_word(one.property, "orderingConstraints")]
    subs = [one for one in restrictions if is_word(one.property, "subAction")]
    task = ontology.span(stating)
    if task is None or not subs:
        return None
    last = constraints or subs
    suffix = _free_suffix(ontology, stating, f"_{_plain(order.before)}_{_plain(order.after)}")
    return Anchors(
        task,
        subs[0].span,
        last[-1].span,
        last[-1].form == "flat",
        stated[order.before].span,
        stated[order.after].span,
        suffix,
    )


def _plain(iri: str) -> str:
    return re.sub(r"\W", "_", local_name(iri))


def _free_suffix(ontology: Ontology, stating: str, wanted: str) -> str:
    suffix, number = wanted, 2
    while ontology.defined(stating + suffix):
        suffix, number = f"{wanted}_{number}", number + 1
    return suffix


def _exchange(first: Span, second: Span) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        _same_file(first, second)
        return text.exchanged(first, second)

    return edit


def _rename(places: list[Span], like: Span) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        _same_file(like, *places)
        return [one for place in places for one in text.renamed(place, like)]

    return edit


def _with_kind(places: list[Span], kind: str) -> Callable[[Editable], list[Edit]]:
    return lambda text: [one for place in places for one in text.with_kind(place, kind)]


def _replace(places: list[Span], rename: Rename) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        return [one for place in places for one in text.replaced(place, rename.written, rename.meant)]

    return edit


def _order(anchors: Anchors) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        _same_file(anchors.task, anchors.sub_action, anchors.last, anchors.before, anchors.after)
        return text.with_ordering(anchors)

    return edit


def _same_file(*spans: Span) -> None:
    if len({span.file for span in spans}) > 1:
        raise CannotEdit("it is stated in several files")
