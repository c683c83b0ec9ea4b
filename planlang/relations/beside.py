"""Relations that are areas around X: at a side of it, near it, far from it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

from planlang.geometry.areas import HAIR
from planlang.relations.demands import BeforeGrip, Bodies, Bounds, Conjunct, Reach, Subject
from planlang.relations.reaching import In, On, handling, is_handled
from planlang.relations.relation_type import Meaning, Parts, RelationType, Stated

if TYPE_CHECKING:
    from planlang.geometry.areas import Area, Block, Strip

BASE_SIDE: Bounds = (0.1, 1.1)
"""Distance of a base at a side of X [m]: clear of X, and within reach for an arm of 0.7 m."""
THING_SIDE: Bounds = (0.0, 0.3)
"""Distance of a hand or a thing at a side of X [m]: about that of things on one tray."""


class Beside(RelationType):
    """Within a distance of X, on the sides that the relation names or on any; usual bounds are in the meanings."""

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Area:
        """Be in the area, and in the room that X is in, unless it is stated how far away that may be."""
        area = self.area(at, bodies, "base", radius)
        is_stated = at.within is not None or math.isinf(area.most)
        return area if is_stated else replace(area, room=_room_around(at.body, bodies))

    def hand(self, at: Conjunct, bodies: Bodies) -> BeforeGrip | Area:
        """Be in the area, with the middle of what is held."""
        return self.area(replace(at, negated=False), bodies, "hand", 0.0)

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> Area | None:
        """Be in the area."""
        return None if self.of_thing is None else self.area(at, bodies, "thing", radius)

    def supports(self, at: Conjunct, bodies: Bodies) -> tuple[str, ...]:
        """Return what X stands on, unless a thing may be any distance away."""
        if self.of_thing is None or self.of_thing.bounds is None or math.isinf(self.of_thing.bounds[1]):
            return ()
        support = bodies.support(at.body)
        return () if support is None else (support,)

    def is_round_about(self, subject: Subject) -> bool:
        """Without sides there is only a distance."""
        return not self.directions

    def area(self, at: Conjunct, bodies: Bodies, subject: Subject, radius: float) -> Area:
        """Return the area for an outline of this radius [m]."""
        limits = self.distances(at, subject)
        assert limits is not None, f"{self.name} has no distance for a {subject}"
        headings = self.headings(at, bodies)
        area = bodies.block(at.body).around(at.words, at.body, headings, limits, radius)
        return replace(area, negated=at.negated)

    def headings(self, at: Conjunct, bodies: Bodies) -> tuple[float, ...]:
        """Return the headings of the sides in the map [rad]: those of X's own front or, without one, the viewer's."""
        front = bodies.front(at.body) if self.directions else None
        if front is not None or not self.directions:
            return tuple((front or 0.0) + turn for turn in self.directions)
        assert at.viewer is not None, f"nobody says whose side of {at.body} is meant"
        block = bodies.block(at.body)
        ahead = math.atan2(at.viewer[1] - block.y, at.viewer[0] - block.x)
        return tuple(ahead - turn for turn in self.directions)  # seen by the viewer, left and right are swapped

    def check_itself(self) -> None:
        """A distance has bounds for whom it means something."""
        if any(meaning.bounds is None for meaning in self.meanings()):
            raise ValueError(f"the relation {self.name} has a distance: say its usual bounds")


def _room_around(name: str, bodies: Bodies) -> Block | None:
    """Return the block of the room that a body is in; None if it is in none or between two, as a doorway is."""
    if bodies.is_room(name):
        return None
    middle = bodies.block(name).centre
    rooms = [room for room in map(bodies.block, filter(bodies.is_room, bodies.names())) if room.away(middle) < HAIR]
    return rooms[0] if len(rooms) == 1 else None


_SAME_ROOM = "in the same room unless a distance is stated"
_SIDE = "within 45 degrees of that side of X: in X's frame if X has a front, else in the viewer's"


class Side(Beside):
    """At sides of X, which are those of its front or, without one, the viewer's."""

    of_base: ClassVar[Meaning | None] = Meaning(f"{_SIDE}, 0.1 to 1.1 m away, {_SAME_ROOM}", BASE_SIDE)
    of_hand: ClassVar[Meaning | None] = Meaning(_SIDE, THING_SIDE)
    of_thing: ClassVar[Meaning | None] = Meaning(f"on the same support unless another is stated, {_SIDE}", THING_SIDE)
    from_outside = True


class InFrontOf(Side):
    """At the front of X; for a hand at a thing that is grasped, the pre-grasp."""

    name = "in_front_of"
    owl = "inFrontOf-Generally"
    forms = ("in front of", "before")
    of_hand = Meaning("the pre-grasp: 8 cm back along the approach; with X in the hand also raised", THING_SIDE)
    directions = (0.0,)
    leads_hand = True

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach | None:
        """Grasp it, or retreat with it, if it can be grasped."""
        return handling(at.body, bodies) if bodies.is_graspable(at.body) else None

    def hand(self, at: Conjunct, bodies: Bodies) -> BeforeGrip | Area:
        """Be at the pre-grasp; in front of what cannot be grasped, in the area."""
        return BeforeGrip(at.body) if is_handled(at.body, bodies) else super().hand(at, bodies)


class Behind(Side):
    """At the back of X."""

    name = "behind"
    owl = "behind-Generally"
    forms = ("behind",)
    directions = (math.pi,)


class LeftOf(Side):
    """At the left side of X."""

    name = "left_of"
    owl = "toTheLeftOf"
    forms = ("left of", "to the left of")
    directions = (math.pi / 2,)


class RightOf(Side):
    """At the right side of X."""

    name = "right_of"
    owl = "toTheRightOf"
    forms = ("right of", "to the right of")
    directions = (-math.pi / 2,)


class NextTo(Side):
    """At the left or right side of X."""

    name = "next_to"
    owl = "toTheSideOf"
    forms = ("next to", "beside")
    directions = (math.pi / 2, -math.pi / 2)


class Near(Beside):
    """Within a distance of X."""

    name = "near"
    owl = "near"
    forms = ("near", "close to")
    of_base = Meaning(f"within 1 m, {_SAME_ROOM}", (0.0, 1.0))
    of_hand = Meaning("within 0.3 m", THING_SIDE)
    of_thing = Meaning("on the same support unless another is stated, within 0.3 m", THING_SIDE)


class Between(RelationType):
    """In the strip between the outlines of two things."""

    name = "between"
    owl = "between"
    forms = ("between", "in between")
    arity = 2
    of_base = Meaning("the middle of the base is on a straight line from X to Y, seen from above, and outside of both")
    of_hand = Meaning("the middle of the hand, or of what it holds, is there")
    of_thing = Meaning("on the same support as both unless another is stated, its middle is there")
    of_rooms = False

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Strip:
        """Be in the strip."""
        one, other = map(bodies.block, at.bodies)
        return replace(one.towards(at.words, other), negated=at.negated)

    def hand(self, at: Conjunct, bodies: Bodies) -> Strip:
        """Be in the strip."""
        return self.base(replace(at, negated=False), bodies, 0.0)

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> Strip:
        """Be in the strip."""
        return self.base(at, bodies, radius)

    def supports(self, at: Conjunct, bodies: Bodies) -> tuple[str, ...]:
        """Return what both stand on; nothing if they stand on different bodies."""
        both = {bodies.support(body) for body in at.bodies}
        return tuple(support for support in both if support is not None) if len(both) == 1 else ()

    def check(self, at: Conjunct, bodies: Bodies, subject: Subject) -> Parts:
        """There is nothing between a thing and itself, or what is over or under it."""
        if problem := super().check(at, bodies, subject):
            return problem
        one, other = at.bodies
        if one == other:
            return at, f" relates {one} to itself: name two things"
        first, second = bodies.block(one), bodies.block(other)
        is_apart = not (first.covers(second) or second.covers(first))
        return () if is_apart else (at, f" is no place: seen from above, one of {one} and {other} is within the other")

    def excludes(self, own: Stated, other: Stated, kind: RelationType, subject: Subject) -> Parts:
        """It has no order, and is outside of both things."""
        if isinstance(kind, Between) and other.negated and {*own.references} == {*other.references}:
            return ~other, " holds wherever ", own, " does"
        if isinstance(kind, On | In) and not other.negated and other.references[0] in own.references:
            return own, " and ", other, " exclude each other: what is between two things is outside of both"
        return ()


class FarFrom(Beside):
    """Beyond a distance of X."""

    name = "far_from"
    owl = "farFrom"
    forms = ("far from", "away from")
    of_base = Meaning("at least 2 m away", (2.0, math.inf))
    of_hand = Meaning("at least 0.6 m away", (0.6, math.inf))
    of_thing = Meaning("at least 0.6 m away", (0.6, math.inf))


BESIDE: tuple[RelationType, ...] = (InFrontOf(), Behind(), LeftOf(), RightOf(), NextTo(), Near(), FarFrom(), Between())
