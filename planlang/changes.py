"""Changes that an action makes to the world, as plain data with names resolved.

Executives derive them from the declared effects of action classes (:mod:`planlang.effects`), apply them to the belief
(:mod:`planlang.state`), and let a simulated world bring about what its own physics has not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import Protocol

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


@dataclass(frozen=True, slots=True)
class Simulated:
    """What has happened in a world by its own physics since it began: all that needs no declaration of effects.

    Of what a robot believes, it is what its motions have poured.
    """

    flowed: Mapping[str, float] = field(default_factory=dict)
    """Vessel -> volume that has flowed out of it, as a hand tilted it [ml]."""
    carried: Mapping[str, int] = field(default_factory=dict)
    """Thing -> number of times that a blade took it along, which turns it over or fails to."""
    switched: Mapping[str, int] = field(default_factory=dict)
    """Device -> number of times that a hand has switched it."""

    def flowed_since(self, since: Simulated, vessel: str) -> float:
        """Compute how much has flowed out of a vessel since an earlier moment [ml]."""
        return self.flowed.get(vessel, 0.0) - since.flowed.get(vessel, 0.0)

    def left_of(self, change: Change, since: Simulated) -> Change | None:
        """Return what of a change has not happened by physics since an earlier moment; None if nothing is left."""
        match change:
            case Poured(source, target, amount):
                left = amount - self.flowed_since(since, source)
                return Poured(source, target, left) if left > 0 else None
            case TurnedOver(name):
                return change if self.carried.get(name) == since.carried.get(name) else None
            case Switched(name):
                return change if self.switched.get(name) == since.switched.get(name) else None
        return change


class Physics(Protocol):
    """A simulated world, in which declared effects come true; a real robot's world is none.

    Its motions may pour, turn over and switch by themselves. A declared effect adds only what they have not done.
    """

    @property
    def changed(self) -> int:
        """Number of changes brought about so far."""

    @property
    def simulated(self) -> Simulated:
        """What has happened by physics so far."""

    def bring_about(self, change: Change, since: Simulated | None = None) -> bool:
        """Let a declared effect come true, as far as it has not happened by physics ``since`` the action began.

        Return False if nothing was left to do. Things that do not exist are skipped.
        """

    def is_free(self, name: str) -> bool:
        """Check that no thing has the name, nor ever had it."""
