"""What a run changes in the process while it lasts: the collector's threshold and the handler of Ctrl-C."""

from __future__ import annotations

import gc
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

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
