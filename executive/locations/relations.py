"""The table of relations: what each means for a base, for a hand, and for an object.

TABLE is that table in words; what designators ask for is bound here to what the believed world has of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import HEIGHTS, OF_A_BASE, OF_A_THING, SIDES, Area, Facing, area_of
from executive.locations.bounds import bounds, check_consistent, contradictory
from executive.locations.doors import Clear
from executive.locations.meaningless import LocationMeaningless, meaningless
from executive.locations.reach import HandTerm, Reach
from planlang.designators import Location, Object, Relation


@dataclass(frozen=True, slots=True)
class Meaning:
    """What a relation to X denotes: a set of poses of the base, of a hand, of an object; None where nothing."""

    base: str | None = None
    hand: str | None = None
    thing: str | None = None


_SIDE = "within 45 degrees of that side of X: in X's frame if X has a front, else in the viewer's"
TABLE: Mapping[str, Meaning] = {
    "in_reach_of": Meaning(
        "X to grasp: pre-grasp, grasp and lift can be reached; a person: a place in their comfort zone; a location of "
        "the hand: some pose of it; anything else: some pose above X",
        "X a person: what the hand holds, or the hand, is inside their comfort zone; else what the base would need",
        "X a person: inside their comfort zone",
    ),
    "visible_from": Meaning(
        "the camera, turned to X as far as the neck can, sees at least 30 % of the side of X that faces it"
    ),
    "above": Meaning(
        None, "level, lowest point of hand and held object 2 to 15 cm over X's top, what is held over X's footprint"
    ),
    "on": Meaning(
        None,
        "puts what it holds on X, from above",
        "rests on X's level top, of a room on its floor, the whole footprint supported",
    ),
    "in_": Meaning(
        None,
        "puts what it holds into X, from above",
        "inside X's volume, resting; in a solid box there is no room",
    ),
    "in_center_of": Meaning(None, "the grip point within 1 cm of X's centre: the grasp"),
    "in_front_of": Meaning(
        f"{_SIDE}, 0.1 to 1.1 m away",
        "the pre-grasp: 8 cm back along the approach; with X in hand: raised and back as well",
        f"on the same support if no other is said, {_SIDE}",
    ),
    **{
        name: Meaning(f"{_SIDE}, 0.1 to 1.1 m away", _SIDE, f"on the same support if no other is said, {_SIDE}")
        for name in ("behind", "left_of", "right_of", "next_to")
    },
    "near": Meaning("within 1 m", "within 0.3 m", "on the same support if no other is said, within 0.3 m"),
    "far_from": Meaning("at least 2 m away", "at least 0.6 m away", "at least 0.6 m away"),
    "facing": Meaning("the heading points at X within 30 degrees"),
    "clear_of": Meaning("neither touches X nor stands in the sweep of X's doors"),
}
"""Distances are defaults; a designator may say others (within, beyond). A negated relation is the complement."""

Viewer = tuple[float, float]
"""Where somebody looks from, in the map [m]."""
NEEDS_SIZE = ("visible_from", "in_center_of", "clear_of")
"""Relations to a thing that can be touched."""
NOT_OF_ROOMS = ("in_reach_of", "visible_from", "above", "in_center_of")
"""Relations to what has an outside that can be touched or seen."""
FROM_OUTSIDE = ("clear_of", *SIDES)
"""Relations that nothing in a room has to the room."""


@dataclass(frozen=True, slots=True)
class BaseDemand:
    """What a location asks of the base, each conjunct once."""

    reaches: tuple[Reach, ...] = ()
    seen: tuple[str, ...] = ()
    areas: tuple[Area | Facing | Clear, ...] = ()
    unreached: tuple[Reach, ...] = ()
    """What must not be in reach."""
    unseen: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class ThingDemand:
    """What a location asks of an object: one of where it rests, and areas."""

    on: str | None = None
    inside: str | None = None
    areas: tuple[Area, ...] = ()
    people: tuple[tuple[str, bool], ...] = ()
    """Persons in whose comfort zone it is, or (False) is not."""
    neither: tuple[tuple[str, bool], ...] = ()
    """Bodies on which, or (True) in which, it does not rest."""


def base_demand(location: Location, scene: PlanningScene, viewer: Viewer) -> BaseDemand:
    """What a location asks of the base; raises LocationMeaningless for what means nothing, or contradicts itself.

    ``viewer``: whose left and right is meant where a thing has no front.
    """
    check_consistent(location, OF_A_BASE)
    reaches: dict[Reach, None] = {}
    unreached: dict[Reach, None] = {}
    seen: dict[str, None] = {}
    unseen: dict[str, None] = {}
    areas: dict[Area | Facing | Clear, None] = {}
    for relation in location.relations:
        match relation.name, relation.reference:
            case "in_reach_of", Location() as hand:
                reach = hand_demand(replace(hand, device=hand.device or location.device), scene, viewer)
                if reach.kind == "grasp" and reach.grasp is None:
                    reach = replace(reach, grasp=location.grasp)
                (unreached if relation.negated else reaches)[reach] = None
            case "in_reach_of", Object() as what:
                reach = _for_body(what, location, scene)
                (unreached if relation.negated else reaches)[reach] = None
            case "visible_from", Object() as what:
                (unseen if relation.negated else seen)[_body(relation, what, scene)] = None
            case "facing", Object() as what:
                body = _body(relation, what, scene)
                areas[Facing(_words(relation, body), scene.bodies.block(body), relation.negated)] = None
            case "clear_of", Object() as what:
                areas[_clear(relation, _body(relation, what, scene), scene)] = None
            case name, Object() as what if name in OF_A_BASE:
                body = _body(relation, what, scene)
                areas[_area(relation, body, viewer, scene.base_radius, OF_A_BASE[name], scene)] = None
            case _:
                raise _without_meaning(relation, "base")
    return BaseDemand(tuple(reaches), tuple(seen), tuple(areas), tuple(unreached), tuple(unseen))


OF_A_HAND: Mapping[str, tuple[float, float]] = {**OF_A_THING, "above": HEIGHTS}
HIGHEST = 1.0
"""How much higher than it has to be a hand is held, where nothing bounds it [m]."""
KINDS = ("retreat", "grasp", "offer", "place", "above")
"""What a hand location is made from, first, and then filtered by its other conjuncts."""


def hand_demand(location: Location, scene: PlanningScene, viewer: Viewer) -> Reach:
    """What a location asks of a hand; raises LocationMeaningless for what means nothing, and for a posture."""
    if not location.relations:
        raise meaningless(location, location, " is no place of a hand")
    check_consistent(location, OF_A_HAND)
    made: dict[HandTerm, Reach] = {}
    terms = hand_terms(location, scene, viewer)
    for relation, term in zip(location.relations, terms, strict=True):
        if not relation.negated and (reach := _made(relation, term.body, location, scene)) is not None:
            made[term] = reach
    if not made:
        needed = ("above", "on", "in_", "in_center_of", "in_front_of", "in_reach_of")
        raise meaningless(location, location, " does not say what the hand is at: it needs one of ", needed)
    first = min(made.values(), key=lambda reach: KINDS.index(reach.kind))
    also = tuple(dict.fromkeys(term for term in terms if made.get(term) != first))
    names = {term.name for term, reach in made.items() if reach == first}
    before = bool(also) and "in_front_of" in names and "in_center_of" not in names
    arms = _arms(location, scene)
    if first.kind == "offer":
        arms = _holding(arms, scene)
    return replace(first, grasp=location.grasp, arms=arms, also=also, before=before)


def hand_terms(location: Location, scene: PlanningScene, viewer: Viewer) -> tuple[HandTerm, ...]:
    """What each conjunct of a location says of a hand; raises LocationMeaningless for what means nothing."""
    terms = []
    for relation in location.relations:
        if not isinstance(relation.reference, Object) or TABLE[relation.name].hand is None:
            raise _without_meaning(relation, "hand")
        body = _body(relation, relation.reference, scene)
        from_there = viewer if relation.name in SIDES and scene.bodies.front(body) is None else None
        terms.append(HandTerm(relation.name, body, relation.within, relation.beyond, relation.negated, from_there))
    return tuple(terms)


def thing_demand(location: Location, thing: str, scene: PlanningScene, viewer: Viewer) -> ThingDemand:
    """What a location asks of an object, told by its name; raises LocationMeaningless as above.

    Nothing is in a relation to itself; only of what is in a hand it can be said how far it is from where it was taken.
    """
    check_consistent(location, OF_A_THING)
    radius, taken = max(scene.bodies.size(thing)[:2]) / 2, scene.arms.is_held(thing)
    on: list[str] = []
    inside: list[str] = []
    areas: list[Area] = []
    people: list[tuple[str, bool]] = []
    neither: list[tuple[str, bool]] = []
    for relation in location.relations:
        if not isinstance(relation.reference, Object) or TABLE[relation.name].thing is None:
            raise _without_meaning(relation, "thing")
        body = _body(relation, relation.reference, scene)
        if relation.name == "in_reach_of" and not scene.bodies.is_person(body):
            only = (" means nothing for an object: only ", ("in_reach_of",), f" a person does, and {body} is none")
            raise meaningless(relation, relation, *only)
        if body == thing and not (taken and relation.name in OF_A_THING):
            raise meaningless(relation, relation, f" means nothing for {thing} itself: other things tell a place")
        match relation.name:
            case "on" | "in_" if not relation.negated:
                (on if relation.name == "on" else inside).append(body)
            case "on" | "in_":
                neither.append((body, relation.name == "in_"))
            case "in_reach_of":
                people.append((body, not relation.negated))
            case name:
                areas.append(_area(relation, body, viewer, radius, OF_A_THING[name], scene))
    if len({*on, *inside}) > 1:
        raise contradictory(location, f"a thing rests in one place, not in {' and '.join(dict.fromkeys(on + inside))}")
    supports = [(r.name, r.reference) for r in location.relations if r.name in SIDES or r.name == "near"]
    if not on and not inside and not people and supports:
        for _, reference in supports:
            if (
                isinstance(reference, Object)
                and (found := scene.bodies.support(scene.bodies.bind(reference))) is not None
            ):
                on.append(found)
                break
    where = on[0] if on else None, inside[0] if inside else None
    return ThingDemand(*where, tuple(areas), tuple(people), tuple(neither))


def sides(demand: BaseDemand | ThingDemand, scene: PlanningScene) -> dict[str, str]:
    """Whose left, right, front and back is meant, for each conjunct that names a side."""
    named = {term.words: term.body for term in demand.areas if isinstance(term, Area) and term.directions}
    reaches = (*demand.reaches, *demand.unreached) if isinstance(demand, BaseDemand) else ()
    for term in (term for reach in reaches for term in reach.also if term.name in SIDES):
        if not (term.name == "in_front_of" and (scene.bodies.is_graspable(term.body) or scene.arms.is_held(term.body))):
            named[_told(term.name, term.body, negated=term.negated)] = term.body
    return {words: "the viewer's" if scene.bodies.front(body) is None else "its own" for words, body in named.items()}


def _arms(location: Location, scene: PlanningScene) -> tuple[str, ...] | None:
    return None if location.device is None else tuple(arm.name for arm in scene.arms.of(location.device))


def _holding(arms: tuple[str, ...] | None, scene: PlanningScene) -> tuple[str, ...] | None:
    """Of the arms that a device may mean those that hold something, if any does: an empty hand offers nothing."""
    return tuple(name for name in arms or () if scene.arms.held(name) is not None) or arms


def _for_body(what: Object, location: Location, scene: PlanningScene) -> Reach:
    """What being in reach of a body asks of a hand."""
    body = _body(Relation("in_reach_of", what), what, scene)
    arms = _arms(location, scene)
    if scene.bodies.is_person(body):
        return Reach("offer", body, None, _holding(arms, scene))
    if scene.arms.is_held(body):
        return Reach("retreat", body, None, arms)
    return Reach("grasp" if scene.bodies.is_graspable(body) else "above", body, location.grasp, arms)


def _made(relation: Relation, body: str, location: Location, scene: PlanningScene) -> Reach | None:
    """The reach that a conjunct of a hand location is, None for one that only filters."""
    match relation.name:
        case "above":
            low, high = bounds(relation.within, relation.beyond, HEIGHTS)
            return Reach("above", body, heights=(low, min(high, low + HIGHEST)))
        case "in_reach_of":
            return replace(_for_body(relation.reference, location, scene), arms=None)  # type: ignore[arg-type]
        case "on" | "in_":
            return Reach("place", body, inside=relation.name == "in_")
        case "in_center_of":
            return Reach("retreat" if scene.arms.is_held(body) else "grasp", body)
        case "in_front_of" if scene.bodies.is_graspable(body):
            return Reach("retreat" if scene.arms.is_held(body) else "grasp", body)
    return None


def _body(relation: Relation, what: Object, scene: PlanningScene) -> str:
    body = scene.bodies.bind(what)
    scene.bodies.block(body)
    if scene.bodies.is_room(body):
        if relation.name in NOT_OF_ROOMS:
            raise meaningless(relation, f"{body} is a room, and nothing is ", (relation.name,), " a room")
        if relation.name in FROM_OUTSIDE and not any(
            scene.bodies.is_room(name) for name in scene.bodies.names() if name != body
        ):
            raise meaningless(relation, f"{body} is the only room: in it nothing is ", (relation.name,), " it")
    if relation.name in NEEDS_SIZE and not scene.bodies.is_solid(body):
        raise meaningless(relation, f"{body} has no size: it is a place, and nothing is ", (relation.name,), " a place")
    if relation.name == "on" and not relation.negated and scene.bodies.rests_at(body) is None:
        raise meaningless(relation, f"{body} has no level top on which things rest")
    if relation.name == "in_" and min(scene.bodies.size(body)) <= 0:
        raise meaningless(relation, f"{body} has no size: nothing is in it")
    return body


def _area(
    relation: Relation,
    body: str,
    viewer: Viewer,
    radius: float,
    default: tuple[float, float],
    scene: PlanningScene,
) -> Area:
    block, front = scene.bodies.block(body), scene.bodies.front(body)
    limits, words = bounds(relation.within, relation.beyond, default), _words(relation, body)
    return area_of(relation.name, words, body, block, front, viewer, radius, limits, negated=relation.negated)


def _clear(relation: Relation, body: str, scene: PlanningScene) -> Clear:
    doors = tuple(scene.bodies.doors(body))
    block = None if any(door.name == body for door in doors) else scene.bodies.block(body)
    return Clear(_words(relation, body), block, doors, scene.base_radius, relation.negated)


def _words(relation: Relation, body: str) -> str:
    return _told(relation.name, body, negated=relation.negated)


def _told(name: str, body: str, *, negated: bool) -> str:
    said = f"{name.strip('_').replace('_', ' ')} {body}"
    return f"not {said}" if negated else said


def _without_meaning(relation: Relation, subject: str) -> LocationMeaningless:
    meant = {"base": "a base", "hand": "a hand", "thing": "an object"}[subject]
    if isinstance(relation.reference, Location) and relation.name != "in_reach_of":
        said = ((relation.name,), " is said of a thing or a person; of a location only ", ("in_reach_of",))
        return meaningless(relation, relation, ": ", *said)
    valid = tuple(name for name, meaning in TABLE.items() if getattr(meaning, subject) is not None)
    return meaningless(relation, relation, f" means nothing for {meant}; what does: ", valid)
