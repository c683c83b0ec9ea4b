"""Hosts: what a step of plan time is."""

from __future__ import annotations

from typing import Protocol


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

    def advance(self, steps: int) -> None:
        """Let this many steps pass; called only when no task can run."""


class VirtualHost:
    """Time without a world: it jumps to the next step in which something is due."""

    jumps = True

    def __init__(self, rate: int = 240) -> None:
        self.rate = _checked(rate)

    def advance(self, steps: int) -> None:
        """Nothing has to be done."""


class SimulationHost:
    """Steps a world, once per step of plan time."""

    jumps = False

    def __init__(self, world: Steps) -> None:
        self.world = world
        self.rate = _checked(world.rate)
        self._step = world.step

    def advance(self, steps: int) -> None:
        """Step the world."""
        for _ in range(steps):
            self._step()


def _checked(rate: int) -> int:
    if isinstance(rate, bool) or not isinstance(rate, int) or rate < 1:
        raise ValueError(f"a rate is an integer number of steps per second, at least 1, not {rate!r}")
    return rate
