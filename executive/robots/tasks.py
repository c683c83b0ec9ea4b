"""Matching of whole recipes with a robot: all steps, and all alternatives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

from executive.robots.matching import Matcher, Missing, Possessions, lacking_in, missing_in
from executive.robots.requirements import NEEDED, Availability, Finding, FindingKind, together
from planlang.designators import a_device, local_name
from planlang.ontology import Ontology, expand, shorten
from planlang.recipe import Kind, Recipe, RecipeSet, Step, Thing
from planlang.recipe.actions import read_primitives
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Match:
    """Result of matching a task with a robot; ``tree`` has the reasons."""

    robot: str
    tree: Finding

    @property
    def feasible(self) -> bool | None:
        """True if the robot has all that the task requires, False if something is missing, None if that is unknown."""
        return self.tree.state.decided

    def required(self, kind: FindingKind) -> tuple[Finding, ...]:
        """List the capabilities, or the components, that the task requires, each once."""
        return _distinct(finding for finding, _ in self.tree.walk() if finding.kind == kind)

    def in_state(self, state: Availability) -> tuple[Finding, ...]:
        """List the capabilities, then the components, that are missing or unknown and cannot be avoided."""
        lacking = [one for one, _ in lacking_in(self.tree) if one.state is state]
        return _distinct(one for kind in NEEDED for one in lacking if one.kind is kind)

    def unknown(self) -> tuple[Finding, ...]:
        """List the steps without stated requirements that neither a recipe nor a process module performs."""
        steps = [one for one, _ in lacking_in(self.tree) if one.kind not in NEEDED and one.reason == UNKNOWN_STEP]
        return _distinct(steps)

    def unknown_steps(self) -> tuple[str, ...]:
        """List the names of these steps."""
        return tuple(local_name(one.iri or one.text) for one in self.unknown())

    def lacking(self) -> tuple[Missing, ...]:
        """List the requirements that the robot lacks or may lack and that no alternative avoids."""
        return missing_in([self.tree])

    def lines(self) -> Iterator[str]:
        """Draw the tree, line by line, then the verdict."""
        yield from self.tree.lines()
        for state, verb in ((Availability.MISSING, "lacks"), (Availability.UNKNOWN, "may lack")):
            names = [f"{one.kind.value} {one.text}" for one in self.in_state(state)]
            if names:
                yield f"{self.robot} {verb} {', '.join(names)}"
        if unknown := self.unknown_steps():
            yield f"nothing performs these steps or says what they require: {', '.join(unknown)}"
        if self.feasible:
            yield f"{self.robot} has all that {self.tree.text} requires"

    def as_json(self) -> dict[str, Any]:
        """Convert the match to JSON data with local names."""
        data: dict[str, Any] = {"robot": self.robot, "feasible": self.feasible}
        for kind, plural in ((FindingKind.CAPABILITY, "capabilities"), (FindingKind.COMPONENT, "components")):
            required = self.required(kind)
            data[f"required_{plural}"] = sorted(one.text for one in required)
            for state in (Availability.MISSING, Availability.UNKNOWN):
                data[f"{state.value}_{plural}"] = sorted(one.text for one in self.in_state(state) if one.kind is kind)
        data["unknown_steps"] = sorted(self.unknown_steps())
        return {**data, "explanation": self.tree.as_json()}


def _distinct(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    distinct: dict[str, Finding] = {}
    for finding in findings:
        distinct.setdefault(finding.iri or finding.text, finding)
    return tuple(distinct.values())


UNKNOWN_STEP = "nothing performs it, and nothing says what it requires"


def match(
    ontology: Ontology,
    task: RecipeSet | str,
    robot: Possessions,
    performed: frozenset[str] = frozenset(),
) -> Match:
    """Compare a task with a robot: its recipe, or a class of actions (IRI) that has none.

    ``ontology`` is the one that the recipe was read from, ``performed`` the classes that registered process modules
    perform.
    """
    matcher = Matcher(ontology, robot)
    if isinstance(task, str):
        return Match(robot.robot, _Tree(matcher, {}, performed).action(task))
    return Match(robot.robot, _Tree(matcher, task.recipes, performed).task(task.main, ()))


class _Tree:
    def __init__(self, matcher: Matcher, recipes: Mapping[str, Recipe], performed: frozenset[str]) -> None:
        self.matcher = matcher
        self.recipes = recipes
        self.performed = performed | read_primitives(matcher.ontology).keys()

    def task(self, recipe: Recipe, above: tuple[str, ...]) -> Finding:
        """Check a recipe: the requirements of its class, and its steps."""
        own = self.matcher.action(recipe.action_class, span=recipe.span)
        performed = [self.step(step, (*above, recipe.iri)) for step in recipe.steps]
        state = together(one.state for one in (own, *performed))
        text = recipe.name if not above else f"recipe {recipe.name}"
        return Finding(FindingKind.TASK, text, recipe.iri, state, "", recipe.span, (*own.below, *performed))

    def step(self, step: Step, above: tuple[str, ...]) -> Finding:
        """Check a step: the requirements of its class, and the best recipe that performs it.

        A choice between alternatives needs only one of them.
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
        devices = tuple(self._devices(step))
        state = together(one.state for one in (own, *devices, *performed))
        text = step.name if local_name(step.action) == step.name else f"{step.name} ({local_name(step.action)})"
        finding = Finding(FindingKind.ACTION, text, step.iri, state, "", step.span, (*own.below, *devices, *performed))
        return self._or_unknown(finding, step.action_class) if step.is_abstract else finding

    def _devices(self, step: Step) -> Iterator[Finding]:
        """Yield the arms and hands that a step names and the robot lacks."""
        for one in step.parameters:
            if isinstance(one.filler, Thing) and one.filler.kind is Kind.DEVICE:
                found = self.matcher.device(a_device(one.filler.type, one.filler.iri), one.span)
                yield from () if found is None else (found,)

    def action(self, cls: str) -> Finding:
        """Check a class of actions without a recipe."""
        return self._or_unknown(self.matcher.action(cls, span=self.matcher.ontology.span(cls)), cls)

    def _or_unknown(self, finding: Finding, cls: str) -> Finding:
        """Replace the finding about an action without a recipe by UNKNOWN if nothing states what it requires."""
        if finding.below or self._is_performed(cls):
            return finding
        return replace(finding, state=Availability.UNKNOWN, reason=UNKNOWN_STEP)

    def _is_performed(self, cls: str) -> bool:
        """Check whether a primitive or a process module performs a class of actions or a superclass."""
        ontology = self.matcher.ontology
        return any(
            not self.performed.isdisjoint((above, shorten(above), local_name(above)))
            for above in ontology.ancestors(cls)
        )


HARDWARE = expand("srdl2-comp:HardwareComponent")
