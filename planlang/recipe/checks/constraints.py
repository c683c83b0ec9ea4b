"""Checks of motion constraints: each needs a kind, two features, and limits that can be satisfied."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.diagnostics import Diagnostic, Span, error
from planlang.motion_constraints import ConstraintKind
from planlang.ontology import Ontology
from planlang.recipe.checks import CheckedRecipe, check
from planlang.recipe.constraints import FEATURES, LIMITS, kind_of_constraint, number_of, stated_feature
from planlang.recipe.fillers import CONSTRAINED_BY
from planlang.recipe.model import Name


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
