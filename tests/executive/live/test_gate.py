"""A run that is held, stepped, paced and stopped does what it does unwatched."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from executive.live.live_run import Command, Gate
from planlang import SimulationHost, Trace, perform, plan, run
from planlang.designators import a_posture, action
from planlang.testing import Script, ScriptedExecutive

LONGEST = 30.0
"""Seconds of the clock after which a test gives up waiting."""


class GatedWorld:
    """A world in which nothing is; a gate stands behind each of its steps."""

    rate = 240

    def __init__(self, gate: Gate) -> None:
        self.gate, self.steps = gate, 0

    def step(self) -> None:
        """Take a step, and pass the gate."""
        self.steps += 1
        self.gate.passed(self.steps)


class Watched:
    """A plan of three movements of an arm, each half a second long, in a thread that a gate holds."""

    def __init__(self, gate: Gate, of: Callable[..., Any] | None = None) -> None:
        self.gate, self.trace = gate, Trace()
        self._plan = of or three_movements
        self.trace.listeners = (gate.heard,)
        self.raised: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        script = Script().on("Reaching", after=0.5)
        try:
            run(
                self._plan,
                host=SimulationHost(GatedWorld(self.gate)),
                executive=ScriptedExecutive(script),
                trace=self.trace,
            )
        except BaseException as problem:
            self.raised = problem

    def ended(self) -> list[str]:
        """Return the names of the movements that have ended."""
        return [one["name"] for one in self.trace.events if one["event"] == "ended" and one["kind"] == "perform"]

    def wait(self) -> None:
        """Wait for the end of the run."""
        self._thread.join(LONGEST)
        assert not self._thread.is_alive()


@plan
async def three_movements() -> None:
    for name in ("First", "Second", "Third"):
        await perform(action("Reaching", to_location=a_posture("carrying")), name=name)


def until(holds: Callable[[], Any]) -> None:
    """Wait until something holds."""
    end = time.monotonic() + LONGEST
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.001)


def test_no_plan_time_passes_while_a_run_is_held() -> None:
    gate = Gate(240, paused=True)
    watched = Watched(gate)
    until(lambda: gate.step == 1)
    time.sleep(0.05)
    assert gate.step == 1
    assert watched.ended() == []
    gate.command(Command.RESUME)
    watched.wait()
    assert watched.ended() == ["First", "Second", "Third"]


def test_a_step_goes_on_until_one_action_has_ended() -> None:
    gate = Gate(240, paused=True)
    watched = Watched(gate)
    for names in (["First"], ["First", "Second"]):
        gate.command(Command.STEP)
        until(lambda names=names: watched.ended() == names and gate.is_held)
        time.sleep(0.05)
        assert watched.ended() == names
    gate.command(Command.RESUME)
    watched.wait()


def test_a_run_that_was_held_and_stepped_leaves_the_trace_of_one_that_was_not() -> None:
    gate = Gate(240, paused=True)
    watched = Watched(gate)
    gate.command(Command.STEP)
    until(lambda: watched.ended() == ["First"])
    gate.command(Command.RESUME)
    watched.wait()
    unwatched = Watched(Gate(240))
    unwatched.wait()
    assert watched.trace.events == unwatched.trace.events


def test_a_run_that_is_stopped_ends_as_by_ctrl_c() -> None:
    gate = Gate(240, paused=True)
    watched = Watched(gate)
    gate.command(Command.STOP)
    watched.wait()
    assert isinstance(watched.raised, KeyboardInterrupt)


@pytest.mark.parametrize("speed", [20.0, 40.0])
def test_a_paced_run_is_no_faster_than_its_speed(speed: float) -> None:
    began = time.monotonic()
    watched = Watched(Gate(240, speed=speed))
    watched.wait()
    assert time.monotonic() - began >= 1.5 / speed - 0.03


def test_a_run_is_stopped_before_it_has_begun() -> None:
    gate = Gate(240)
    gate.command(Command.STOP)
    watched = Watched(gate)
    watched.wait()
    assert isinstance(watched.raised, KeyboardInterrupt)
    assert gate.step <= 1


def test_a_run_that_computes_is_stopped_at_the_second_request(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("executive.live.live_run.INSISTING", 0.0)
    computes = threading.Event()

    @plan
    async def endless() -> None:
        computes.set()
        while True:
            pass

    gate = Gate(240)
    watched = Watched(gate, endless)
    assert computes.wait(LONGEST)
    for _ in range(2):
        gate.command(Command.STOP)
    watched.wait()
    assert isinstance(watched.raised, KeyboardInterrupt)


def test_a_double_click_on_stop_leaves_the_cleanups_of_the_plan_alone() -> None:
    gate = Gate(240, paused=True)
    watched = Watched(gate)
    until(lambda: gate.step == 1)
    for _ in range(2):
        gate.command(Command.STOP)
    watched.wait()
    assert isinstance(watched.raised, KeyboardInterrupt)
    assert "drained" not in [one["event"] for one in watched.trace.events]
