"""Performances of steps: in each, a designator by class means one thing, and in another one perhaps another thing.

``an_object("Cup")`` says of which class a thing is, not which one it is. The outermost step around an action that
mentions such a designator is what it is bound for: all that happens within this performance means the same thing. What
an attempt repeats, of a recovery, at another base pose or after a suspension, is the same performance again. An
executive asks :func:`performance_of` which performance that is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from planlang.designators import Action, Location, Object, Situation
from planlang.kernel.core import here, running
from planlang.kernel.tree import Node


class Performance(NamedTuple):
    """One performance of a step that mentions a designator by class."""

    occasion: str
    """Occasion of its first node: another one for each performance, the same one for each attempt at it."""
    step: str
    """What is performed and where in the plan: the same in each performance of a step."""
    actions: tuple[Action | None, ...]
    """Actions in progress that mention the designator, outermost first; None for a scope such as ``at_location``."""
    is_round: bool = False
    """True within a state that has been entered before."""
    group: str | None = None
    """Occasion above performances that are about different things; None if they need not be."""
    path: str = ""
    """Path of its first node: another one for each attempt, too."""


class _Begun(NamedTuple):
    about: frozenset[Object]
    node: Node
    """The node in which the performance began; its first node is the next one below."""
    name: str
    step: str
    action: Action | None
    times: int


_begun: ContextVar[tuple[_Begun, ...]] = ContextVar("performances that mention designators by class", default=())
"""The performances around the running task, outermost first."""


def by_class(fillers: Iterable[object]) -> Iterator[Object]:
    """Yield the designators in fillers of properties that describe a thing, no person and no device, by its class."""
    for filler in fillers:
        match filler:
            case Object(iri=None) if type(filler) is Object:
                yield filler
            case Location():
                yield from by_class(filler.things())
            case Situation():
                yield from by_class(part for _, part in filler.properties)
            case tuple():
                yield from by_class(filler)


@contextmanager
def performing(what: Action | Location, name: str, body: str = "", *, times: int = 1) -> Iterator[None]:
    """Begin a performance of an action, or of a ``body`` at a location, whose first node will be called ``name``.

    It is one of so many ``times``; if these are several, each is about other things.
    """
    action = what if isinstance(what, Action) else None
    fillers = (what,) if action is None else (filler for _, filler in action.properties)
    about = frozenset(by_class(fillers))
    if not about:
        yield
        return
    own = _Begun(about, here()[1].node, name, f"{name} {what} {body}".rstrip(), action, times)
    token = _begun.set((*_begun.get(), own))
    try:
        yield
    finally:
        _begun.reset(token)


def performance_of(what: Object) -> Performance | None:
    """Find the performance around the running task for which a designator is bound; None without one."""
    around = [one for one in _begun.get() if what in one.about]
    task = None if running.scheduler is None else running.scheduler.current
    if not around or task is None:
        return None
    begun = next((one for one in reversed(around) if one.times > 1), around[0])
    around = around[around.index(begun) :]
    first: Node | None = None
    node: Node | None = task.node
    while node is not None and node is not begun.node:
        first, node = node, node.parent
    above = list(_upwards(begun.node))
    return Performance(
        begun.node.occasion_of_next(begun.name) if first is None else first.occasion,
        "/".join([*(one.base_name for one in reversed(above)), begun.step]),
        tuple(one.action for one in around),
        any(one.kind == "state" and one.ordinal > 1 for one in above),
        begun.node.occasion if begun.times > 1 else None,
        begun.node.path_of_next(begun.name) if first is None else first.path,
    )


def _upwards(node: Node | None) -> Iterator[Node]:
    while node is not None:
        yield node
        node = node.parent
