"""Checks for statements about steps and their order that become part of no recipe."""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.ontology import Literal, Ontology, Restriction, Term
from planlang.ontology.classes import RESTRICTING, meant
from planlang.ontology.terms import OWL, RDFS
from planlang.recipe.actions import Actions
from planlang.recipe.checks import CheckedFile, check
from planlang.recipe.statements import KINDS, NAMING, is_word

_DESCRIBED_BY = {
    "orderingConstraints": ("occursBeforeInOrdering", "occursAfterInOrdering"),
    "inputOutputConstraints": ("createsOutput", "requiresInput"),
    "stateTransition": ("fromState", "toState"),
}
"""Property of a task -> properties that describe its filler."""

_STEPS = ("subAction", "subEvents")
_NEGATIVE = frozenset({OWL.complementOf, OWL.disjointWith})
_FILLERS = (OWL.someValuesFrom, OWL.hasValue, OWL.onClass)


@check("R059")
def lost_statements(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report statements of the main document about steps and orders that become part of no recipe."""
    actions, ontology = checked.actions, checked.ontology
    every: list[Restriction] = []
    for cls in _own_classes(ontology):
        stated = ontology.restrictions(cls)
        if stated:
            every += stated
            yield from _of_no_recipe(actions, cls, stated)
            yield from _permitted(ontology, cls, stated)
            for one in stated:
                if isinstance(one.filler, Literal):
                    yield from _text(local_name(cls), one.property, one.filler, one.span)
    yield from _texts_of_individuals(ontology)
    yield from _inside_expressions(actions, every)
    properties = {one.property for one in every}
    for holder, words in _DESCRIBED_BY.items():
        holding = frozenset(name for name in properties if is_word(name, holder))
        yield from _held_by_nothing(ontology, holder, words, [one for one in every if one.property in holding])
    yield from _crossed(ontology)
    yield from _roles_of_no_task(ontology)


def _own_classes(ontology: Ontology) -> Iterator[str]:
    """Yield the named classes of the main document with a superclass or an equivalent class, each once."""
    store = ontology.store
    rows = (row for word in (RDFS.subClassOf, OWL.equivalentClass) for row in _here(ontology, store.by(word)))
    for number in dict.fromkeys(map(store.subjects.__getitem__, rows)):
        name = store.name(number)
        if name is not None:
            yield name


def _here(ontology: Ontology, rows: Sequence[int]) -> list[int]:
    """Those of the given rows that belong to the main document, whose rows come first."""
    main = ontology.store.ranges[0]
    return list(rows[: bisect_left(rows, main.stop)])


def _using(ontology: Ontology, *words: str) -> Sequence[int]:
    """Rows whose property has one of these local names."""
    return ontology.store.by(*ontology.properties_named(*words))


def _of_no_recipe(actions: Actions, cls: str, stated: tuple[Restriction, ...]) -> Iterator[Diagnostic]:
    """Report orders stated by a class that states no sub-actions itself, whatever it inherits."""
    order = next(
        (one for one in stated if is_word(one.property, "orderingConstraints", "inputOutputConstraints")), None
    )
    if order is not None and actions.statements(cls) is None:
        short = local_name(order.property)
        message = f"`{local_name(cls)}` states {short}, but no sub-actions: nothing is ordered"
        advice = "move them to the class that states the sub-actions, or state the sub-actions here as well"
        yield error("R059", message, order.span, advice)


def _permitted(ontology: Ontology, cls: str, stated: tuple[Restriction, ...]) -> Iterator[Diagnostic]:
    """Report restrictions (only, max) that permit but do not require a step or a constraint."""
    if all(one.kind in KINDS for one in stated):
        return
    required = {(one.property, one.filler) for one in stated if one.kind in KINDS}
    for one in stated:
        if one.kind in KINDS or one.cardinality == 0 or not isinstance(one.filler, str) or one.filler == OWL.Thing:
            continue
        if is_word(one.property, *_STEPS, *_DESCRIBED_BY) and (one.property, one.filler) not in required:
            word, name = local_name(one.property), local_name(one.filler)
            message = (
                f"`{word} {one.kind} {name}` of `{local_name(cls)}` permits it but does not state it; it is ignored"
            )
            right = f"{word} {'some' if ontology.is_class(one.filler) else 'value'} {name}"
            yield warning("R059", message, one.span, f"write `{right}` to require it")


def _inside_expressions(actions: Actions, read: list[Restriction]) -> Iterator[Diagnostic]:
    """Report sub-actions and constraints inside unions, which state nothing definite.

    Complements state what is absent, and the definition of a class without a recipe describes other tasks; neither is
    reported.
    """
    ontology = actions.ontology
    store = ontology.store
    subjects, objects, lines, columns = store.subjects, store.objects, store.lines, store.columns
    restricting = _here(ontology, store.by(OWL.onProperty))
    names = {number: store.name(number) or "" for number in {objects[row] for row in restricting}}
    words = {number: local_name(name) for number, name in names.items() if is_word(name, *_STEPS, *_DESCRIBED_BY)}
    asserted_at = {
        (line, column, str(number) if number is not None else filler if isinstance(filler, str) else _word_of(filler))
        for _, _, filler, number, (_, line, column), _ in read
    }
    asserted = {
        subjects[row]
        for row in store.by(*RESTRICTING)
        if (
            lines[row],
            columns[row],
            what
            if isinstance(what := store.terms[meant(store, objects[row])], str)
            else _word_of(store.term(objects[row])),
        )
        in asserted_at
    }
    fillers = {store.numbers.get(word) for word in _FILLERS}
    for row in restricting:
        node = subjects[row]
        if objects[row] in words and node not in asserted:
            filled = [other for other in store.about(node) if store.predicates[other] in fillers]
            if filled and not _is_about_others(actions, node):
                word = words[objects[row]]
                message = f"{word} is in an expression that does not determine which action is performed"
                advice = "write each alternative as a recipe: a subclass of the sub-action"
                yield error("R059", message, store.span(filled[0]), advice)


def _word_of(term: Term) -> str:
    """Text that distinguishes terms on one line of Turtle: an IRI, the text of a literal, or the label of a node."""
    return term.value if isinstance(term, Literal) else str(term)


def _is_about_others(actions: Actions, node: int) -> bool:
    """True if an expression (number of its node) is negated, or defines a class that states no recipe."""
    store, visited = actions.ontology.store, set[int]()
    word: str | None = None
    while store.name(node) is None and node not in visited:
        visited.add(node)
        holding = store.with_object(node)
        if not holding:
            return False
        word, node = store.name(store.predicates[holding[0]]), store.subjects[holding[0]]
        if word in _NEGATIVE:
            return True
    return word == OWL.equivalentClass and actions.statements(store.name(node) or "") is None


def _texts_of_individuals(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report text literals as values of properties that take names."""
    store = ontology.store
    rows = _here(ontology, _using(ontology, *NAMING))
    texts = {number for number in set(map(store.objects.__getitem__, rows)) if isinstance(store.terms[number], Literal)}
    for row in rows if texts else ():
        value = store.terms[store.objects[row]]
        if isinstance(value, Literal) and (owner := store.name(store.subjects[row])) is not None:
            yield from _text(local_name(owner), store.triple(row).predicate, value, store.span(row))


def _text(owner: str, name: str, value: Literal, span: Span) -> Iterator[Diagnostic]:
    """Report a text literal where the name of an action, a constraint or a state is expected."""
    if is_word(name, *NAMING):
        message = f"{local_name(name)} of `{owner}` is the text {value.value!r}, which is not a name"
        yield error("R059", message, span, f"write {value.value} without quotation marks (in XML: rdf:resource)")


def _held_by_nothing(
    ontology: Ontology, holder: str, words: tuple[str, str], stated: list[Restriction]
) -> Iterator[Diagnostic]:
    """Report constraints, mappings and transitions that no task refers to, in files where tasks refer to others.

    If a task refers to one that is not described, the name may just be wrong, which R011 reports.
    """
    store = ontology.store
    referenced = {store.find(one.filler) for one in stated}
    referenced |= set(map(store.objects.__getitem__, _using(ontology, holder)))
    first, second = (set(map(store.subjects.__getitem__, _using(ontology, word))) for word in words)
    if not referenced or any(number is not None and store.name(number) for number in referenced - first - second):
        return
    unused = (first & second) - referenced
    for row in _here(ontology, _using(ontology, words[0])) if unused else ():
        name = store.name(store.subjects[row])
        if name is not None and store.subjects[row] in unused:
            unused.remove(store.subjects[row])
            short = local_name(name)
            advice = f"add `{holder} value {short}` to its task, or remove it"
            span = ontology.span(name) or store.span(row)
            yield warning("R059", f"`{short}` is ignored: no task refers to it", span, advice)


def _crossed(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report constraints with several befores and several afters, as two constraints under one name have."""
    store, words = ontology.store, _DESCRIBED_BY["orderingConstraints"]
    several = (Counter(map(store.subjects.__getitem__, _using(ontology, word))) for word in words)
    befores_of, afters_of = ({number for number, times in counted.items() if times > 1} for counted in several)
    for number in sorted(befores_of & afters_of, key=store.first_about):
        name = store.name(number)
        if name is None or not ontology.main(name):
            continue
        befores, afters = ontology.linked(name, *words)
        if len(befores) > 1 and len(afters) > 1:
            sides = (" and ".join(f"`{local_name(one)}`" for one in ends) for ends in (befores, afters))
            message = f"`{local_name(name)}` puts each of {' before each of '.join(sides)}"
            advice = "if these are two constraints, give them different names"
            yield warning("R059", message, ontology.span(name), advice)


def _roles_of_no_task(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report roles of a workflow or a thing that belong to no task."""
    store = ontology.store
    of_tasks = {store.objects[row] for row in _using(ontology, "isTaskOf")}
    of_tasks |= {store.subjects[row] for row in _using(ontology, "hasTask")}
    stated = [(store.objects[row], row) for row in _here(ontology, _using(ontology, "definesRole", "hasRole"))]
    stated += [(store.subjects[row], row) for row in _here(ontology, _using(ontology, "isRoleOf"))]
    for number, row in dict(reversed(stated)).items() if _using(ontology, "hasStep", "isStepOf") else ():
        name = store.name(number)
        if name is not None and number not in of_tasks:
            message = f"the role `{local_name(name)}` is ignored: no task has it"
            yield warning("R059", message, store.span(row), f"state `isTaskOf {local_name(name)}` of the task")
