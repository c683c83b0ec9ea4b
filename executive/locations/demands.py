"""Demands of a location on a base, a hand or a thing, bound to bodies of the planning scene.

The senses of :mod:`planlang.relations` become areas of the floor, things to see, and reaches, which are tasks of a
hand. Meaningless relations and contradictory conjunctions are rejected.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

from executive.belief.believed_bodies import BelievedBodies
from executive.belief.planning_scene import PlanningScene, RobotArms
from executive.locations.consistency import LocationMeaningless, bounds, check_consistent, contradictory, meaningless
from planlang.designators import Action, Location, Object, Person, Relation, Situation, a_location, resting_on
from planlang.failures import ObjectUnresolvable
from planlang.geometry.areas import Area, Clear, Facing, area_of
from planlang.records import dataclass
from planlang.relations import HEIGHTS, RELATIONS, Bounds, Sense, Subject, meaningful

Viewer = tuple[float, float]
"""Position of a viewer in the map [m]."""
HIGHEST = 1.0
"""Greatest height of a hand above the least one if nothing limits it [m]: no bundled arm reaches farther."""


class ReachKind(Enum):
    """Purpose of a hand pose, by precedence: the first of several conjuncts generates poses, the others filter."""

    RETREAT = "retreat"
    """Retreat, raised, with the held thing."""
    GRASP = "grasp"
    OFFER = "offer"
    """Hold something where a person takes it."""
    PLACE = "place"
    ABOVE = "above"


ORDER = tuple(ReachKind)


class HandTerm(NamedTuple):
    """Conjunct about a hand: relation, body, greatest and least distance if stated, and negation."""

    name: str
    body: str
    within: float | None = None
    beyond: float | None = None
    negated: bool = False
    viewer: Viewer | None = None
    """Whose left and right is meant if the body has no front of its own."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Task of a hand with respect to one body."""

    kind: ReachKind
    body: str
    grasp: str | None = None
    """Required grasp class."""
    arms: tuple[str, ...] | None = None
    """Names of the arms that may do it; None: all."""
    heights: Bounds = HEIGHTS
    """For ABOVE: bounds of the lowest point's height above the body's top [m]."""
    inside: bool = False
    """For PLACE: True in the body, False on it."""
    also: tuple[HandTerm, ...] = ()
    """Other conjuncts for the hand."""
    before: bool = False
    """For GRASP and RETREAT: True if these apply to the pre-grasp pose instead of the grasp pose."""
    then: tuple[Reach, ...] = ()
    """For GRASP: later tasks of hands with the thing, which the grip has to suit."""


@dataclass(frozen=True, slots=True)
class BaseDemand:
    """Demands of a location on the base, without duplicates."""

    reaches: tuple[Reach, ...] = ()
    seen: tuple[str, ...] = ()
    areas: tuple[Area | Facing | Clear, ...] = ()
    unreached: tuple[Reach, ...] = ()
    """Reaches that must not be possible."""
    unseen: tuple[str, ...] = ()
    remembered: tuple[str, ...] = ()
    """Things to be handled that need not be visible from there: they are looked at before."""


@dataclass(frozen=True, slots=True)
class ThingDemand:
    """Demands of a location on an object: at most one place to rest, and areas."""

    on: str | None = None
    inside: str | None = None
    areas: tuple[Area, ...] = ()
    people: tuple[tuple[str, bool], ...] = ()
    """Persons whose comfort zone contains it, or (False) does not."""
    neither: tuple[tuple[str, bool], ...] = ()
    """Bodies on which, or (True) in which, it does not rest."""


def base_demand(location: Location, scene: PlanningScene, viewer: Viewer) -> BaseDemand:
    """Derive the demands of a location on the base; raises LocationMeaningless if none, or contradictory.

    ``viewer``: whose left and right is meant if a thing has no front.
    """
    check_consistent(location, "base")
    viewer = viewpoint(location, scene) or viewer
    reaches: dict[Reach, None] = {}
    unreached: dict[Reach, None] = {}
    seen: dict[str, None] = {}
    unseen: dict[str, None] = {}
    areas: dict[Area | Facing | Clear, None] = {}
    for relation in location.relations:
        match RELATIONS[relation.name].sense("base"), relation.references[0]:
            case Sense.REACH, Location() as hand:
                reach = hand_demand(replace(hand, device=hand.device or location.device), scene, viewer)
                if reach.kind is ReachKind.GRASP and reach.grasp is None:
                    reach = replace(reach, grasp=location.grasp)
                (unreached if relation.negated else reaches)[reach] = None
            case Sense.REACH, Object() as what:
                reach = _reach_of(_body(relation, what, scene.bodies), location, scene)
                (unreached if relation.negated else reaches)[reach] = None
            case Sense.SIGHT, Object() as what:
                (unseen if relation.negated else seen)[_body(relation, what, scene.bodies)] = None
            case Sense.HEADING, Object() as what:
                body = _body(relation, what, scene.bodies)
                areas[Facing(_words(relation, body), scene.bodies.block(body), relation.negated)] = None
            case Sense.CLEARANCE, Object() as what:
                areas[_clear(relation, _body(relation, what, scene.bodies), scene)] = None
            case Sense.AREA, Object() as what:
                body = _body(relation, what, scene.bodies)
                areas[_area(relation, "base", body, viewer, scene.base_radius, scene.bodies)] = None
            case Sense.VIEWPOINT, _:
                pass
            case _:
                raise _without_meaning(relation, "base")
    if not (reaches or unreached or seen or unseen or areas):
        raise meaningless(location, location, " states a viewpoint, but no relation")
    return BaseDemand(tuple(reaches), tuple(seen), tuple(areas), tuple(unreached), tuple(unseen))


def hand_demand(location: Location, scene: PlanningScene, viewer: Viewer) -> Reach:
    """Derive the task of a hand; raises LocationMeaningless for meaningless locations, and for postures."""
    if not location.relations:
        raise meaningless(location, location, " states no place for a hand")
    check_consistent(location, "hand")
    reach_of: dict[HandTerm, Reach] = {}
    terms = hand_terms(location, scene, viewer)
    relations = [relation for relation in location.relations if not _is_viewpoint(relation)]
    for relation, term in zip(relations, terms, strict=True):
        if not relation.negated and (reach := _reach_for(relation, term.body, location, scene)) is not None:
            reach_of[term] = reach
    if not reach_of:
        reach_of = _beside(terms, scene)
    if not reach_of:
        for relation, term in zip(relations, terms, strict=True):
            if RELATIONS[relation.name].sense("hand") is Sense.PRE_GRASP and not relation.negated:
                why = scene.bodies.ungraspable(term.body)
                failure = meaningless(relation, relation, f" is the pre-grasp pose of {term.body}, which {why}")
                widest = max((arm.max_opening for arm in scene.arms.all), default=0.0)
                failure.figures = f"{term.body} {why} (the hands of {scene.robot.name} open to {widest:g} m)"
                raise failure
        filters = (Sense.AREA, Sense.VIEWPOINT)
        needed = tuple(name for name in meaningful("hand") if RELATIONS[name].sense("hand") not in filters)
        raise meaningless(location, location, " does not state what the hand is at: it needs one of ", needed)
    # a thing put on one body may also be in front of another, or in reach of a person
    first = min(reach_of.values(), key=lambda reach: (reach.kind is not ReachKind.PLACE, ORDER.index(reach.kind)))
    also = tuple(dict.fromkeys(term for term in terms if reach_of.get(term) != first))
    senses = {RELATIONS[term.name].sense("hand") for term, reach in reach_of.items() if reach == first}
    before = bool(also) and Sense.PRE_GRASP in senses and Sense.GRASP_POINT not in senses
    arms = _arms(location, scene.arms)
    if first.kind is ReachKind.OFFER:
        arms = _holding(arms, scene.arms)
    return replace(first, grasp=location.grasp, arms=arms, also=also, before=before)


def _beside(terms: Sequence[HandTerm], scene: PlanningScene) -> dict[HandTerm, Reach]:
    """Find where a hand puts a held thing beside something: on what that stands on; empty for an empty hand."""
    if not any(scene.arms.held(arm.name) for arm in scene.arms.all):
        return {}
    positive = ((term, RELATIONS[term.name].thing) for term in terms if not term.negated)
    near = (term.body for term, sense in positive if sense and sense.bounds and sense.bounds[1] < float("inf"))
    supports = (scene.bodies.support(body) for body in near)
    return {HandTerm("on", on): Reach(ReachKind.PLACE, on) for on in supports if on is not None}


def viewpoint(location: Location, scene: PlanningScene) -> Viewer | None:
    """Find the stated viewpoint of a location for left and right, if there is one."""
    for relation in filter(_is_viewpoint, location.relations):
        if relation.negated or not isinstance(relation.references[0], Object):
            raise meaningless(relation, relation, " is no valid viewpoint")
        block = scene.bodies.block(_body(relation, relation.references[0], scene.bodies))
        return block.x, block.y
    return None


def _is_viewpoint(relation: Relation) -> bool:
    return RELATIONS[relation.name].sense("thing") is Sense.VIEWPOINT


def hand_terms(location: Location, scene: PlanningScene, viewer: Viewer) -> tuple[HandTerm, ...]:
    """List the conjuncts of a location about a hand; raises LocationMeaningless for meaningless ones."""
    terms = []
    bodies, viewer = scene.bodies, viewpoint(location, scene) or viewer
    for relation in location.relations:
        if _is_viewpoint(relation):
            continue
        if not isinstance(relation.references[0], Object) or RELATIONS[relation.name].hand is None:
            raise _without_meaning(relation, "hand")
        body = _body(relation, relation.references[0], bodies)
        term_viewer = viewer if RELATIONS[relation.name].directions and bodies.front(body) is None else None
        terms.append(HandTerm(relation.name, body, relation.within, relation.beyond, relation.negated, term_viewer))
    return tuple(terms)


def thing_demand(location: Location, thing: str, scene: PlanningScene, viewer: Viewer) -> ThingDemand:
    """Derive the demands of a location on an object, given by name; raises LocationMeaningless as above.

    Nothing is in a relation to itself; only a held thing can be near to, or far from, where it was taken.
    """
    check_consistent(location, "thing")
    bodies, viewer = scene.bodies, viewpoint(location, scene) or viewer
    radius, taken = max(bodies.size(thing)[:2]) / 2, scene.arms.is_held(thing)
    on: list[str] = []
    inside: list[str] = []
    areas: list[Area] = []
    people: list[tuple[str, bool]] = []
    neither: list[tuple[str, bool]] = []
    near: list[str] = []
    for relation in location.relations:
        if _is_viewpoint(relation):
            continue
        meaning = RELATIONS[relation.name].thing
        if not isinstance(relation.references[0], Object) or meaning is None:
            raise _without_meaning(relation, "thing")
        body = _body(relation, relation.references[0], bodies)
        if meaning.sense is Sense.REACH and not bodies.is_person(body):
            only = (" means nothing for an object: it takes a person, and ", f"{body} is not a person")
            raise meaningless(relation, relation, *only)
        if body == thing and not (taken and meaning.sense is Sense.AREA):
            raise meaningless(relation, relation, f" relates {thing} to itself: state its place by other things")
        match meaning.sense:
            case Sense.SUPPORT if not relation.negated:
                on.append(body)
            case Sense.CONTAINMENT if not relation.negated:
                inside.append(body)
            case Sense.SUPPORT | Sense.CONTAINMENT:
                neither.append((body, meaning.sense is Sense.CONTAINMENT))
            case Sense.REACH:
                people.append((body, not relation.negated))
            case _:
                areas.append(_area(relation, "thing", body, viewer, radius, bodies))
                if meaning.bounds is not None and meaning.bounds[1] < float("inf"):
                    near.append(body)
    if len({*on, *inside}) > 1:
        supports = " and ".join(dict.fromkeys(on + inside))
        raise contradictory(location, f"a thing can rest in one place only, not in {supports}")
    if not on and not inside and not people:  # a thing beside a body rests on that body's support
        on.extend(support for body in near if (support := bodies.support(body)) is not None)
    where = on[0] if on else None, inside[0] if inside else None
    return ThingDemand(*where, tuple(areas), tuple(people), tuple(neither))


def put_demand(reach: Reach, thing: str, scene: PlanningScene) -> ThingDemand:
    """Derive the demands of PLACE on the held object, given by name."""
    radius = max(scene.bodies.size(thing)[:2]) / 2
    areas: list[Area] = []
    people: list[tuple[str, bool]] = []
    neither: list[tuple[str, bool]] = []
    for term in reach.also:
        meaning = RELATIONS[term.name].thing
        match None if meaning is None else meaning.sense:
            case Sense.REACH:
                people.append((term.body, not term.negated))
            case Sense.SUPPORT | Sense.CONTAINMENT as sense:
                neither.append((term.body, sense is Sense.CONTAINMENT))
            case Sense.AREA if meaning is not None and meaning.bounds is not None:
                areas.append(area_of_term(term, meaning.bounds, scene, radius))
    on, inside = (None, reach.body) if reach.inside else (reach.body, None)
    return ThingDemand(on, inside, tuple(areas), tuple(people), tuple(neither))


def area_of_term(term: HandTerm, usual: Bounds, scene: PlanningScene, radius: float = 0.0) -> Area:
    """Create the area of a conjunct for an outline of a radius [m]; ``usual`` bounds apply if it states none."""
    return area_of(
        in_words(term.name, term.body, negated=term.negated),
        term.body,
        scene.bodies.block(term.body),
        RELATIONS[term.name].directions,
        front=scene.bodies.front(term.body),
        viewer=term.viewer or scene.base()[:2],
        radius=radius,
        bounds=bounds(term.within, term.beyond, usual),
        negated=term.negated,
    )


def sides(demand: BaseDemand | ThingDemand, scene: PlanningScene) -> dict[str, str]:
    """Determine whose left, right, front and back each conjunct refers to: the viewer's or the body's own."""
    named = {term.words: term.body for term in demand.areas if isinstance(term, Area) and term.directions}
    reaches = (*demand.reaches, *demand.unreached) if isinstance(demand, BaseDemand) else ()
    for term in (term for reach in reaches for term in reach.also if RELATIONS[term.name].directions):
        handled = scene.bodies.is_graspable(term.body) or scene.arms.is_held(term.body)
        if not (RELATIONS[term.name].sense("hand") is Sense.PRE_GRASP and handled):
            named[in_words(term.name, term.body, negated=term.negated)] = term.body
    return {words: "the viewer's" if scene.bodies.front(body) is None else "its own" for words, body in named.items()}


USES = (ReachKind.OFFER, ReachKind.PLACE)
"""Later tasks that depend on how a thing is held."""


def goals_of(body: str, actions: Iterable[Action], scene: PlanningScene) -> list[Location]:
    """List where enclosing actions take a thing after it is grasped, innermost first."""
    goals = ((_goal(action), action.get("object_acted_on")) for action in actions)
    matching = (goal for goal, what in goals if goal and isinstance(what, Object) and scene.bodies.known(what) == body)
    return list(dict.fromkeys(matching))


def bodies_meant(location: Location, actions: Iterable[Action], scene: PlanningScene) -> frozenset[str]:
    """Collect the bodies that a location or enclosing actions refer to: without them neither means anything."""
    fillers = [filler for one in actions for _, filler in one.properties]
    bodies = scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    return frozenset(name for what in _things([location, *fillers]) if (name := bodies.known(what)) is not None)


def _things(fillers: Iterable[object]) -> Iterator[Object]:
    """Yield the objects in fillers of properties, including those of locations and situations."""
    for filler in fillers:
        match filler:
            case Object():
                yield filler
            case Location():
                yield from filler.things()
            case Situation():
                yield from _things(part for _, part in filler.properties)
            case tuple():
                yield from _things(filler)


def use_at(goal: Location, body: str, scene: PlanningScene, viewer: Viewer) -> Reach | None:
    """Derive the task of a hand with a thing at a goal; None if the grip does not matter, or it is meaningless."""
    try:
        reach = hand_demand(goal, scene, viewer)
    except (LocationMeaningless, ObjectUnresolvable):
        return None  # reported by the step that goes there
    return reach if reach.kind in USES and reach.body != body else None


def _goal(action: Action) -> Location | None:
    """Location at which an action leaves its object; None if it states none."""
    where, recipient = action.get("to_location"), action.get("recipient")
    if isinstance(where, (Object, Location)):
        return resting_on(where)
    return a_location(in_reach_of=recipient) if isinstance(recipient, Person) else None


CHOSEN = (ReachKind.GRASP, ReachKind.ABOVE, ReachKind.OFFER)
"""Tasks for which a grasp can be chosen: a thing in the hand is already held in one way."""


def without_unused(location: Location, scene: PlanningScene, viewer: Viewer) -> Location:
    """Remove arms and grasps that nothing in a location uses; raises LocationMeaningless as demands do."""
    uses_device = uses_grasp = False
    relations = []
    for relation in location.relations:
        if RELATIONS[relation.name].sense("base") is Sense.REACH:
            match relation.references[0]:
                case Location() as hand:
                    kind = hand_demand(hand, scene, viewer).kind
                    uses_device |= hand.device is None
                    uses_grasp |= hand.grasp is None and kind is ReachKind.GRASP
                    if kind not in CHOSEN:
                        relation = replace(relation, references=(replace(hand, grasp=None),))
                case Object() as what:
                    uses_device = True
                    uses_grasp |= not scene.bodies.is_person(scene.bodies.bind(what))
        relations.append(relation)
    device, grasp = location.device if uses_device else None, location.grasp if uses_grasp else None
    return replace(location, relations=tuple(relations), device=device, grasp=grasp)


def asks_for(location: Location, subject: Subject, sense: Sense) -> bool:
    """Check whether one of a location's relations has a sense for a subject."""
    return any(RELATIONS[relation.name].sense(subject) is sense for relation in location.relations)


def in_words(name: str, body: str, *, negated: bool) -> str:
    """Express a relation to a body in words, as reasons state it."""
    words = f"{name.strip('_').replace('_', ' ')} {body}"
    return f"not {words}" if negated else words


def _words(relation: Relation, body: str) -> str:
    return in_words(relation.name, body, negated=relation.negated)


def _arms(location: Location, arms: RobotArms) -> tuple[str, ...] | None:
    return None if location.device is None else tuple(arm.name for arm in arms.of(location.device))


def _holding(names: tuple[str, ...] | None, arms: RobotArms) -> tuple[str, ...] | None:
    """Restrict arms to those that hold something, if any does: an empty hand offers nothing."""
    return tuple(name for name in names or () if arms.held(name) is not None) or names


def _reach_of(body: str, location: Location, scene: PlanningScene) -> Reach:
    """Derive the task of a hand for being in reach of a body."""
    arms = _arms(location, scene.arms)
    if scene.bodies.is_person(body):
        return Reach(ReachKind.OFFER, body, None, _holding(arms, scene.arms))
    if scene.arms.is_held(body):
        return Reach(ReachKind.RETREAT, body, None, arms)
    kind = ReachKind.GRASP if scene.bodies.is_graspable(body) else ReachKind.ABOVE
    return Reach(kind, body, location.grasp, arms)


def _reach_for(relation: Relation, body: str, location: Location, scene: PlanningScene) -> Reach | None:
    """Derive the reach from a conjunct about a hand; None if it only filters."""
    handling = ReachKind.RETREAT if scene.arms.is_held(body) else ReachKind.GRASP
    match RELATIONS[relation.name].hand:
        case None:
            return None
        case meaning if meaning.sense is Sense.OVER and meaning.bounds is not None:
            low, high = bounds(relation.within, relation.beyond, meaning.bounds)
            return Reach(ReachKind.ABOVE, body, heights=(low, min(high, low + HIGHEST)))
        case meaning if meaning.sense is Sense.REACH:
            return replace(_reach_of(body, location, scene), arms=None)
        case meaning if meaning.sense in (Sense.SUPPORT, Sense.CONTAINMENT):
            return Reach(ReachKind.PLACE, body, inside=meaning.sense is Sense.CONTAINMENT)
        case meaning if meaning.sense is Sense.GRASP_POINT:
            return Reach(handling, body)
        case meaning if meaning.sense is Sense.PRE_GRASP and scene.bodies.is_graspable(body):
            return Reach(handling, body)
    return None


def _body(relation: Relation, what: Object, bodies: BelievedBodies) -> str:
    """Bind a relation's reference to a body; raises LocationMeaningless if the relation does not apply to it."""
    body, meant = bodies.bind(what), RELATIONS[relation.name]
    bodies.block(body)  # raises if its pose is impossible
    if bodies.is_room(body):
        if not meant.of_rooms:
            raise meaningless(relation, f"{body} is a room: nothing can be ", (relation.name,), " a room")
        others = (name for name in bodies.names() if name != body)
        if meant.from_outside and not any(map(bodies.is_room, others)):
            raise meaningless(relation, f"{body} is the only room: nothing can be ", (relation.name,), " it")
    if meant.of_solids and not bodies.is_solid(body):
        raise meaningless(relation, f"{body} is a place and has no size: nothing can be ", (relation.name,), " a place")
    senses = {meant.sense("hand"), meant.sense("thing")}
    if Sense.SUPPORT in senses and not relation.negated and bodies.rests_at(body) is None:
        raise meaningless(relation, f"{body} has no level top to rest things on")
    if Sense.CONTAINMENT in senses and min(bodies.size(body)) <= 0:
        raise meaningless(relation, f"{body} has no size: nothing can be in it")
    return body


def _area(
    relation: Relation, subject: Subject, body: str, viewer: Viewer, radius: float, bodies: BelievedBodies
) -> Area:
    meaning = RELATIONS[relation.name].meaning(subject)
    if meaning is None or meaning.bounds is None:
        raise _without_meaning(relation, subject)
    return area_of(
        _words(relation, body),
        body,
        bodies.block(body),
        RELATIONS[relation.name].directions,
        front=bodies.front(body),
        viewer=viewer,
        radius=radius,
        bounds=bounds(relation.within, relation.beyond, meaning.bounds),
        negated=relation.negated,
    )


def _clear(relation: Relation, body: str, scene: PlanningScene) -> Clear:
    doors = tuple(scene.bodies.doors(body))
    block = None if any(door.name == body for door in doors) else scene.bodies.block(body)
    return Clear(_words(relation, body), block, doors, scene.base_radius, relation.negated)


def _without_meaning(relation: Relation, subject: Subject) -> LocationMeaningless:
    if isinstance(relation.references[0], Location) and not RELATIONS[relation.name].of_locations:
        of_locations = tuple(name for name, one in RELATIONS.items() if one.of_locations)
        only = ((relation.name,), " takes a thing or a person; a location can follow only ", of_locations)
        return meaningless(relation, relation, ": ", *only)
    meant = {"base": "a base", "hand": "a hand", "thing": "an object"}[subject]
    return meaningless(relation, relation, f" means nothing for {meant}; relations that apply: ", meaningful(subject))
