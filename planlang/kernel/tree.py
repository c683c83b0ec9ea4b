"""The tree of a run: constructs, branches, tags, plans and performs; a path names a place in it.

A node that is a task, or belongs to one, ends with one of the final states of :class:`Status`.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from enum import Enum
from types import FunctionType
from typing import Any


class Status(Enum):
    """Life of a task; the last three are final. Handles also show ``EVAPORATING``."""

    CREATED = "created"
    RUNNING = "running"
    SUSPENDED = "suspended"
    EVAPORATING = "evaporating"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    EVAPORATED = "evaporated"

    @property
    def final(self) -> bool:
        """True for a task that is dead."""
        return self in _FINAL


# Members as plain names: looking one up on an Enum costs as much as starting a coroutine.
SUCCEEDED, FAILED, EVAPORATED = Status.SUCCEEDED, Status.FAILED, Status.EVAPORATED
_FINAL = frozenset({SUCCEEDED, FAILED, EVAPORATED})


class Node:
    """A place in the tree of a run. Its name is unique under its parent: later ones get ``#2``, ``#3``."""

    __slots__ = ("_counts", "_path", "base_name", "kind", "number", "ordinal", "parent", "written")

    def __init__(self, parent: Node, kind: str, name: str) -> None:
        self.parent: Node | None = parent
        self.kind = kind
        self.base_name = name
        """The path element without its number."""
        self._counts: dict[str, int] | None = None
        self._path: str | None = None
        self.number = 0
        """Its number in the trace; 0 before it is written there."""
        self.written = ""
        """Text after ``"node": `` in the records of its start and end, once that was written."""
        counts = parent._counts
        if counts is None:
            parent._counts = {name: 1}
            self.ordinal = 1
        else:
            self.ordinal = counts[name] = counts.get(name, 0) + 1

    @property
    def name(self) -> str:
        """The path element."""
        return self.base_name if self.ordinal == 1 else f"{self.base_name}#{self.ordinal}"

    @property
    def path(self) -> str:
        """Names from the root, joined by ``/``."""
        if self._path is not None:
            return self._path
        parent = self.parent
        if parent is not None and parent._path is not None:
            name = self.base_name if self.ordinal == 1 else f"{self.base_name}#{self.ordinal}"
            path = self._path = f"{parent._path}/{name}"
            return path
        names: list[str] = []
        node: Node | None = self
        while node is not None and node._path is None:
            names.append(node.name)
            node = node.parent
        head = "" if node is None or node._path is None else f"{node._path}/"
        path = head + "/".join(reversed(names))
        self._path = path
        return path

    @property
    def unused(self) -> bool:
        """True as long as nothing was started under this node."""
        return self._counts is None


def name_of(branch: Callable[..., Any]) -> str:
    """Return the path element of a branch: its function's name, ``lambda`` for a lambda, else the class's name.

    No line numbers: random streams are derived from paths, and have to stay the same when a line is inserted.
    """
    while isinstance(branch, functools.partial):
        branch = branch.func
    name: object = branch.__name__ if branch.__class__ is FunctionType else getattr(branch, "__name__", None)
    if name == "<lambda>":
        return "lambda"
    return name if isinstance(name, str) else type(branch).__name__
