"""Branches as they are given to constructs: checked, named, in order."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping
from functools import cache, partial
from typing import Any, TypeVar

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel import checkpoint, shield
from planlang.kernel.core import here
from planlang.kernel.primitives import called, in_node, node
from planlang.kernel.tree import Node, name_of
from planlang.misuse import Usage, WrongType, contrast, discard, written

A = TypeVar("A")
V = TypeVar("V")

Branch = Callable[[], Awaitable[Any]]
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


async def seq(*branches: Branch, name: str | None = None, **named: Branch) -> list[Any]:
    """Run branches one after another; returns the list of their results; the first failure is raised at once."""
    result: list[Any] = await node("seq", name or "seq", partial(_each, named_branches("seq", branches, named, name)))
    return result


async def _each(branches: Iterable[tuple[str, Branch]]) -> list[Any]:
    results = [await node("branch", name, partial(called, branch)) for name, branch in branches]
    if not results:
        await checkpoint()
    return results


async def try_in_order(
    *branches: Callable[[], Awaitable[V]], name: str | None = None, **named: Callable[[], Awaitable[V]]
) -> V:
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


async def unwind_protect(
    body: Callable[[], Awaitable[V]], cleanup: Callable[[], Awaitable[Any]], *, within: float = 10.0
) -> V:
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
