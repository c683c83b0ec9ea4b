"""Code that computes long and says so: the watchdog leaves it alone, Ctrl-C ends it, results do not depend on it."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
from virtual_time import go

from planlang import *
from planlang.kernel import still_computing

SHORT = 0.05


def computes(seconds: float, log: list[str] | None = None) -> str:
    """Compute so long, saying again and again that it goes on."""
    end = time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            still_computing()
    finally:
        if log is not None:
            log.append("left")
    return "computed"


def press() -> None:
    """Press Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)


async def in_the_runs_own_thread(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


def test_outside_of_a_run_nothing_happens() -> None:
    assert computes(0.001) == "computed"


def test_the_watchdog_leaves_it_alone_and_barks_when_it_says_no_more() -> None:
    def stops_saying() -> None:
        computes(4 * SHORT)
        time.sleep(30)

    assert run(partial(in_the_runs_own_thread, computes, 4 * SHORT), host=VirtualHost(watchdog=SHORT)) == "computed"
    with pytest.raises(NoProgress, match="did not reach a checkpoint"):
        run(partial(in_the_runs_own_thread, stops_saying), host=VirtualHost(watchdog=SHORT))


@pytest.mark.parametrize("how", [in_the_runs_own_thread, in_thread])
def test_the_first_ctrl_c_ends_it_and_cleanups_run(how: Any) -> None:
    log: list[str] = []

    def pressed() -> None:
        press()
        computes(30, log)

    async def cleanup() -> None:
        await sleep(1)
        log.append("cleaned up")

    began = time.monotonic()
    trace = Trace()
    with pytest.raises(KeyboardInterrupt):
        go(partial(par, partial(unwind_protect, partial(how, pressed), cleanup), partial(sleep, 9)), trace=trace)
    assert time.monotonic() - began < 2
    assert log == ["left", "cleaned up"]
    assert sum(event["event"] == "interrupted" for event in trace.events) == 1


def test_a_shielded_task_goes_on_after_ctrl_c() -> None:
    log: list[str] = []

    async def shielded() -> None:
        with shield():
            press()
            log.append(computes(0.02))
        await checkpoint()
        log.append("never")

    with pytest.raises(KeyboardInterrupt):
        go(shielded)
    assert log == ["computed"]


def test_the_second_ctrl_c_ends_what_the_first_one_does_not_reach() -> None:
    log: list[str] = []

    async def shielded() -> None:
        try:
            with shield():
                press()
                computes(0.02)
                press()
                computes(30, log)
        finally:
            log.append(computes(0.001))  # a drain lets cleanups end

    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        go(shielded)
    assert time.monotonic() - began < 2
    assert log == ["left", "computed"]


def test_code_that_no_task_runs_may_say_so_too() -> None:
    read: list[str] = []

    def door() -> bool:
        read.append(computes(0.001))
        return len(read) > 3

    go(partial(wait_for, Fluent(read=door)))
    assert len(read) > 3


def test_an_evaporated_caller_does_not_wait_for_what_is_computed_in_a_thread() -> None:
    log: list[str] = []
    begun = threading.Event()

    def call() -> None:
        begun.set()
        computes(30, log)

    async def wins() -> None:
        begun.wait(10)

    began = time.monotonic()
    go(partial(pursue, partial(in_thread, call), wins))
    assert time.monotonic() - began < 2
    assert log == ["left"]
