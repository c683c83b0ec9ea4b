"""A whole recipe compared with a robot: every step, every alternative."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from executive.robots.matching import Matcher, Missing, Possessions, lacking_in, missing_in
from executive.robots.original import OriginalMatcher
from executive.robots.requirements import (
    NEEDED,
    Availability,
    Finding,
    FindingKind,
    Semantics,
    together,
)
from planlang.designators import local_name
from planlang.ontology import Ontology, expand, shorten
from planlang.recipe import Recipe, RecipeSet, Step
from planlang.recipe.actions import read_primitives
from planlang.records import dataclass


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
        return _distinct(finding for finding, _ in self.tree.walk() if finding.kind == kind)

    def in_state(self, state: Availability) -> tuple[Finding, ...]:
        """Return the capabilities, then components, that are missing or unknown and not avoided by an alternative."""
        lacking = [one for one, _ in lacking_in(self.tree) if one.state is state]
        return _distinct(one for kind in NEEDED for one in lacking if one.kind is kind)

    def unknown(self) -> tuple[Finding, ...]:
        """Return the steps of which nothing is known: neither what they require nor who performs them."""
        found = [one for one, _ in lacking_in(self.tree) if one.kind not in NEEDED and one.reason == UNKNOWN_STEP]
        return _distinct(found)

    def unknown_steps(self) -> tuple[str, ...]:
        """Return the names of these steps."""
        return tuple(local_name(one.iri or one.text) for one in self.unknown())

    def lacking(self) -> tuple[Missing, ...]:
        """Return what the task lacks or may lack, without what only one of several alternatives needs."""
        return missing_in([self.tree])

    def lines(self, *, all_of_it: bool = True) -> Iterator[str]:
        """Yield the tree and the verdict."""
        yield from self.tree.lines(all_of_it=all_of_it)
        for state, verb in ((Availability.MISSING, "lacks"), (Availability.UNKNOWN, "may lack")):
            names = [f"{one.kind.value} {one.text}" for one in self.in_state(state)]
            if names:
                yield f"{self.robot} {verb} {', '.join(names)}"
        if unknown := self.unknown_steps():
            yield f"nothing performs these steps or says what they require: {', '.join(unknown)}"
        if self.feasible:
            yield f"{self.robot} has all that {self.tree.text} requires"

    def as_json(self) -> dict[str, Any]:
        """Return the match as JSON data; names are local ones."""
        data: dict[str, Any] = {"robot": self.robot, "semantics": self.semantics.value, "feasible": self.feasible}
        for kind, plural in ((FindingKind.CAPABILITY, "capabilities"), (FindingKind.COMPONENT, "components")):
            required = self.required(kind)
            data[f"required_{plural}"] = sorted(one.text for one in required)
            for state in (Availability.MISSING, Availability.UNKNOWN):
                data[f"{state.value}_{plural}"] = sorted(one.text for one in self.in_state(state) if one.kind is kind)
        data["unknown_steps"] = sorted(self.unknown_steps())
        return {**data, "explanation": self.tree.as_json()}


def _distinct(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    found: dict[str, Finding] = {}
    for finding in findings:
        found.setdefault(finding.iri or finding.text, finding)
    return tuple(found.values())


UNKNOWN_STEP = "nothing performs it, and nothing says what it requires"


def match(
    ontology: Ontology,
    task: RecipeSet | str,
    robot: Possessions,
    semantics: Semantics = Semantics.CLOSURE,
    performed: frozenset[str] = frozenset(),
) -> Match:
    """Compare a task with a robot: its recipe, or a class of actions (IRI) that has none.

    ``ontology`` is the one that the recipe was read from, ``performed`` the classes that registered process modules
    perform. The original semantics read the ontology itself.
    """
    if semantics is Semantics.ORIGINAL:
        iri = task if isinstance(task, str) else task.main.iri
        return Match(robot.robot, semantics, OriginalMatcher(ontology, robot).task(iri))
    matcher = Matcher(ontology, robot)
    if isinstance(task, str):
        return Match(robot.robot, semantics, _Tree(matcher, {}, performed).action(task))
    return Match(robot.robot, semantics, _Tree(matcher, task.recipes, performed).task(task.main, ()))


class _Tree:
    def __init__(self, matcher: Matcher, recipes: Mapping[str, Recipe], performed: frozenset[str]) -> None:
        self.matcher = matcher
        self.recipes = recipes
        self.performed = performed | read_primitives(matcher.ontology).keys()

    def task(self, recipe: Recipe, above: tuple[str, ...]) -> Finding:
        """Return the finding about a recipe: what its own class requires, and its steps."""
        own = self.matcher.action(recipe.action_class, span=recipe.span)
        performed = [self.step(step, (*above, recipe.iri)) for step in recipe.steps]
        state = together(one.state for one in (own, *performed))
        text = recipe.name if not above else f"recipe {recipe.name}"
        return Finding(FindingKind.TASK, text, recipe.iri, state, "", recipe.span, (*own.below, *performed))

    def step(self, step: Step, above: tuple[str, ...]) -> Finding:
        """Return the finding about a step: what its class requires, and the best recipe that performs it.

        Of a step that is nothing but its alternatives one is enough.
        """
        own = self.matcher.action(step.action_class, span=step.span)
        inner = [self.recipes[iri] for iri in step.recipes if iri in self.recipes and iri not in above]
        if step.is_choice:
            performed = tuple(self.step(one, above) for recipe in inner for one in recipe.steps)
        else:
            performed = tuple(self.task(recipe, above) for recipe in inner)
        if len(performed) > 1:
            state = together((one.state for one in performed), any_of=True)
            performed = (Finding(FindingKind.ALTERNATIVES, "one of", None, state, "", None, performed),)
        state = together(one.state for one in (own, *performed))
        text = step.name if local_name(step.action) == step.name else f"{step.name} ({local_name(step.action)})"
        found = Finding(FindingKind.ACTION, text, step.iri, state, "", step.span, (*own.below, *performed))
        return self._judged(found, step.action_class) if step.is_abstract else found

    def action(self, cls: str) -> Finding:
        """Return the finding about a class of actions without recipe."""
        return self._judged(self.matcher.action(cls, span=self.matcher.ontology.span(cls)), cls)

    def _judged(self, found: Finding, cls: str) -> Finding:
        """Return the finding about an action without recipe: unknown if nothing is known of it."""
        if found.below or self._is_performed(cls):
            return found
        return replace(found, state=Availability.UNKNOWN, reason=UNKNOWN_STEP)

    def _is_performed(self, cls: str) -> bool:
        """Return whether a primitive or a process module performs a class of actions or one above it."""
        ontology = self.matcher.ontology
        return any(
            not self.performed.isdisjoint((above, shorten(above), local_name(above)))
            for above in ontology.ancestors(cls)
        )


HARDWARE = expand("srdl2-comp:HardwareComponent")
