"""A call in a worker process: its limits, and how it can end."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from enum import Enum
from typing import Any

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of one call."""

    seconds: int = 10
    """CPU time [s]."""
    memory: int = 1_000_000_000
    """Memory in addition to that of a new worker [bytes]."""
    wall: float = 0.0
    """Wall-clock time [s], for calls that may block forever; 0 means no limit."""


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


Performs = Callable[[Callable[..., Any], Sequence[Any]], Any]
"""Calls a function with its arguments in a worker, and possibly with data shared by all workers."""
