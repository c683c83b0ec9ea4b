"""Branches as they are given to constructs: checked, named, in order."""

from __future__ import annotations

import inspect
from collections.abc import Awaitable, Callable, Iterable, Mapping
from typing import Any

from planlang.kernel.errors import contrast
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
        raise TypeError(
            contrast(
                f"you called {name}(); pass {name} or partial({name}, ...) to {construct}",
                f"await {construct}({name}())",
                f"await {construct}({name})    or    await {construct}(partial({name}, ...))",
            )
        )
    raise TypeError(
        contrast(
            f"{construct} takes branches, that is async functions without arguments, not {wrong!r}",
            f"await {construct}(await reach(cup))",
            f"await {construct}(partial(reach, cup))",
        )
    )


def named_branches(
    construct: str, branches: tuple[Branch, ...], named: Mapping[str, Branch], name: str | None = None
) -> list[tuple[str, Branch]]:
    """Name and branch of each, positional ones first; ``name`` is the construct's own."""
    for reserved, taken in (("name", not (name is None or isinstance(name, str))), ("limit", "limit" in named)):
        if taken:
            raise TypeError(
                contrast(
                    f"{reserved!r} is reserved; a branch cannot be named so",
                    f"await {construct}({reserved}=reach)",
                    f"await {construct}(the_{reserved}=reach)",
                )
            )
    check(construct, branches)
    check(construct, named.values())
    return [(name_of(branch), branch) for branch in branches] + list(named.items())
