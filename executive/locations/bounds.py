"""Distances of relations: what a designator states, what else holds, and conjunctions that leave no distance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import permutations

from executive.locations.meaningless import LocationMeaningless, meaningless
from planlang.designators import Location, Relation

ROUND_ABOUT = ("near", "far_from")
"""Relations of which the distance is all there is."""
OPPOSITE = ({"in_front_of", "behind"}, {"left_of", "right_of"})


def bounds(within: float | None, beyond: float | None, default: tuple[float, float]) -> tuple[float, float]:
    """Least and greatest distance [m]; a bound that is stated alone moves the other default out of its way."""
    least = default[0] if beyond is None else beyond
    most = default[1] if within is None else within
    if beyond is None and least > most:
        least = 0.0
    if within is None and most < least:
        most = math.inf
    return least, most


def check_consistent(location: Location, defaults: Mapping[str, tuple[float, float]]) -> None:
    """Raise LocationMeaningless if a relation is asked for and excluded, or if nothing is at all the distances.

    ``defaults``: least and greatest distance of each relation that has one.
    """
    stated = set(location.relations)
    for relation in location.relations:
        if ~relation in stated:
            raise contradictory(location, "it asks for ", positive(relation), " and excludes it")
    measured = [relation for relation in location.relations if relation.name in defaults]
    for first, second in permutations(measured, 2):
        if first.reference != second.reference or first.negated:
            continue
        least, most = _distances(first, defaults)
        other_least, other_most = _distances(second, defaults)
        if second.negated:
            inside = other_least <= least and most <= other_most
            if second.name in ROUND_ABOUT and first.name in ROUND_ABOUT and inside:
                raise contradictory(location, positive(second), " holds wherever ", first, " does")
            continue
        # distances on a side are measured square to it, those round about to the nearest point: never less
        if least > other_most and (second.name in ROUND_ABOUT or second.name == first.name):
            raise contradictory(location, first, " and ", second, " leave no distance")
        if {first.name, second.name} in OPPOSITE:
            raise contradictory(location, first, " and ", second, " are opposite sides")


def positive(relation: Relation) -> Relation:
    """The relation without its negation."""
    return ~relation if relation.negated else relation


def contradictory(location: Location, *why: object) -> LocationMeaningless:
    """The failure of a conjunction that nothing can satisfy, ``why`` in parts."""
    return meaningless(location, location, " contradicts itself: ", *why)


def _distances(relation: Relation, defaults: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    return bounds(relation.within, relation.beyond, defaults[relation.name])
