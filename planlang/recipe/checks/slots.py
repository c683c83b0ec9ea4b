"""Checks of slots: their declarations, and the kinds of their fillers."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error, warning
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check
from planlang.recipe.model import Absence, Filler, Kind, Name, Place, Slot, Thing
from planlang.recipe.slots import accepts, in_words


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
