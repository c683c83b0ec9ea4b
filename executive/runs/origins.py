"""What the recipe that a plan was compiled from requires of a robot, beyond what the plan shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from executive.cli.inputs import recipe_of
from executive.robots import Missing, Robot
from executive.robots.matching import possessions_of
from executive.robots.tasks import match
from planlang.diagnostics import BadInput, Diagnostic, Span, warning
from planlang.language.plans import Plan
from planlang.ontology import Ontology, load
from planlang.plan_header import LONGEST, header
from planlang.recipe import Actions, RecipeSet, read_recipe

Requirements = Callable[[Robot], tuple[Missing, ...]]
"""What a robot lacks, or may lack, of what a recipe requires."""


def required(ontology: Ontology, recipes: RecipeSet) -> Requirements:
    """What recipes require, as the ontology says that they were read from."""
    return lambda robot: match(ontology, recipes, possessions_of(robot)).lacking()


def required_of_plan(
    file: Path, plan: Plan[Any, Any], found: list[Diagnostic], *, folders: Sequence[Path] = ()
) -> Requirements | None:
    """What the recipe of a compiled plan requires; None if a person wrote the plan.

    A plan shows what its steps do, not what the classes of task and steps ask for besides. That is read from the recipe
    that the header names, also where the plan was edited. If that is gone, or has changed, a warning among ``found``
    says what is not known, and the answer is None.
    """
    with file.open(encoding="utf-8", errors="replace") as source:
        origin = header(source.read(LONGEST))
    if origin is None:
        return None
    span = Span(str(file))
    unknown = f"what the recipe {origin.recipe} itself requires of a robot is not known"
    recipe = recipe_of(file, origin, folders)
    if recipe is None:
        advice = "--ontologies DIR names a folder in which it is"
        found.append(warning("C011", f"{unknown}: it is not beside the plan", span, advice))
        return None
    try:
        ontology = load(recipe, folders=folders)
    except BadInput as problem:
        advice = f"planlang check {recipe} tells more"
        found.append(warning("C011", f"{unknown}: {problem.diagnostics[0].message}", span, advice))
        return None
    if not ontology.documents[0].sha256.startswith(origin.sha256):
        advice = f"planlang compile {recipe} -o {file} writes the plan anew"
        found.append(warning("C009", f"{unknown}: it has changed since this plan was compiled from it", span, advice))
        return None
    reading = read_recipe(Actions(ontology), plan.iri or origin.task, allow_abstract=True)
    return None if reading.recipes is None else required(ontology, reading.recipes)
