"""Relations of a base to what it looks at, and to what it stands clear of; viewpoints."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from planlang.relations.demands import Bodies, Conjunct, See
from planlang.relations.relation_type import Meaning, RelationType

if TYPE_CHECKING:
    from planlang.geometry.areas import Clear, Facing


class VisibleFrom(RelationType):
    """The camera sees X."""

    name = "visible_from"
    owl = "visibleFrom"
    forms = ("visible from", "in view of", "in sight of", "seeing")
    of_base = Meaning(
        "the camera, turned to X as far as the neck allows, sees at least 30 % of the side of X that faces it"
    )
    synonyms = ("visible",)
    of_solids = True
    of_rooms = False

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> See:
        """See it."""
        return See(at.body)


class Faces(RelationType):
    """The heading points at X."""

    name = "facing"
    owl = "facing"
    forms = ("facing",)
    of_base = Meaning("the heading points at X within 30 degrees")

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Facing:
        """Face it."""
        return replace(bodies.block(at.body).faced(at.words), negated=at.negated)


class ClearOf(RelationType):
    """Out of the way of X and its doors."""

    name = "clear_of"
    owl = "clearOf"
    forms = ("clear of", "not blocking", "not touching")
    of_base = Meaning("neither touches X nor stands in the sweep of its doors")
    of_solids = True
    from_outside = True

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Clear:
        """Neither touch it nor stand in the sweep of its doors."""
        clear = bodies.block(at.body).cleared(at.words, at.body, tuple(bodies.doors(at.body)), radius)
        return replace(clear, negated=at.negated)


_VIEW = Meaning("the viewer of the other relations is at X")


class SeenFrom(RelationType):
    """A viewer at X defines left and right, in front and behind in the other conjuncts; no constraint by itself."""

    name = "seen_from"
    owl = "seenFrom"
    forms = ("seen from", "as seen from")
    of_base = _VIEW
    of_hand = _VIEW
    of_thing = _VIEW
    of_rooms = False


LOOKING: tuple[RelationType, ...] = (VisibleFrom(), Faces(), ClearOf(), SeenFrom())
