"""The faults of one run: drawn at its opportunities, they happen at once or over the next steps of the world."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from planlang.faults.drawing import Draw, Drawn
from planlang.faults.kinds import Kind, Opportunity
from sim.faults.faulty_world import FaultyWorld

Event = Callable[[], bool]
"""Called after each step of the world; True once it is over."""


def untold(event: str, details: Mapping[str, Any]) -> None:
    """Write no record."""


class Injection:
    """Lets faults happen in a true world."""

    def __init__(self, truth: FaultyWorld, draw: Draw) -> None:
        """Nothing happens before an opportunity begins."""
        self.truth, self.draw = truth, draw
        self.tell: Callable[[str, Mapping[str, Any]], None] = untold
        """Writes a record of a fault that has happened."""
        self._events: list[Event] = []
        truth.then(self._go_on)

    @property
    def now(self) -> float:
        """Plan time [s]."""
        return self.truth.steps / self.truth.rate

    def begins(
        self, opportunity: Opportunity, names: Sequence[str], can: Callable[[Kind, str | None, str | None], bool]
    ) -> Drawn | None:
        """Draw what goes wrong at an opportunity that begins now; see :meth:`planlang.faults.drawing.Draw.at`."""
        return self.draw.at(opportunity, names, self.now, can)

    def happens(self, fault: Drawn) -> None:
        """Record that a fault happens now."""
        self.draw.happened(fault, self.now)
        self.tell("fault", {"fault": str(fault), "opportunity": fault.number})

    def later(self, event: Event) -> None:
        """Call an event after each step of the world, until it is over."""
        self._events.append(event)

    def _go_on(self) -> None:
        """Let the events go on after a step of the world."""
        for event in tuple(self._events):
            if event():
                self._events.remove(event)
