"""A call in another process: its limits, and how it may end."""

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
    """Memory beyond what every worker has [bytes]."""
    wall: float = 0.0
    """Wall-clock time [s], for calls that may wait forever; 0: as long as the CPU time allows."""


LAYOUT = struct.Struct("qqd")
"""The limits of a worker, as they are sent with its connection."""


class Ending(Enum):
    """How a call ended."""

    DONE = "done"
    REFUSED = "refused"
    """The function raised BadInput; the answer has the diagnostics."""
    FAILED = "failed"
    """The function raised another exception; the answer names it."""
    MEMORY = "memory"
    """The function needed too much memory."""
    LATE = "late"
    """The worker was ended at its limit of time."""
    LOST = "lost"
    """The worker ended within its limits: it crashed, or was killed."""


@dataclass(frozen=True, slots=True)
class Reply:
    """What a call led to."""

    ending: Ending
    answer: Any = None
    seconds: float = 0.0
    """CPU time of the worker since its last reply [s]; 0 if it ended."""


Performs = Callable[[Callable[..., Any], Sequence[Any]], Any]
"""How the workers of a source call a function: with arguments, and perhaps with what they share."""
