"""The table of relations in locations: their names, phrases and meanings.

A new relation is one new row here: recipes use its OWL property, plans its name, phrases its forms, and the executive
resolves it by its :class:`Sense` for a base, a hand or a thing. A relation that fits no existing sense needs a new one,
implemented in executive/locations.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import Literal

from planlang.records import dataclass

Bounds = tuple[float, float]
"""Least and greatest distance [m]."""
Subject = Literal["base", "hand", "thing"]
"""Subject of a relation to X: the robot's base, a hand with the object in it, an object."""

HEIGHTS: Bounds = (0.02, 0.15)
"""Height above a surface that counts as above it [m]: clear of it, and near enough for putting down."""
BASE_SIDE: Bounds = (0.1, 1.1)
"""Distance of a base at a side of X [m]: clear of X, and within reach for an arm of 0.7 m."""
THING_SIDE: Bounds = (0.0, 0.3)
"""Distance of a hand or a thing at a side of X [m]: about that of things on one tray."""


class Sense(Enum):
    """Geometric constraint behind a relation to X; the executive implements each once."""

    REACH = "reach"
    """A hand can reach X for its purpose: to grasp it, to hand something over, to be above it or at a location."""
    SIGHT = "sight"
    AREA = "area"
    """Within a distance of X, on the sides that the relation names or on any."""
    HEADING = "heading"
    CLEARANCE = "clearance"
    OVER = "over"
    SUPPORT = "support"
    CONTAINMENT = "containment"
    GRASP_POINT = "grasp point"
    PRE_GRASP = "pre-grasp"
    """Pose from which the hand starts to grasp X; an area if X cannot be grasped."""
    VIEWPOINT = "viewpoint"
    """A viewer at X defines left and right, in front and behind in the other conjuncts; no constraint by itself."""


@dataclass(frozen=True, slots=True)
class Meaning:
    """Meaning of a relation to X for one subject."""

    sense: Sense
    text: str
    """Explanation for users, shown in docs/guides/locations.md."""
    bounds: Bounds | None = None
    """Default bounds of the distance; None for a relation without one."""


@dataclass(frozen=True, slots=True)
class RelationType:
    """One row of the table; ``name`` is the keyword in ``a_location(...)``."""

    name: str
    owl: str
    """The OWL property: a local name of the KnowRob vocabulary, or a whole IRI."""
    forms: tuple[str, ...]
    """Forms in phrases, the one that planlang writes first; "not F" makes F a form of the complement."""
    base: Meaning | None = None
    hand: Meaning | None = None
    thing: Meaning | None = None
    directions: tuple[float, ...] = ()
    """Sides of X relative to its front [rad], left positive; empty for all sides."""
    synonyms: tuple[str, ...] = ()
    """Other keywords for it."""
    arity: int = 1
    """Number of things that it relates to."""
    of_locations: bool = False
    """X may be a location."""
    of_solids: bool = False
    """X must have a size; a mere place has none."""
    of_rooms: bool = True
    """X may be the room that contains everything."""
    from_outside: bool = False
    """Things inside X cannot have this relation to X."""

    def meaning(self, subject: Subject) -> Meaning | None:
        """Return the meaning for a subject; None if it has none."""
        return {"base": self.base, "hand": self.hand, "thing": self.thing}[subject]

    def sense(self, subject: Subject) -> Sense | None:
        """Return the constraint on a subject; None if the relation has no meaning for it."""
        meaning = self.meaning(subject)
        return None if meaning is None else meaning.sense

    @property
    def measured(self) -> bool:
        """True if it has a distance that a location can bound."""
        return any(meaning is not None and meaning.bounds is not None for meaning in (self.base, self.hand, self.thing))

    def is_opposite(self, other: RelationType) -> bool:
        """Check whether the two relations name opposite sides of X."""
        if len(self.directions) != 1 or len(other.directions) != 1:
            return False
        return math.cos(self.directions[0] - other.directions[0]) < -1 + 1e-9


def _side(name: str, owl: str, forms: tuple[str, ...], *directions: float) -> RelationType:
    """Make a relation that means a side of X."""
    where = "within 45 degrees of that side of X: in X's frame if X has a front, else in the viewer's"
    return RelationType(
        name,
        owl,
        forms,
        base=Meaning(Sense.AREA, f"{where}, 0.1 to 1.1 m away", BASE_SIDE),
        hand=Meaning(Sense.AREA, where, THING_SIDE),
        thing=Meaning(Sense.AREA, f"on the same support unless another is stated, {where}", THING_SIDE),
        directions=directions,
        from_outside=True,
    )


_BEFORE = _side("in_front_of", "inFrontOf-Generally", ("in front of", "before"), 0.0)

_VIEW = Meaning(Sense.VIEWPOINT, "the viewer of the other relations is at X")

_TABLE = (
    RelationType(
        "in_reach_of",
        "inReachOf",
        ("in reach of", "within reach of"),
        base=Meaning(
            Sense.REACH,
            "an object to grasp: pre-grasp, grasp and lift are reachable; a person: a point in their comfort zone; "
            "a hand location: some pose of it; anything else: some pose above X",
        ),
        hand=Meaning(
            Sense.REACH,
            "a person: the held object, or the hand, is inside their comfort zone; else as for a base",
        ),
        thing=Meaning(Sense.REACH, "a person: inside their comfort zone"),
        of_locations=True,
        of_rooms=False,
    ),
    RelationType(
        "visible_from",
        "visibleFrom",
        ("visible from", "in view of", "in sight of", "seeing"),
        base=Meaning(
            Sense.SIGHT,
            "the camera, turned to X as far as the neck allows, sees at least 30 % of the side of X that faces it",
        ),
        synonyms=("visible",),
        of_solids=True,
        of_rooms=False,
    ),
    RelationType(
        "above",
        "aboveOf",
        ("above", "over"),
        hand=Meaning(
            Sense.OVER,
            "level, the lowest point of hand and held object 2 to 15 cm above X's top, the object above X's footprint",
            HEIGHTS,
        ),
        of_rooms=False,
    ),
    RelationType(
        "on",
        "on-Physical",
        ("on", "on top of"),
        hand=Meaning(Sense.SUPPORT, "puts the held object on X, from above"),
        thing=Meaning(
            Sense.SUPPORT, "rests on X's level top (in a room: on its floor), with its whole footprint supported"
        ),
    ),
    RelationType(
        "in_",
        "in-ContGeneric",
        ("in", "inside", "inside of"),
        hand=Meaning(Sense.CONTAINMENT, "puts the held object into X, from above"),
        thing=Meaning(Sense.CONTAINMENT, "rests inside X's volume; a solid box has no room"),
    ),
    RelationType(
        "in_center_of",
        "inCenterOf",
        ("in the center of", "in the centre of", "in the middle of"),
        hand=Meaning(
            Sense.GRASP_POINT,
            "the grasp: the grip point within 1 cm of X's centre, or of the vertical through it from halfway down "
            "upwards, or where else X is gripped",
        ),
        of_solids=True,
        of_rooms=False,
    ),
    RelationType(
        _BEFORE.name,
        _BEFORE.owl,
        _BEFORE.forms,
        base=_BEFORE.base,
        hand=Meaning(
            Sense.PRE_GRASP,
            "the pre-grasp: 8 cm back along the approach; with X in the hand also raised",
            THING_SIDE,
        ),
        thing=_BEFORE.thing,
        directions=_BEFORE.directions,
        from_outside=True,
    ),
    _side("behind", "behind-Generally", ("behind",), math.pi),
    _side("left_of", "toTheLeftOf", ("left of", "to the left of"), math.pi / 2),
    _side("right_of", "toTheRightOf", ("right of", "to the right of"), -math.pi / 2),
    _side("next_to", "toTheSideOf", ("next to", "beside"), math.pi / 2, -math.pi / 2),
    RelationType(
        "near",
        "near",
        ("near", "close to"),
        base=Meaning(Sense.AREA, "within 1 m", (0.0, 1.0)),
        hand=Meaning(Sense.AREA, "within 0.3 m", THING_SIDE),
        thing=Meaning(Sense.AREA, "on the same support unless another is stated, within 0.3 m", THING_SIDE),
    ),
    RelationType(
        "far_from",
        "farFrom",
        ("far from", "away from"),
        base=Meaning(Sense.AREA, "at least 2 m away", (2.0, math.inf)),
        hand=Meaning(Sense.AREA, "at least 0.6 m away", (0.6, math.inf)),
        thing=Meaning(Sense.AREA, "at least 0.6 m away", (0.6, math.inf)),
    ),
    RelationType(
        "facing",
        "facing",
        ("facing",),
        base=Meaning(Sense.HEADING, "the heading points at X within 30 degrees"),
    ),
    RelationType(
        "clear_of",
        "clearOf",
        ("clear of", "not blocking", "not touching"),
        base=Meaning(Sense.CLEARANCE, "neither touches X nor stands in the sweep of its doors"),
        of_solids=True,
        from_outside=True,
    ),
    RelationType(
        "seen_from",
        "seenFrom",
        ("seen from", "as seen from"),
        base=_VIEW,
        hand=_VIEW,
        thing=_VIEW,
        of_rooms=False,
    ),
)

RELATIONS: dict[str, RelationType] = {}
"""All relations by name."""


def add(relation: RelationType) -> None:
    """Add a relation to the table; raises ValueError if it has no meaning, or shares a word with another."""
    for other in RELATIONS.values():
        for mine, theirs in zip(_words(relation), _words(other), strict=True):
            if mine & theirs:
                raise ValueError(f"{min(mine & theirs)!r} of the relation {relation.name} means {other.name} already")
    if not relation.name.isidentifier() or not relation.forms:
        raise ValueError(f"the relation {relation.name!r} needs a Python name and at least one spoken form")
    meanings = [meaning for meaning in (relation.base, relation.hand, relation.thing) if meaning is not None]
    if not meanings:
        raise ValueError(f"the relation {relation.name} means nothing for a base, a hand or a thing")
    if any(meaning.sense in (Sense.AREA, Sense.OVER, Sense.PRE_GRASP) and not meaning.bounds for meaning in meanings):
        raise ValueError(f"the relation {relation.name} has a distance: say its usual bounds")
    RELATIONS[relation.name] = relation


def _words(relation: RelationType) -> tuple[set[str], ...]:
    """Return the keywords, the OWL property and the forms in phrases."""
    return {relation.name, *relation.synonyms}, {relation.owl}, set(relation.forms)


for _row in _TABLE:
    add(_row)


def named(keyword: str) -> RelationType | None:
    """Look up a relation by a keyword of ``a_location``; None if there is none."""
    found = RELATIONS.get(keyword)
    return found or next((one for one in RELATIONS.values() if keyword in one.synonyms), None)


def measured() -> tuple[str, ...]:
    """Return the names of the relations whose distance can be bounded."""
    return tuple(name for name, one in RELATIONS.items() if one.measured)


def owl_properties() -> tuple[str, ...]:
    """Return the OWL properties of all relations."""
    return tuple(one.owl for one in RELATIONS.values())


def of_owl_property(owl: str) -> str | None:
    """Look up the name of a relation by its OWL property; None if there is none."""
    return next((name for name, one in RELATIONS.items() if one.owl == owl), None)


def meaningful(subject: Subject) -> tuple[str, ...]:
    """Return the names of the relations that have a meaning for a subject."""
    return tuple(name for name, one in RELATIONS.items() if one.meaning(subject) is not None)
