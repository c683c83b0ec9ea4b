"""A whole recipe compared with a robot: every step, every alternative, and where missing things could be had.

A missing thing is searched with its specialisations, nearest first; the requirements of a candidate are checked in the
same way, and the first one without unmet requirement is taken. Hardware cannot be had from a knowledge base."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from executive.robots.matching import Matcher, Missing, Possessions, missing_in
from executive.robots.requirements import (
    NEEDED,
    Availability,
    Finding,
    FindingKind,
    Semantics,
    requirements_of,
    together,
)
from planlang.designators import local_name
from planlang.ontology import Ontology, expand
from planlang.recipe import Recipe, RecipeSet, Step
from planlang.recipe.model import FLAT, INTERSECTION

SEEN_BY_THE_ORIGINAL = (INTERSECTION, FLAT)
"""Dialects whose sub-actions KnowRob's SRDL saw; all others read as empty."""


@dataclass(frozen=True, slots=True)
class Match:
    """A task and a robot. ``tree`` has the reasons."""

    robot: str
    semantics: Semantics
    tree: Finding

    @property
    def feasible(self) -> bool | None:
        """False if something is missing, None if something may be."""
        return {Availability.AVAILABLE: True, Availability.MISSING: False}.get(self.tree.state)

    def required(self, kind: FindingKind) -> tuple[Finding, ...]:
        """Return the capabilities, or the components, that the task requires, each once."""
        found: dict[str, Finding] = {}
        for finding, path in self.tree.walk():
            followed = sum(one.kind is FindingKind.CAPABILITY for one in path)
            if self.semantics is Semantics.ORIGINAL and followed > (kind is FindingKind.COMPONENT):
                continue
            if finding.kind == kind:
                found.setdefault(finding.iri or finding.text, finding)
        return tuple(found.values())

    def in_state(self, state: Availability) -> tuple[Finding, ...]:
        """Return the required capabilities, then components, that are missing, unknown or available."""
        return tuple(one for kind in NEEDED for one in self.required(kind) if one.state is state)

    def lacking(self) -> tuple[Missing, ...]:
        """Return what the task lacks or may lack, without what only one of several alternatives needs."""
        return missing_in([self.tree])

    def lines(self, *, all_of_it: bool = True) -> Iterator[str]:
        """Yield the verdict, the tree, and where what is missing could be had."""
        yield from self.tree.lines(all_of_it=all_of_it)
        for state, verb in ((Availability.MISSING, "lacks"), (Availability.UNKNOWN, "may lack")):
            names = [f"{one.kind.value} {one.text}" for one in self.in_state(state)]
            if names:
                yield f"{self.robot} {verb} {', '.join(names)}"
        if self.feasible:
            yield f"{self.robot} has all that {self.tree.text} requires"

    def as_json(self) -> dict[str, Any]:
        """Return the match as JSON data; names are local ones."""
        data: dict[str, Any] = {"robot": self.robot, "semantics": self.semantics.value, "feasible": self.feasible}
        for kind, plural in ((FindingKind.CAPABILITY, "capabilities"), (FindingKind.COMPONENT, "components")):
            required = self.required(kind)
            data[f"required_{plural}"] = sorted(one.text for one in required)
            for state in (Availability.MISSING, Availability.UNKNOWN):
                data[f"{state.value}_{plural}"] = sorted(one.text for one in required if one.state is state)
        return {**data, "explanation": self.tree.as_json()}


def match(
    ontology: Ontology, recipes: RecipeSet, robot: Possessions, semantics: Semantics = Semantics.CLOSURE
) -> Match:
    """Compare a recipe with a robot. ``ontology`` is the one that the recipe was read from."""
    matcher = Matcher(ontology, robot, semantics)
    return Match(robot.robot, semantics, _Tree(matcher, recipes).task(recipes.main, ()))


class _Tree:
    def __init__(self, matcher: Matcher, recipes: RecipeSet) -> None:
        self.matcher = matcher
        self.recipes = recipes.recipes

    def task(self, recipe: Recipe, above: tuple[str, ...]) -> Finding:
        """Return the finding about a recipe: what its own class requires, and its steps."""
        own = self.matcher.action(recipe.action_class, span=recipe.span)
        steps: tuple[Step, ...] = recipe.steps
        if self.matcher.semantics is Semantics.ORIGINAL and recipe.dialect not in SEEN_BY_THE_ORIGINAL:
            steps = ()
        performed = [self.step(step, (*above, recipe.iri)) for step in steps]
        state = together(one.state for one in (own, *performed))
        text = recipe.name if not above else f"recipe {recipe.name}"
        return Finding(FindingKind.TASK, text, recipe.iri, state, "", recipe.span, (*own.below, *performed))

    def step(self, step: Step, above: tuple[str, ...]) -> Finding:
        """Return the finding about a step: what its class requires, and the best recipe that performs it."""
        own = self.matcher.action(step.action_class, span=step.span)
        inner = [self.recipes[iri] for iri in step.recipes if iri in self.recipes and iri not in above]
        performed = tuple(self.task(recipe, above) for recipe in inner)
        if len(performed) > 1:
            state = together((one.state for one in performed), any_of=True)
            performed = (Finding(FindingKind.ALTERNATIVES, "one of", None, state, "", None, performed),)
        state = together(one.state for one in (own, *performed))
        text = step.name if step.action == step.name else f"{step.name} ({local_name(step.action)})"
        return Finding(FindingKind.ACTION, text, step.iri, state, "", step.span, (*own.below, *performed))


HARDWARE = expand("srdl2-comp:HardwareComponent")
DEEPEST = 8
"""Requirements of requirements that are followed."""


def with_remedies(match: Match, matcher: Matcher, knowledge: Iterable[Ontology]) -> Match:
    """Return the match with a remedy at everything missing or unknown for which the knowledge base has one."""
    search = _Search(matcher, tuple(knowledge))
    return replace(match, tree=search.with_remedies(match.tree))


class _Search:
    def __init__(self, matcher: Matcher, knowledge: tuple[Ontology, ...]) -> None:
        self.matcher = matcher
        self.knowledge = knowledge
        own = {part.iri for part in matcher.robot.parts}
        self.own = frozenset(iri for iri in own if iri)

    def with_remedies(self, finding: Finding) -> Finding:
        below = tuple(self.with_remedies(one) for one in finding.below)
        remedy = ""
        if finding.iri and finding.state is not Availability.AVAILABLE and finding.kind in NEEDED:
            ways = self.remedy(finding.kind, finding.iri, ())
            remedy = f"could be had: {', with '.join(ways)}" if ways else ""
        return replace(finding, below=below, remedy=remedy)

    def remedy(self, kind: FindingKind, cls: str, above: tuple[str, ...]) -> tuple[str, ...]:
        """Return what to get so that a missing class is there, with what that takes; nothing if there is no way."""
        if cls in above or len(above) >= DEEPEST:
            return ()
        inside = (*above, cls)
        for special in self._specialisations(cls):
            if kind is FindingKind.COMPONENT and self._is_hardware(special):
                continue
            unmet = self._unmet(special)
            needed = [self.remedy(one.kind, one.iri or "", inside) for one in unmet]
            if any(not one for one in needed):
                continue
            met = tuple(what for one in needed for what in one)
            if kind is FindingKind.COMPONENT:
                source = next(self._individuals(special), None)
                if source is not None:
                    return (source, *met)
            elif unmet or special != cls:
                takes = met if unmet else (f"{local_name(special)}, all that it takes is there",)
                return takes
        return ()

    def _specialisations(self, cls: str) -> Iterator[str]:
        yield from dict.fromkeys(below for one in self.knowledge for below in one.subclasses(cls))

    def _is_hardware(self, cls: str) -> bool:
        return any(one.taxonomy.is_below(cls, HARDWARE) for one in self.knowledge)

    def _unmet(self, cls: str) -> list[Finding]:
        """Return what a class requires and the robot does not have."""
        stated = [(one, needed) for one in self.knowledge for needed in requirements_of(one, cls)]
        found = {needed.text: self.matcher.requirement(needed) for _, needed in stated}
        return [one for one in found.values() if one.state is not Availability.AVAILABLE]

    def _individuals(self, cls: str) -> Iterator[str]:
        """Yield individuals of just this class that are no parts of the robot, with where they are."""
        for one in self.knowledge:
            for iri in one.individuals(cls):
                if iri not in self.own and cls in one.types(iri) and not one.is_class(iri):
                    yield f"{local_name(iri)} ({local_name(cls)}, {one.span(iri)})"
