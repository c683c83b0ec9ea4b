"""A step keeps one name and one class from the recipe to the trace, whatever is ordered, and whoever performs it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from examples import examples
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.failures import GraspMissed
from planlang.language.loading import load_plan
from planlang.testing import PlanRun, Script, run_plan

HEAD = """
Prefix: : <http://example.org/soup.owl#>
Prefix: k: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/soup.owl>
Import: <http://knowrob.org/kb/knowrob.owl>
"""
ABOVE = {
    "StirSoup": ("k:PurposefulAction",),
    "Waiting2": ("k:Waiting",),
    "Waiting3": ("Waiting2",),
    "k:Stirring7": ("k:Stirring",),
    "step_b": ("k:PurposefulAction",),
    "StepB": ("k:Mixing", "k:Stirring"),
    "taste-it": ("StirSoup", "k:LookingForSomething"),
    "Name": ("k:LookingForSomething",),
    "limit": ("k:LookingForSomething",),
    "Import": ("k:PurposefulAction",),
}
"""Steps and their superclasses: unknown classes, numbered copies, names that Python or the plan language has, too."""
FARTHER = ("PurposefulAction", "Stirring", "Mixing")
BUNDLED = {"k:LookingForSomething": "perception", "k:Waiting": "waiting"}
"""Classes that every scripted robot performs -> its process modules."""


def recipe(steps: Sequence[str], pairs: Sequence[tuple[str, str]]) -> str:
    """The text of a task of these steps, in the order of these pairs."""
    parts = ["k:PurposefulAction", *(f"k:subAction some {step}" for step in steps)]
    parts += [f"k:orderingConstraints value O{number}" for number, _ in enumerate(pairs)]
    lines = [HEAD, f"Class: MakeSoup SubClassOf: {', '.join(parts)}"]
    lines += [f"Class: {step} SubClassOf: {', '.join(above)}" for step, above in ABOVE.items()]
    for number, (before, after) in enumerate(pairs):
        facts = f"k:occursBeforeInOrdering {before}, k:occursAfterInOrdering {after}"
        lines.append(f"Individual: O{number} Types: k:PartialOrdering-Strict Facts: {facts}")
    return "\n".join(lines)


def plan_in(text: str, folder: Path) -> Any:
    """The plan that a recipe's text compiles to."""
    path = folder / "soup.omn"
    path.write_text(text, encoding="utf-8")
    return load_plan(compile_recipe(path, task="MakeSoup").plan_source).make_soup


def performed(run: PlanRun) -> list[tuple[str, str | None]]:
    """Name and class of each action in the trace, sorted."""
    return sorted((step.name, step.action) for step in run.steps() if step.kind == "perform")


def module_of(run: PlanRun) -> Mapping[str, str]:
    """Step -> module that was asked to perform it."""
    asked = {event["node"]: event["module"] for event in run.events if event["event"] == "request"}
    nodes = {event["node"]: event for event in run.events if "kind" in event and "node" in event}
    return {nodes[nodes[node]["parent"]]["name"]: module for node, module in asked.items()}


def nearest(step: str, modules: frozenset[str]) -> str:
    """The module that performs a step, by the superclasses above."""
    level = [step]
    while level:
        for cls in level:
            if local_name(cls.removeprefix("k:")) in modules:
                return cls.removeprefix("k:")
            if cls in BUNDLED:
                return BUNDLED[cls]
        level = [above for cls in level for above in ABOVE.get(cls, ())]
    raise AssertionError(step)


@st.composite
def soups(draw: st.DrawFn) -> tuple[list[str], list[tuple[str, str]], frozenset[str]]:
    steps = draw(st.lists(st.sampled_from(sorted(ABOVE)), min_size=1, unique=True))
    pairs = [(a, b) for index, a in enumerate(steps) for b in steps[index + 1 :]]
    own = [step.removeprefix("k:") for step in ABOVE]
    return (
        steps,
        draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else [],
        frozenset((*FARTHER, *draw(st.lists(st.sampled_from(own), unique=True)))),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("soups")


@settings(max_examples=examples(40), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(soup=soups())
def test_each_step_keeps_its_name_and_class_and_the_nearest_module_performs_it(
    soup: tuple[list[str], list[tuple[str, str]], frozenset[str]], folder: Path
) -> None:
    steps, pairs, modules = soup
    run = run_plan(plan_in(recipe(steps, pairs), folder), script=Script().performs(*sorted(modules)))
    assert run.failure is None
    names = [step.removeprefix("k:") for step in steps]
    assert performed(run) == sorted((name, name) for name in names)
    copies = "Waiting2" in names and "Waiting3" in names, "StirSoup" in names and "taste-it" in names
    expected = {"Waiting2": 1 + copies[0], "StirSoup": 1 + copies[1]}
    assert {name: int(run.attempts(name)) for name in names} == {name: expected.get(name, 1) for name in names}
    assert module_of(run) == {step.removeprefix("k:"): nearest(step, modules) for step in steps}


@pytest.mark.parametrize("pairs", [[], [("StirSoup", "Waiting2")]], ids=["unordered", "ordered"])
def test_a_test_about_a_step_holds_with_and_without_an_order(pairs: list[tuple[str, str]], tmp_path: Path) -> None:
    plan = plan_in(recipe(["StirSoup", "Waiting2"], pairs), tmp_path)
    script = Script().on("StirSoup", after=3.0)
    run = run_plan(plan, script=script)
    assert run.steps("StirSoup")[0].end == 3.0
    assert run.attempts("PurposefulAction") == 1, "found by a class above its own, too"
    failed = run_plan(plan, script=script.fault("StirSoup", GraspMissed))
    assert failed.failed_with("StirSoup", GraspMissed)
    assert failed.unused == ("rule StirSoup",)


def test_a_request_that_waits_for_a_role_is_not_in_the_way_of_the_one_that_has_it(tmp_path: Path) -> None:
    """Import may need all roles, so Name holds the head; limit, unordered with Name, has the same module."""
    plan = plan_in(recipe(["Import", "limit", "Name"], [("Import", "limit")]), tmp_path)
    assert run_plan(plan, script=Script().performs("PurposefulAction")).failure is None


def test_a_module_for_a_farther_class_does_not_replace_a_steps_own_recipe(tmp_path: Path) -> None:
    text = recipe(["Waiting2"], []).replace(
        "Class: Waiting2 SubClassOf: ", "Class: Waiting2 SubClassOf: k:subAction some Name, "
    )
    plan = plan_in(text, tmp_path)
    assert performed(run_plan(plan, script=Script())) == [
        ("Name", "Name"),
        ("Waiting2", "Waiting2"),
    ]
    assert performed(run_plan(plan, script=Script().performs("Waiting2"))) == [("Waiting2", "Waiting2")]
