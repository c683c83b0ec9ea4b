"""Descriptions of no place at all, told in parts that Python and phrases put into words of their own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

from planlang.designators import Location, Relation
from planlang.failures import LocationUnresolvable


@dataclass(eq=False, repr=False)
class LocationMeaningless(LocationUnresolvable):
    """The description is of no place at all: it means nothing for what is looked for, or contradicts itself.

    ``parts`` of the message are texts, relations and locations, and tuples with names of relations.
    """

    parts: tuple[object, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "no place is described"

    def describe(self) -> str:
        """The parts, relations and locations as Python has them."""
        return self.told(str) if self.parts else super().describe()

    def details(self) -> dict[str, Any]:
        """The typed fields but for the parts, which the message has."""
        return {name: value for name, value in super().details().items() if name != "parts"}

    def told(self, words: Callable[[object], str]) -> str:
        """The message with the words that there are for a relation, a location and the name of a relation."""
        return "".join(
            part if isinstance(part, str) else ", ".join(map(words, part)) if isinstance(part, tuple) else words(part)
            for part in self.parts
        )


def meaningless(about: Relation | Location, *parts: object) -> LocationMeaningless:
    """The failure of a relation or a location that is of no place, told in parts."""
    return LocationMeaningless(designator=str(about), parts=parts)
