"""Results that are computed once for an ontology, or for a recipe, and kept as long as it is."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar


class Keeping(Protocol):
    """An object that never changes, and so may keep what was computed from it."""

    @property
    def kept(self) -> dict[object, Any]:
        """Function with its further arguments -> result."""
        ...


_MISSING = object()
K = TypeVar("K", bound=Keeping)
P = ParamSpec("P")
R = TypeVar("R")


def kept(compute: Callable[Concatenate[K, P], R]) -> Callable[Concatenate[K, P], R]:
    """Keep the results of a function in its first argument; the others must be hashable, and are passed by position."""

    @wraps(compute)
    def computed(keeping: K, /, *args: P.args, **_: P.kwargs) -> R:
        known, key = keeping.kept, (compute, *args)
        result: R = known.get(key, _MISSING)
        if result is _MISSING:
            result = known[key] = compute(keeping, *args, **_)
        return result

    return computed
