"""A recovery does the same again only if the failure may pass by itself, or if something was done or seen between."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import planlang
from planlang import Recovery, perform, plan
from planlang.designators import action
from planlang.failures import GraspMissed
from planlang.files import bundled
from planlang.ontology import Ontology, load
from planlang.recipe.actions import read_recoveries
from planlang.testing import compiled
from planlang.testing.running import attempt
from tests.support.examples import examples
from tests.support.repetition import base_poses, passing, repeated, retries

RECIPES = ("serve_a_drink", "pass_a_drink", "fetch_from_cabinet")
REACHING = ("ManipulationGoalNotReached", "ManipulationPoseUnreachable", "ManipulationGoalInCollision")
FAILURES = {
    "Translation-LocationChange": (
        "NavigationGoalNotReached",
        "NavigationPoseUnreachable",
        "NavigationGoalInCollision",
    ),
    "SteppingBack": ("NavigationGoalNotReached",),
    "Reaching": REACHING,
    "OpeningAGripper": ("GripperGoalNotReached",),
    "ClosingAGripper": ("GraspMissed", "GraspSlipped", "GripperGoalNotReached"),
    "LookingForSomething": ("ObjectNotFound", "LookingFailure", "AmbiguousPerception"),
    "HandingOverAnObject": ("HandoverNotTaken", "GripperGoalNotReached", "ObjectLost"),
    "OpeningAContainerArtifact": ("ContainerStuck", "HandleNotReachable", "GraspSlipped"),
    "ClosingAContainerArtifact": ("ContainerStuck", "HandleNotReachable"),
}
"""Action class -> failures that its process modules raise."""
FAULTS = st.sampled_from([(cls, failure) for cls, some in FAILURES.items() for failure in some])
WHEN = st.builds(lambda first, more: f"@{first}-{first + more}", st.integers(1, 4), st.integers(0, 3))


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


def plain_recoveries(path: Path) -> Iterator[str]:
    """Yield the recoveries in a file of Python that do nothing before the next attempt, and have no time."""
    calls = (one for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(one, ast.Call))
    for one in calls:
        stated = {keyword.arg for keyword in one.keywords}
        if getattr(one.func, "id", "") == "Recovery" and len(one.args) == 1 and not {"do", "within"} & stated:
            yield f"{path.name}:{one.lineno}"


def test_recoveries_of_the_constructs_and_process_modules_that_do_nothing_first_have_a_time() -> None:
    root = Path(planlang.__file__).parents[1]
    found = [one for folder in ("planlang", "executive") for path in (root / folder).rglob("*.py")
             if "templates" not in path.parts for one in plain_recoveries(path)]  # fmt: skip
    assert found == []


@pytest.mark.parametrize("recipe", RECIPES)
@given(faults=st.lists(st.tuples(FAULTS, WHEN), max_size=5))
@settings(max_examples=examples(500))
def test_whatever_fails_nothing_else_is_repeated_in_the_same_belief(
    vocabulary: Ontology, recipe: str, faults: list[tuple[tuple[str, str], str]]
) -> None:
    stated = [f"step.{cls}:fails={failure}{when}" for (cls, failure), when in faults]
    run = attempt(compiled(recipe), faults=stated)
    assert run.error is None
    assert list(repeated(run.events, passing(vocabulary))) == []
    for before, after in base_poses(run.events):
        assert before != after


def test_what_may_pass_is_repeated_at_once(vocabulary: Ontology) -> None:
    run = attempt(compiled("serve_a_drink"), faults=["step.OpeningAGripper:fails=GripperGoalNotReached@1-2"])
    assert (retries(run.events), list(repeated(run.events, ()))) == (2, ["GripperGoalNotReached"] * 2)
    assert list(repeated(run.events, passing(vocabulary))) == []


def test_a_plan_that_repeats_what_does_not_pass_is_found(vocabulary: Ontology) -> None:
    @plan
    async def close_again() -> None:
        await perform(action("ClosingAGripper"), recoveries=[Recovery(GraspMissed, retries=2)])

    run = attempt(close_again, faults=["step.ClosingAGripper:fails=GraspMissed@1"])
    assert list(repeated(run.events, passing(vocabulary))) == ["GraspMissed"]
