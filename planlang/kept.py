"""Results kept within a process: as long as the ontology or recipe that they belong to, or the last few of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import wraps
from types import MappingProxyType
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
Key = TypeVar("Key", bound=Hashable)


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


class Latest(dict[Key, R]):
    """The ``most`` latest values by key, none of them None: a new key replaces the one that was set first."""

    def __init__(self, most: int, values: Mapping[Key, R] = MappingProxyType({})) -> None:
        super().__init__(values)
        self._most = most

    def of(self, key: Key, compute: Callable[[], R]) -> R:
        """Look up the value of a key, or compute and keep it."""
        value = self.get(key)
        if value is None:
            value = self[key] = compute()
        return value

    def renew(self, key: Key, value: R) -> None:
        """Set the value of a key, which is the latest from now on."""
        self.pop(key, None)
        self[key] = value

    def __setitem__(self, key: Key, value: R) -> None:
        super().__setitem__(key, value)
        if len(self) > self._most:
            del self[next(iter(self))]
