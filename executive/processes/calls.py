"""A call in a worker process: its limits, and how it can end."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum
from typing import Any

from planlang.records import dataclass
from planlang.shell_limits import cpu_seconds, stated


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call."""

    seconds: int = 10
    """CPU time [s]."""
    memory: int = 1_000_000_000
    """Memory in addition to that of a new worker [bytes]."""
    wall: float = 0.0
    """Wall-clock time [s], for calls that may block forever; 0 means no limit."""

    def within_shell(self) -> Limits:
        """Return the limits that apply where the shell limits CPU time to less."""
        most = cpu_seconds()
        return self if most is None or most > self.seconds else replace(self, seconds=max(1, most - 1))


LAYOUT = struct.Struct("qqd")
"""Binary layout of the limits that are sent with a worker's connection."""


class Ending(Enum):
    """How a call ended."""

    DONE = "done"
    REFUSED = "refused"
    """The function raised BadInput; the answer has the diagnostics."""
    FAILED = "failed"
    """The function raised another exception; the answer is its class and message."""
    MEMORY = "memory"
    """The function exceeded its memory limit."""
    LATE = "late"
    """The worker was killed at its time limit."""
    LOST = "lost"
    """The worker died within its limits: it crashed, or was killed from outside."""


@dataclass(frozen=True, slots=True)
class Reply:
    """Result of a call."""

    ending: Ending
    answer: Any = None
    seconds: float = 0.0
    """CPU time of the worker since its last reply [s]; 0 if it died."""
    is_last: bool = False
    """True if the worker has ended after it."""

    def beyond(self, limits: Limits) -> str:
        """Say which limit the call exceeded, its own or the shell's."""
        of_shell = stated()
        match self.ending:
            case Ending.MEMORY if self.answer is not None and self.answer < limits.memory:
                return f"it needed more than {self.answer / 1e6:.0f} MB of memory; the shell's limit: {of_shell}"
            case Ending.MEMORY:
                return f"it needed more than {limits.memory / 1e6:g} MB of memory"
            case Ending.LATE:
                seconds = limits.within_shell().seconds
                wall = f", or {limits.wall:g} s in all" if limits.wall else ""
                whose = f"; the shell's limit: {of_shell}" if seconds < limits.seconds else ""
                return f"it took more than {seconds} s of CPU time{wall}{whose}"
        whose = f"; the shell's limits: {of_shell}" if of_shell else ""
        return f"several processes in a row died without a result{whose}"


Performs = Callable[[Callable[..., Any], Sequence[Any]], Any]
"""Calls a function with its arguments in a worker, and possibly with data shared by all workers."""
