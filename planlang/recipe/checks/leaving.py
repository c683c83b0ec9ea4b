"""Checks of what a recipe leaves behind: doors that it opened, devices that it switched on."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, warning
from planlang.goals import ON, OPEN, InState
from planlang.ontology import Ontology
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.goals import lasting_effects
from planlang.recipe.model import Step, Thing
from planlang.recipe.order import recipe_order

LEFT = {
    OPEN: ("opens", "closes it", "add a step of ClosingAContainerArtifact after it"),
    ON: ("switches on", "switches it off", "add a step of TurningOffPoweredDevice after it"),
}
"""State -> what a step does, what no later step does, and what to add."""
LEAVES = ("Door", "DoorwayCovering", "Drawer")
"""Classes of what opens and closes furniture."""


@check("R071", unless=("R020", "R022"))
def left_behind(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report what a step opens or switches on before others, and no step that may come later closes or switches off.

    What comes last is what the recipe is for.
    """
    recipe = checked.recipe
    for one in lasting_effects(checked.ontology, recipe):
        if not (isinstance(one.fact, InState) and one.fact.state in LEFT) or not recipe_order(recipe).later(one.step):
            continue
        step = recipe.step(one.step)
        others = (other for other in recipe.steps if other.iri != step.iri)
        if one.fact.state == OPEN and any(_is_of_leaf(other, checked.ontology) for other in others):
            continue  # the leaf of what was opened may be closed itself
        does, undoes, help = LEFT[one.fact.state]
        message = f"`{step.name}` {does} {local_name(one.subject.iri or '')}, and no later step {undoes}"
        yield warning("R071", message, step.span, help)


def _is_of_leaf(step: Step, ontology: Ontology) -> bool:
    """Check whether a step acts on a door or a drawer."""
    acted_on = (one for one in step.fillers("objectActedOn") if isinstance(one, Thing))
    return any(ontology.is_a(one.stated or one.type, cls) for one in acted_on for cls in LEAVES)
