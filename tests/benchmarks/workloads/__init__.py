"""The same work for each library: every function takes a size and returns the seconds that it took.

``spawn`` branches and join them, ``order`` them, ``evaporate`` sleepers, set what waits for a ``fluent`` free, let time
pass (``step``), and ``nest`` constructs inside of each other.
"""

from __future__ import annotations

import random
import time

clock = time.process_time  # what other processes take does not count
FOREVER = 10**6
STEPS = 5_000
"""World steps that are measured at a time."""


async def nothing(*_: object) -> None:
    """A branch that does nothing."""


def graph(size: int) -> dict[int, tuple[int, ...]]:
    """Two predecessors for each step, among the hundred before it."""
    stream = random.Random(1)
    return {step: tuple(sorted(stream.sample(range(max(0, step - 100), step), min(2, step)))) for step in range(size)}
