"""A relation of locations as a class: its words, and what it demands of a base, a hand or a thing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar, Protocol

from planlang.records import dataclass
from planlang.relations.demands import SUBJECTS, Bodies, Bounds, Conjunct, InZone, Reach, Rest, See, Subject

if TYPE_CHECKING:
    from planlang.geometry.areas import Clear, Facing, Region
    from planlang.relations.demands import AtGrip, BeforeGrip, Over

Parts = tuple[object, ...]
"""Parts of a message: texts, relations as they are stated or bound, and tuples of names of relations."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """Meaning of a relation to X for one subject."""

    text: str
    """Explanation for users, shown in docs/guides/locations.md."""
    bounds: Bounds | None = None
    """Usual bounds of the distance; None for a relation without one."""


class Stated(Protocol):
    """A relation as a location states it: a designator."""

    @property
    def references(self) -> tuple[object, ...]:
        """What it relates to."""

    @property
    def within(self) -> float | None:
        """Greatest distance, if stated [m]."""

    @property
    def beyond(self) -> float | None:
        """Least distance, if stated [m]."""

    @property
    def negated(self) -> bool:
        """True if it must not hold."""

    def __invert__(self) -> Stated:
        """The complement."""


class RelationType:
    """Base class of relations; an instance of each is in :data:`planlang.relations.RELATIONS`.

    A subclass states words and meanings, and implements a method for each subject that it has a meaning for.
    """

    name: ClassVar[str]
    """The keyword in ``a_location(...)``."""
    owl: ClassVar[str]
    """The OWL property: a local name of the KnowRob vocabulary, or a whole IRI."""
    forms: ClassVar[tuple[str, ...]]
    """Forms in phrases, the one that planlang writes first; "not F" makes F a form of the complement."""
    synonyms: ClassVar[tuple[str, ...]] = ()
    """Other keywords for it."""
    arity: ClassVar[int] = 1
    """Number of things that it relates to: one, or two in any order."""

    of_base: ClassVar[Meaning | None] = None
    of_hand: ClassVar[Meaning | None] = None
    of_thing: ClassVar[Meaning | None] = None

    directions: ClassVar[tuple[float, ...]] = ()
    """Sides of X relative to its front [rad], left positive; empty for all sides."""
    of_locations: ClassVar[bool] = False
    """X may be a location."""
    of_solids: ClassVar[bool] = False
    """X must have a size; a mere place has none."""
    of_rooms: ClassVar[bool] = True
    """X may be the room that contains everything."""
    from_outside: ClassVar[bool] = False
    """Things inside X cannot have this relation to X."""
    leads_hand: ClassVar[bool] = False
    """Says what a hand is at; other relations only filter such poses."""

    # Demands

    def base(self, at: Conjunct, bodies: Bodies, radius: float) -> Reach | See | Region | Facing | Clear | None:
        """Return what the relation demands of a base with an outline of this radius [m]; None if nothing by itself."""

    def reach(self, at: Conjunct, bodies: Bodies) -> Reach | None:
        """Return the task with which a hand comes there; None if the relation only filters."""

    def hand(self, at: Conjunct, bodies: Bodies) -> InZone | AtGrip | BeforeGrip | Over | Rest | Region | None:
        """Return what holds for a hand that is there, ignoring negation; None if the relation has no meaning for it."""

    def thing(self, at: Conjunct, bodies: Bodies, radius: float) -> Rest | InZone | Region | None:
        """Return what the relation demands of a thing with an outline of this radius [m]; None without a meaning."""

    def supports(self, at: Conjunct, bodies: Bodies) -> tuple[str, ...]:
        """Return what a thing rests on if the location says nothing of it: for a thing beside X, what X stands on."""
        return ()

    # Mistakes

    def check(self, at: Conjunct, bodies: Bodies, subject: Subject) -> Parts:
        """Return why the relation cannot be had to these bodies, as parts of a message; () if it can."""
        for body in at.bodies:
            if bodies.is_room(body):
                if not self.of_rooms:
                    return f"{body} is a room: nothing can be ", (self.name,), " a room"
                others = (name for name in bodies.names() if name != body)
                if self.from_outside and not any(map(bodies.is_room, others)):
                    return f"{body} is the only room: nothing can be ", (self.name,), " it"
            if self.of_solids and not bodies.is_solid(body):
                return f"{body} is a place and has no size: nothing can be ", (self.name,), " a place"
        return ()

    def excludes(self, own: Stated, other: Stated, kind: RelationType, subject: Subject) -> Parts:
        """Return why ``own``, which is not negated, and ``other``, of a kind, cannot both hold; () if they can.

        The reason is given as parts of a message. Distances and sides exclude each other only of the same thing.
        """
        if own.references != other.references:
            return ()
        mine, theirs = self.distances(own, subject), kind.distances(other, subject)
        if mine is None or theirs is None:
            return ()
        if other.negated:
            # an excluded area around X contains the required one
            inside = theirs[0] <= mine[0] and mine[1] <= theirs[1]
            both_round = self.is_round_about(subject) and kind.is_round_about(subject)
            return (~other, " holds wherever ", own, " does") if inside and both_round else ()
        # distances on a side are measured perpendicular to it, others to the nearest point, so these are never longer
        if mine[0] > theirs[1] and (kind.is_round_about(subject) or kind.name == self.name):
            return own, " and ", other, " leave no possible distance"
        return (own, " and ", other, " are opposite sides") if self.is_opposite(kind) else ()

    def is_round_about(self, subject: Subject) -> bool:
        """Check whether the relation of a subject consists of a distance only."""
        return False

    def is_opposite(self, other: RelationType) -> bool:
        """Check whether the two relations name opposite sides of X."""
        if len(self.directions) != 1 or len(other.directions) != 1:
            return False
        return math.cos(self.directions[0] - other.directions[0]) < -1 + 1e-9

    def check_itself(self) -> None:
        """Raise ValueError if the class lacks something; called when it is added."""

    # Meanings

    def meaning(self, subject: Subject) -> Meaning | None:
        """Return the meaning for a subject; None if it has none."""
        return {"base": self.of_base, "hand": self.of_hand, "thing": self.of_thing}[subject]

    def meanings(self) -> tuple[Meaning, ...]:
        """Return the meanings, for a base, a hand and a thing."""
        return tuple(meaning for subject in SUBJECTS if (meaning := self.meaning(subject)) is not None)

    @property
    def measured(self) -> bool:
        """True if it has a distance that a location can bound."""
        return any(meaning.bounds is not None for meaning in self.meanings())

    def distances(self, stated: Stated | Conjunct, subject: Subject) -> Bounds | None:
        """Return least and greatest distance [m], stated or usual; None for a relation without distances."""
        meaning = self.meaning(subject)
        return None if meaning is None or meaning.bounds is None else bounds(stated, meaning.bounds)


def bounds(stated: Stated | Conjunct, usual: Bounds) -> Bounds:
    """Return least and greatest distance [m]; a bound that is stated alone moves the usual other one out of its way."""
    least = usual[0] if stated.beyond is None else stated.beyond
    most = usual[1] if stated.within is None else stated.within
    if stated.beyond is None and least > most:
        least = 0.0
    if stated.within is None and most < least:
        most = math.inf
    return least, most
