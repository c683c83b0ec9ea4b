"""whenever: a body that runs each time a fluent is true."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

from planlang.kernel import Signal, wait_for
from planlang.kernel.calling import called
from planlang.kernel.fluent import SIGNAL
from planlang.kernel.journal import taken_over
from planlang.kernel.park import deliver, here, park
from planlang.kernel.primitives import inside
from planlang.language.recovery import Return
from planlang.misuse import Usage

_WHENEVER = Usage("await whenever", {"signal": "bell_rings", "body": "answer"})


async def whenever(signal: Signal[Any], body: Callable[[], Awaitable[Any]]) -> Any:
    """Run the body each time the fluent is true, at most once per world step; ``Return(v)`` from it leaves with v."""
    _WHENEVER.branch("body", body)
    _WHENEVER.instance("signal", signal, Signal, SIGNAL)
    if (before := taken_over("whenever", "whenever")) is not None:
        return await before
    with inside("whenever", "whenever", signal=str(signal)) as node:
        while True:
            await wait_for(signal)
            result = await called(body)
            if isinstance(result, Return):
                node.result = result.value
                return result.value
            await _next_step()


async def _next_step() -> None:
    scheduler, task = here()
    if task.doomed:
        await deliver(task)
    timer = scheduler.alarm(task, 1, lambda: scheduler.wake(task))
    try:
        await park(timer)
    finally:
        timer.drop()
