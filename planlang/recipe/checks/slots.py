"""Checks of slots: how they are declared, and whether what fills them is of the right kind."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error, warning
from planlang.recipe.checks import CheckedFile, CheckedRecipe, check
from planlang.recipe.model import Absence, Filler, Name, Place, Thing
from planlang.recipe.readers import made
from planlang.recipe.slots import in_words, takes


@check("R063")
def declarations(checked: CheckedFile) -> Iterator[Diagnostic]:
    """Report slots that primitives and signatures declare in a way that cannot be read."""
    yield from checked.actions.slot_problems


@check("R060")
def wrong_kinds(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report what fills a slot though it is of another kind; what another step makes may be anything."""
    created = made(checked.ontology, checked.statements)
    for owner in checked.owners:
        slots = checked.actions.slots(owner.action_class)
        for parameter in owner.parameters if slots else ():
            slot, filler = slots.get(parameter.property), parameter.filler
            iri = filler.iri if isinstance(filler, (Thing, Place, Name)) else None
            if slot is not None and iri not in created and not takes(checked.ontology, slot, filler):
                message = f"{slot.property} of `{owner.name}` is {_what(filler)}, but must be {in_words(slot)}"
                yield error("R060", message, parameter.span, f"name {in_words(slot)} there")


@check("R068", unless=("R060",))
def unstated(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps of the file that do not state what a recipe should say, such as to whom something is handed."""
    recipe = checked.recipe
    for step in recipe.steps:
        for slot in checked.actions.slots(step.action_class).values() if checked.ontology.main(step.iri) else ():
            if slot.absence is Absence.EXPECTED and not (step.fillers(slot.property) or recipe.fillers(slot.property)):
                message = f"`{step.name}` states no {slot.property}: the robot chooses {in_words(slot)}"
                advice = f"add `{slot.property} value X` to `{step.name}`, where X is {in_words(slot)}"
                yield warning("R068", message, checked.ontology.span(step.iri) or step.span, advice)


def _what(filler: Filler) -> str:
    match filler:
        case Thing():
            return f"the {filler.kind.value} `{filler.name}`"
        case Place():
            return f"the place `{filler.name}`"
        case Name():
            return f"`{local_name(filler.iri)}`"
        case _:
            return f"the value {filler!r}"
