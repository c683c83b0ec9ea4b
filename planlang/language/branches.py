"""Branches as they are given to constructs: checked, named, in order."""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from functools import cache
from typing import Any

from planlang.kernel.park import here
from planlang.kernel.tree import name_of
from planlang.misuse import Usage, WrongType, contrast, discard

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
    _usage(construct).branch("branch", *branches, *named.values())
    return [(name_of(branch), branch) for branch in branches] + list(named.items())


def evaporating() -> bool:
    """Return True while evaporation reaches the running task: then no recovery, alternative or attempt may begin.

    A failing cleanup replaces ``Evaporated`` on its way out, as exceptions in ``finally`` do. A construct that handles
    failures would take it for a failure of its body and start over, in a task that is being stopped. Under a shield
    this is False, so that cleanups may use all constructs.
    """
    return here()[1].doomed


@cache
def _usage(construct: str) -> Usage:
    return Usage(f"await {construct}", {"branch": "reach"})
