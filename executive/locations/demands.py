"""Demands of a location on a base, a hand or a thing, bound to bodies of the planning scene.

What each relation demands (:mod:`planlang.relations`) becomes areas of the floor, things to see, and reaches, which are
tasks of a hand. Meaningless relations and contradictory conjunctions are rejected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field, replace
from itertools import permutations
from typing import Any, ClassVar

from executive.belief.planning_scene import PlanningScene, RobotArms
from planlang.designators import Action, Location, Object, Person, Relation, Situation, a_location, resting_on
from planlang.failures import LocationUnresolvable, ObjectUnresolvable
from planlang.geometry.areas import Area, Clear, Facing, Region
from planlang.records import dataclass
from planlang.relations import RELATIONS, RelationType, meaningful
from planlang.relations.beside import InFrontOf
from planlang.relations.demands import Conjunct, InZone, Reach, ReachKind, Rest, See, Subject, Viewer
from planlang.relations.looking import SeenFrom
from planlang.relations.reaching import InCenterOf, InReachOf

ORDER = tuple(ReachKind)
DELIVERIES = (ReachKind.ABOVE, ReachKind.OFFER, ReachKind.PLACE)
"""What hands do with things that they hold."""


@dataclass(eq=False, repr=False)
class LocationMeaningless(LocationUnresolvable):
    """The description applies to no place: it is meaningless for the subject, or contradicts itself.

    ``parts`` of the message are texts, relations, locations, and tuples of relation names.
    """

    parts: tuple[object, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "no place is described"

    def describe(self) -> str:
        """Render the message with relations and locations in Python syntax."""
        return self.worded(str) if self.parts else super().describe()

    def details(self) -> dict[str, Any]:
        """List the typed fields without the parts, which make up the message."""
        return {name: value for name, value in super().details().items() if name != "parts"}

    def worded(self, words: Callable[[object], str]) -> str:
        """Render the message; ``words`` renders a relation, a location or a relation's name."""
        return "".join(
            part if isinstance(part, str) else ", ".join(map(words, part)) if isinstance(part, tuple) else words(part)
            for part in self.parts
        )


def meaningless(about: Relation | Location, *parts: object) -> LocationMeaningless:
    """Create the failure of a meaningless relation or location, with its message in parts."""
    return LocationMeaningless(designator=str(about), parts=parts)


def contradictory(location: Location, *why: object) -> LocationMeaningless:
    """Create the failure of a conjunction that nothing can satisfy, with the reason in parts."""
    return meaningless(location, location, " contradicts itself: ", *why)


def check_consistent(location: Location, subject: Subject) -> None:
    """Raise LocationMeaningless if a relation is both required and excluded, or excludes another one."""
    stated = set(location.relations)
    for relation in location.relations:
        if ~relation in stated:
            required = ~relation if relation.negated else relation
            raise contradictory(location, "it both requires and excludes ", required)
    for first, second in permutations(location.relations, 2):
        kind, other = RELATIONS[first.name], RELATIONS[second.name]
        if not first.negated and (why := kind.excludes(first, second, other, subject)):
            raise contradictory(location, *why)


@dataclass(frozen=True, slots=True)
class BaseDemand:
    """Demands of a location on the base, without duplicates."""

    reaches: tuple[Reach, ...] = ()
    seen: tuple[str, ...] = ()
    areas: tuple[Region | Facing | Clear, ...] = ()
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
    areas: tuple[Region, ...] = ()
    people: tuple[tuple[str, bool], ...] = ()
    """Persons whose comfort zone contains it, or (False) does not."""
    neither: tuple[tuple[str, bool], ...] = ()
    """Bodies on which, or (True) in which, it does not rest."""
    clear: tuple[str, ...] = ()
    """Doors and drawers in whose way it does not stand."""


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
    areas: dict[Region | Facing | Clear, None] = {}
    plain: set[Reach] = set()  # of things as such: no purpose of the hand is stated
    for relation in filter(_limits, location.relations):
        kind, (first, *_) = RELATIONS[relation.name], relation.references
        if kind.of_locations and isinstance(first, Location):
            hand = hand_demand(replace(first, device=first.device or location.device), scene, viewer)
            if hand.kind is ReachKind.GRASP and hand.grasp is None:
                hand = replace(hand, grasp=location.grasp)
            (unreached if relation.negated else reaches)[hand] = None
            continue
        match kind.base(_bound(relation, "base", scene, viewer), scene.bodies, scene.robot.base.radius):
            case Reach() as reach:
                reach = _by_arms(_while_holding(reach, scene), location, scene.arms)
                (unreached if relation.negated else reaches)[reach] = None
                plain.add(reach)
            case See(body):
                (unseen if relation.negated else seen)[body] = None
            case None:
                pass
            case area:
                areas[area] = None
    if not (reaches or unreached or seen or unseen or areas):
        raise meaningless(location, location, " states a viewpoint, but no relation")
    # what something is put on, or in, is in reach for that: nobody grasps it
    supports = {reach.body for reach in reaches if reach.kind is ReachKind.PLACE}
    needed = tuple(reach for reach in reaches if reach not in plain or reach.body not in supports)
    needed = _by_hand_with_thing(needed, scene)
    return BaseDemand(needed, tuple(seen), tuple(areas), tuple(unreached), tuple(unseen))


def _by_hand_with_thing(reaches: tuple[Reach, ...], scene: PlanningScene) -> tuple[Reach, ...]:
    """Restrict what hands do with held things to those that hold one which the location also names.

    Who puts a thing down and then draws the hand back from it puts down this thing, whatever the other hand holds.
    """
    bodies = {reach.body for reach in reaches}
    full = {arm.name: held.name for arm in scene.arms.all if (held := scene.arms.held(arm.name)) is not None}
    meant = tuple(arm for arm, thing in full.items() if thing in bodies)
    if not meant or len(meant) == len(full):
        return reaches
    return tuple(
        replace(one, arms=tuple(arm for arm in meant if arm in (one.arms or meant)) or one.arms)
        if one.kind in DELIVERIES
        else one
        for one in reaches
    )


def _while_holding(reach: Reach, scene: PlanningScene) -> Reach:
    """Come above what takes several hands, instead of grasping it, while one of them holds something else.

    It can only be there for what is in the hand, as a pot to pour into is.
    """
    is_free = not any(scene.arms.held(arm.name) for arm in scene.arms.all)
    if is_free or reach.kind is not ReachKind.GRASP or scene.bodies.hands(reach.body) < 2:
        return reach
    return Reach(ReachKind.ABOVE, reach.body)


def hand_demand(location: Location, scene: PlanningScene, viewer: Viewer) -> Reach:
    """Derive the task of a hand; raises LocationMeaningless for meaningless locations, and for postures."""
    if not location.relations:
        raise meaningless(location, location, " states no place for a hand")
    check_consistent(location, "hand")
    terms = hand_terms(location, scene, viewer)
    tasks = ((term, RELATIONS[term.name].reach(term, scene.bodies)) for term in terms if not term.negated)
    reach_of = {term: reach for term, reach in tasks if reach is not None} or _beside(terms, scene)
    if not reach_of:
        raise _without_place(location, terms, scene)
    # a thing put on one body may also be in front of another, or in reach of a person
    first = min(reach_of.values(), key=lambda reach: (reach.kind is not ReachKind.PLACE, ORDER.index(reach.kind)))
    also = tuple(dict.fromkeys(term for term in terms if reach_of.get(term) != first))
    kinds = {type(RELATIONS[term.name]) for term, reach in reach_of.items() if reach == first}
    before = bool(also) and InFrontOf in kinds and InCenterOf not in kinds
    by_arms = _by_arms(first, location, scene.arms)
    return replace(by_arms, grasp=location.grasp, also=also, before=before)


def _without_place(location: Location, terms: Sequence[Conjunct], scene: PlanningScene) -> LocationMeaningless:
    """Explain that a location does not state what the hand is at."""
    for relation, term in zip(filter(_limits, location.relations), terms, strict=True):
        if RELATIONS[term.name].leads_hand and not relation.negated:
            why = scene.bodies.ungraspable(term.body)
            failure = meaningless(relation, relation, f" is the pre-grasp pose of {term.body}, which {why}")
            widest = max((arm.max_opening for arm in scene.arms.all), default=0.0)
            hands = f" (the hands of {scene.robot.name} open to {widest:g} m)" if "m wide" in why else ""
            failure.figures = f"{term.body} {why}{hands}"
            return failure
    needed = tuple(name for name, one in RELATIONS.items() if one.leads_hand)
    return meaningless(location, location, " does not state what the hand is at: it needs one of ", needed)


def _beside(terms: Sequence[Conjunct], scene: PlanningScene) -> dict[Conjunct, Reach]:
    """Find where a hand puts a held thing beside something: on what that stands on; empty for an empty hand."""
    if not any(scene.arms.held(arm.name) for arm in scene.arms.all):
        return {}
    supports = (RELATIONS[term.name].supports(term, scene.bodies) for term in terms if not term.negated)
    return {Conjunct("on", (on,)): Reach(ReachKind.PLACE, on) for some in supports for on in some}


def viewpoint(location: Location, scene: PlanningScene) -> Viewer | None:
    """Find the stated viewpoint of a location for left and right, if there is one."""
    for relation in location.relations:
        if _limits(relation):
            continue
        if relation.negated or not isinstance(relation.references[0], Object):
            raise meaningless(relation, relation, " is no valid viewpoint")
        block = scene.bodies.block(_bound(relation, "thing", scene, (0.0, 0.0)).body)
        return block.x, block.y
    return None


def _limits(relation: Relation) -> bool:
    """Check whether a relation demands something by itself, which a viewpoint does not."""
    return not isinstance(RELATIONS[relation.name], SeenFrom)


def hand_terms(location: Location, scene: PlanningScene, viewer: Viewer) -> tuple[Conjunct, ...]:
    """Bind the conjuncts of a location about a hand; raises LocationMeaningless for meaningless ones."""
    viewer = viewpoint(location, scene) or viewer
    return tuple(_bound(relation, "hand", scene, viewer) for relation in filter(_limits, location.relations))


def thing_demand(location: Location, thing: str, scene: PlanningScene, viewer: Viewer) -> ThingDemand:
    """Derive the demands of a location on an object, given by name; raises LocationMeaningless as above.

    Nothing is in a relation to itself; only a held thing can be near to, or far from, where it was taken.
    """
    check_consistent(location, "thing")
    bodies, viewer = scene.bodies, viewpoint(location, scene) or viewer
    radius, taken = max(bodies.size(thing)[:2]) / 2, bodies.is_held(thing)
    rests, supports = list[Rest](), list[str]()
    others: list[tuple[Rest | InZone | Region | None, bool]] = []
    for relation in filter(_limits, location.relations):
        term, kind = _bound(relation, "thing", scene, viewer), RELATIONS[relation.name]
        demand = kind.thing(term, bodies, radius)
        if thing in term.bodies and not (taken and not isinstance(demand, Rest | InZone)):
            raise meaningless(relation, relation, f" relates {thing} to itself: state its place by other things")
        supports.extend(kind.supports(term, bodies))
        if isinstance(demand, Rest) and not relation.negated:
            rests.append(demand)
        else:
            others.append((demand, relation.negated))
    if len({rest.body for rest in rests}) > 1:
        named = " and ".join(dict.fromkeys(rest.body for rest in sorted(rests, key=lambda rest: rest.inside)))
        raise contradictory(location, f"a thing can rest in one place only, not in {named}")
    on, into = ([rest.body for rest in rests if rest.inside is inner] for inner in (False, True))
    demanded = _besides(others)
    if not on and not into and not demanded.people:  # a thing beside a body rests on that body's support
        on = supports
    return replace(demanded, on=on[0] if on else None, inside=into[0] if into else None)


def put_demand(reach: Reach, thing: str, scene: PlanningScene) -> ThingDemand:
    """Derive the demands of PLACE on the held object, given by name."""
    radius = max(scene.bodies.size(thing)[:2]) / 2
    besides = _besides((RELATIONS[term.name].thing(term, scene.bodies, radius), term.negated) for term in reach.also)
    at = replace(besides, inside=reach.body) if reach.inside else replace(besides, on=reach.body)
    return replace(at, clear=reach.clear)


def _besides(demands: Iterable[tuple[Rest | InZone | Region | None, bool]]) -> ThingDemand:
    """Collect demands on an object, each with its negation, besides where it rests."""
    each = list(demands)
    return ThingDemand(
        areas=tuple(one for one, _ in each if one is not None and not isinstance(one, Rest | InZone)),
        people=tuple((one.person, not negated) for one, negated in each if isinstance(one, InZone)),
        neither=tuple((one.body, one.inside) for one, _ in each if isinstance(one, Rest)),
    )


def sides(demand: BaseDemand | ThingDemand, scene: PlanningScene) -> dict[str, str]:
    """Determine whose left, right, front and back each conjunct refers to: the viewer's or the body's own."""
    named = {term.words: term.body for term in demand.areas if isinstance(term, Area) and term.directions}
    reaches = (*demand.reaches, *demand.unreached) if isinstance(demand, BaseDemand) else ()
    for term in (term for reach in reaches for term in reach.also):
        area = RELATIONS[term.name].hand(term, scene.bodies)
        if isinstance(area, Area) and area.directions:
            named[term.words] = term.body
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
    return bodies_in(actions, scene, location)


def bodies_in(actions: Iterable[Action], scene: PlanningScene, *others: Location) -> frozenset[str]:
    """Collect the bodies that actions, and other locations, refer to, as far as they are known."""
    fillers = [filler for one in actions for _, filler in one.properties]
    bodies = scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    return frozenset(name for what in things_in([*others, *fillers]) if (name := bodies.known(what)) is not None)


def things_in(fillers: Iterable[object]) -> Iterator[Object]:
    """Yield the objects in fillers of properties, including those of locations and situations."""
    for filler in fillers:
        match filler:
            case Object():
                yield filler
            case Location():
                yield from filler.things()
            case Situation():
                yield from things_in(part for _, part in filler.properties)
            case tuple():
                yield from things_in(filler)


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
        if isinstance(RELATIONS[relation.name], InReachOf):
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


def asks_for(location: Location, kind: type[RelationType]) -> bool:
    """Check whether a location states a relation of a kind."""
    return any(isinstance(RELATIONS[relation.name], kind) for relation in location.relations)


def _by_arms(reach: Reach, location: Location, arms: RobotArms) -> Reach:
    """Restrict a task to the arms that a location, or a step, names, and to its grasp; an empty hand offers nothing."""
    able = arms.asked() if location.device is None else arms.of(location.device)
    names = None if location.device is None and len(able) == len(arms.all) else tuple(arm.name for arm in able)
    if reach.kind is ReachKind.OFFER:
        names = tuple(name for name in names or () if arms.held(name) is not None) or names
    chosen = location.grasp if reach.kind in (ReachKind.GRASP, ReachKind.ABOVE) else None
    if reach.kind is ReachKind.GRASP:
        chosen = chosen or arms.grasp
    return replace(reach, arms=names, grasp=chosen)


def _bound(relation: Relation, subject: Subject, scene: PlanningScene, viewer: Viewer) -> Conjunct:
    """Bind a relation to bodies; raises LocationMeaningless if it does not apply to them, or not to the subject."""
    kind, bodies, names = RELATIONS[relation.name], scene.bodies, []
    for reference in relation.references:
        if not isinstance(reference, Object) and not kind.of_locations:
            of_locations = tuple(name for name, one in RELATIONS.items() if one.of_locations)
            only = ((relation.name,), " takes a thing or a person; a location can follow only ", of_locations)
            raise meaningless(relation, relation, ": ", *only)
        if not isinstance(reference, Object) or kind.meaning(subject) is None:
            meant = {"base": "a base", "hand": "a hand", "thing": "an object"}[subject]
            apply = f" means nothing for {meant}; relations that apply: "
            raise meaningless(relation, relation, apply, meaningful(subject))
        names.append(bodies.bind(reference))
        bodies.block(names[-1])  # raises if its pose is impossible
    own = all(bodies.front(name) is not None for name in names) if kind.directions else True
    limits = relation.within, relation.beyond, relation.negated
    term = Conjunct(relation.name, tuple(names), *limits, None if own else viewer)
    if problem := kind.check(term, bodies, subject):
        raise meaningless(relation, *(relation if part is term else part for part in problem))
    return term


def names_a_side(location: Location) -> bool:
    """Check whether a location may depend on the viewpoint."""
    inner = (one for one in location.references() if isinstance(one, Location))
    return any(RELATIONS[relation.name].directions for relation in location.relations) or any(map(names_a_side, inner))
