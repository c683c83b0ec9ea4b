"""Locations that are meaningless or contradictory, and the bounds that relations imply."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field
from itertools import permutations
from typing import Any, ClassVar

from planlang.designators import Location, Relation
from planlang.failures import LocationUnresolvable
from planlang.records import dataclass
from planlang.relations import RELATIONS, Bounds, Sense, Subject


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


def bounds(within: float | None, beyond: float | None, default: Bounds) -> Bounds:
    """Return least and greatest distance [m]; a bound that is stated alone moves the other default out of its way."""
    least = default[0] if beyond is None else beyond
    most = default[1] if within is None else within
    if beyond is None and least > most:
        least = 0.0
    if within is None and most < least:
        most = math.inf
    return least, most


def check_consistent(location: Location, subject: Subject) -> None:
    """Raise LocationMeaningless if a relation is both required and excluded, or if distances exclude each other."""
    stated = set(location.relations)
    for relation in location.relations:
        if ~relation in stated:
            required = ~relation if relation.negated else relation
            raise contradictory(location, "it both requires and excludes ", required)
    distances = {relation: limits for relation in location.relations if (limits := _distances(relation, subject))}
    for first, second in permutations(distances, 2):
        if first.references != second.references or first.negated:
            continue
        (least, most), (other_least, other_most) = distances[first], distances[second]
        if second.negated:
            # an excluded area around X contains the required one
            inside = other_least <= least and most <= other_most
            if _is_round_about(first, subject) and _is_round_about(second, subject) and inside:
                raise contradictory(location, ~second, " holds wherever ", first, " does")
            continue
        # distances on a side are measured perpendicular to it, others to the nearest point, so these are never longer
        if least > other_most and (_is_round_about(second, subject) or second.name == first.name):
            raise contradictory(location, first, " and ", second, " leave no possible distance")
        if RELATIONS[first.name].is_opposite(RELATIONS[second.name]):
            raise contradictory(location, first, " and ", second, " are opposite sides")


def _distances(relation: Relation, subject: Subject) -> Bounds | None:
    """Bounds of a relation, stated or usual; None for one without distances."""
    meaning = RELATIONS[relation.name].meaning(subject)
    if meaning is None or meaning.bounds is None:
        return None
    return bounds(relation.within, relation.beyond, meaning.bounds)


def _is_round_about(relation: Relation, subject: Subject) -> bool:
    """Check whether a relation consists of a distance only."""
    meant = RELATIONS[relation.name]
    return meant.sense(subject) is Sense.AREA and not meant.directions
