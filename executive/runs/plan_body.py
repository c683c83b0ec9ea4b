"""What is executed, or replayed, of a plan: its subject; the plan with its budget, after actions that come first."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from executive.maps import SemanticMap
from executive.runs.parameters import Bound
from planlang.designators import Action, Object, action
from planlang.diagnostics import BadInput, error
from planlang.language.budgets import budget
from planlang.language.performing import perform
from planlang.language.plan_text import Needs
from planlang.language.plans import Plan
from planlang.language.recovery import trying_more, without_recoveries
from planlang.language.source import PlanSource
from planlang.language.tidying import tidied
from planlang.ontology import shorten
from planlang.records import dataclass
from planlang.words import Option, Text
from sim import Scene

BUDGET, PER_STEP = 600.0, 60.0
"""Plan time, beside waiting, after which a run is aborted: a constant, and more for each step of the plan [s]."""


@dataclass(frozen=True, slots=True)
class Subject:
    """Subject of a plan: the map, its bodies, the parameters, and what the plan needs."""

    map: SemanticMap
    scene: Scene
    bound: Mapping[str, Bound]
    needs: Needs


def allowance(source: PlanSource, bound: Mapping[str, Bound], first: Sequence[Action] = ()) -> float:
    """Plan time after which the run is aborted [s]; stated waiting times extend it."""
    stated = sum(value for value in bound.values() if isinstance(value, float))
    return BUDGET + PER_STEP * (len(source.actions) + len(first)) + source.waiting + stated


def body_of(
    plan: Plan[Any, Any],
    bound: Mapping[str, Bound],
    seconds: float,
    first: Sequence[Action] = (),
    *,
    bare: bool = False,
    attempts: int = 0,
) -> Callable[[], Awaitable[Any]]:
    """Make what a host runs: the actions that come ``first``, then the plan, within ``seconds`` of plan time.

    If ``bare``, without its recoveries; else each of these may try ``attempts`` times more.
    """

    async def with_actions_before() -> Any:
        for one in first:
            await perform(one)
        return await plan(**bound)

    whole = with_actions_before if first else partial(plan, **bound)

    async def body() -> Any:
        with without_recoveries() if bare else trying_more(attempts):
            return await tidied(partial(budget, whole, seconds=seconds))

    body.__name__ = plan.name
    vars(body)["iri"] = plan.iri
    return body


def actions_before(stated: Iterable[str], semantic_map: SemanticMap) -> list[Action]:
    """Read actions that come before a plan, such as ``OpeningAContainerArtifact door1``. Raises BadInput."""
    found = []
    for text in stated:
        kind, _, name = text.strip().partition(" ")
        thing = semantic_map.find(name.strip()) if name else None
        if not kind or thing is None or thing.pose is None:
            message = Text(Option("before", text), ": it is no action on a thing of the map")
            raise BadInput([error("X005", message, help="write the class of an action and a thing, such as door1")])
        found.append(action(kind, object_acted_on=Object(shorten(thing.types[0]), thing.iri)))
    return found
