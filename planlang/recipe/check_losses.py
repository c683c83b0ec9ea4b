"""Checks of what a file states about steps and their order without any recipe taking it up."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.ontology import Literal, Ontology, Restriction, Term, Triple, expand
from planlang.ontology.terms import EQUIVALENT_CLASS, ON_PROPERTY, OWL, SUBCLASS_OF, THING
from planlang.recipe.actions import Actions
from planlang.recipe.fillings import action_properties
from planlang.recipe.statements import KINDS, is_word
from planlang.recipe.words import NAMING

_DESCRIBED_BY = {
    "orderingConstraints": ("occursBeforeInOrdering", "occursAfterInOrdering"),
    "inputOutputConstraints": ("createsOutput", "requiresInput"),
    "stateTransition": ("fromState", "toState"),
}
"""Word by which a task has something -> the words that describe it."""

_STEPS = ("subAction", "subEvents")
_FILLERS = (OWL + "someValuesFrom", OWL + "hasValue", OWL + "onClass")


def check_losses(actions: Actions) -> Iterator[Diagnostic]:
    """Judge what the main document states about steps and orders: each statement must reach a recipe."""
    ontology = actions.ontology
    own = {one.subject: None for p in (SUBCLASS_OF, EQUIVALENT_CLASS) for one in ontology.triples(p=p)
           if isinstance(one.subject, str) and _is_here(ontology, one)}  # fmt: skip
    restrictions = {cls: ontology.restrictions(cls) for cls in own}
    for cls, stated in restrictions.items():
        yield from _of_no_recipe(actions, cls, stated)
        yield from _permitted(ontology, cls, stated)
        yield from _texts(local_name(cls), [(one.property, one.filler, one.span) for one in stated])
    for word in NAMING:
        for one in ontology.using(word):
            if isinstance(one.subject, str) and _is_here(ontology, one):
                yield from _texts(local_name(one.subject), [(one.predicate, one.object, one.span)])
    every = [one for stated in restrictions.values() for one in stated]
    yield from _inside_expressions(ontology, {one.span for one in every})
    for holder, words in _DESCRIBED_BY.items():
        held: set[Term] = {one.filler for one in every if is_word(one.property, holder)}
        held |= {one.object for one in ontology.using(holder)}
        if held:
            yield from _held_by_nothing(ontology, holder, words, held)
    yield from _crossed(ontology)


def _is_here(ontology: Ontology, triple: Triple) -> bool:
    return triple.span.file == str(ontology.documents[0].path)


def _of_no_recipe(actions: Actions, cls: str, stated: tuple[Restriction, ...]) -> Iterator[Diagnostic]:
    """Orders that a class states of which no recipe is: one without sub-actions, whatever it inherits."""
    orders = [one for one in stated if is_word(one.property, "orderingConstraints", "inputOutputConstraints")]
    if orders and actions.statements(cls) is None:
        short = local_name(orders[0].property)
        message = f"`{local_name(cls)}` states {short}, but no sub-actions: they order nothing"
        advice = "state them for the class that states the sub-actions, or state the sub-actions here, too"
        yield error("R059", message, orders[0].span, advice)


def _permitted(ontology: Ontology, cls: str, stated: tuple[Restriction, ...]) -> Iterator[Diagnostic]:
    """What may be there (only, max) of which nothing says that it is there: sub-actions, constraints, parameters."""
    if all(one.kind in KINDS for one in stated):
        return
    there = {(one.property, one.filler) for one in stated if one.kind in KINDS}
    filled = {one.property for one in stated if one.kind in KINDS}
    parameters = frozenset(action_properties(ontology))
    for one in stated:
        if one.kind in KINDS or one.cardinality == 0 or not isinstance(one.filler, str) or one.filler == THING:
            continue
        is_held = is_word(one.property, *_STEPS, *_DESCRIBED_BY) and (one.property, one.filler) not in there
        if is_held or (one.property in parameters - filled and ontology.defined(one.filler)):
            word, name = local_name(one.property), local_name(one.filler)
            message = f"`{word} {one.kind} {name}` of `{local_name(cls)}` says what may be, not what is: it is left out"
            right = f"{word} {'some' if ontology.is_class(one.filler) else 'value'} {name}"
            yield warning("R059", message, one.span, f"write `{right}` if it is meant to be there")


def _inside_expressions(ontology: Ontology, read: set[Span]) -> Iterator[Diagnostic]:
    """Sub-actions and constraints in alternatives and complements, which say nothing certain."""
    words = (*_STEPS, *_DESCRIBED_BY)
    for word in ontology.properties_named(*words) + tuple(map(expand, words)):
        for one in ontology.triples(p=ON_PROPERTY, o=word):
            if not _is_here(ontology, one) or not read.isdisjoint(t.span for t in ontology.triples(s=one.subject)):
                continue
            fillers = [other for other in ontology.triples(s=one.subject) if other.predicate in _FILLERS]
            if fillers:
                message = f"{local_name(word)} stands in an expression that does not say for certain what is done"
                advice = "write alternatives as recipes of their own: classes below one that is the sub-action"
                yield error("R059", message, fillers[0].span, advice)


def _texts(owner: str, stated: list[tuple[str, object, Span]]) -> Iterator[Diagnostic]:
    """Texts where the name of an action, a constraint or a state is expected."""
    for name, value, span in stated:
        if isinstance(value, Literal) and is_word(name, *NAMING):
            message = f"{local_name(name)} of `{owner}` is the text {value.value!r}, which names nothing"
            yield error("R059", message, span, f"write {value.value}, without quotation marks, or rdf:resource in XML")


def _held_by_nothing(ontology: Ontology, holder: str, words: tuple[str, str], held: set[Term]) -> Iterator[Diagnostic]:
    """Constraints, mappings and transitions that no task has, in files that have others.

    Where a task has one that is not described, that may be one of them under a wrong name, which is told of it.
    """
    first, second = ({one.subject: one for one in reversed(list(ontology.using(word)))} for word in words)
    if any(isinstance(name, str) and name not in first and name not in second for name in held):
        return
    for name, one in reversed(first.items()):
        if isinstance(name, str) and name in second and name not in held and _is_here(ontology, one):
            short = local_name(name)
            advice = f"add `{holder} value {short}` to the task that it is of, or remove it"
            yield warning("R059", f"`{short}` is left out: no task has it", ontology.span(name) or one.span, advice)


def _crossed(ontology: Ontology) -> Iterator[Diagnostic]:
    """Constraints with several ends on either side, as two of one name have: each before each."""
    for name in dict.fromkeys(one.subject for one in ontology.using("occursBeforeInOrdering")):
        befores, afters = ontology.linked(name, *_DESCRIBED_BY["orderingConstraints"])
        if isinstance(name, str) and ontology.main(name) and len(befores) > 1 and len(afters) > 1:
            sides = (" and ".join(f"`{local_name(one)}`" for one in ends) for ends in (befores, afters))
            message = f"`{local_name(name)}` puts each of {' before each of '.join(sides)}"
            advice = "if these are two constraints, give each a name of its own"
            yield warning("R059", message, ontology.span(name), advice)
