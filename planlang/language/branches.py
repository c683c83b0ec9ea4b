"""Constructs that run branches: one after another (seq, try_in_order, unwind_protect), or side by side (par, race).

Side by side, a construct is a :class:`planlang.kernel.Scope`: it starts branches, decides between rounds, and finishes
when all of them are dead.
"""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping
from functools import cache, partial
from typing import Any, TypeVar, overload

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel import All, Task, checkpoint, failure_of, shield
from planlang.kernel.core import here, running
from planlang.kernel.primitives import called, in_node, node
from planlang.kernel.tree import FAILED, SUCCEEDED, Node, name_of
from planlang.misuse import Usage, WrongType, contrast, discard, written

A = TypeVar("A")
B = TypeVar("B")
C = TypeVar("C")
D = TypeVar("D")
V = TypeVar("V")

BranchOf = Callable[[], Awaitable[V]]
"""A branch by its result: a function without arguments that is awaited."""
Branch = BranchOf[Any]
"""A zero-argument async callable: a plan, a partial, a lambda that returns a coroutine."""


def named_branches(
    construct: str, branches: tuple[Branch, ...], named: Mapping[str, Branch], name: str | None = None
) -> list[tuple[str, Branch]]:
    """Name and branch of each, positional ones first; ``name`` is the construct's own."""
    for reserved, taken in (("name", not (name is None or isinstance(name, str))), ("limit", "limit" in named)):
        if taken:
            discard((*branches, *named.values(), name))
            raise WrongType(
                contrast(
                    f"{reserved!r} is reserved; a branch cannot be named so",
                    f"await {construct}({reserved}=reach)",
                    f"await {construct}(the_{reserved}=reach)",
                )
            )
    if name == "":
        discard((*branches, *named.values()))
        raise Usage(f"await {construct}", {"branch": "reach"}, {"name": '"both"'}).empty("name")
    for value in branches:
        if isinstance(value, (list, tuple, set, Mapping)):
            raise _refused_collection(construct, value)
    _usage(construct).branch("branch", *branches, *named.values())
    return [(name_of(branch), branch) for branch in branches] + list(named.items())


def evaporating() -> bool:
    """Return True while evaporation reaches the running task: then no recovery, alternative or attempt may begin.

    A failing cleanup replaces ``Evaporated`` on its way out, as exceptions in ``finally`` do. A construct that handles
    failures would take it for a failure of its body and start over, in a task that is being stopped. Under a shield
    this is False, so that cleanups may use all constructs.
    """
    return here()[1].doomed


def _refused_collection(construct: str, value: Any) -> WrongType:
    """Return the error of ``par([reach, look])``; the right form is that of the user, unpacked."""
    items = value.values() if isinstance(value, Mapping) else value
    calls = [item.__name__ for item in items if inspect.iscoroutine(item)]
    code = written(value)
    right = code
    for name in calls:
        right = right.replace(f"{name}()", name)
    stars = "**" if isinstance(value, Mapping) else "*"
    message = f"{construct} takes branches one by one, not in a {type(value).__name__}"
    return WrongType(contrast(message, f"await {construct}({code})", f"await {construct}({stars}{right})"))


@cache
def _usage(construct: str) -> Usage:
    return Usage(f"await {construct}", {"branch": "reach"})


_UNWIND_PROTECT = Usage("await unwind_protect", {"body": "reach", "cleanup": "retract"}, {"within": "30"})
_TRY_EACH = Usage("await try_each_in_order", {"values": "cups", "body": "reach"})


@overload
async def seq(first: BranchOf[A], second: BranchOf[B], /, *, name: str | None = None) -> tuple[A, B]: ...
@overload
async def seq(
    first: BranchOf[A], second: BranchOf[B], third: BranchOf[C], /, *, name: str | None = None
) -> tuple[A, B, C]: ...
@overload
async def seq(
    first: BranchOf[A], second: BranchOf[B], third: BranchOf[C], fourth: BranchOf[D], /, *, name: str | None = None
) -> tuple[A, B, C, D]: ...
@overload
async def seq(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> tuple[V, ...]: ...
async def seq(*branches: Branch, name: str | None = None, **named: Branch) -> Any:
    """Run branches one after another; returns the tuple of their results; the first failure is raised at once."""
    return await node("seq", name or "seq", partial(_each, named_branches("seq", branches, named, name)))


async def _each(branches: Iterable[tuple[str, Branch]]) -> tuple[Any, ...]:
    results = [await node("branch", name, partial(called, branch)) for name, branch in branches]
    if not results:
        await checkpoint()
    return tuple(results)


async def try_in_order(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Try branches one after another; returns the result of the first that succeeds.

    A failed branch is fully unwound before the next starts. When all fail: CompositeFailure in order.
    """
    kind = "try_in_order"
    result: V = await node(kind, name or kind, partial(_first, named_branches(kind, branches, named, name)))
    return result


async def try_each_in_order(values: Iterable[A], body: Callable[[A], Awaitable[V]]) -> V:
    """Try ``body(value)`` for one value after another; returns the first result.

    When all fail, or there is no value: CompositeFailure in order.
    """
    _TRY_EACH.branch("body", body)
    _TRY_EACH.iterable("values", values, "an iterable of values")
    name, kind = name_of(body), "try_each_in_order"
    result: V = await node(kind, kind, partial(_first, ((name, partial(body, value)) for value in values)))
    return result


async def _first(branches: Iterable[tuple[str, Branch]]) -> Any:
    failures: list[PlanFailure] = []
    names: list[str] = []
    for name, branch in branches:
        attempt = Node(here()[1].node, "branch", name)
        try:
            return await in_node(attempt, partial(called, branch))
        except PlanFailure as failure:
            if evaporating():
                raise
            failures.append(failure)
            names.append(attempt.name)
    if not failures:
        await checkpoint()
    raise CompositeFailure(failures=tuple(failures), names=tuple(names))


async def unwind_protect(body: BranchOf[V], cleanup: Callable[[], Awaitable[Any]], *, within: float = 10.0) -> V:
    """Run a body, then ``cleanup`` in any case: after success, failure and evaporation, shielded from evaporation.

    A cleanup longer than ``within`` seconds of plan time is a programming error, CleanupOverrun. A failure of the
    cleanup replaces the outcome, as in ``finally``; in an evaporated task it is recorded.
    """
    _UNWIND_PROTECT.branches(body=body, cleanup=cleanup)
    _UNWIND_PROTECT.seconds("within", within)
    try:
        return await called(body)  # type: ignore[no-any-return]
    finally:
        with shield(within):
            await called(cleanup)


_PAR_EACH = Usage("await par_each", {"values": "cups", "body": "reach"}, {"limit": "2"})


class _SideBySide(All):
    """Branches that start at once and have nothing to do with each other."""

    def __init__(self, kind: str, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__(kind, name)
        self.branches = branches

    def begin(self) -> None:
        for index, (name, branch) in enumerate(self.branches):
            self.start(branch, name, index)


class _Par(_SideBySide):
    def __init__(self, kind: str, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__(kind, name, branches)
        self.results: list[Any] = [None] * len(branches)

    def decide(self, dead: list[Task]) -> None:
        results = self.results
        for task in dead:
            if task.outcome is SUCCEEDED:
                results[task.index] = task.result
            else:
                self.fail([one for one in dead if one.outcome is not SUCCEEDED])
                return

    def finish(self) -> tuple[Any, ...]:
        self.raise_failure()
        return tuple(self.results)


@overload
async def par(first: BranchOf[A], second: BranchOf[B], /, *, name: str | None = None) -> tuple[A, B]: ...
@overload
async def par(
    first: BranchOf[A], second: BranchOf[B], third: BranchOf[C], /, *, name: str | None = None
) -> tuple[A, B, C]: ...
@overload
async def par(
    first: BranchOf[A], second: BranchOf[B], third: BranchOf[C], fourth: BranchOf[D], /, *, name: str | None = None
) -> tuple[A, B, C, D]: ...
@overload
async def par(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> tuple[V, ...]: ...
async def par(*branches: Branch, name: str | None = None, **named: Branch) -> Any:
    """Run branches side by side; succeeds when all do, with the tuple of their results in textual order.

    At the first failure the other branches are evaporated, and when all are dead it is raised. Failures of branches
    that died at the same decision are attached to it as ``siblings``.
    """
    return await _Par("par", name, named_branches("par", branches, named, name)).execute()


class _Pursue(_SideBySide):
    winner: Task | None = None
    evaporated: Task | None = None

    def decide(self, dead: list[Task]) -> None:
        failed = [task for task in dead if task.outcome is FAILED]
        if failed:
            self.fail(failed)
            return
        for task in dead:
            if task.outcome is SUCCEEDED:
                self.winner = task
                self.close()
                return
            self.evaporated = self.evaporated or task

    def finish(self) -> Any:
        self.raise_failure()
        if self.winner is not None:
            return self.outcome_of(self.winner)
        if self.evaporated is None:
            raise CompositeFailure()
        raise self.attach(failure_of(self.evaporated))

    def outcome_of(self, winner: Task) -> Any:
        """Return the result of the construct, from the branch that won."""
        return winner.result


class _Race(_Pursue):
    def outcome_of(self, winner: Task) -> tuple[str, Any]:
        return winner.name, winner.result


async def pursue(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Run branches side by side until the first succeeds; returns its result, the others are evaporated.

    A failure before any success is raised; of what is simultaneous, failure beats success, then the textually first
    counts. Without branches: CompositeFailure without members.
    """
    result: V = await _Pursue("pursue", name, named_branches("pursue", branches, named, name)).execute()
    return result


async def race(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> tuple[str, V]:
    """Run branches as :func:`pursue` does; returns the name of the branch that won and its result."""
    result: tuple[str, V] = await _Race("race", name, named_branches("race", branches, named, name)).execute()
    return result


class _TryAll(_SideBySide):
    winner: Task | None = None

    def __init__(self, kind: str, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__(kind, name, branches)
        self.lost: dict[int, Task] = {}

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


async def try_all(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Run branches side by side until the first succeeds, even after others failed; returns its result.

    When all fail: CompositeFailure with their failures in textual order.
    """
    result: V = await _TryAll("try_all", name, named_branches("try_all", branches, named, name)).execute()
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
        if group is None or isinstance(group, (_SideBySide, _ParEach)):
            found.append(task)
        task = None if group is None else group.owner
    return tuple(found)
