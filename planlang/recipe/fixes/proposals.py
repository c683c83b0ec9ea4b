"""Which fixes a recipe needs: each told apart from its text edits, which a file's syntax makes."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span
from planlang.ontology import Ontology
from planlang.recipe.actions import Actions
from planlang.recipe.fixes.edits import Anchors, CannotEdit, Edit, Editable
from planlang.recipe.model import Recipe, RecipeSet, Step
from planlang.recipe.reading import recipes_for
from planlang.recipe.repairs import exchanged_pair
from planlang.recipe.scopes import added_by_scopes
from planlang.recipe.statements import Statements, SubAction, is_word
from planlang.recipe.wise import wise_orderings

_ORDERS_UNKNOWN = frozenset({"R010", "R011", "R012", "R020"})
"""Codes of mistakes by which it is not known what the file orders: an order may only seem to be missing."""


@dataclass(frozen=True, slots=True)
class Fix:
    """A fix that would silence diagnostics of ``code``: what it does, where, and how.

    What is not safe is a guess at what was meant, which a person has to accept.
    """

    code: str
    message: str
    span: Span | None
    edit: Callable[[Editable], list[Edit]]
    is_safe: bool = True


def proposed(
    actions: Actions, recipes: RecipeSet | None, unrepaired: RecipeSet | None, diagnostics: tuple[Diagnostic, ...]
) -> list[Fix]:
    """All fixes that a file needs, as read.

    ``unrepaired`` are the recipes before exchanged fillers were taken the right way round.
    """
    fixes = [
        Fix(
            "O012", found.message.replace(" is read as ", " becomes "), found.span, lambda text: text.with_right_terms()
        )
        for found in diagnostics
        if found.code == "O012"
    ]
    broken = _ORDERS_UNKNOWN & {found.code for found in diagnostics}
    if unrepaired is not None:
        for recipe in unrepaired.recipes.values():
            fixes += _exchanges(actions.ontology, recipe)
    if recipes is not None:
        for recipe in recipes.recipes.values():
            statements = actions.statements(recipes_for(actions, recipe.iri)[0][0])
            assert statements is not None
            fixes += _names(actions.ontology, statements, recipe)
            if not broken and recipe.machine is None:
                fixes += _orders(actions, statements, recipe, added_by_scopes(actions, recipe, recipes))
    return list({(fix.code, fix.message): fix for fix in fixes}.values())


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


def _orders(
    actions: Actions, statements: Statements, recipe: Recipe, added: tuple[tuple[str, str], ...]
) -> Iterator[Fix]:
    ontology, stating = actions.ontology, statements.iri
    stated: dict[str, SubAction] = {}
    for one in statements.sub_actions:
        if one.iri is not None:
            stated.setdefault(one.iri, one)
    restrictions = ontology.restrictions(stating)
    constraints = [one for one in restrictions if is_word(one.property, "orderingConstraints")]
    subs = [one for one in restrictions if is_word(one.property, "subAction")]
    task = ontology.span(stating)
    if task is None or not subs:
        return
    last, sub_action = constraints or subs, subs[0]
    for before, after, why in wise_orderings(actions, recipe, added):
        suffix = _free_suffix(ontology, stating, f"_{_plain(before)}_{_plain(after)}")
        anchors = Anchors(
            task,
            sub_action.span,
            last[-1].span,
            last[-1].form == "flat",
            stated[before].span,
            stated[after].span,
            suffix,
        )
        message = f"`{local_name(before)}` before `{local_name(after)}`: {why}"
        yield Fix("R042", message, stated[after].span, _order(anchors))


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


def _order(anchors: Anchors) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        _same_file(anchors.task, anchors.sub_action, anchors.last, anchors.before, anchors.after)
        return text.with_ordering(anchors)

    return edit


def _same_file(*spans: Span) -> None:
    if len({span.file for span in spans}) > 1:
        raise CannotEdit("it is stated in several files")
