"""A recovery does the same again only if the failure may pass by itself, or if something was done or seen between."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import pytest

import planlang.failures as failures
from planlang.files import bundled
from planlang.ontology import Ontology, load, shorten
from planlang.recipe.actions import read_recoveries
from planlang.testing import compiled
from planlang.testing.running import attempt
from planlang.testing.script import Script
from planlang.testing.scripted import ScriptedExecutive
from tests.support.random_faults import FailingModule, RandomFaults

RECIPES = {"serve_a_drink": True, "pass_a_drink": False, "fetch_from_cabinet": True}
"""Recipe -> whether its base drives, so that there are other base poses."""


@pytest.fixture(scope="module")
def vocabulary() -> Ontology:
    """The bundled ontologies."""
    return load(bundled("ontologies") / "knowrob.omn")


def test_recoveries_that_do_nothing_first_are_marked_transient_and_have_a_count_and_a_time(
    vocabulary: Ontology,
) -> None:
    repeating = [rule for rule in read_recoveries(vocabulary) if rule.strategy == "Repeat"]
    assert repeating
    assert [rule.name for rule in repeating if not (rule.transient and rule.attempts and rule.within)] == []
    others = [rule.name for rule in read_recoveries(vocabulary) if rule.transient and rule.strategy != "Repeat"]
    assert others == [], "other strategies change something themselves"


def repeated(events: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Yield the failures after which a construct ran its body again, with nothing done since the failure."""
    failed: dict[int, int] = {}
    for number, event in enumerate(events):
        if event["event"] == "ended" and event.get("status") == "failed":
            failed[event["parent"]] = number
        elif event["event"] == "recovery" and event["decision"] == "retry":
            between = events[failed[event["node"]] : number]
            if not any(one["event"] == "started" and one["kind"] == "perform" for one in between):
                yield event["failure"]["type"]


def poses(events: Sequence[dict[str, Any]]) -> Iterator[tuple[object, object]]:
    """Yield each base pose that failed with the next one of its scope, each with the revision of the belief."""
    last: dict[int, dict[str, Any]] = {}
    tried: dict[int, tuple[object, object]] = {}
    for event in events:
        if event["event"] == "pose failed":
            tried[event["node"]] = last[event["node"]]["base"], last[event["node"]]["revision"]
        elif event["event"] == "solution":
            last[event["node"]] = event
            if (before := tried.pop(event["node"], None)) is not None:
                yield before, (event["base"], event["revision"])


@pytest.mark.parametrize("recipe", RECIPES)
def test_over_many_failures_nothing_else_is_repeated_in_the_same_belief(vocabulary: Ontology, recipe: str) -> None:
    rules = [rule for rule in read_recoveries(vocabulary) if rule.transient]
    passing = tuple(getattr(failures, shorten(name)) for rule in rules for name in rule.failures)
    passing += (failures.ManipulationGoalInCollision,)  # a contact has shown it: the belief is another one
    retries, others = 0, 0
    for seed in range(12):
        executive = ScriptedExecutive(Script())
        faults = RandomFaults(seed, 0.25, executive.ancestors)
        executive.modules = tuple(FailingModule(module, faults) for module in executive.modules)  # type: ignore[misc]
        run = attempt(compiled(recipe), executive=executive)
        for name in repeated(run.events):
            retries += 1
            assert issubclass(getattr(failures, name), passing), name
        for before, after in poses(run.events):
            others += 1
            assert before != after
    assert retries
    assert bool(others) is RECIPES[recipe]
