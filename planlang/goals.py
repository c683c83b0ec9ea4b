"""Goals as data: what has to hold in the world once a plan has ended.

:func:`planlang.phrases.read_goal` reads them from phrases such as "3 Cup on table1".
"""

from __future__ import annotations

from planlang.designators import Location, Object
from planlang.records import dataclass

OPEN, CLOSED, ON, OFF, EMPTY = "open", "closed", "on", "off", "empty"
"""States that each world has; others are individuals of ontologies, such as Clean."""


@dataclass(frozen=True, slots=True)
class HeldBy:
    """A thing is in the hands of a person, or of the robot; ``holder`` is None for the robot."""

    holder: Object | None
    negated: bool = False


@dataclass(frozen=True, slots=True)
class At:
    """A thing, or the base of the robot, is at a location."""

    location: Location


@dataclass(frozen=True, slots=True)
class RestsAt:
    """A thing is at rest on another or in it, as recipes say of what is put somewhere."""

    where: Object


@dataclass(frozen=True, slots=True)
class InState:
    """A door, drawer or lid is open or closed, a device on or off, a vessel empty; or a thing has a state (IRI)."""

    state: str
    negated: bool = False


@dataclass(frozen=True, slots=True)
class Holds:
    """A vessel contains some of a substance, or of anything: from ``least`` to ``most`` [ml].

    Both are the same for an amount that is stated as such. ``least`` is 0 if any amount will do.
    """

    substance: Object | None
    least: float = 0.0
    most: float | None = None
    negated: bool = False


@dataclass(frozen=True, slots=True)
class Exists:
    """A thing is there."""

    negated: bool = False


Fact = HeldBy | At | RestsAt | InState | Holds | Exists


@dataclass(frozen=True, slots=True)
class Number:
    """How many things of a class a goal is about, both ends included; ``most`` is None without a limit."""

    least: int = 1
    most: int | None = None
    every: bool = False
    """True for all things of the class, however many there are."""


@dataclass(frozen=True, slots=True)
class Goal:
    """A fact about a named thing, about a number of things of a class, or about the robot (``subject`` None)."""

    text: str
    """The phrase, as it was written."""
    subject: Object | None
    fact: Fact
    number: Number = Number()
    """It counts only for a subject without a name."""

    def __str__(self) -> str:
        return self.text
