"""Reading recipes of dialects D1 and D1f: subAction restrictions, in an intersection or flat, and ordering constraints.

The reader keeps everything that the file says, right or wrong; :mod:`planlang.recipe.checks` judges it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from planlang.diagnostics import Span
from planlang.ontology import BNode, Ontology, Restriction, Term, expand, shorten
from planlang.recipe.model import Ordering, Parameter, Reason, Recipe, Step
from planlang.recipe.tables import Primitive
from planlang.recipe.terms import is_device, nearest_in_vocabulary, read_filler

SUB_ACTION = expand("subAction")
ORDERING = expand("orderingConstraints")
TRANSITION = expand("stateTransition")
DATA_FLOW = expand("inputOutputConstraints")
BEFORE = expand("occursBeforeInOrdering")
AFTER = expand("occursAfterInOrdering")

NO_PARAMETERS = frozenset(
    expand(name)
    for name in (
        "subAction",
        "subEvents",
        "orderingConstraints",
        "inputOutputConstraints",
        "dependsOnCapability",
        "dependsOnComponent",
        "hasCapability",
        "providedByMotionPrimitive",
        "lispClass",
        "stateTransition",
        "taskStartState",
        "taskEndState",
        "nextAction",
        "previousAction",
        "constrainedBy",
    )
)
"""Properties of action classes that say how or with what right, not on what."""


@dataclass(frozen=True, slots=True)
class SubAction:
    """A sub-action as the file states it: its named class and what an anonymous intersection adds to it."""

    iri: str | None
    restrictions: tuple[Restriction, ...]
    span: Span


def states_recipe(ontology: Ontology, cls: str) -> bool:
    """True if the class itself states sub-actions in a dialect that is read: a finite-state recipe does not."""
    properties = {restriction.property for restriction in own_restrictions(ontology, cls)}
    return SUB_ACTION in properties and TRANSITION not in properties


def own_restrictions(ontology: Ontology, cls: str) -> tuple[Restriction, ...]:
    """The class's own restrictions, those under owl:equivalentClass left out, in source order."""
    return tuple(restriction for restriction in ontology.restrictions(cls) if restriction.form != "equivalent")


def recipes_for(ontology: Ontology, cls: str, primitives: dict[str, Primitive]) -> tuple[tuple[str, ...], str | None]:
    """Who performs a class: the classes whose recipes do, or the primitive class that does; the nearer wins.

    On a tie the recipe wins. Several recipes at the same distance are alternatives.
    """
    for level in levels(ontology, cls):
        found = tuple(ancestor for ancestor in level if states_recipe(ontology, ancestor))
        if found:
            return found, None
        for ancestor in level:
            if ancestor in primitives:
                return (), ancestor
    return (), None


def levels(ontology: Ontology, cls: str) -> Iterator[tuple[str, ...]]:
    """The class, its direct superclasses, theirs, ...: each class once, at its least distance."""
    known = set(ontology.ancestors(cls))
    seen = {cls}
    level: tuple[str, ...] = (cls,)
    while level:
        yield level
        above: list[str] = []
        for member in level:
            for ancestor in ontology.parents(member):
                if ancestor in known and ancestor not in seen:
                    seen.add(ancestor)
                    above.append(ancestor)
        level = tuple(above)


def sub_actions(ontology: Ontology, cls: str) -> tuple[SubAction, ...]:
    """The sub-actions of a class in the order of the file, repeated ones included."""
    found = []
    for restriction in own_restrictions(ontology, cls):
        if restriction.property == SUB_ACTION and restriction.kind in ("some", "value", "min", "exactly"):
            if isinstance(restriction.filler, BNode):
                found.append(_anonymous(ontology, restriction))
            elif isinstance(restriction.filler, str):
                found.append(SubAction(restriction.filler, (), restriction.span))
    return tuple(found)


def read_orderings(ontology: Ontology, cls: str) -> tuple[Ordering, ...]:
    """The orderings that a class states, by constraints and by data flow; incomplete constraints are left out."""
    orderings = []
    for restriction in own_restrictions(ontology, cls):
        if restriction.property not in (ORDERING, DATA_FLOW) or not isinstance(restriction.filler, str):
            continue
        constraint = restriction.filler
        data_flow = restriction.property == DATA_FLOW
        befores = ontology.values(constraint, "createsOutput" if data_flow else BEFORE)
        afters = ontology.values(constraint, "requiresInput" if data_flow else AFTER)
        reason = Reason.DATA_FLOW if data_flow else Reason.CONSTRAINT
        span = ontology.span(constraint) or restriction.span
        orderings += [
            Ordering(before, after, constraint, reason, span)
            for before in befores
            for after in afters
            if isinstance(before, str) and isinstance(after, str)
        ]
    return tuple(orderings)


def read_parameters(ontology: Ontology, cls: str, more: tuple[Restriction, ...] = ()) -> tuple[Parameter, ...]:
    """What fills the properties of an action class: ``more``, its own restrictions, and those of its ancestors.

    A nearer filler replaces a farther one of the same property. A robot part given as a body part is the device used.
    """
    found: dict[str, list[Parameter]] = {}
    for restrictions in filling_restrictions(ontology, cls, more):
        nearer = set(found)
        for restriction in restrictions:
            parameter = _parameter(ontology, restriction)
            if parameter is not None and parameter.property not in nearer:
                found.setdefault(parameter.property, []).append(parameter)
    return tuple(dict.fromkeys(parameter for parameters in found.values() for parameter in parameters))


def filling_restrictions(
    ontology: Ontology, cls: str, more: tuple[Restriction, ...] = ()
) -> Iterator[list[Restriction]]:
    """The restrictions that say what fills the properties of an action class, nearest class first.

    Superclasses and equivalent classes count alike. What the bundled vocabulary says about its own classes does not.
    """
    own = [
        ontology.restrictions(ancestor)
        for ancestor in ontology.ancestors(cls)
        if shorten(ancestor) == ancestor or ontology.main(ancestor)
    ]
    for restrictions in (more, *own):
        yield [
            restriction
            for restriction in restrictions
            if restriction.property not in NO_PARAMETERS and restriction.kind in ("some", "value", "exactly", "min")
        ]


def read_step(ontology: Ontology, sub_action: SubAction, primitives: dict[str, Primitive]) -> Step | None:
    """A sub-action as a step; None if it has no named class that is defined."""
    iri = sub_action.iri
    if iri is None or not ontology.defined(iri):
        return None
    recipes, primitive = recipes_for(ontology, iri, primitives)
    return Step(
        iri,
        nearest_in_vocabulary(ontology, iri),
        read_parameters(ontology, iri, sub_action.restrictions),
        recipes,
        primitive,
        ontology.label(iri) if shorten(iri) == iri else None,
        sub_action.span,
    )


def read_recipe_of(ontology: Ontology, cls: str, primitives: dict[str, Primitive], task: str | None = None) -> Recipe:
    """The recipe that a class states: repeated and undefined sub-actions left out.

    ``task`` is the class it is read for, when that inherits it.
    """
    task = task or cls
    steps: dict[str, Step] = {}
    for sub_action in sub_actions(ontology, cls):
        step = read_step(ontology, sub_action, primitives)
        if step is not None:
            steps.setdefault(step.iri, step)
    flat = any(
        restriction.property == SUB_ACTION and restriction.form == "flat"
        for restriction in own_restrictions(ontology, cls)
    )
    return Recipe(
        task,
        nearest_in_vocabulary(ontology, task),
        tuple(steps.values()),
        read_orderings(ontology, cls),
        read_parameters(ontology, task),
        ontology.label(task),
        ontology.span(task),
        "D1f" if flat else "D1",
    )


def _parameter(ontology: Ontology, restriction: Restriction) -> Parameter | None:
    filler = read_filler(ontology, restriction.filler)
    if filler is None:
        return None
    property_name = shorten(restriction.property)
    if property_name == "bodyPartsUsed" and _is_device_term(ontology, restriction.filler):
        property_name = "deviceUsed"
    return Parameter(property_name, filler, restriction.span)


def _is_device_term(ontology: Ontology, term: Term) -> bool:
    return (
        isinstance(term, str)
        and not isinstance(term, BNode)
        and any(is_device(ontology, cls) for cls in (ontology.types(term) or (term,)))
    )


def _anonymous(ontology: Ontology, restriction: Restriction) -> SubAction:
    """A sub-action that is an intersection: its first named member, placed where that stands, and its restrictions."""
    filler = restriction.filler
    assert isinstance(filler, BNode)
    named = next((member for member in ontology.members(filler) if isinstance(member, str)), None)
    span = restriction.span
    if named is not None:
        mentions = [triple.span for triple in ontology.triples(o=named) if triple.predicate.endswith("#first")]
        span = min((mention for mention in mentions if mention >= span), default=span)
    return SubAction(named, ontology.restrictions(filler), span)
