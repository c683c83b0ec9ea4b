"""Changes that an action makes to the world, as plain data with names resolved.

Executives derive them from the declared effects of action classes (:mod:`planlang.effects`), and apply the same change
to the world and to the belief.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Output:
    """A new thing: its name, its class and, for food, the usual amount [ml]."""

    name: str
    type: str
    amount: float | None


@dataclass(frozen=True, slots=True)
class Transformed:
    """Things are destroyed and contents used up, and new things made of them."""

    things: tuple[tuple[str, float], ...]
    """Names, each with the usual amount [ml] in case none is stated."""
    used: tuple[tuple[str, str], ...]
    """Containers, each with the class of the contents that are used up."""
    outputs: tuple[Output, ...]
    vessel: str | None
    """The vessel that holds the outputs, if they have amounts."""


@dataclass(frozen=True, slots=True)
class TurnedOver:
    """A thing is turned upside down."""

    name: str


@dataclass(frozen=True, slots=True)
class Switched:
    """A device changes to a state, such as ``DeviceStateOn``."""

    name: str
    state: str


@dataclass(frozen=True, slots=True)
class Poured:
    """An amount [ml] of the contents of one thing moves onto or into another."""

    source: str
    target: str
    amount: float


Change = Transformed | TurnedOver | Switched | Poured


@runtime_checkable
class Physics(Protocol):
    """A world that applies declared effects itself, as a simulator does; a real robot's world does not."""

    @property
    def changed(self) -> int:
        """Number of changes made so far, whoever made them."""

    def do(self, change: Change) -> float:
        """Apply a change; return the amount that flowed [ml]. Things that do not exist are skipped."""

    def is_free(self, name: str) -> bool:
        """Check that no thing has the name, nor ever had it."""
