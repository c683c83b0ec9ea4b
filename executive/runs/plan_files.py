"""Plans to run: compiling them, finding the one that is meant, and what it needs of robot and modules."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from executive.robots import Availability, FindingKind, Missing, Robot, possessions_of
from executive.robots.tasks import match
from executive.runs.files import RecipeFile
from planlang.action_classes import ancestors_of
from planlang.designators import is_called
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.language.plan_text import Alternative, Needs
from planlang.language.plans import Plan
from planlang.language.source import PlanSource
from planlang.ontology import Ontology, expand, load, shorten
from planlang.ontology.catalog import FOLDER
from planlang.recipe import Actions, RecipeSet, read_recipe
from planlang.records import dataclass
from planlang.words import Blank, Text, calling

if TYPE_CHECKING:
    from planlang.compiler import CompiledPlan


def fixed_recipe(
    file: RecipeFile, diagnostics: list[Diagnostic], task: str | None, folders: Sequence[Path], accepted: Sequence[str]
) -> bytes:
    """Fix a recipe in memory, with uncertain fixes of accepted codes; lines of diagnostics are those of its text."""
    from planlang.recipe.fixes.fixing import fix_recipe  # slow to import, and most recipes are not fixed

    result = fix_recipe(file.path, task=task, folders=folders, accepted=frozenset(accepted), content=file.content)
    diagnostics.extend(note("C017", f"fixed {one.code} {one.message}", Span(str(file.path))) for one in result.done)
    for one, why in result.refused:
        diagnostics.append(warning("C022", f"refused: {one.code} {one.message}; {why}", one.span, why.advice))
    return result.content


def compiled(recipe: Ontology, task: str | None, performed: frozenset[str]) -> CompiledPlan:
    """Compile a recipe; ``performed`` are the action classes that process modules perform. Raises BadInput."""
    from planlang.compiler import compile_ontology  # plans run without the compiler

    return compile_ontology(recipe, task=task, performed=lambda: performed)


def main_plan(module: ModuleType, task: str | None) -> Plan[Any, Any]:
    """Find a plan by name or IRI; by default the last one in the file, which calls the others.

    Raises BadInput, listing the plans, if there is none, or not that one.
    """
    plans = [value for value in vars(module).values() if isinstance(value, Plan)]
    if not plans:
        advice = "mark the plan with @plan from planlang"
        raise BadInput([error("X002", "this file defines no plan", Span(str(module.__file__)), advice)])
    if task is None:
        return plans[-1]
    for plan in plans:
        if task == plan.name or is_called(plan.iri or "", task):
            return plan
    advice = f"this file defines {', '.join(plan.name for plan in plans)}"
    raise BadInput([error("R001", f"there is no task {task}", Span(str(module.__file__)), advice)])


@dataclass(frozen=True, slots=True)
class Assessment:
    """Requirements of a plan that a robot lacks, and infeasible alternatives of choices that have a feasible one.

    ``unknown`` are requirements that it may lack: the plan runs, with a warning.
    """

    missing: tuple[Missing, ...]
    infeasible: tuple[tuple[Alternative, Missing], ...] = ()
    unknown: tuple[Missing, ...] = ()

    def also(self, lacking: Iterable[Missing]) -> Assessment:
        """Add what the robot lacks of the recipe's requirements; each is listed once."""
        known = {(one.kind, one.name) for one in (*self.missing, *self.unknown)}
        others = [one for one in lacking if (one.kind, one.name) not in known]
        missing = tuple(one for one in others if one.state is Availability.MISSING)
        unknown = tuple(one for one in others if one.state is not Availability.MISSING)
        return Assessment((*self.missing, *missing), self.infeasible, (*self.unknown, *unknown))

    def notes(self, file: Path | None) -> Iterator[Diagnostic]:
        """Yield a note for each infeasible alternative, and a warning for each thing that the robot may lack.

        ``file`` is that of the plan, unless it is temporary.
        """
        for what in self.unknown:
            shown = calling("match", Blank("RECIPE"), robot=Blank("ROBOT"))
            advice = Text(shown, " shows why it is required; a self-model can claim it")
            yield warning("X009", f"the robot may lack {what}", None, advice)
        for alternative, why in self.infeasible:
            span = Span(str(file), alternative.line) if file is not None else None
            yield note("X008", f"the robot cannot do the alternative `{alternative.name}`: {why}", span)


Lacking = Callable[[Iterable[str]], tuple[Missing, ...]]
"""Finds all that is or may be missing for action classes."""


def assess(needs: Needs, lacking: Lacking, unperformed: Lacking = lambda actions: ()) -> Assessment:
    """Assess whether a robot can do what is needed.

    ``lacking`` finds what it lacks for action classes, ``unperformed`` the classes without a process module. If no
    alternative of a choice is feasible, all that they lack is missing.
    """
    lacks = (*unperformed(needs.modular), *lacking(needs.actions))
    missing = dict.fromkeys(one for one in lacks if one.state is Availability.MISSING)
    unknown = dict.fromkeys(one for one in lacks if one.state is not Availability.MISSING)
    infeasible: dict[tuple[Alternative, Missing], None] = {}
    for choice in needs.choices:
        assessed = [(alternative, assess(alternative.needs, lacking, unperformed)) for alternative in choice]
        feasible = [assessment for _, assessment in assessed if not assessment.missing]
        for alternative, assessment in assessed:
            unknown.update(dict.fromkeys(assessment.unknown))
            if not feasible:
                missing.update(dict.fromkeys(assessment.missing))
            elif assessment.missing:
                infeasible[alternative, assessment.missing[0]] = None
            else:
                infeasible.update(dict.fromkeys(assessment.infeasible))
    return Assessment(tuple(missing), tuple(infeasible), tuple(unknown))


def without_module(ontology: Ontology, performed: frozenset[str] | None, actions: Iterable[str]) -> tuple[Missing, ...]:
    """Find the action classes that no process module performs.

    ``performed`` are the classes that modules perform; None if unknown: then nothing is missing.
    """
    reason = "no process module is registered for it or a superclass"

    def vocabulary(cls: str) -> tuple[str, ...]:
        return tuple(map(shorten, ontology.ancestors(expand(cls))))

    return tuple(
        Missing(cls, FindingKind.ACTION, Availability.MISSING, (cls,), reason)
        for cls in actions
        if performed is not None and performed.isdisjoint(ancestors_of(cls, vocabulary))
    )


Requirements = Callable[[Robot], tuple[Missing, ...]]
"""Finds the requirements of a recipe that a robot lacks or may lack."""


def required(ontology: Ontology, recipes: RecipeSet) -> Requirements:
    """Make the requirements of recipes, which were read from ``ontology``."""
    return lambda robot: match(ontology, recipes, possessions_of(robot)).lacking()


def required_of_plan(recipe: Ontology, source: PlanSource, plan: Plan[Any, Any]) -> Requirements | None:
    """Make the requirements of a compiled plan, whose recipe may state more than its steps show."""
    assert source.header is not None
    reading = read_recipe(Actions(recipe), plan.iri or source.header.task)
    return None if reading.recipes is None else required(recipe, reading.recipes)


def recipe_of_plan(
    source: PlanSource, diagnostics: list[Diagnostic], *, folders: Sequence[Path] = ()
) -> Ontology | None:
    """Read the recipe of a compiled plan, with what it imports; None for a plan written by hand.

    It states requirements of the task and of its steps, and declares effects, which the plan does not show. It is named
    in the header, also of an edited plan. If it is missing or has changed, the result is None, with a warning in
    ``diagnostics``.
    """
    origin, file = source.header, source.path
    if origin is None:
        return None
    span = Span(str(file))
    unknown = f"the robot is not checked against the recipe {origin.recipe}, whose effects do not count"
    recipe = origin.find_recipe(file, folders)
    if recipe is None:
        advice = Text("name its folder with ", FOLDER)
        diagnostics.append(warning("C011", f"{unknown}: it was not found", span, advice))
        return None
    try:
        ontology = load(recipe, folders=folders)
    except BadInput as problem:
        advice = Text(calling("check", recipe), " shows more")
        diagnostics.append(warning("C011", f"{unknown}: {problem.diagnostics[0].message}", span, advice))
        return None
    if not ontology.documents[0].sha256.startswith(origin.sha256):
        advice = Text(calling("compile", recipe, output=file), " compiles the plan again")
        diagnostics.append(warning("C009", f"{unknown}: it has changed since this plan was compiled", span, advice))
        return None
    return ontology
