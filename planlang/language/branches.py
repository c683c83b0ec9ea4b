"""Constructs that run branches in sequence (seq, try_in_order, unwind_protect) or concurrently (par, race).

A concurrent construct is a :class:`planlang.kernel.Scope`: it starts branches, decides between rounds, and finishes
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
"""A branch with a result of type V: an async function without arguments."""
Branch = BranchOf[Any]
"""A branch: a plan, a partial, or a lambda that returns a coroutine."""


def named_branches(
    construct: str, branches: tuple[Branch, ...], named: Mapping[str, Branch], name: str | None = None
) -> list[tuple[str, Branch]]:
    """Check the branches of a construct and pair them with names, positional ones first.

    ``name`` is the name of the construct itself.
    """
    for reserved, used in (("name", not (name is None or isinstance(name, str))), ("limit", "limit" in named)):
        if used:
            discard((*branches, *named.values(), name))
            raise WrongType(
                contrast(
                    f"{reserved!r} is a parameter and cannot be the name of a branch",
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
    """Check whether the running task is being evaporated, so that no recovery, alternative or attempt may begin.

    A failing cleanup replaces ``Evaporated``, as exceptions in ``finally`` do. A construct that handles failures would
    mistake it for a failure of its body and start over, in a task that is being stopped. False inside a shield, so that
    cleanups may use all constructs.
    """
    return here()[1].doomed


def _refused_collection(construct: str, value: Any) -> WrongType:
    """Error for ``par([reach, look])``; its right form is the user's own call, unpacked."""
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
    """Run branches in sequence; return the tuple of their results, or raise the first failure at once."""
    return await node("seq", name or "seq", partial(_run_all, named_branches("seq", branches, named, name)))


async def _run_all(branches: Iterable[tuple[str, Branch]]) -> tuple[Any, ...]:
    results = [await node("branch", name, partial(called, branch)) for name, branch in branches]
    if not results:
        await checkpoint()
    return tuple(results)


async def try_in_order(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Try branches in sequence; return the result of the first that succeeds.

    A failed branch is fully unwound before the next one starts. If all fail: CompositeFailure, in order.
    """
    kind = "try_in_order"
    result: V = await node(kind, name or kind, partial(_first_success, named_branches(kind, branches, named, name)))
    return result


async def try_each_in_order(values: Iterable[A], body: Callable[[A], Awaitable[V]]) -> V:
    """Try ``body(value)`` for each value in turn; return the result of the first that succeeds.

    If all fail, or there are no values: CompositeFailure, in order.
    """
    _TRY_EACH.branch("body", body)
    _TRY_EACH.iterable("values", values, "an iterable of values")
    name, kind = name_of(body), "try_each_in_order"
    result: V = await node(kind, kind, partial(_first_success, ((name, partial(body, value)) for value in values)))
    return result


async def _first_success(branches: Iterable[tuple[str, Branch]]) -> Any:
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
    """Run a body, then ``cleanup`` in any case: after success, failure or evaporation. The cleanup is shielded.

    A cleanup that takes longer than ``within`` [s] of plan time is a programming error, CleanupOverrun. A failure of
    the cleanup replaces the outcome of the body, as in ``finally``; in an evaporated task it is recorded.
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
    """Independent branches that all start at once."""

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
                self.fail([each for each in dead if each.outcome is not SUCCEEDED])
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
    """Run branches concurrently until all have succeeded; return the tuple of their results in textual order.

    At the first failure the other branches are evaporated, and it is raised when all are dead. Failures of other
    branches at the same decision are attached to it as ``siblings``.
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
        """Result of the construct, from the branch that won."""
        return winner.result


class _Race(_Pursue):
    def outcome_of(self, winner: Task) -> tuple[str, Any]:
        return winner.name, winner.result


async def pursue(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Run branches concurrently until the first succeeds; return its result and evaporate the others.

    A failure before any success is raised. Of simultaneous ends a failure takes precedence over a success, and the
    textually first branch over later ones. Without branches: CompositeFailure without members.
    """
    result: V = await _Pursue("pursue", name, named_branches("pursue", branches, named, name)).execute()
    return result


async def race(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> tuple[str, V]:
    """Run branches as :func:`pursue` does; return the name of the branch that won, and its result."""
    result: tuple[str, V] = await _Race("race", name, named_branches("race", branches, named, name)).execute()
    return result


class _TryAll(_SideBySide):
    winner: Task | None = None

    def __init__(self, kind: str, name: str | None, branches: list[tuple[str, Branch]]) -> None:
        super().__init__(kind, name, branches)
        self.losers: dict[int, Task] = {}

    def decide(self, dead: list[Task]) -> None:
        for task in dead:
            if task.outcome is SUCCEEDED:
                self.winner = task
                self.close()
                return
            self.losers[task.index] = task

    def finish(self) -> Any:
        if self.winner is not None:
            return self.winner.result
        tasks = [self.losers[index] for index in sorted(self.losers)]
        raise self.attach(
            CompositeFailure(
                failures=tuple(failure_of(task) for task in tasks), names=tuple(task.name for task in tasks)
            )
        )


async def try_all(*branches: BranchOf[V], name: str | None = None, **named: BranchOf[V]) -> V:
    """Run branches concurrently until the first succeeds, whether or not others have failed; return its result.

    If all fail: CompositeFailure with their failures in textual order.
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
    """Run ``body(value)`` concurrently for all values; return the results in order; fail as :func:`par` does.

    At most ``limit`` branches run at a time; the next value is taken when a branch has ended.
    """
    _PAR_EACH.branch("body", body)
    _PAR_EACH.iterable("values", values, "an iterable of values")
    if limit is not None:
        limit = _PAR_EACH.whole("limit", limit, 1, "branches")
    result: list[V] = await _ParEach(iter(values), body, limit).execute()
    return result


def concurrent_branches() -> tuple[Task, ...]:
    """List the branches around the running task that run concurrently with independent ones, innermost first.

    These are the branches of par, par_each, pursue, race and try_all, and finally the top-level plan. Steps of a
    partial_order do not count, as one may continue what another has begun. Empty if no plan is running.
    """
    scheduler = running.scheduler
    task = None if scheduler is None else scheduler.current
    branches: list[Task] = []
    while task is not None:
        group = task.group
        if group is None or isinstance(group, (_SideBySide, _ParEach)):
            branches.append(task)
        task = None if group is None else group.owner
    return tuple(branches)
