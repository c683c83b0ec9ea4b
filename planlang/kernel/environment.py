"""What a run changes in the process while it lasts: the collector's threshold, the handler of Ctrl-C, and warnings.

A coroutine that a plan makes and never awaits: Python warns of it when it is freed, and a run that went well otherwise
fails for it. One that outlives the run, as in a global list, stays Python's warning.
"""

from __future__ import annotations

import gc
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from planlang.kernel.errors import PlanStructureError
from planlang.kernel.listing import is_own
from planlang.misuse import contrast

YOUNG = 500_000
"""Allocations before the collector looks: live tasks are no garbage, and looking at them costs more than they do.

Enough for 100,000 tasks at a time; what refers to itself and is garbage waits as long."""


@contextmanager
def quiet_collector() -> Iterator[None]:
    """Raise the collector's threshold, and restore it."""
    before = gc.get_threshold()
    if before[0] and before[0] < YOUNG:
        gc.set_threshold(YOUNG, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


@contextmanager
def signals(on_interrupt: Callable[[FrameType | None], None]) -> Iterator[bool]:
    """Call ``on_interrupt`` on Ctrl-C where Python's own handler is in place and this is the main thread.

    The value is whether that is so.
    """
    ours = (
        threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if not ours:
        yield False
        return
    signal.signal(signal.SIGINT, lambda number, frame: on_interrupt(frame))
    try:
        yield True
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


ORIGINS = 2
"""Frames of its making that a coroutine remembers: the call of a ``@plan`` function passes through one of ours."""
_WARNING = re.compile(r"coroutine '(.+)' was never awaited")
_MADE_AT = re.compile(r'^  File "(.+)", line (\d+), in .*(?:\n    (.*))?$', re.MULTILINE)


class _Found(threading.local):
    errors: list[PlanStructureError] | None = None
    """Of the run in this thread."""


_found = _Found()
_lock = threading.Lock()
_runs = 0
_before = warnings.catch_warnings()
_show: Callable[..., Any] = warnings.showwarning


def _showwarning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    error = _error(str(message)) if _found.errors is not None and category is RuntimeWarning else None
    if error is None or _found.errors is None:
        _show(message, category, *where, **more)
    else:
        _found.errors.append(error)


def _error(message: str) -> PlanStructureError | None:
    """Return the error for a warning; None if it is another one, or is about what was made before the run."""
    warning = _WARNING.match(message)
    places = [place for place in _MADE_AT.findall(message) if not is_own(place[0])]
    if warning is None or not places:
        return None
    file, line, source = places[-1]  # the innermost
    name = warning[1].rpartition(".")[2]
    text = f"{os.path.basename(file)}:{line} calls {name}() without await, so nothing was done"
    return PlanStructureError(contrast(text, source or f"{name}(...)", f"await {name}(...)"))


@contextmanager
def unawaited_are_errors() -> Iterator[None]:
    """Raise PlanStructureError at the end of the block if it ends well, and a coroutine was made and not awaited.

    Filters of warnings belong to the process: the first of the runs that go on in it changes them, the last one
    restores them.
    """
    global _runs, _before, _show
    with _lock:
        _runs += 1
        if _runs == 1:
            _before = warnings.catch_warnings()
            _before.__enter__()
            _show, warnings.showwarning = warnings.showwarning, _showwarning
            warnings.filterwarnings("always", _WARNING.pattern, RuntimeWarning)
    depth = sys.get_coroutine_origin_tracking_depth()
    sys.set_coroutine_origin_tracking_depth(ORIGINS)
    errors = _found.errors = []
    try:
        yield
    finally:
        _found.errors = None
        sys.set_coroutine_origin_tracking_depth(depth)
        with _lock:
            _runs -= 1
            if not _runs:
                _before.__exit__(None, None, None)
    if errors:
        first, *others = errors
        for other in others:
            first.add_note(f"so it is here: {str(other).partition(',')[0]}")
        raise first
