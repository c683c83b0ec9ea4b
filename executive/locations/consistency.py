"""Locations that mean nothing or contradict themselves, and the distances that relations leave."""

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
    """The description is of no place at all: it means nothing for what is looked for, or contradicts itself.

    ``parts`` of the message are texts, relations and locations, and tuples with names of relations.
    """

    parts: tuple[object, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "no place is described"

    def describe(self) -> str:
        """Return the parts, relations and locations as Python has them."""
        return self.worded(str) if self.parts else super().describe()

    def details(self) -> dict[str, Any]:
        """Return the typed fields but for the parts, which the message has."""
        return {name: value for name, value in super().details().items() if name != "parts"}

    def worded(self, words: Callable[[object], str]) -> str:
        """Return the message; ``words`` writes a relation, a location or the name of a relation."""
        return "".join(
            part if isinstance(part, str) else ", ".join(map(words, part)) if isinstance(part, tuple) else words(part)
            for part in self.parts
        )


def meaningless(about: Relation | Location, *parts: object) -> LocationMeaningless:
    """Return the failure of a relation or a location that means nothing, with its message in parts."""
    return LocationMeaningless(designator=str(about), parts=parts)


def contradictory(location: Location, *why: object) -> LocationMeaningless:
    """Return the failure of a conjunction that nothing can satisfy, ``why`` in parts."""
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
    """Raise LocationMeaningless if a relation is asked for and excluded, or if nothing is at all the distances."""
    stated = set(location.relations)
    for relation in location.relations:
        if ~relation in stated:
            asked = ~relation if relation.negated else relation
            raise contradictory(location, "it asks for ", asked, " and excludes it")
    distances = {relation: found for relation in location.relations if (found := _distances(relation, subject))}
    for first, second in permutations(distances, 2):
        if first.reference != second.reference or first.negated:
            continue
        (least, most), (other_least, other_most) = distances[first], distances[second]
        if second.negated:
            # an area around X that is excluded as a whole
            inside = other_least <= least and most <= other_most
            if _is_round_about(first, subject) and _is_round_about(second, subject) and inside:
                raise contradictory(location, ~second, " holds wherever ", first, " does")
            continue
        # distances on a side are measured square to it, those round about to the nearest point: never less
        if least > other_most and (_is_round_about(second, subject) or second.name == first.name):
            raise contradictory(location, first, " and ", second, " leave no distance")
        if RELATIONS[first.name].is_opposite(RELATIONS[second.name]):
            raise contradictory(location, first, " and ", second, " are opposite sides")


def _distances(relation: Relation, subject: Subject) -> Bounds | None:
    """Return the bounds of a relation as they are stated or usual, None for one without."""
    meaning = RELATIONS[relation.name].meaning(subject)
    if meaning is None or meaning.bounds is None:
        return None
    return bounds(relation.within, relation.beyond, meaning.bounds)


def _is_round_about(relation: Relation, subject: Subject) -> bool:
    """Return whether the distance is all that a relation says."""
    meant = RELATIONS[relation.name]
    return meant.sense(subject) is Sense.AREA and not meant.directions
