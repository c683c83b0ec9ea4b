"""A whole recipe compared with a robot: every step, every alternative, everything they require."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from executive.robots.finding import NEEDED, Availability, Finding, FindingKind, together
from executive.robots.matching import Judge, Missing, Possessions
from executive.robots.requirements import Semantics
from planlang.designators import local_name
from planlang.ontology import Ontology
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
        """Required capabilities, then components, that are missing, unknown or available."""
        return tuple(one for kind in NEEDED for one in self.required(kind) if one.state is state)

    def lacking(self) -> tuple[Missing, ...]:
        """What is missing, or may be, for the task; not what only an alternative needs for which another stands in."""
        found: dict[tuple[FindingKind, str], Missing] = {}
        for finding, path in self.tree.walk():
            if finding.kind not in NEEDED or finding.state is Availability.AVAILABLE:
                continue
            choices = [one.state for one in path if one.kind is FindingKind.ALTERNATIVES]
            if Availability.AVAILABLE in choices or (
                finding.state is Availability.MISSING and any(one is not Availability.MISSING for one in choices)
            ):
                continue
            because = tuple(one.iri or one.text for one in (*path, finding) if one.kind is not FindingKind.ALTERNATIVES)
            what = finding.iri or finding.text
            found.setdefault((finding.kind, what), Missing(what, finding.kind, finding.state, because, finding.reason))
        return tuple(found.values())

    def lines(self, *, all_of_it: bool = True) -> Iterator[str]:
        """The verdict, the tree, and where what is missing could be had."""
        yield from self.tree.lines(all_of_it=all_of_it)
        for state, verb in ((Availability.MISSING, "lacks"), (Availability.UNKNOWN, "may lack")):
            names = [f"{one.kind.value} {one.text}" for one in self.in_state(state)]
            if names:
                yield f"{self.robot} {verb} {', '.join(names)}"
        if self.feasible:
            yield f"{self.robot} has all that {self.tree.text} requires"

    def as_json(self) -> dict[str, Any]:
        """The match as JSON data; names are local ones."""
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
    judge = Judge(ontology, robot, semantics)
    return Match(robot.robot, semantics, _Tree(judge, recipes).task(recipes.main, ()))


class _Tree:
    def __init__(self, judge: Judge, recipes: RecipeSet) -> None:
        self.judge = judge
        self.recipes = recipes.recipes

    def task(self, recipe: Recipe, above: tuple[str, ...]) -> Finding:
        """A recipe: what its own class requires, and its steps."""
        own = self.judge.action(recipe.action_class, span=recipe.span)
        steps: tuple[Step, ...] = recipe.steps
        if self.judge.semantics is Semantics.ORIGINAL and recipe.dialect not in SEEN_BY_THE_ORIGINAL:
            steps = ()
        performed = [self.step(step, (*above, recipe.iri)) for step in steps]
        state = together(one.state for one in (own, *performed))
        text = recipe.name if not above else f"recipe {recipe.name}"
        return Finding(FindingKind.TASK, text, recipe.iri, state, "", recipe.span, (*own.below, *performed))

    def step(self, step: Step, above: tuple[str, ...]) -> Finding:
        """A step: what its class requires, and the recipe that performs it, or the best of several."""
        own = self.judge.action(step.action_class, span=step.span)
        inner = [self.recipes[iri] for iri in step.recipes if iri in self.recipes and iri not in above]
        performed = tuple(self.task(recipe, above) for recipe in inner)
        if len(performed) > 1:
            state = together((one.state for one in performed), any_of=True)
            performed = (Finding(FindingKind.ALTERNATIVES, "one of", None, state, "", None, performed),)
        state = together(one.state for one in (own, *performed))
        text = step.name if step.action == step.name else f"{step.name} ({local_name(step.action)})"
        return Finding(FindingKind.ACTION, text, step.iri, state, "", step.span, (*own.below, *performed))
