"""Whether a plan still is what its recipe compiles to; nothing of the plan is executed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from executive.inputs import PlanFile, PlanHeader
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.resources import bundled


def freshness(plan: PlanFile, *, folders: Sequence[Path] = ()) -> tuple[str, tuple[Diagnostic, ...]]:
    """The state of a plan in words, and diagnostics: an error when its recipe has changed since.

    The recipe is looked for beside the plan, then in ``folders``, then among the bundled recipes.
    """
    origin = plan.header
    if origin is None:
        return "a plan written by hand", ()
    span = Span(str(plan.path))
    places = [place / origin.recipe for place in (plan.path.parent, *folders, bundled("recipes"))]
    found = [place for place in places if place.is_file()]
    if not found:
        advice = "--ontologies DIR names a folder in which it is"
        message = f"the recipe {origin.recipe} is not beside the plan: whether it has changed is not known"
        return "a compiled plan without its recipe", (warning("C011", message, span, advice),)
    recipe = next((place for place in found if origin.matches(place.read_bytes())), None)
    if recipe is None:
        advice = f"planlang compile {found[0]} -o {plan.path} writes the plan anew"
        message = f"the recipe has changed since this plan was compiled from it: {found[0]}"
        return "out of date", (error("C009", message, span, advice),)
    return _compare(plan, origin, recipe, folders)


def _compare(
    plan: PlanFile, origin: PlanHeader, recipe: Path, folders: Sequence[Path]
) -> tuple[str, tuple[Diagnostic, ...]]:
    """The recipe is the same file as then: compile it again, with every option that shapes the source."""
    from planlang.compiler import compile_recipe

    sources: list[str] = []
    try:
        for scopes in (True, False):
            compiled = compile_recipe(recipe, task=origin.task, folders=folders, allow_abstract=True, scopes=scopes)
            sources.append(compiled.source)
    except BadInput as problem:
        return "compiled from a recipe that no longer compiles", problem.diagnostics
    if plan.source in sources:
        return f"what {recipe.name} compiles to", ()
    message = f"the plan differs from what {origin.recipe} compiles to: it was edited, or another planlang compiled it"
    return "an edited plan", (note("C010", message, Span(str(plan.path))),)
