"""Relations of a hand: in reach of, above, on, in, in the centre of."""

from __future__ import annotations

from typing import TYPE_CHECKING

from planlang.relations.demands import (
    HEIGHTS,
    AtGrip,
    Bodies,
    Conjunct,
    InZone,
    Over,
    Reach,
    ReachKind,
    Rest,
    Subject,
)
from planlang.relations.relation_type import Meaning, Parts, RelationType, bounds

if TYPE_CHECKING:
    from planlang.geometry.areas import Area

HIGHEST = 1.0
"""Greatest height of a hand above the least one if nothing limits it [m]: no bundled arm reaches farther."""


def is_handled(body: str, bodies: Bodies) -> bool:
    """Check whether a hand can grasp a body, or has."""
    return bodies.is_graspable(body) or bodies.is_held(body)


def handling(body: str, bodies: Bodies) -> Reach:
    """Return the task of a hand at a thing: to grasp it, or to retreat with it."""
    return Reach(ReachKind.RETREAT if bodies.is_held(body) else ReachKind.GRASP, body)


class InReachOf(RelationType):
    """A hand can reach X for its purpose: to grasp it, to hand something over, to be above it or at a location."""

    name = "in_reach_of"
    owl = "inReachOf"
    forms = ("in reach of", "within reach of")
    of_base = Meaning(
        "an object to grasp: pre-grasp, grasp and lift are reachable; a person: a point in their comfort zone; "
        "a hand location: some pose of it; anything else, or a full hand at what takes two hands: some pose above X"
    )
    of_hand = Meaning("a person: the held object, or the hand, is inside their comfort zone; else as for a base")
    of_thing = Meaning("a person: inside their comfort zone")
    of_locations = True
    of_rooms = False
    leads_hand = True

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Reach:
        """Reach it."""
        return self.reach(at, bodies)

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach:
        """Offer something to a person, retreat with what is held, grasp what can be grasped, else come above it."""
        if bodies.is_person(at.body):
            return Reach(ReachKind.OFFER, at.body)
        return handling(at.body, bodies) if is_handled(at.body, bodies) else Reach(ReachKind.ABOVE, at.body)

    def hand(self, at: Conjunct, bodies: Bodies) -> InZone | AtGrip | Over:
        """Be in a person's comfort zone, at the grip of a thing, or above it."""
        if bodies.is_person(at.body):
            return InZone(at.body)
        return AtGrip(at.body) if is_handled(at.body, bodies) else Over(at.body, HEIGHTS)

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> InZone:
        """Be in a person's comfort zone."""
        return InZone(at.body)

    def check(self, at: Conjunct, bodies: Bodies, subject: Subject) -> Parts:
        """Things are in reach of persons only."""
        if (problem := super().check(at, bodies, subject)) or subject != "thing" or bodies.is_person(at.body):
            return problem
        return at, " means nothing for an object: it takes a person, and ", f"{at.body} is not a person"


class Above(RelationType):
    """Over X, at a height."""

    name = "above"
    owl = "aboveOf"
    forms = ("above", "over")
    of_hand = Meaning(
        "level, the lowest point of hand and held object 2 to 15 cm above X's top, the object above X's footprint",
        HEIGHTS,
    )
    of_rooms = False
    leads_hand = True

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach:
        """Come above it."""
        low, high = bounds(at, HEIGHTS)
        return Reach(ReachKind.ABOVE, at.body, heights=(low, min(high, low + HIGHEST)))

    def hand(self, at: Conjunct, bodies: Bodies) -> Over:
        """Be above it."""
        return Over(at.body, bounds(at, HEIGHTS))


class On(RelationType):
    """Resting on X."""

    name = "on"
    owl = "on-Physical"
    forms = ("on", "on top of")
    of_hand = Meaning("puts the held object on X, from above")
    of_thing = Meaning("rests on X's level top (in a room: on its floor), with its whole footprint supported")
    leads_hand = True

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach:
        """Put something down."""
        return Reach(ReachKind.PLACE, at.body)

    def hand(self, at: Conjunct, bodies: Bodies) -> Rest:
        """What is held rests there."""
        return Rest(at.body)

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> Rest:
        """Rest there."""
        return Rest(at.body)

    def check(self, at: Conjunct, bodies: Bodies, subject: Subject) -> Parts:
        """Nothing rests where there is no level top."""
        if (problem := super().check(at, bodies, subject)) or at.negated or bodies.rests_at(at.body) is not None:
            return problem
        return (f"{at.body} has no level top to rest things on",)


class In(RelationType):
    """Resting inside X."""

    name = "in_"
    owl = "in-ContGeneric"
    forms = ("in", "inside", "inside of")
    of_base = Meaning("a room: the whole base is inside it")
    of_hand = Meaning("puts the held object into X, from above")
    of_thing = Meaning("rests inside X's volume; a solid box has no room")
    leads_hand = True

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Area:
        """Stand in the room, with all of the outline: whoever is sent there does not stay in its doorway."""
        return bodies.block(at.body).inside(at.words, at.body, radius, negated=at.negated)

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach:
        """Put something into it."""
        return Reach(ReachKind.PLACE, at.body, inside=True)

    def hand(self, at: Conjunct, bodies: Bodies) -> Rest:
        """What is held rests inside."""
        return Rest(at.body, inside=True)

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> Rest:
        """Rest inside."""
        return Rest(at.body, inside=True)

    def check(self, at: Conjunct, bodies: Bodies, subject: Subject) -> Parts:
        """Nothing is inside of what has no size, and a base only in a room."""
        problem = super().check(at, bodies, subject)
        if not problem and subject == "base" and not bodies.is_room(at.body):
            return at, " means nothing for a base: it takes a room, and ", f"{at.body} is not a room"
        if problem or min(bodies.size(at.body)) > 0:
            return problem
        return (f"{at.body} has no size: nothing can be in it",)


class InCenterOf(RelationType):
    """Gripping X."""

    name = "in_center_of"
    owl = "inCenterOf"
    forms = ("in the center of", "in the centre of", "in the middle of")
    of_hand = Meaning(
        "the grasp: the grip point within 1 cm of X's centre, or of the vertical through it from halfway down upwards, "
        "or where else X is gripped"
    )
    of_solids = True
    of_rooms = False
    leads_hand = True

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach:
        """Grasp it, or retreat with it."""
        return handling(at.body, bodies)

    def hand(self, at: Conjunct, bodies: Bodies) -> AtGrip:
        """Be at its grip."""
        return AtGrip(at.body)


REACHING: tuple[RelationType, ...] = (InReachOf(), Above(), On(), In(), InCenterOf())
