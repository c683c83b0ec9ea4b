"""The fixes that a recipe needs, apart from their text edits, which depend on the syntax of the file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Order, Rename, Severity, Span
from planlang.ontology import Ontology, Restriction
from planlang.ontology.terms import OWL
from planlang.recipe.actions import Actions
from planlang.recipe.checks.orderings import constraints_of, follow_from_others
from planlang.recipe.checks.places import unused_designators
from planlang.recipe.checks.repairs import exchanged_pair
from planlang.recipe.checks.states import unlisted_states
from planlang.recipe.fixes.edits import Anchors, CannotEdit, Edit, Editable, Fix, Place
from planlang.recipe.model import Recipe, RecipeSet, Step, Thing
from planlang.recipe.readers.partial_order import is_sub_action
from planlang.recipe.statements import Statements, SubAction, is_word
from planlang.recipe.tasks import recipes_for

_ORDERS_UNKNOWN = frozenset({"R010", "R011", "R012", "R020"})
"""Codes of mistakes by which it is not known what the file orders: an order may only seem to be missing."""

UNLISTED = "no restrictions of a class list its sub-actions"


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
    fixes += _unused(ontology)
    broken = _ORDERS_UNKNOWN & {found.code for found in diagnostics}
    if unrepaired is not None:
        for recipe in unrepaired.recipes.values():
            fixes += _exchanges(ontology, recipe)
            if recipes is not None:
                fixes += _bindings(ontology, recipe, recipes.recipes[recipe.iri])
    if recipes is not None:
        for recipe in recipes.recipes.values():
            statements = actions.statements(recipes_for(actions, recipe.iri)[0][0])
            assert statements is not None
            fixes += _names(ontology, statements, recipe)
            fixes += removals(ontology, statements, recipe)
            fixes += _states(actions, recipe)
        if not broken:
            fixes += _orders(actions, recipes, diagnostics)
    return list({(fix.code, fix.message): fix for fix in fixes}.values())


def _kinds(ontology: Ontology) -> Iterator[Fix]:
    """Restrictions with the word for classes about an individual, and the other way round."""
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
            before, after = local_name(found.suggestion.before), local_name(found.suggestion.after)
            why = found.message.partition(": ")[2] if found.code == "R042" else found.message
            message = f"`{before}` before `{after}`: {why}"
            yield Fix(found.code, message, found.span, _order(anchors), found.code == "R042")


def _anchors(actions: Actions, recipe: Recipe, order: Order) -> Anchors | None:
    """Return where the file states the ends of a new ordering; None if no restrictions of a class state the steps."""
    stating = recipes_for(actions, recipe.iri)[0][0]
    statements = actions.statements(stating)
    assert statements is not None
    stated: dict[str, SubAction] = {}
    for one in statements.sub_actions:
        if one.iri is not None:
            stated.setdefault(one.iri, one)
    place = _place(actions.ontology, stating, "orderingConstraints")
    if place is None:
        return None
    suffix = _free_suffix(actions.ontology, stating, f"_{_plain(order.before)}_{_plain(order.after)}")
    return Anchors(place, stated[order.before].span, stated[order.after].span, suffix)


def _place(ontology: Ontology, stating: str, *words: str) -> Place | None:
    """Return where a class lists sub-actions, and the place of a new restriction: after the last with one of the words.

    Behind the last sub-action if there is none; None if restrictions list no sub-actions.
    """
    restrictions = ontology.restrictions(stating)
    subs = [one for one in restrictions if is_sub_action(one)]
    task = ontology.span(stating)
    if task is None or not subs:
        return None
    last = ([one for one in restrictions if is_word(one.property, *words)] or subs)[-1]
    return Place(task, subs[0].span, local_name(subs[0].property), last.span, last.form == "flat")


def _states(actions: Actions, recipe: Recipe) -> Iterator[Fix]:
    """States that are no sub-actions though others are become some."""
    ontology = actions.ontology
    stating = recipes_for(actions, recipe.iri)[0][0]
    statements = actions.statements(stating)
    assert statements is not None
    for name, mention in unlisted_states(actions.ontology, statements):
        place = _place(ontology, stating)
        message = f"the state `{local_name(name)}` becomes a sub-action of `{recipe.name}`"
        head, kind = ontology.span(name), "some" if ontology.is_class(name) else "value"
        yield Fix("R051", message, mention or recipe.span, _list(place, head, kind))


def _bindings(ontology: Ontology, unrepaired: Recipe, repaired: Recipe) -> Iterator[Fix]:
    """Things told by their class become the individual that they were taken for."""
    owners: tuple[tuple[Recipe | Step, Recipe | Step], ...] = (
        (unrepaired, repaired),
        *zip(unrepaired.steps, repaired.steps, strict=True),
    )
    for stated, taken in owners:
        if exchanged_pair(ontology, stated.parameters) is not None:
            continue
        for before, after in zip(stated.parameters, taken.parameters, strict=True):
            thing, only = before.filler, after.filler
            is_bound = isinstance(thing, Thing) and thing.iri is None and isinstance(only, Thing) and only.iri
            if is_bound and before.span is not None and isinstance(thing, Thing) and isinstance(only, Thing):
                message = f"{before.property} of `{stated.name}` becomes `{only.name}` instead of any `{thing.name}`"
                rename = Rename(thing.stated, only.iri or "")
                yield Fix("R034", message, before.span, _bind(before.span, rename), is_safe=False)


def _unused(ontology: Ontology) -> Iterator[Fix]:
    """Location designators and things that nothing uses are taken out; another file may be meant to use them."""
    for what, names in zip(("location designator", "thing"), unused_designators(ontology), strict=True):
        for name in names:
            message, span = f"the unused {what} `{local_name(name)}` is taken out", ontology.span(name)
            if span is not None:
                yield Fix("R039", message, span, _gone(span, name), is_safe=False)


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


def _bind(where: Span, rename: Rename) -> Callable[[Editable], list[Edit]]:
    return lambda text: [*text.replaced(where, rename.written, rename.meant), *text.with_kind(where, "value")]


def _gone(where: Span, name: str) -> Callable[[Editable], list[Edit]]:
    return lambda text: text.without_individual(where, name)


def _list(place: Place | None, step: Span | None, kind: str) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        if place is None or step is None:
            raise CannotEdit(UNLISTED)
        _same_file(place.task, place.sub_action, place.last, step)
        return text.with_sub_action(place, step, kind)

    return edit


def _order(anchors: Anchors | None) -> Callable[[Editable], list[Edit]]:
    def edit(text: Editable) -> list[Edit]:
        if anchors is None:
            raise CannotEdit(UNLISTED)
        place = anchors.place
        _same_file(place.task, place.sub_action, place.last, anchors.before, anchors.after)
        return text.with_ordering(anchors)

    return edit


def _same_file(*spans: Span) -> None:
    if len({span.file for span in spans}) > 1:
        raise CannotEdit("it is stated in several files")


def removals(ontology: Ontology, statements: Statements, recipe: Recipe) -> Iterator[Fix]:
    """Yield removals of repeated sub-actions, of constraints without effect, and of all in a recipe of states."""
    restrictions = ontology.restrictions(statements.iri)
    stated = {str(one.filler): one for one in restrictions if is_word(one.property, "orderingConstraints")}
    pairs: dict[str, set[tuple[str, str]]] = {}
    for ordering in statements.orderings:
        if ordering.iri in stated:
            pairs.setdefault(ordering.iri, set()).add((ordering.before, ordering.after))
    if statements.states is not None:
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
