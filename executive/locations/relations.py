"""The table of relations: what each means for a base and for a hand.

- ``in_reach_of``, for a base: a thing to grasp: pre-grasp, grasp and lift reachable; a person: a place in their
  comfort zone reachable; a location: some pose of it; anything else: some pose above it. For a hand: a person: what
  it holds is in their comfort zone.
- ``visible_from``, for a base: the camera sees it within its limits, unoccluded.
- ``above``, for a hand: level, lowest point 2 to 15 cm over the top, what it holds inside the footprint.
- ``in_front_of``, for a base: on the side of its x axis, 0.4 to 1.5 m away. For a hand: 8 cm back along the approach;
  with the thing in hand also raised, so that it clears what it stood on.
- ``in_center_of``, for a hand: the grasp.

Relations beside these are refused with a list of the valid ones.
"""

from __future__ import annotations

from dataclasses import dataclass

from executive.locations.reach import Reach
from executive.locations.surroundings import Surroundings
from planlang.designators import Location, Object, Relation
from planlang.failures import LocationUnresolvable

BASE_RELATIONS = ("in_reach_of", "visible_from", "in_front_of")
HAND_RELATIONS = ("in_reach_of", "above", "in_front_of", "in_center_of")


@dataclass(frozen=True, slots=True)
class Demand:
    """What a base location asks for, each conjunct once."""

    reaches: tuple[Reach, ...]
    seen: tuple[str, ...]
    in_front_of: tuple[str, ...]


def base_demand(location: Location, around: Surroundings) -> Demand:
    """What a location asks of the base; raises LocationUnresolvable for a relation that means nothing for a base."""
    reaches: dict[Reach, None] = {}
    seen: dict[str, None] = {}
    front: dict[str, None] = {}
    for relation in location.relations:
        match relation:
            case Relation("in_reach_of", Location() as hand):
                reaches.update(dict.fromkeys(hand_demand(hand, around)))
            case Relation("in_reach_of", Object() as what):
                reaches[_reach(around.bind(what), around)] = None
            case Relation("visible_from", Object() as what):
                seen[around.bind(what)] = None
            case Relation("in_front_of", Object() as what):
                front[around.bind(what)] = None
            case _:
                raise _meaningless(relation, "base", BASE_RELATIONS)
    return Demand(tuple(reaches), tuple(seen), tuple(front))


def hand_demand(location: Location, around: Surroundings) -> tuple[Reach, ...]:
    """What a location asks of a hand; empty for a posture."""
    reaches: dict[Reach, None] = {}
    for relation in location.relations:
        if not isinstance(relation.reference, Object) or relation.name not in HAND_RELATIONS:
            raise _meaningless(relation, "hand", HAND_RELATIONS)
        body = around.bind(relation.reference)
        if relation.name == "above":
            reaches[Reach("above", body)] = None
        elif relation.name == "in_reach_of":
            reaches[_reach(body, around)] = None
        else:
            reaches[Reach("retreat" if is_held(body, around) else "grasp", body)] = None
    return tuple(reaches)


def is_held(body: str, around: Surroundings) -> bool:
    """Whether one of the robot's hands holds the body."""
    return any((held := around.held(arm.name)) is not None and held.name == body for arm in around.arms)


def _reach(body: str, around: Surroundings) -> Reach:
    if around.is_person(body):
        return Reach("offer", body)
    if is_held(body, around):
        return Reach("retreat", body)
    return Reach("grasp" if around.is_graspable(body) else "above", body)


def _meaningless(relation: Relation, what: str, valid: tuple[str, ...]) -> LocationUnresolvable:
    message = f"{relation} means nothing for a {what}; what does: {', '.join(valid)}"
    return LocationUnresolvable(message, designator=str(relation))
