"""The law of rounds and decisions: branches that share nothing have the same outcome under every schedule.

Random trees of constructs are run under several schedules and compared with a model that knows no tasks: it computes
from durations alone when a tree ends, and how. A moment is (step, 0, 0), or (step, 1, -depth) for what a deadline sets
off: deadlines strike when a step is at rest, the most deeply nested first.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from planlang import (
    PlanFailure,
    VirtualHost,
    now,
    par,
    partial_order,
    pursue,
    run,
    seq,
    sleep,
    timeout,
    try_all,
    try_in_order,
    unwind_protect,
)
from planlang.failures import CompositeFailure, Timeout

RATE = 240
Moment = tuple[int, int, int]
NEVER: Moment = (10**9, 0, 0)


@dataclass(frozen=True)
class Leaf:
    """Works for some steps, then succeeds, fails or errs, then cleans up, shielded."""

    name: str
    steps: int
    how: str
    cleanup: int


@dataclass(frozen=True)
class Inner:
    """A construct over trees; ``steps`` is the bound of a timeout."""

    kind: str
    children: tuple[Tree, ...]
    steps: int = 0


Tree = Leaf | Inner


# -- the tree as a plan


class Bug(Exception):
    """A programming error of a leaf."""


def plan_of(tree: Tree) -> Callable[[], Awaitable[Any]]:
    if isinstance(tree, Leaf):
        return partial(unwind_protect, partial(work, tree), partial(sleep, tree.cleanup / RATE), within=10**6)
    children = [plan_of(child) for child in tree.children]
    if tree.kind == "timeout":
        return partial(timeout, tree.steps / RATE, children[0])
    if tree.kind == "chain":
        names = [str(number) for number in range(len(children))]
        steps = dict(zip(names, children, strict=True))
        return partial(partial_order, steps, list(pairwise(names)))
    construct: Any = {"par": par, "pursue": pursue, "try_all": try_all, "seq": seq, "try_in_order": try_in_order}
    return partial(construct[tree.kind], *children)


async def work(leaf: Leaf) -> str:
    await sleep(leaf.steps / RATE)
    if leaf.how == "fails":
        raise PlanFailure(leaf.name)
    if leaf.how == "errs":
        raise Bug(leaf.name)
    return leaf.name


def outcome_of(tree: Tree, schedule: int | None) -> tuple[int, Any]:
    end: list[int] = []

    async def top() -> Any:
        try:
            return await plan_of(tree)()
        finally:
            end.append(round(now() * RATE))

    try:
        how = ("value", run(top, host=VirtualHost(RATE), schedule=schedule))
    except PlanFailure as failure:
        how = ("failure", told(failure))
    except Bug:
        how = ("error", None)
    return end[0], how


def told(failure: PlanFailure) -> Any:
    if isinstance(failure, CompositeFailure):
        return [told(member) for member in failure.failures]
    return "timeout" if isinstance(failure, Timeout) else str(failure)


# -- the model

EVAPORATED = ("evaporated", None)


def after(moment: Moment, steps: int) -> Moment:
    return (moment[0] + steps, 0, 0) if steps else moment


def model(tree: Tree, start: Moment, cut: Moment, depth: int) -> tuple[Moment, Any]:
    """When the tree is dead, and its outcome, if it begins at ``start`` and is evaporated at ``cut``."""
    if isinstance(tree, Leaf):
        done = after(start, tree.steps)
        if done <= cut:
            how = {"succeeds": ("value", tree.name), "fails": ("failure", tree.name), "errs": ("error", None)}
            return after(done, tree.cleanup), how[tree.how]
        return after(max(start, cut), tree.cleanup), EVAPORATED
    if tree.kind in ("seq", "try_in_order"):
        return in_order(tree, start, cut, depth)
    if start > cut:
        return start, EVAPORATED
    return side_by_side(tree, start, cut, depth)


def in_order(tree: Inner, start: Moment, cut: Moment, depth: int) -> tuple[Moment, Any]:
    results: list[Any] = []
    goes_on = "value" if tree.kind == "seq" else "failure"
    moment = start
    for child in tree.children:
        moment, how = model(child, moment, cut, depth)
        if how[0] != goes_on:
            return moment, how
        results.append(how[1])
    return moment, (goes_on, results)


def side_by_side(tree: Inner, start: Moment, cut: Moment, depth: int) -> tuple[Moment, Any]:
    if tree.kind == "chain":
        return chain(tree, start, cut, depth)
    alone = [model(child, start, NEVER, depth + 1) for child in tree.children]
    decided, how = decision(tree, start, alone, depth)
    ends = [model(child, start, min(decided, cut), depth + 1) for child in tree.children]
    end = max(end for end, _ in ends)
    if any(one == ("error", None) for _, one in ends):
        return end, ("error", None)
    return end, (how if decided <= cut and end <= cut else EVAPORATED)


def decision(tree: Inner, start: Moment, alone: list[tuple[Moment, Any]], depth: int) -> tuple[Moment, Any]:
    """When the outcome is fixed, and the outcome, if nothing comes from outside."""
    errors = [end for end, how in alone if how[0] == "error"]
    failures = [end for end, how in alone if how[0] == "failure"]
    values = [end for end, how in alone if how[0] == "value"]
    last = max(end for end, _ in alone)

    def first(kind: str, moment: Moment) -> Any:
        return next(how for end, how in alone if how[0] == kind and end == moment)

    if tree.kind == "timeout":
        deadline = (start[0] + tree.steps, 1, -depth)
        return (last, alone[0][1]) if last <= deadline else (deadline, ("failure", "timeout"))
    if tree.kind == "par":
        moment = min([*errors, *failures], default=last)
        how = ("value", [how[1] for _, how in alone])
        if failures and moment == min(failures):
            how = first("failure", moment)
        return moment, how
    if tree.kind == "pursue":
        moment = min(end for end, _ in alone)
        kind = "failure" if moment in failures else "value"
        return moment, (first(kind, moment) if moment not in errors else ("error", None))
    moment = min([*errors, *values], default=last)
    if values and moment == min(values):
        return moment, first("value", moment)
    return moment, ("failure", [how[1] for _, how in alone])


def chain(tree: Inner, start: Moment, cut: Moment, depth: int) -> tuple[Moment, Any]:
    results: dict[str, Any] = {}
    moment = start
    for number, child in enumerate(tree.children):
        if moment > cut:
            return moment, EVAPORATED
        moment, how = model(child, moment, cut, depth + 1)
        if how[0] == "error":
            return moment, how
        if moment > cut or how == EVAPORATED:
            return moment, EVAPORATED
        if how[0] == "failure":
            return moment, how
        results[str(number)] = how[1]
    return moment, ("value", results)


# -- the facts


def leaves() -> st.SearchStrategy[Tree]:
    return st.builds(
        lambda name, steps, how, cleanup: Leaf(f"leaf{name}", steps, how, cleanup),
        st.integers(0, 99),
        st.integers(0, 4),
        st.sampled_from(["succeeds", "succeeds", "succeeds", "fails", "fails", "errs"]),
        st.sampled_from([0, 0, 1, 3]),
    )


def grown(children: st.SearchStrategy[Tree]) -> st.SearchStrategy[Tree]:
    kinds = st.sampled_from(["par", "pursue", "try_all", "seq", "try_in_order", "chain"])
    several = st.builds(Inner, kinds, st.lists(children, min_size=1, max_size=4).map(tuple))
    bounded = st.builds(lambda child, steps: Inner("timeout", (child,), steps), children, st.integers(1, 5))
    return st.one_of(several, several, bounded)


trees = st.recursive(leaves(), grown, max_leaves=14)


@settings(max_examples=400, deadline=None)
@given(trees)
def test_the_outcome_of_a_tree_is_what_the_model_computes(tree: Tree) -> None:
    end, how = model(tree, (0, 0, 0), NEVER, 0)
    assert outcome_of(tree, None) == (end[0], how)


@settings(max_examples=200, deadline=None)
@given(trees, st.lists(st.integers(0, 1000), min_size=1, max_size=3))
def test_branches_that_share_nothing_have_the_same_outcome_under_every_schedule(
    tree: Tree, schedules: list[int]
) -> None:
    first_come = outcome_of(tree, None)
    for schedule in schedules:
        assert outcome_of(tree, schedule) == first_come
