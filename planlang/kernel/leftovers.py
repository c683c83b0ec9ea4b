"""Coroutines that are held by something to the end of a run and were never awaited."""

from __future__ import annotations

import gc
import inspect
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import CellType, CoroutineType, FrameType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, ClassVar, TypeGuard
from weakref import ReferenceType

from planlang.kernel.errors import PlanStructureError
from planlang.kernel.forgotten import calls_of, collector, judged, watch
from planlang.kernel.listing import is_own

if TYPE_CHECKING:
    from planlang.kernel.scheduler import Scheduler
    from planlang.kernel.task import Task

    Coroutine = CoroutineType[Any, Any, Any]

_HOLDERS = (list, tuple, dict, set, deque, CellType, Iterator)
_EVERYWHERE = (ModuleType, FunctionType, type)
_FAR = 4
"""Through how many things that hold each other a frame is looked for."""
_LOOPS = frozenset({"asyncio", "_asyncio", "concurrent", "queue", "_queue", "threading", "rclpy", "trio", "uvloop"})
"""Libraries that take coroutines over, to await them in another thread."""
_runs: set[int] = set()
"""The runs of the process that go on, in whatever thread. What is made beside others is nobody's in particular."""


class _Noted:
    """What the process remembers of coroutines that never ran.

    Once the whole heap is looked through, then only the youngest generation of the collector: when a run begins or
    ends, and at each collection within. Between runs nothing is called by the collector, for a Ctrl-C would get lost
    in it.
    """

    old: ClassVar[list[ReferenceType[Coroutine]]] = []
    """Those that have been seen at a collection, or were there at the first run; others are young."""
    limit = 1000
    begun = False

    @classmethod
    def begin(cls) -> None:
        """With each run."""
        if not cls.begun:
            cls.begun = True
            cls.old += map(ReferenceType, filter(_unbegun, gc.get_objects()))

    @classmethod
    def collecting(cls, phase: str, details: dict[str, int]) -> None:
        """Before a collection: what is young now may be old afterwards."""
        if phase == "start":
            cls.old += map(ReferenceType, _young())
            if len(cls.old) > cls.limit:
                cls.old = [one for one in cls.old if _unbegun(one())]
                cls.limit = 2 * len(cls.old) + 1000

    @classmethod
    def all(cls) -> dict[int, Coroutine]:
        """By identity, in the order in which they were made."""
        old = [one for reference in cls.old if _unbegun(one := reference())]
        return {id(one): one for one in [*old, *_young()]}


_CALLED = (collector, _Noted.collecting)


def _young() -> list[Coroutine]:
    things = gc.get_objects(generation=0)
    return list(filter(_unbegun, things)) if CoroutineType in map(type, things) else []


def _unbegun(thing: object) -> TypeGuard[Coroutine]:
    return type(thing) is CoroutineType and inspect.getcoroutinestate(thing) == inspect.CORO_CREATED


class Found:
    """What one run knows about coroutines that never ran."""

    def __init__(self, root: Task) -> None:
        self.root = root
        """The top-level task."""
        _Noted.begin()
        self.before = _Noted.all()
        """They are kept, or one that the run makes might get the identity of one that is gone."""

    def left(self) -> list[Coroutine]:
        """Coroutines that were made since then and never ran, in the order in which they were made."""
        return [one for identity, one in _Noted.all().items() if identity not in self.before]


@contextmanager
def watching(scheduler: Scheduler, root: Task) -> Iterator[None]:
    """While the run lasts. Of one that fails, what was never awaited is closed: why it fails is more important."""
    watch()
    scheduler.coroutines = Found(root)
    gc.callbacks.extend(_CALLED)
    _runs.add(id(scheduler))
    try:
        yield
    except BaseException:
        if len(_runs) == 1:
            _close_left(scheduler, root)
        raise
    finally:
        _runs.discard(id(scheduler))
        scheduler.coroutines.before.clear()
        for called in _CALLED:
            gc.callbacks.remove(called)


def _close_left(scheduler: Scheduler, root: Task) -> None:
    left = scheduler.coroutines.left()
    while left:  # so that nothing of ours holds it
        coroutine = left.pop()
        ours = is_own(coroutine.cr_code.co_filename) or calls_of(root, coroutine, [])
        if ours and not _held(coroutine)[1]:
            coroutine.close()


def last_look(scheduler: Scheduler, root: Task) -> PlanStructureError | None:
    """The error of a run whose top-level task has succeeded, while a coroutine is left that nobody has awaited."""
    left = scheduler.coroutines.left()[::-1] if len(_runs) == 1 else []
    while left:
        coroutine = left.pop()
        calls = calls_of(root, coroutine, [])
        if calls or is_own(coroutine.cr_code.co_filename):
            kept, elsewhere = _held(coroutine)
            error = None if elsewhere else judged(root, coroutine, calls, [], kept)
            if error is not None:
                scheduler.spoilt = scheduler.spoilt or error
            if not elsewhere:
                coroutine.close()
    return scheduler.spoilt if isinstance(scheduler.spoilt, PlanStructureError) else None


def _held(coroutine: Coroutine) -> tuple[bool, bool]:
    """How a coroutine is held.

    Whether by a call that has ended, as those do through which an exception has gone that somebody keeps; and whether
    it was handed on to what is not the plan's, such as another event loop, which may await it yet.
    """
    held: list[object] = [coroutine]
    kept = False
    for distance in range(_FAR):
        referrers = [one for one in gc.get_referrers(*held) if one is not held]
        if any(map(_awaits, referrers)) or not (referrers or distance):  # by nothing: by what runs in another thread
            return kept, True
        kept = kept or any(isinstance(one, FrameType) for one in referrers)
        held = [one for one in referrers if isinstance(one, _HOLDERS) or hasattr(one, "__dict__")]
        held = [one for one in held if not isinstance(one, _EVERYWHERE) and "__builtins__" not in _names(one)]
    return kept, False


def _awaits(holder: object) -> bool:
    """Whether it belongs to a library that hands coroutines on or awaits them itself."""
    if isinstance(holder, FunctionType):
        name = holder.__module__
    else:
        name = type(holder).__module__
    return str(name).partition(".")[0] in _LOOPS


def _names(thing: object) -> Mapping[Any, Any]:
    return thing if isinstance(thing, dict) else {}
