"""Branches as they are given to constructs: checked, named, in order."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any

from planlang.kernel.tree import name_of

Branch = Callable[[], Awaitable[Any]]
"""A zero-argument async callable: a plan, a partial, a lambda that returns a coroutine."""


def check(construct: str, branches: Iterable[object]) -> None:
    """Refuse what is no branch; coroutine objects are closed, with the right form in the message."""
    wrong: object = None
    for branch in branches:
        if not callable(branch):
            if inspect.iscoroutine(branch):
                branch.close()
            wrong = wrong or branch
    if wrong is None:
        return
    if inspect.iscoroutine(wrong):
        name = wrong.__name__
        raise TypeError(f"you called {name}(); pass {name} or partial({name}, ...) to {construct}")
    raise TypeError(f"{construct} takes branches, that is async functions without arguments, not {wrong!r}")


def named_branches(
    construct: str, branches: tuple[Branch, ...], named: Mapping[str, Branch]
) -> list[tuple[str, Branch]]:
    """Name and branch of each, positional ones first."""
    check(construct, branches)
    check(construct, named.values())
    return [(name_of(branch), branch) for branch in branches] + list(named.items())
