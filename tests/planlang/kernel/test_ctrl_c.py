"""Ctrl-C on every host: the first one lets bounded cleanups run, the second one drains. Real signals and processes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from itertools import product
from pathlib import Path

import pytest

from tests.support.examples import some

PROLOGUE = """
import sys, threading, time, warnings
from functools import partial
from planlang import *

class World:
    rate = 240
    def step(self): time.sleep(1 / 240)

class Slow:
    '''A virtual host whose steps take the time they stand for.'''
    rate, jumps = 240, False
    def advance(self, steps): time.sleep(steps / 240)

hosts = {"simulation": SimulationHost(World()), "virtual": Slow(), "real time": RealTimeHost()}
host = hosts[sys.argv[1]]

def say(text):
    print(text, flush=True)

def go(plan):
    trace = Trace()
    try:
        run(plan, host=host, trace=trace)
    except BaseException as error:
        say(f"ended with {type(error).__name__}")
    names = [{e["node"] for e in trace.events if e["event"] == event} for event in ("started", "ended")]
    say(f"live tasks: {len(names[0] - names[1])}")
"""
HOSTS = ("virtual", "simulation", "real time")


class Plan:
    """A plan that runs in a process of its own and says what it does."""

    def __init__(self, code: str, host: str, folder: Path) -> None:
        script = folder / "script.py"
        script.write_text(PROLOGUE + textwrap.dedent(code), encoding="utf-8")
        self.process = subprocess.Popen(
            [sys.executable, "-W", "error", str(script), host],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )
        assert self.process.stdout is not None
        self.out = self.process.stdout

    def hears(self, line: str) -> None:
        """Wait until the plan has said this."""
        assert self.out.readline().strip() == line

    def press(self) -> float:
        """Press Ctrl-C; the time of pressing."""
        pressed = time.monotonic()
        self.process.send_signal(signal.SIGINT)
        return pressed

    def rest(self) -> list[str]:
        """Return what it says until its end; nothing may be printed about things left open."""
        lines = self.out.read().splitlines()
        assert self.process.stderr is not None
        assert self.process.stderr.read() == ""
        self.process.wait()
        return lines


@pytest.fixture
def start(tmp_path: Path):  # type: ignore[no-untyped-def]
    """Start plans; what a failing test leaves behind is killed."""
    plans: list[Plan] = []

    def begin(code: str, host: str) -> Plan:
        plans.append(Plan(code, host, tmp_path))
        return plans[-1]

    yield begin
    for plan in plans:
        plan.process.kill()
        plan.process.communicate()


CLEANUP = """
    async def body():
        say("works")
        try:
            await sleep(60)
        except Evaporated:
            say("evaporated")
            raise

    async def cleanup():
        await sleep({seconds})
        say("gripper opened")

    go(partial(par, partial(unwind_protect, body, cleanup), partial(sleep, 60)))
"""


@pytest.mark.parametrize("host", HOSTS)
def test_the_first_ctrl_c_delivers_evaporation_within_two_tenths_and_runs_bounded_cleanups(start, host: str) -> None:  # type: ignore[no-untyped-def]
    plan = start(CLEANUP.format(seconds=0.05), host)
    plan.hears("works")
    pressed = plan.press()
    plan.hears("evaporated")
    assert time.monotonic() - pressed < 0.2
    assert plan.rest() == ["gripper opened", "ended with KeyboardInterrupt", "live tasks: 0"]


@pytest.mark.parametrize("host", HOSTS)
def test_the_second_ctrl_c_drains_within_two_tenths(start, host: str) -> None:  # type: ignore[no-untyped-def]
    plan = start(CLEANUP.format(seconds=9), host)
    plan.hears("works")
    plan.press()
    plan.hears("evaporated")
    pressed = plan.press()
    plan.hears("ended with KeyboardInterrupt")
    assert time.monotonic() - pressed < 0.2
    assert plan.rest() == ["live tasks: 0"]


@pytest.mark.parametrize(
    ("host", "code"),
    some(product(HOSTS, ["for _ in iter(int, 1): pass", "time.sleep(60)", "threading.Event().wait(60)"]), every=4),
)
def test_the_second_ctrl_c_ends_a_plan_that_reaches_no_checkpoint(start, host: str, code: str) -> None:  # type: ignore[no-untyped-def]
    plan = start(
        f"""
        async def busy():
            say("works")
            try:
                {code}
            finally:
                say("left")

        go(partial(par, partial(sleep, 60), busy))
        """,
        host,
    )
    plan.hears("works")
    plan.press()
    time.sleep(0.05)
    pressed = plan.press()
    plan.hears("left")
    assert time.monotonic() - pressed < 0.25
    assert plan.rest() == ["ended with KeyboardInterrupt", "live tasks: 0"]


@pytest.mark.parametrize("host", ["virtual", "simulation"])
def test_in_simulation_the_first_ctrl_c_waits_for_calls_in_flight_and_the_second_does_not(start, host: str) -> None:  # type: ignore[no-untyped-def]
    plan = start(
        """
        async def other():
            say("works")
            try:
                await sleep(60)
            finally:
                say("other evaporated")

        async def calls():
            try:
                await in_thread(time.sleep, 60)
            finally:
                say("caller released")

        go(partial(par, calls, other))
        """,
        host,
    )
    plan.hears("works")
    pressed = plan.press()
    plan.hears("other evaporated")
    assert time.monotonic() - pressed < 0.2
    pressed = plan.press()
    plan.hears("caller released")
    assert time.monotonic() - pressed < 0.2
    assert plan.rest() == ["ended with KeyboardInterrupt", "live tasks: 0"]


def test_in_real_time_the_first_ctrl_c_abandons_calls_in_flight(start) -> None:  # type: ignore[no-untyped-def]
    plan = start(
        """
        async def calls():
            say("works")
            try:
                await in_thread(time.sleep, 60)
            finally:
                say("caller released")

        go(calls)
        """,
        "real time",
    )
    plan.hears("works")
    pressed = plan.press()
    plan.hears("caller released")
    assert time.monotonic() - pressed < 0.2
    assert plan.rest() == ["ended with KeyboardInterrupt", "live tasks: 0"]


def test_a_third_ctrl_c_interrupts_cleanup_code_that_blocks_the_drain(start) -> None:  # type: ignore[no-untyped-def]
    plan = start(
        """
        async def stubborn():
            say("works")
            try:
                await sleep(60)
            finally:
                say("cleaning")
                time.sleep(60)

        go(partial(par, stubborn, partial(unwind_protect, partial(sleep, 60), partial(sleep, 9))))
        """,
        "simulation",
    )
    plan.hears("works")
    plan.press()
    plan.hears("cleaning")
    pressed = plan.press()
    assert plan.rest() == ["ended with KeyboardInterrupt", "live tasks: 0"]
    assert time.monotonic() - pressed < 1


def test_a_task_that_swallows_everything_ends_stuck_after_the_second_ctrl_c(start) -> None:  # type: ignore[no-untyped-def]
    plan = start(
        """
        warnings.simplefilter("ignore")

        async def undying():
            say("works")
            with shield(within=1000):
                while True:
                    try:
                        await sleep(1)
                    except BaseException:
                        pass

        go(partial(par, undying, partial(sleep, 60)))
        """,
        "real time",
    )
    plan.hears("works")
    plan.press()
    time.sleep(0.05)
    pressed = plan.press()
    assert plan.rest() == ["ended with StuckTask", "live tasks: 0"]
    assert time.monotonic() - pressed < 1
