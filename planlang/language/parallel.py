"""Constructs that run branches side by side: par, pursue, race, try_all, par_each."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable, Iterator
from functools import partial
from typing import Any, TypeVar, overload

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel import All, Scope, failure_of
from planlang.kernel.core import Task, running
from planlang.kernel.tree import FAILED, SUCCEEDED, name_of
from planlang.language.branches import Branch, named_branches
from planlang.misuse import Usage

A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")
D = TypeVar("D")
V = TypeVar("V")

_PAR_EACH = Usage("await par_each", {"values": "cups", "body": "reach"}, {"limit": "2"})


class _Par(All):
    def __init__(self, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__("par", name)
        self.branches = branches
        self.results: list[Any] = [None] * len(branches)

    def begin(self) -> None:
        for index, (name, branch) in enumerate(self.branches):
            self.start(branch, name, index)

    def decide(self, dead: list[Task]) -> None:
        results = self.results
        for task in dead:
            if task.outcome is SUCCEEDED:
                results[task.index] = task.result
            else:
                self.fail([one for one in dead if one.outcome is not SUCCEEDED])
                return

    def finish(self) -> list[Any]:
        self.raise_failure()
        return self.results


@overload
async def par(first: Callable[[], Awaitable[A]], second: Callable[[], Awaitable[B]], /) -> tuple[A, B]: ...
@overload
async def par(
    first: Callable[[], Awaitable[A]], second: Callable[[], Awaitable[B]], third: Callable[[], Awaitable[C]], /
) -> tuple[A, B, C]: ...
@overload
async def par(
    first: Callable[[], Awaitable[A]],
    second: Callable[[], Awaitable[B]],
    third: Callable[[], Awaitable[C]],
    fourth: Callable[[], Awaitable[D]],
    /,
) -> tuple[A, B, C, D]: ...
@overload
async def par(*branches: Branch, name: str | None = None, **named: Branch) -> list[Any]: ...
async def par(*branches: Branch, name: str | None = None, **named: Branch) -> Any:
    """Run branches side by side; succeeds when all do, with the list of their results in textual order.

    At the first failure the other branches are evaporated, and when all are dead it is raised. Failures of branches
    that died at the same decision are attached to it as ``siblings``. (Two to four positional branches are typed as
    a tuple, so that ``a, b = await par(f, g)`` is typed; at run time it is a list too.)
    """
    return await _Par(name, named_branches("par", branches, named, name)).execute()


class _Pursue(Scope):
    winner: Task | None = None
    failed: Task | None = None
    evaporated: Task | None = None
    siblings: tuple[tuple[str, PlanFailure], ...] = ()

    def __init__(self, kind: str, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__(kind, name)
        self.branches = branches

    def begin(self) -> None:
        for index, (name, branch) in enumerate(self.branches):
            self.start(branch, name, index)

    def decide(self, dead: list[Task]) -> None:
        failed = [task for task in dead if task.outcome is FAILED]
        if failed:
            self.failed = failed[0]
            self.siblings = tuple((task.name, failure_of(task)) for task in failed[1:])
            self.close()
            return
        for task in dead:
            if task.outcome is SUCCEEDED:
                self.winner = task
                self.close()
                return
            self.evaporated = self.evaporated or task

    def finish(self) -> Any:
        if self.winner is not None:
            return self.outcome_of(self.winner)
        lost = self.failed or self.evaporated
        if lost is None:
            raise CompositeFailure()
        failure = failure_of(lost)
        failure.siblings += tuple((name, other) for name, other in self.siblings if other is not failure)
        raise self.attach(failure)

    def outcome_of(self, winner: Task) -> Any:
        """Return the result of the construct, from the branch that won."""
        return winner.result


class _Race(_Pursue):
    def outcome_of(self, winner: Task) -> tuple[str, Any]:
        return winner.name, winner.result


async def pursue(
    *branches: Callable[[], Awaitable[V]], name: str | None = None, **named: Callable[[], Awaitable[V]]
) -> V:
    """Run branches side by side until the first succeeds; returns its result, the others are evaporated.

    A failure before any success is raised; of what is simultaneous, failure beats success, then the textually first
    counts. Without branches: CompositeFailure without members.
    """
    result: V = await _Pursue("pursue", name, named_branches("pursue", branches, named, name)).execute()
    return result


async def race(
    *branches: Callable[[], Awaitable[V]], name: str | None = None, **named: Callable[[], Awaitable[V]]
) -> tuple[str, V]:
    """Run branches as :func:`pursue` does; returns the name of the branch that won and its result."""
    result: tuple[str, V] = await _Race("race", name, named_branches("race", branches, named, name)).execute()
    return result


class _TryAll(Scope):
    winner: Task | None = None

    def __init__(self, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__("try_all", name)
        self.branches = branches
        self.lost: dict[int, Task] = {}

    def begin(self) -> None:
        for index, (name, branch) in enumerate(self.branches):
            self.start(branch, name, index)

    def decide(self, dead: list[Task]) -> None:
        for task in dead:
            if task.outcome is SUCCEEDED:
                self.winner = task
                self.close()
                return
            self.lost[task.index] = task

    def finish(self) -> Any:
        if self.winner is not None:
            return self.winner.result
        tasks = [self.lost[index] for index in sorted(self.lost)]
        raise self.attach(
            CompositeFailure(
                failures=tuple(failure_of(task) for task in tasks), names=tuple(task.name for task in tasks)
            )
        )


async def try_all(
    *branches: Callable[[], Awaitable[V]], name: str | None = None, **named: Callable[[], Awaitable[V]]
) -> V:
    """Run branches side by side until the first succeeds, even after others failed; returns its result.

    When all fail: CompositeFailure with their failures in textual order.
    """
    result: V = await _TryAll(name, named_branches("try_all", branches, named, name)).execute()
    return result


class _ParEach(All):
    def __init__(self, values: Iterator[Any], body: Callable[[Any], Awaitable[Any]], limit: int | None) -> None:
        super().__init__("par_each")
        self.values = values
        self.body = body
        self.limit = limit
        self.branch_name = name_of(body)
        self.results: list[Any] = []
        self.exhausted = False

    def begin(self) -> None:
        self._launch()

    def _launch(self) -> None:
        while not self.exhausted and (self.limit is None or len(self.live) < self.limit):
            try:
                value = next(self.values)
            except StopIteration:
                self.exhausted = True
                return
            self.results.append(None)
            self.start(partial(self.body, value), self.branch_name, len(self.results) - 1)

    def decide(self, dead: list[Task]) -> None:
        super().decide(dead)
        if not self.over:
            for task in dead:
                self.results[task.index] = task.result
            self._launch()

    def finish(self) -> list[Any]:
        self.raise_failure()
        return self.results


async def par_each(values: Iterable[A], body: Callable[[A], Awaitable[V]], limit: int | None = None) -> list[V]:
    """Run ``body(value)`` side by side for all values; returns the results in order; fails as :func:`par`.

    Values are taken as branches get free: at most ``limit`` run at a time.
    """
    _PAR_EACH.branch("body", body)
    _PAR_EACH.iterable("values", values, "an iterable of values")
    if limit is not None:
        limit = _PAR_EACH.whole("limit", limit, 1, "branches")
    result: list[V] = await _ParEach(iter(values), body, limit).execute()
    return result


SIDE_BY_SIDE = (_Par, _ParEach, _Pursue, _TryAll)
"""Scopes whose branches have nothing to do with each other."""


def concurrent_branches() -> tuple[Task, ...]:
    """Return the branches in which the running task stands, innermost first, that go on side by side with others.

    These are the branches of par, par_each, pursue, race and try_all, and last the run itself. Steps of a
    partial_order do not count: they belong together, as what one has begun another may go on with. Empty where no plan
    is running.
    """
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    found: list[Task] = []
    while task is not None:
        group = task.group
        if group is None or isinstance(group, SIDE_BY_SIDE):
            found.append(task)
        task = None if group is None else group.owner
    return tuple(found)
