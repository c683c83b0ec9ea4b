"""Locations that are meaningless or contradictory."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field
from itertools import permutations
from typing import Any, ClassVar

from planlang.designators import Location, Relation
from planlang.failures import LocationUnresolvable
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.relations.demands import Subject


@dataclass(eq=False, repr=False)
class LocationMeaningless(LocationUnresolvable):
    """The description applies to no place: it is meaningless for the subject, or contradicts itself.

    ``parts`` of the message are texts, relations, locations, and tuples of relation names.
    """

    parts: tuple[object, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "no place is described"

    def describe(self) -> str:
        """Render the message with relations and locations in Python syntax."""
        return self.worded(str) if self.parts else super().describe()

    def details(self) -> dict[str, Any]:
        """List the typed fields without the parts, which make up the message."""
        return {name: value for name, value in super().details().items() if name != "parts"}

    def worded(self, words: Callable[[object], str]) -> str:
        """Render the message; ``words`` renders a relation, a location or a relation's name."""
        return "".join(
            part if isinstance(part, str) else ", ".join(map(words, part)) if isinstance(part, tuple) else words(part)
            for part in self.parts
        )


def meaningless(about: Relation | Location, *parts: object) -> LocationMeaningless:
    """Create the failure of a meaningless relation or location, with its message in parts."""
    return LocationMeaningless(designator=str(about), parts=parts)


def contradictory(location: Location, *why: object) -> LocationMeaningless:
    """Create the failure of a conjunction that nothing can satisfy, with the reason in parts."""
    return meaningless(location, location, " contradicts itself: ", *why)


def check_consistent(location: Location, subject: Subject) -> None:
    """Raise LocationMeaningless if a relation is both required and excluded, or excludes another one."""
    stated = set(location.relations)
    for relation in location.relations:
        if ~relation in stated:
            required = ~relation if relation.negated else relation
            raise contradictory(location, "it both requires and excludes ", required)
    for first, second in permutations(location.relations, 2):
        kind, other = RELATIONS[first.name], RELATIONS[second.name]
        if not first.negated and (why := kind.excludes(first, second, other, subject)):
            raise contradictory(location, *why)
