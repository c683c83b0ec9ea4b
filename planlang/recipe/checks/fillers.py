"""Checks of what fills the properties of actions: slots, places, motion constraints."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, warning
from planlang.motion_constraints import ConstraintKind
from planlang.ontology import Ontology
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check
from planlang.recipe.constraints import FEATURES, LIMITS, kind_of_constraint, number_of, stated_feature
from planlang.recipe.fillers import CONSTRAINED_BY
from planlang.recipe.model import Absence, Filler, Kind, Name, Place, Slot, Thing
from planlang.recipe.slots import accepts, in_words
from planlang.relations import RELATIONS


@check("R063")
def declarations(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report malformed declarations of slots."""
    yield from checked.actions.slot_problems


@check("R060")
def wrong_kinds(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report fillers of the wrong kind for their slot; individuals that another step creates are not checked."""
    created = checked.created
    for owner in checked.owners:
        slots = checked.actions.slots(owner.action_class)
        for parameter in owner.parameters if slots else ():
            slot, filler = slots.get(parameter.property), parameter.filler
            iri = filler.iri if isinstance(filler, (Thing, Place, Name)) else None
            if slot is not None and iri not in created and not accepts(checked.ontology, slot, filler):
                message = f"{slot.property} of `{owner.name}` is {_described(filler)}, but must be {in_words(slot)}"
                yield error("R060", message, parameter.span, _advice(slot, owner.name))


@check("R068", unless=("R060",))
def unstated(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps of the file that leave out what a recipe should state, such as the recipient of a hand-over."""
    recipe = checked.recipe
    for step in recipe.steps:
        for slot in checked.actions.slots(step.action_class).values() if checked.ontology.main(step.iri) else ():
            if slot.absence is Absence.EXPECTED and not (step.fillers(slot.property) or recipe.fillers(slot.property)):
                message = f"`{step.name}` states no {slot.property}: the robot chooses {in_words(slot)}"
                advice = f"add `{slot.property} value X` to `{step.name}`, where X is {in_words(slot)}"
                yield warning("R068", message, checked.ontology.span(step.iri) or step.span, advice)


def _advice(slot: Slot, owner: str) -> str:
    """Tell what to write into a slot; what counts as a device is not obvious."""
    if slot.kinds != (Kind.DEVICE,):
        return f"write {in_words(slot)} there"
    example = f"`{slot.property} some LeftHand` in `{owner}`, or `value` and an individual with `Types: LeftHand`"
    return f"write a hand, gripper or arm of the robot there: {example}; without a side, any of its hands is meant"


def _described(filler: Filler) -> str:
    match filler:
        case Thing():
            return f"the {filler.kind.value} `{filler.name}`"
        case Place():
            return f"the place `{filler.name}`"
        case Name():
            return f"`{local_name(filler.iri)}`"
        case _:
            return f"the value {filler!r}"


@check("R065")
def incomplete_constraints(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report motion constraints without effect: without a kind, a feature, or valid limits."""
    reported: set[str] = set()
    for step in checked.recipe.steps:
        for parameter in step.parameters:
            name = parameter.filler
            if parameter.property == CONSTRAINED_BY and isinstance(name, Name) and name.iri not in reported:
                reported.add(name.iri)
                span = checked.ontology.span(name.iri) or parameter.span
                yield from _lacks(checked.ontology, name, span)


def _lacks(ontology: Ontology, name: Name, span: Span | None) -> Iterator[Diagnostic]:
    if not ontology.defined(name.iri):
        advice = "import the file that defines it, or correct the name"
        yield error("R065", f"the constraint `{name.name}` is not defined", span, advice)
        return
    if kind_of_constraint(ontology, name.iri) is None:
        kinds = ", ".join(kind.value.owl for kind in ConstraintKind)
        message = f"`{name.name}` is not a constraint of a known kind"
        yield error("R065", message, span, f"make it a subclass of one of {kinds}")
    for word in FEATURES:
        if stated_feature(ontology, name.iri, word) is None:
            advice = f"add `{word} some FEATURE`: a class of parts of things, such as FlatPhysicalSurface"
            yield error("R065", f"the constraint `{name.name}` has no {word}", span, advice)
    lower, upper, weight = numbers = [number_of(ontology, name.iri, word) for word in LIMITS]
    for word, number in zip(LIMITS, numbers, strict=True):
        if isinstance(number, str):
            message = f"{word} of the constraint `{name.name}` is {number!r}, not a number"
            yield error("R065", message, span, "write a number, such as 0.1")
    if isinstance(lower, float) and isinstance(upper, float) and lower > upper:
        message = f"the constraint `{name.name}` has the lower limit {lower:g} above its upper limit {upper:g}"
        yield error("R065", message, span, "swap the two limits")
    if isinstance(weight, float) and weight < 0:
        message = f"the constraint `{name.name}` has the weight {weight:g}"
        yield error("R065", message, span, "write a weight of 0 (inactive) or more")


@check("R070")
def numbers_of_references(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report relations to several things of which a place states fewer or more."""
    stated = [(one.filler, one.span) for owner in checked.owners for one in owner.parameters]
    places = [(place, span) for filler, span in stated if isinstance(filler, Place) for place in filler.places()]
    for place, span in dict(places).items():
        for name, references in place.relations:
            relation, number = RELATIONS[name], len(references)
            if number != relation.arity:
                message = f"{relation.owl} of the place `{place.name}` relates to {number} of {relation.arity} things"
                advice = "state a fact for each thing, and a place of its own for each pair"
                yield error("R070", message, checked.ontology.span(place.iri) or span, advice)
