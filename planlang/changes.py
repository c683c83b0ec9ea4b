"""Changes of what there is, as plain data: what an action brings about, with names resolved.

Executives work them out of what classes of actions declare (:mod:`planlang.effects`), and do the same to the world and
to what they believe.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Output:
    """Something that comes into being: its name and class; of a food, how much there is of it usually [ml]."""

    name: str
    type: str
    amount: float | None


@dataclass(frozen=True, slots=True)
class Transformed:
    """Things are destroyed, contents of things used up, and something comes into being of them."""

    things: tuple[tuple[str, float], ...]
    """Names, and how much there is usually of what has no amount [ml]."""
    used: tuple[tuple[str, str], ...]
    """Things, and the class of what is used up of their contents."""
    outputs: tuple[Output, ...]
    vessel: str | None
    """The thing in which the outputs come into being, if they have amounts."""


@dataclass(frozen=True, slots=True)
class TurnedOver:
    """A thing lies upside down."""

    name: str


@dataclass(frozen=True, slots=True)
class Switched:
    """A device is in another state, such as ``DeviceStateOn``."""

    name: str
    state: str


@dataclass(frozen=True, slots=True)
class Poured:
    """An amount [ml] of what is in a thing is on or in another one."""

    source: str
    target: str
    amount: float


Change = Transformed | TurnedOver | Switched | Poured


@runtime_checkable
class Physics(Protocol):
    """A world in which the effects of actions come about because they are declared: a simulated one."""

    @property
    def changed(self) -> int:
        """The number of changes of what there is, by whomever."""

    def do(self, change: Change) -> float:
        """Make a change; return how much has flowed [ml]. What is not there is let alone."""

    def is_free(self, name: str) -> bool:
        """Return whether nothing has or had a name."""
