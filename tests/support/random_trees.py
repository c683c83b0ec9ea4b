"""Random trees of constructs, and what they are as plans. Their branches share nothing but fluents that they only read.

Durations are multiples of one slot; the host's rate is 1, so that seconds are steps.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any

from reference_model import Outcome, Tree

from planlang import *
from planlang.failures import (
    BranchEvaporated,
    BudgetExceeded,
    CompositeFailure,
    GoalNotAchieved,
    PolicyViolated,
    Timeout,
)

SLOT = 2**15
FLUENTS = 2
TAGS = 4
FOREVER = 10**9
Branch = Callable[[], Awaitable[Any]]


class Bug(Exception):
    """A programming error of a plan."""


# -- trees as plans


def plan_of(tree: Tree, fluents: list[Fluent[bool]]) -> Branch:
    below = [plan_of(child, fluents) for child in tree.children]
    first = below[0] if below else None
    simple: dict[str, Any] = {
        "seq": seq,
        "try_in_order": try_in_order,
        "par": par,
        "pursue": pursue,
        "race": result_of_race,
        "try_all": try_all,
        "retry_after_suspension": retry_after_suspension,
    }
    if tree.kind in simple:
        return partial(simple[tree.kind], *below)
    made: dict[str, Callable[[], Any]] = {
        "work": lambda: partial(work, tree),
        "fluent": lambda: partial(wait_for, fluents[tree.number]),
        "retry": lambda: partial(with_failure_handling, first, Recovery(PlanFailure, retries=tree.number)),
        "step": lambda: partial(
            perform,
            action("PurposefulAction"),
            otherwise=first,
            until=fluents[tree.children[1].number],
            recoveries=[Recovery(PlanFailure, retries=tree.number)],
        ),
        "protected": lambda: partial(unwind_protect, first, partial(work, tree), within=FOREVER),
        "shield": lambda: partial(shielded, tree.number, first),
        "par_each": lambda: partial(par_each, below, called, limit=tree.number or None),
        "partial_order": lambda: partial(
            partial_order,
            {str(number): branch for number, branch in enumerate(below)},
            [(str(before), str(after)) for before, after in tree.orderings],
            limit=tree.number or None,
        ),
        "tag": lambda: partial(tag, f"part {tree.number}", first),
        "timeout": lambda: partial(timeout, tree.number, first),
        "budget_of_time": lambda: partial(budget, first, seconds=tree.number),
        "budget": lambda: partial(budget, first, attempts=tree.number),
        "policies": lambda: partial(
            with_policies,
            [Policy(f"{one.number} of {place}", fluents[one.number]) for place, one in enumerate(tree.children[1:])],
            first,
        ),
    }
    branch: Branch = made[tree.kind]()
    return branch


async def work(tree: Tree) -> str:
    await sleep(tree.number)
    if tree.end == "failure":
        raise PlanFailure(tree.name)
    if tree.end == "error":
        raise Bug(tree.name)
    return tree.name


async def shielded(within: int, branch: Branch) -> Any:
    with shield(within=within):
        return await branch()


async def called(branch: Branch) -> Any:
    return await branch()


async def result_of_race(*branches: Branch) -> Any:
    """The result of a race without the name of its winner: the model knows branches by number only."""
    return (await race(*branches))[1]


def told(failure: PlanFailure) -> Any:
    """A failure in the words of the model."""
    if isinstance(failure, CompositeFailure):
        return [told(member) for member in failure.failures]
    if isinstance(failure, BranchEvaporated):
        return "gone"
    if isinstance(failure, BudgetExceeded):
        return "budget_of_time" if failure.seconds is not None else "budget"
    if isinstance(failure, PolicyViolated):
        return f"policy {failure.policy.partition(' ')[0]}"
    if isinstance(failure, GoalNotAchieved):
        return "goal"
    return "timeout" if isinstance(failure, Timeout) else str(failure)


def outcome_of(
    tree: Tree,
    values: Sequence[bool] = (False,) * FLUENTS,
    *,
    beside: Callable[[list[Fluent[bool]]], Awaitable[Any]] | None = None,
    schedule: int | None = None,
    trace: Trace | None = None,
) -> tuple[float, Outcome]:
    """Return when the plan of a tree ends, and how, if ``beside`` runs beside it. What ``beside`` raises is raised.

    A plan that cannot go on ends in a deadlock, at no moment (-1).
    """
    fluents = [Fluent(value, name=f"fluent {number}") for number, value in enumerate(values)]
    plan = plan_of(tree, fluents)
    end: list[float] = []

    async def measured() -> Any:
        try:
            return await plan()
        finally:
            end.append(now())

    async def top() -> Any:
        return await (measured() if beside is None else pursue(measured, partial(beside, fluents)))

    how: Outcome
    try:
        how = ("value", run(top, host=VirtualHost(1), schedule=schedule, trace=trace))
    except PlanFailure as failure:
        how = ("failure", told(failure))
    except (Bug, CleanupOverrun):
        how = ("error", None)
    except DeadlockError:
        return -1, ("deadlock", None)
    return end[0], how


def tags_of(tree: Tree) -> list[int]:
    """The numbers of the tagged parts."""
    return sorted(part.number for part in tree.walk() if part.kind == "tag")


# -- random trees

SEVERAL = ("par", "pursue", "race", "try_all", "seq", "try_in_order")
KINDS = (
    "work",
    "work",
    "fluent",
    *SEVERAL,
    *SEVERAL,
    "par_each",
    "partial_order",
    "policies",
    "protected",
    "protected",
)
KINDS += ("timeout", "budget_of_time", "budget", "retry", "step", "shield", "retry_after_suspension", "tag", "tag")


class Grower:
    """Makes a tree of a string of bytes: one draw instead of a hundred, and shorter strings are simpler trees."""

    def __init__(self, source: bytes) -> None:
        self.source = iter(source)
        self.tags = iter(range(1, TAGS))
        self.leaves = 0

    def below(self, bound: int) -> int:
        return next(self.source, 0) % bound

    def pick(self, *values: str) -> str:
        return values[self.below(len(values))]

    def leaf(self) -> Tree:
        self.leaves += 1
        end = self.pick(*["value"] * 9, "failure", "failure", "failure", "error")
        return Tree("work", (), SLOT * (0, 1, 2, 3, 4, 6, 8, 12)[self.below(8)], end, f"work {self.leaves}")

    def tree(self, depth: int = 0) -> Tree:
        kind = self.pick(*KINDS) if depth < 7 else "work"
        if kind == "work":
            return self.leaf()
        if kind == "fluent":
            return Tree("fluent", (), self.below(FLUENTS))
        if kind in (*SEVERAL, "par_each", "partial_order"):
            return self.construct(kind, depth)
        child = self.tree(depth + 1)
        if kind == "policies":
            watches = [Tree("fluent", (), self.below(FLUENTS)) for _ in range(1 + self.below(2))]
            return Tree("policies", (child, *watches))
        if kind == "step":
            return Tree("step", (child, Tree("fluent", (), self.below(FLUENTS))), self.below(4))
        if kind == "protected":
            end = self.pick("value", "value", "failure")
            return Tree("protected", (child,), SLOT * self.below(4), end, f"cleanup {self.leaves}")
        if kind == "tag":
            number = next(self.tags, None)
            return child if number is None else Tree("tag", (child,), number)
        numbers = {"budget": 3, "retry": 4, "retry_after_suspension": 1}
        return Tree(kind, (child,), self.below(numbers[kind]) if kind in numbers else SLOT * (1 + self.below(9)))

    def construct(self, kind: str, depth: int) -> Tree:
        children = tuple(self.tree(depth + 1) for _ in range(1 + self.below(4)))
        if kind in SEVERAL:
            return Tree(kind, children)
        limit = self.below(3)
        pairs = [(before, after) for after in range(len(children)) for before in range(after)]
        chosen = tuple(pair for pair in pairs if kind == "partial_order" and self.below(2))
        return Tree(kind, children, limit, orderings=chosen)
