"""Constructs that run branches one after another, in the same task: seq, try_in_order, try_each_in_order."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from typing import Any, TypeVar

from planlang.failures import CompositeFailure, PlanFailure
from planlang.kernel import checkpoint
from planlang.kernel.calling import called
from planlang.kernel.journal import taken_over
from planlang.kernel.primitives import inside
from planlang.kernel.tree import name_of
from planlang.language.branches import Branch, evaporating, named_branches
from planlang.misuse import Usage

A = TypeVar("A")
V = TypeVar("V")
_TRY_EACH = Usage("await try_each_in_order", {"values": "cups", "body": "reach"})


async def seq(*branches: Branch, name: str | None = None, **named: Branch) -> list[Any]:
    """Run branches one after another; returns the list of their results; the first failure is raised at once."""
    results: list[Any] = []
    if (before := taken_over("seq", name or "seq")) is not None:
        return await before  # type: ignore[no-any-return]
    with inside("seq", name or "seq") as construct:
        for branch_name, branch in named_branches("seq", branches, named, name):
            if (before := taken_over("branch", branch_name)) is not None:
                results.append(await before)
                continue
            with inside("branch", branch_name) as node:
                node.result = await called(branch)
                results.append(node.result)
        if not results:
            await checkpoint()
        construct.result = results
    return results


async def try_in_order(
    *branches: Callable[[], Awaitable[V]], name: str | None = None, **named: Callable[[], Awaitable[V]]
) -> V:
    """Try branches one after another; returns the result of the first that succeeds.

    A failed branch is fully unwound before the next starts. When all fail: CompositeFailure in order.
    """
    result: V = await _first("try_in_order", name, named_branches("try_in_order", branches, named, name))
    return result


async def try_each_in_order(values: Iterable[A], body: Callable[[A], Awaitable[V]]) -> V:
    """Try ``body(value)`` for one value after another; returns the first result.

    When all fail, or there is no value: CompositeFailure in order.
    """
    _TRY_EACH.branch("body", body)
    _TRY_EACH.iterable("values", values, "an iterable of values")
    name = name_of(body)
    result: V = await _first("try_each_in_order", None, ((name, partial(body, value)) for value in values))
    return result


async def _first(kind: str, name: str | None, branches: Iterable[tuple[str, Branch]]) -> Any:
    failures: list[PlanFailure] = []
    names: list[str] = []
    if (before := taken_over(kind, name or kind)) is not None:
        return await before
    with inside(kind, name or kind) as construct:
        for branch_name, branch in branches:
            node = inside("branch", branch_name)
            try:
                with node:
                    construct.result = node.result = await called(branch)
                    return node.result
            except PlanFailure as failure:
                if evaporating():
                    raise
                failures.append(failure)
                names.append(node.name)
        if not failures:
            await checkpoint()
        raise CompositeFailure(failures=tuple(failures), names=tuple(names))
