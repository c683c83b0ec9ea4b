"""The law of rounds and decisions: branches that share nothing have the same outcome under every schedule."""

from __future__ import annotations

import os

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_trees import Grower, outcome_of
from reference_model import Tree, World

from planlang.runs import Trace, with_paths

pytestmark = pytest.mark.filterwarnings("ignore::planlang.kernel.errors.CutShort")

EXAMPLES = int(os.environ.get("PLANLANG_EXAMPLES", "5000"))
trees = st.binary(min_size=24, max_size=80).map(lambda source: Grower(source).tree())
schedules = st.one_of(st.none(), st.integers(0, 10**6))


def fluents_of(tree: Tree) -> list[bool]:
    """All true: nothing in a tree changes a fluent, so a plan that waited for one would never end."""
    return [True] * (1 + max([part.number for part in tree.walk() if part.kind == "fluent"], default=0))


@settings(max_examples=max(10, EXAMPLES // 10), deadline=None)
@given(trees, st.lists(st.integers(0, 10**6), min_size=1, max_size=4))
def test_branches_that_share_nothing_have_the_same_outcome_under_every_schedule(
    tree: Tree, schedules: list[int]
) -> None:
    values = fluents_of(tree)
    first_come = outcome_of(tree, values)
    for schedule in schedules:
        assert outcome_of(tree, values, schedule=schedule) == first_come


@settings(max_examples=max(10, EXAMPLES // 10), deadline=None)
@given(trees)
def test_the_outcome_of_a_tree_is_what_the_model_computes(tree: Tree) -> None:
    values = fluents_of(tree)
    world = World(tree, list(values))
    world.advance(10**12)
    assert outcome_of(tree, values) == (world.now, world.root.outcome)


@settings(max_examples=max(10, EXAMPLES // 10), deadline=None)
@given(trees, schedules)
def test_every_node_of_the_tree_starts_and_ends_once_within_its_parent(tree: Tree, schedule: int | None) -> None:
    trace = Trace()
    outcome_of(tree, fluents_of(tree), schedule=schedule, trace=trace)
    open_nodes: dict[str, int] = {}
    seen: set[str] = set()
    for event in with_paths(trace.events):
        path = event.get("path")
        if event["event"] == "started":
            assert path not in seen, "started twice"
            seen.add(path)
            parent = path.rpartition("/")[0]
            assert not parent or parent in open_nodes, "started before its parent, or after its end"
            open_nodes[path] = event["step"]
        elif event["event"] == "ended":
            assert open_nodes.pop(path) <= event["step"]
            assert not any(one.startswith(path + "/") for one in open_nodes), "survived by what is below"
            failure = {"succeeded": (False,), "failed": (True,), "evaporated": (False, True)}  # of a cleanup
            assert ("failure" in event) in failure[event["status"]]
    assert open_nodes == {}


@settings(max_examples=max(10, EXAMPLES // 20), deadline=None)
@given(trees)
def test_written_order_is_the_order_of_beginning(tree: Tree) -> None:
    trace = Trace()
    outcome_of(tree, fluents_of(tree), trace=trace)
    begun: dict[str, int] = {}
    for event in with_paths(trace.events):
        if event["event"] == "started" and event["kind"] == "branch":
            parent, _, name = event["path"].rpartition("/")
            number = int(name.rpartition("#")[2]) if "#" in name else 1
            key = f"{parent}/{name.partition('#')[0]}"
            assert number == begun.get(key, 0) + 1, "a later one of the same name has begun before"
            begun[key] = number
