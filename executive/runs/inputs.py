"""What runs are made from, read once for all runs of a process that have it in common."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")


class Inputs:
    """Keeps what was read or compiled: ontologies, maps, robots and plans' sources, none of which a run changes.

    A file that changes in the meantime is not read again.
    """

    def __init__(self) -> None:
        self._kept: dict[Hashable, Any] = {}

    def once(self, read: Callable[P, T], *arguments: P.args, **options: P.kwargs) -> T:
        """Return what the function returns; it is called once for the same arguments, which have to be hashable."""
        key = (read, arguments, tuple(sorted(options.items())))
        if key not in self._kept:
            self._kept[key] = read(*arguments, **options)
        kept: T = self._kept[key]
        return kept
