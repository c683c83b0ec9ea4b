"""Expressions that no reader understands: where one fills something, it is an error, because dropping it changes what
the recipe says.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.closure import reached
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error
from planlang.ontology import BNode, Literal, Ontology, Restriction, Term, shorten
from planlang.ontology.expression_text import expression_of, text_of
from planlang.ontology.expressions import FACETS
from planlang.ontology.terms import OWL, RDF
from planlang.recipe.checks import CheckedRecipe
from planlang.recipe.fillers import (
    action_class,
    action_properties,
    is_counted,
    is_relation,
    read_described,
    read_thing,
    takes_numbers,
)
from planlang.recipe.model import Place
from planlang.recipe.readers import partial_order
from planlang.recipe.readers.alternatives import is_union
from planlang.recipe.statements import KINDS, Filling, fillings_of, is_word

_STATES = ("taskStartState", "taskEndState")
_CONSTRAINTS = ("orderingConstraints", "inputOutputConstraints", "stateTransition")
_ENDS = (
    "occursBeforeInOrdering", "occursAfterInOrdering", "createsOutput", "requiresInput", "fromState", "toState",
    "causedBy",
)  # fmt: skip


def unread_filling(ontology: Ontology, owner: str, filling: Filling) -> Diagnostic | None:
    """Report (R035) a filler that is an expression, or that is required several times; None for any other."""
    short, term = local_name(shorten(filling.property)), filling.term
    if isinstance(term, BNode):
        described = read_described(ontology, term)
        is_one = filling.number == 1 or is_counted(filling, described)
        if is_one and described is not None and not is_relation(filling.property):
            return None
        what = f"{short} of `{local_name(owner)}`"
        return _unread(ontology, what, term, filling.span, _instead(ontology, filling.property, term))
    if filling.number > 1 and not (isinstance(term, str) and is_counted(filling, read_thing(ontology, term))):
        name = f"`{local_name(term)}`" if isinstance(term, str) else f"the value {term.value!r}"
        message = f"{short} of `{local_name(owner)}` is {filling.number} of {name}, but a step takes one"
        advice = f"write a step for each, with `{short} value` and its name"
        if filling.kind == "min" and short == "objectActedOn":
            advice = f"write `{short} exactly {filling.number}`, or a step for each"
        return error("R035", message, filling.span, advice)
    return None


def unread_expressions(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report (R035) expressions of a task, its steps, conditions and places of which something would be dropped."""
    ontology, statements = checked.ontology, checked.statements
    yield from _of_task(ontology, statements.iri)
    members = (member for sub in statements.sub_actions for _, member in sub.alternatives)
    owners = dict.fromkeys([statements.iri, *(one.iri for one in (*statements.sub_actions, *members) if one.iri)])
    seen: set[str] = set()
    for owner in owners:
        cls = owner if ontology.is_class(owner) else action_class(ontology, owner) or owner
        for above in dict.fromkeys((owner, *ontology.ancestors(cls))):
            if above not in seen and (shorten(above) == above or ontology.main(above)):
                yield from _of_action(ontology, above)
            seen.add(above)
    yield from _counted(checked)
    places = (one.filler for owner in checked.owners for one in owner.parameters if isinstance(one.filler, Place))
    for place in dict.fromkeys(each.iri for one in places for each in one.places()):
        yield from _of_place(ontology, place)


def _counted(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report numbers of things that a task is about, or alternatives: only a step is performed for each thing."""
    is_task = checked.recipe.iri == checked.file.recipes.task
    for action in (*([checked.recipe] if is_task else []), *(one for one in checked.recipe.steps if one.is_choice)):
        for one in (each for each in action.parameters if each.number > 1):
            message = f"{one.property} of `{action.name}` is {one.number} things, but only a step is performed for each"
            yield error("R035", message, one.span, f"state `{one.property} exactly {one.number}` of a step of it")


def _of_task(ontology: Ontology, task: str) -> Iterator[Diagnostic]:
    """Report expressions that name steps, states and constraints."""
    for one in ontology.restrictions(task):
        short = local_name(one.property)
        if isinstance(one.filler, Literal):
            continue
        if isinstance(one.filler, BNode) and is_word(one.property, *_STATES):
            yield _unread(ontology, f"{short} of `{local_name(task)}`", one.filler, one.span, "name one state")
        elif isinstance(one.filler, BNode) and partial_order.is_sub_action(one):
            yield from _of_mention(ontology, task, one.filler, one.span)
        elif is_word(one.property, *_CONSTRAINTS):
            for triple in ontology.said(one.filler, *_ENDS):
                if isinstance(triple.object, BNode):
                    what = f"{local_name(triple.predicate)} of `{local_name(str(one.filler))}`"
                    yield _unread(ontology, what, triple.object, triple.span, "name a step")


def _of_mention(ontology: Ontology, task: str, mention: BNode, span: Span) -> Iterator[Diagnostic]:
    """Report the parts of an expression for a sub-action besides one class and its restrictions."""
    named = [member for member in ontology.members(mention) if isinstance(member, str)]
    first = partial_order.named_class(ontology, mention)
    more = [name for name in named if name != first and not (first and ontology.is_a(first, name))]
    if more:
        names = " and ".join(f"`{local_name(name)}`" for name in (first or "", *more))
        message = f"a sub-action of `{local_name(task)}` is {names} at once"
        yield error("R035", message, span, "name one class, such as a subclass of both")
    unread = ontology.unread_parts(mention)
    unions = [part for part, _ in unread if not named and ontology.alternatives(part)]
    for member in (member for union in unions for member in ontology.alternatives(union)):
        if isinstance(member, BNode):
            yield from _of_mention(ontology, task, member, span)
    for part, where in unread if named or unions else ():
        if part not in unions:
            what = f"a part of the sub-action `{local_name(first or task)}`"
            yield _unread(ontology, what, part, max(span, where), "state it of a class of its own, and name that")
    yield from _ineffective(ontology, first or task, ontology.restrictions(mention))


def _of_action(ontology: Ontology, cls: str) -> Iterator[Diagnostic]:
    """Report expressions above a class of actions, or among the types of an individual, that state parameters."""
    parameters = frozenset(action_properties(ontology))
    for part, span in (*ontology.unread_parts(cls), *_types(ontology, cls)):
        used = [name for name in _properties(ontology, part) if name in parameters]
        if used and not is_union(ontology, part):
            short = local_name(shorten(used[0]))
            advice = f"state `{short}` of `{local_name(cls)}` itself, as `{short} value` and a name"
            yield _unread(ontology, f"what `{local_name(cls)}` is", part, span, advice)
    stated = ontology.restrictions(cls)
    yield from _ineffective(ontology, cls, (one for one in stated if one.property in parameters))
    for one in stated:
        if is_word(one.property, "conditionEvaluated") and isinstance(one.filler, BNode):
            yield from _of_condition(ontology, cls, one.filler, one.span)


def _of_condition(ontology: Ontology, cls: str, condition: BNode, span: Span) -> Iterator[Diagnostic]:
    named = [member for member in ontology.members(condition) if isinstance(member, str)]
    what = f"the condition of `{local_name(cls)}`"
    if len(named) > 1:
        names = " and ".join(f"`{local_name(name)}`" for name in named)
        yield error("R035", f"{what} is {names} at once", span, "name one class")
    for part, where in ontology.unread_parts(condition):
        yield _unread(
            ontology, f"a part of {what}", part, max(span, where), "state one thing that is so, for each step"
        )
    yield from _ineffective(ontology, cls, ontology.restrictions(condition))
    for filling in fillings_of(ontology.restrictions(condition)):
        unread = unread_filling(ontology, cls, filling)
        if unread is not None:
            yield unread


def _of_place(ontology: Ontology, place: str) -> Iterator[Diagnostic]:
    """Report relations of a place to expressions, to several things, or in restrictions that relate it to nothing."""
    for part, span in (*ontology.unread_parts(place), *_types(ontology, place)):
        if any(map(is_relation, _properties(ontology, part))):
            advice = "state its relations as facts: `Facts: inFrontOf X`"
            yield _unread(ontology, f"what the place `{local_name(place)}` is", part, span, advice)
    relations = [one for one in ontology.restrictions(place) if is_relation(one.property)]
    yield from _ineffective(ontology, place, relations)
    for filling in fillings_of(relations):
        unread = unread_filling(ontology, place, filling)
        if unread is not None:
            yield unread
    for triple in ontology.triples(s=place):
        if isinstance(triple.object, BNode) and is_relation(triple.predicate):
            what = f"{local_name(triple.predicate)} of `{local_name(place)}`"
            yield _unread(ontology, what, triple.object, triple.span, "give the thing a name")


def _ineffective(ontology: Ontology, owner: str, stated: Iterable[Restriction]) -> Iterator[Diagnostic]:
    """Report restrictions that state no filler: ``only`` and ``max`` without one that does, and those to none."""
    every = list(stated)
    filled = {one.property for one in every if one.kind in KINDS and one.cardinality != 0}
    for one in every:
        limits = one.filler == OWL.Thing or (one.property in filled and not isinstance(one.filler, BNode))
        if (one.kind not in KINDS and not limits) or one.cardinality == 0:
            short, words = local_name(shorten(one.property)), _text(ontology, one.filler, one.span)
            number = "" if one.cardinality is None else f" {one.cardinality}"
            message = f"`{short} {one.kind}{number} {words}` of `{local_name(owner)}` states no {short}"
            advice = f"write `{short} some` with a class, or `{short} value` with a name, or remove it"
            yield error("R035", message, one.span, advice)


def _unread(ontology: Ontology, what: str, term: BNode, span: Span, advice: str) -> Diagnostic:
    message = f"{what} is the expression `{_text(ontology, term, span)}`, which is not understood"
    return error("R035", message, span, advice)


def _text(ontology: Ontology, term: Term, span: Span) -> str:
    """Manchester syntax of an expression, or the class of an anonymous individual."""
    if not isinstance(term, BNode):
        return local_name(shorten(term)) if isinstance(term, str) else repr(term.value)
    expression = expression_of(ontology, term, span)
    types = ontology.types(term)
    return (
        f"an unnamed {local_name(types[0])}"
        if expression is None and types
        else text_of(expression)
        if expression
        else "..."
    )


def _instead(ontology: Ontology, property_name: str, term: BNode) -> str:
    """What to write instead of an expression that fills a property."""
    short, expression = local_name(shorten(property_name)), expression_of(ontology, term, Span(""))
    kind = "individual" if expression is None else expression.kind
    if takes_numbers(ontology, property_name) or kind in ("facets", *FACETS):
        return f"write one number, such as `{short} value 0.5`"
    match kind:
        case "or":
            return "make each alternative a step: `subAction some (A or B)` performs the first that succeeds"
        case "one of":
            return f"name one of them: `{short} value` and its name"
        case "individual":
            return "give it a name"
        case _:
            return (
                f"name a class alone, a class and relations to one thing each (`{short} some (Cup and on-Physical value"
                f" table1)`), or an individual: `{short} value` and its name"
            )


def _types(ontology: Ontology, individual: str) -> Iterator[tuple[BNode, Span]]:
    """Yield the anonymous classes of an individual, with their positions."""
    for triple in ontology.triples(s=individual, p=RDF.type):
        if isinstance(triple.object, BNode):
            yield triple.object, triple.span


def _properties(ontology: Ontology, term: BNode) -> list[str]:
    """List the properties (IRIs) that an expression restricts, inverse ones included."""

    def inside(node: BNode) -> Iterator[BNode]:
        return (triple.object for triple in ontology.triples(s=node) if isinstance(triple.object, BNode))

    stated = (triple for node in reached((term,), inside) for triple in ontology.triples(s=node))
    named = (triple.object for triple in stated if triple.predicate in (OWL.onProperty, OWL.inverseOf))
    return [name for name in named if isinstance(name, str)]
