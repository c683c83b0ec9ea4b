"""Unions of action classes as sub-actions: alternatives, of which the first that succeeds is performed."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planlang.compiler import CompiledPlan, compile_recipe
from planlang.compiler.drawing import FORMATS, task_graph
from planlang.diagnostics import BadInput, Severity
from planlang.failures import ManipulationFailure
from planlang.language.loading import load_plan
from planlang.ontology.convert import Target, convert
from planlang.testing import Script, run_plan

HEAD = """
Prefix: : <http://example.org/ways.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>
Ontology: <http://example.org/ways.owl>
Class: First
    SubClassOf: knowrob:LookingForSomething
Class: Last
    SubClassOf: knowrob:LookingForSomething
Class: Mug
    SubClassOf: knowrob:Cup
Individual: mug
    Types: Mug
Individual: left
    Types: knowrob:HolderGripper
Individual: right
    Types: knowrob:HolderGripper
"""
WAYS = "ABCDEF"
SUFFIXES = {Target.MANCHESTER: ".omn", Target.TURTLE: ".ttl", Target.RDFXML: ".owl", Target.NTRIPLES: ".nt"}


def written(folder: Path, subs: str, *orders: str, more: str = "") -> Path:
    """A recipe with some sub-actions, and orders of steps written ``A<B``."""
    classes = "".join(f"Class: {way}\n    SubClassOf: knowrob:OpeningAGripper\n" for way in WAYS)
    named = "".join(f", knowrob:orderingConstraints value o{number}" for number, _ in enumerate(orders))
    for number, order in enumerate(orders):
        before, after = order.split("<")
        more += f"Individual: o{number}\n    Types: knowrob:PartialOrdering-Strict\n"
        more += f"    Facts: knowrob:occursBeforeInOrdering {before}, knowrob:occursAfterInOrdering {after}\n"
    path = folder / "ways.omn"
    path.write_text(f"{HEAD}{classes}Class: Task\n    SubClassOf: knowrob:PurposefulAction, {subs}{named}\n{more}")
    return path


def some(*names: str) -> str:
    return ", ".join(f"knowrob:subAction some {name}" for name in names)


def ran(plan: CompiledPlan, fails: str = "") -> list[str]:
    """The actions that a plan performs, in order, where some fail."""
    script = Script()
    for name in fails:
        script.on(name, fails=ManipulationFailure)
    run = run_plan(load_plan(plan.plan_source).task, script=script, allow_unused=True)
    return [step.name for step in run.steps() if step.kind == "perform"]


def refused(path: Path) -> list[tuple[str, str]]:
    with pytest.raises(BadInput) as caught:
        compile_recipe(path)
    return [(one.code, one.message) for one in caught.value.diagnostics if one.severity is Severity.ERROR]


def test_a_failed_alternative_is_followed_by_the_next_and_a_done_one_by_none(tmp_path: Path) -> None:
    plan = compile_recipe(written(tmp_path, some("First", "(A or B or C)", "Last"), "First<A", "B<Last"))
    assert [one.code for one in plan.diagnostics] == ["R039"]  # that the things are not used
    assert ran(plan) == ["First", "A", "Last"]
    assert ran(plan, fails="A") == ["First", "A", "B", "Last"]
    assert ran(plan, fails="ABC") == ["First", "A", "B", "C"]


def test_of_a_run_with_named_orders_and_states_the_union_is_one_step(tmp_path: Path) -> None:
    named = compile_recipe(written(tmp_path, some("First", "(A or B)", "Last"), "First<AOrB", "AOrB<Last"))
    by_member = compile_recipe(written(tmp_path, some("First", "(A or B)", "Last"), "First<B", "A<Last"))
    body = named.source.partition("async def task")[2]
    assert body == by_member.source.partition("async def task")[2]
    assert ran(named, fails="A") == ["First", "A", "B", "Last"]


def test_a_base_pose_has_to_suit_the_first_alternative_only(tmp_path: Path) -> None:
    more = "".join(
        f"Individual: {name}\n    Types: knowrob:Point3D\n    Facts: knowrob:{fact}\n"
        for name, fact in (("near", "inReachOf mug"), ("before", "inFrontOf-Generally mug"), ("over", "aboveOf mug"))
    )
    more += "Class: Drive\n    SubClassOf: knowrob:Translation-LocationChange, knowrob:toLocation value near\n"
    more += "Class: Forward\n    SubClassOf: knowrob:Reaching, knowrob:toLocation value before\n"
    more += "Class: Down\n    SubClassOf: knowrob:Reaching, knowrob:toLocation value over\n"
    path = written(tmp_path, some("Drive", "(Forward or Down)"), "Drive<Forward", more=more)
    source = compile_recipe(path).source
    assert 'a_location("over"' in source
    assert "reaching=(before,)" in source


@pytest.mark.parametrize("kind", ["EquivalentTo", "SubClassOf"])
def test_a_class_that_is_defined_by_a_union_has_its_members_as_alternatives(tmp_path: Path, kind: str) -> None:
    more = f'Class: Get\n    {kind}: A or (B or C)\n    Annotations: rdfs:label "get it somehow"\n'
    plan = compile_recipe(written(tmp_path, some("First", "Get", "Last"), "First<Get", "Get<Last", more=more))
    assert "# get it somehow" in plan.source
    assert ran(plan, fails="AB") == ["First", "A", "B", "C", "Last"]


def test_what_is_stated_of_the_union_holds_for_each_member_that_does_not_state_it(tmp_path: Path) -> None:
    union = "((A or (B and (knowrob:deviceUsed value right))) and (knowrob:deviceUsed value left))"
    source = compile_recipe(written(tmp_path, some(union))).source
    assert 'action(RECIPE + "A", below="OpeningAGripper", device_used=LEFT)' in source
    assert 'action(RECIPE + "B", below="OpeningAGripper", device_used=(LEFT, RIGHT))' in source
    more = "Class: Get\n    EquivalentTo: A or (B and (knowrob:deviceUsed value right))\n"
    more += "    SubClassOf: knowrob:deviceUsed value left\n"
    source = compile_recipe(written(tmp_path, some("Get"), more=more)).source
    assert 'action(RECIPE + "A", below="OpeningAGripper", device_used=LEFT)' in source
    assert 'action(RECIPE + "B", below="OpeningAGripper", device_used=RIGHT)' in source


def test_an_alternative_may_have_a_recipe_of_its_own(tmp_path: Path) -> None:
    more = f"Class: Long\n    SubClassOf: knowrob:PurposefulAction, {some('C', 'D')}, "
    more += "knowrob:orderingConstraints value long\nIndividual: long\n    Types: knowrob:PartialOrdering-Strict\n"
    more += "    Facts: knowrob:occursBeforeInOrdering C, knowrob:occursAfterInOrdering D\n"
    plan = compile_recipe(written(tmp_path, some("(Long or A)"), more=more))
    assert ran(plan) == ["Long", "C", "D"]
    assert ran(plan, fails="D") == ["Long", "C", "D", "A"]


def test_what_no_alternative_states_and_the_task_does_is_that_of_the_task(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        f"knowrob:objectActedOn value mug, {some('(Grasp or Push)')}",
        more="""
Class: Grasp
    SubClassOf: knowrob:PickingUpAnObject
Class: Push
    SubClassOf: knowrob:PickingUpAnObject
""",
    )
    source = compile_recipe(path).source
    assert source.count("object_acted_on=mug") == 2
    assert "mug: Object = MUG" in source


@pytest.mark.parametrize(
    ("subs", "found"),
    [
        ("(A or Mug)", "`Mug` is an alternative of a step of `Task`, but not a class of actions"),
        ("(A or Missing)", "alternative `Missing` of `Task` is not defined"),
        ("(A or (not B))", "an alternative of `Task` is an expression without a named action class"),
    ],
)
def test_a_member_that_is_no_action_is_one_error(tmp_path: Path, subs: str, found: str) -> None:
    assert refused(written(tmp_path, some(subs))) == [("R020", found)]


def test_an_order_among_alternatives_is_an_error_that_says_so(tmp_path: Path) -> None:
    with pytest.raises(BadInput) as caught:
        compile_recipe(written(tmp_path, some("(A or B)"), "A<B"))
    errors = [one for one in caught.value.diagnostics if one.severity is Severity.ERROR]
    assert {one.code for one in errors} == {"R010"}
    advice = "it is an alternative of the step `AOrB`, of which only one is performed"
    assert {one.help for one in errors} == {advice}


def test_a_graph_shows_alternatives_and_their_order(tmp_path: Path) -> None:
    plan = compile_recipe(written(tmp_path, some("First", "(B or A)"), "First<A"))
    graph = task_graph(plan.recipes, plan.added, plan.recoveries)
    for write in FORMATS.values():
        text = write(graph)
        assert "tried in order" in text
        assert text.index("one way: B") < text.index("one way: A")


def unions(depth: int) -> st.SearchStrategy[str]:
    """Unions of some of the ways, nested."""
    leaf = st.sampled_from(WAYS)
    if not depth:
        return leaf
    inner = st.one_of(leaf, unions(depth - 1))
    return st.lists(inner, min_size=2, max_size=3).map(lambda members: f"({' or '.join(members)})")


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(unions(2), st.sets(st.sampled_from(WAYS)), st.sampled_from(list(SUFFIXES)))
def test_random_unions_try_each_member_once_in_order_in_every_syntax(
    tmp_path: Path, union: str, failing: set[str], syntax: Target
) -> None:
    path = written(
        tmp_path, some("First", union, "Last"), f"First<{union.strip('(')[0]}", f"{union.strip('(')[0]}<Last"
    )
    other = tmp_path / f"other{SUFFIXES[syntax]}"
    other.write_text(convert(path, syntax).text)
    ways = list(dict.fromkeys(letter for letter in union if letter in WAYS))
    done = next((number for number, way in enumerate(ways, 1) if way not in failing), None)
    expected = ["First", *ways[:done], *(["Last"] if done else [])]
    assert ran(compile_recipe(other), fails="".join(sorted(failing))) == expected
