"""Inputs of runs, read once for all runs of a process."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class Inputs:
    """Cache of ontologies, maps, robots and compiled plans, none of which a run changes.

    A file that changes in the meantime is not read again.
    """

    def __init__(self) -> None:
        self._kept: dict[Hashable, Any] = {}

    def once(self, read: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Call a function once for the same, hashable arguments, and return its result."""
        key = (read, arguments, tuple(sorted(options.items())))
        if key not in self._kept:
            self._kept[key] = read(*arguments, **options)
        result: T = self._kept[key]
        return result
