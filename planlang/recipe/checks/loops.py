"""Checks of loops between states."""

from __future__ import annotations

from collections.abc import Iterator

from planlang import graphs as nx
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, warning
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.model import Kind, Parameter, Thing


@check("R069", unless=("R052",))
def one_of_several(checked: CheckedRecipe) -> Iterator[Diagnostic]:
    """Report steps that act on things of a class while one of this class is seen, be it one that they are done with."""
    machine, recipe = checked.recipe.machine, checked.recipe
    if machine is None:
        return
    graph = nx.DiGraph((one.source, one.target) for one in machine.transitions)
    for loop in nx.strongly_connected_components(graph):
        steps = [step for step in recipe.steps if step.iri in loop] if len(loop) > 1 else []
        asked = [one for step in steps if step.condition is not None for one in _classes(step.condition.parameters)]
        is_a = checked.ontology.is_a
        for step in steps:
            acted_on = [one for one in step.parameters if one.property == "objectActedOn" and step.condition is None]
            for cls, parameter in _classes(tuple(acted_on)):
                if any(is_a(cls, other) or is_a(other, cls) for other, _ in asked):
                    message = (
                        f"the loop goes on while any `{local_name(cls)}` is seen, also one with which `{step.name}` is"
                        " done; then it fails, as none is left"
                    )
                    advice = (
                        f"say where it has to be in the condition: `some ({local_name(cls)} and on-Physical value X)`,"
                        " or check from where what is done cannot be seen"
                    )
                    yield warning("R069", message, parameter.span, advice)


def _classes(parameters: tuple[Parameter, ...]) -> Iterator[tuple[str, Parameter]]:
    """Yield the classes of objects that are given by their class alone."""
    for one in parameters:
        if (
            isinstance(one.filler, Thing)
            and one.filler.iri is None
            and one.filler.kind is Kind.OBJECT
            and not one.filler.where
        ):
            yield one.filler.stated, one
