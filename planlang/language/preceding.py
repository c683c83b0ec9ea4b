"""Actions that come before steps of a plan, although the plan does not have them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from planlang.designators import Action
from planlang.kernel.core import here

_preceding: ContextVar[Mapping[str, Sequence[Action]] | None] = ContextVar("actions before steps", default=None)


@contextmanager
def preceded(by: Mapping[str, Sequence[Action]]) -> Iterator[None]:
    """Perform actions before steps inside: actions and location scopes, by the path of their node in the tree.

    Paths are unique in a run, so that each action is performed once; not at all if the plan does not come to its step.
    """
    token = _preceding.set(by or None)
    try:
        yield
    finally:
        _preceding.reset(token)


def before_next(name: str) -> Sequence[Action]:
    """Actions that come before the step whose node, called ``name``, is the next one under the running node."""
    by = _preceding.get()
    return by.get(here()[1].node.path_of_next(name), ()) if by else ()
