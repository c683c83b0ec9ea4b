"""Hosts: what a step of plan time is."""

from __future__ import annotations

from typing import Protocol

from planlang.misuse import Usage, WrongValue, amount

WATCHDOG = 10.0
"""Seconds that code may compute, or be blocked, without reaching a checkpoint before it is interrupted."""


VIRTUAL_HOST = Usage("VirtualHost", {"rate": "240"}, {"watchdog": "10.0"})
SIMULATION_HOST = Usage("SimulationHost", {"world": "world"}, {"rate": "240", "watchdog": "10.0"})


class Steps(Protocol):
    """The part of a world that a host needs; every ``planlang.protocols.World`` has it."""

    rate: int

    def step(self) -> None:
        """Advance by one step."""


class Host(Protocol):
    """Gives plan time its rate and its steps."""

    rate: int
    """Steps per second."""
    jumps: bool
    """Whether steps in which nothing is due may be taken at once."""

    def advance(self, steps: int) -> int | None:
        """Let this many steps pass; called only when no task can run.

        A host that came back early returns the number of steps that have passed; None means all of them. Its attribute
        ``watchdog``, if there is one, is the longest time [s] that code may run without reaching a checkpoint.
        """


class VirtualHost:
    """Time without a world: it jumps to the next step in which something is due."""

    jumps = True

    def __init__(self, rate: int = 240, *, watchdog: float | None = WATCHDOG) -> None:
        self.rate = checked(VIRTUAL_HOST, rate, watchdog)
        self.watchdog = watchdog

    def advance(self, steps: int) -> None:
        """Nothing has to be done."""


class SimulationHost:
    """Steps a world, once per step of plan time."""

    jumps = False

    def __init__(self, world: Steps, *, watchdog: float | None = WATCHDOG) -> None:
        if isinstance(world, type) or not hasattr(world, "rate") or not hasattr(world, "step"):
            raise SIMULATION_HOST.wrong("world", world, "a world, which has a rate and a step()")
        self.world = world
        self.rate = checked(SIMULATION_HOST, world.rate, watchdog)
        self.watchdog = watchdog
        self._step = world.step

    def advance(self, steps: int) -> None:
        """Step the world."""
        for _ in range(steps):
            self._step()


def checked(function: Usage, rate: int, watchdog: float | None) -> int:
    """Return the rate, if it and the watchdog's time are what they should be."""
    rate = function.whole("rate", rate, 1, "steps per second")
    if watchdog is not None and not amount(watchdog):
        meant = "None, or a time > 0 [s] for code that does not wait"
        raise function.wrong("watchdog", watchdog, meant, WrongValue)
    return rate
