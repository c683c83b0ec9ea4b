"""What is executed, or replayed, of a plan: its subject; the plan with its budget, after actions that come first."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from executive.maps import SemanticMap
from executive.options.running import SituationSettings
from executive.runs.allowance import Allowance
from executive.runs.options import RunResult
from executive.runs.parameters import Bound
from executive.runs.true_world import TrueWorld
from planlang.designators import Action, Object, action
from planlang.diagnostics import BadInput, Diagnostic, error, warning
from planlang.language.budgets import budget
from planlang.language.performing import perform
from planlang.language.plan_text import Needs
from planlang.language.plans import Plan
from planlang.language.preceding import preceded
from planlang.language.recovery import trying_more, without_recoveries
from planlang.language.tidying import tidied
from planlang.ontology import shorten
from planlang.records import dataclass
from planlang.runs import RunTree
from planlang.runs.codec import load as load_exact
from planlang.spelling import similar
from planlang.words import Option, Text
from sim import Scene

STEPS = ("perform", "at_location")
"""Kinds of constructs before which an action may come."""
NO_SETTINGS = SituationSettings()
MOST_ALIKE = 3
"""Steps that are named in place of one to which a run did not come."""
ACTIONS_BEFORE = "with_actions_before"
"""Node around a plan before which actions come."""


@dataclass(frozen=True, slots=True)
class Subject:
    """Subject of a plan: the map, its bodies, the parameters, what the plan needs, and what is there in truth."""

    map: SemanticMap
    scene: Scene
    bound: Mapping[str, Bound]
    needs: Needs
    there: TrueWorld | None = None
    """The true world; None if that is as the map."""

    @property
    def in_truth(self) -> tuple[SemanticMap, Scene]:
        """The map and the bodies of what is there in truth, whose names goals have."""
        return (self.map, self.scene) if self.there is None else (self.there.map, self.there.scene)


@dataclass(frozen=True, slots=True)
class ActionBefore:
    """An action that comes before the plan, or before a step of it."""

    action: Action
    step: str = ""
    """Path of the step, as failures state it; empty: before the plan."""

    @staticmethod
    def read(stated: Iterable[str], semantic_map: SemanticMap, plan: str) -> list[ActionBefore]:
        """Read texts such as ``OpeningAContainerArtifact door1``, or before a step of the plan ``ACTION THING@PATH``.

        Raises BadInput.
        """
        found = []
        for text in stated:
            what, step = _parts(text)
            kind, _, name = what.partition(" ")
            thing = semantic_map.find(name.strip()) if name else None
            if not kind or thing is None or thing.pose is None:
                message = Text(Option("before", text), ": it is no action on a thing of the map")
                raise BadInput([error("X005", message, help="write the class of an action and a thing, such as door1")])
            if "@" in text and not step.startswith(f"{plan}/"):
                message = Text(Option("before", text), ": what follows @ is no step of the plan")
                advice = f"name the step as failures do, by its path: {plan}/budget/{plan}/..."
                raise BadInput([error("X005", message, help=advice)])
            act = action(kind, object_acted_on=Object(shorten(thing.types[0]), thing.iri))
            found.append(ActionBefore(act, step))
        return found

    @staticmethod
    def recorded(header: Mapping[str, Any]) -> list[ActionBefore]:
        """Read those of the header of a trace. Raises ValueError."""
        actions, stated = load_exact(header.get("actions_before", [])), header.get("before") or ()
        return [ActionBefore(one, _parts(text)[1]) for one, text in zip(actions, stated, strict=True)]


def steps_not_reached(first: Sequence[ActionBefore], records: Iterable[Mapping[str, Any]]) -> list[Diagnostic]:
    """Warn of steps before which actions should have come, and to which a run, by its trace, did not come."""
    if not any(one.step for one in first):
        return []
    tree = RunTree()
    for record in records:
        tree.add(record)
    paths = {node.path for node in tree.numbered.values()}
    steps = dict.fromkeys(node.path for node in tree.numbered.values() if node.kind in STEPS)
    found = []
    for one in first:
        tried = f"{one.step.rpartition('/')[0]}/{one.action.type}"  # it may have failed before the step began
        if one.step and not paths & {one.step, tried}:
            message = Text(Option("before"), f": the run did not come to the step {one.step}: nothing came before it")
            alike = ", ".join(similar(one.step, steps, n=MOST_ALIKE))
            advice = f"name a step that it came to, such as {alike}" if alike else "name a step that it came to"
            found.append(warning("X035", message, help=advice))
    return found


def told_of_steps(
    result: RunResult, first: Sequence[ActionBefore], announce: Callable[[Sequence[Diagnostic]], None]
) -> RunResult:
    """Announce steps to which a run did not come, unless it was interrupted, and return it with these warnings."""
    found = [] if result.is_interrupted else steps_not_reached(first, result.trace)
    if not found:
        return result
    announce(found)
    return replace(result, diagnostics=(*result.diagnostics, *found))


def body_of(
    plan: Plan[Any, Any],
    bound: Mapping[str, Bound],
    allowance: Allowance,
    first: Sequence[ActionBefore] = (),
    settings: SituationSettings = NO_SETTINGS,
) -> Callable[[], Awaitable[Any]]:
    """Make what a host runs: the actions that come ``first``, and the plan, within an ``allowance``.

    ``settings`` state whether it is without its recoveries, or how often more each of them may try.
    """
    before_plan = [one.action for one in first if not one.step]
    before_steps: dict[str, list[Action]] = {}
    for one in first:
        if one.step:
            before_steps.setdefault(one.step, []).append(one.action)

    async def before_and_plan() -> Any:
        for action_before in before_plan:
            await perform(action_before)
        return await plan(**bound)

    before_and_plan.__name__ = ACTIONS_BEFORE
    whole = before_and_plan if before_plan else partial(plan, **bound)

    async def body() -> Any:
        more = without_recoveries() if settings.no_recoveries else trying_more(settings.attempts or 0)
        with more, preceded(before_steps):
            within = partial(budget, whole, seconds=allowance.seconds, attempts=allowance.attempts)
            return await tidied(within)

    body.__name__ = plan.name
    vars(body)["iri"] = plan.iri
    return body


def _parts(text: str) -> tuple[str, str]:
    """An action, and the path of the step before which it comes."""
    what, _, step = text.partition("@")
    return what.strip(), step.strip()
