"""Places where something is likely to be, in the order of likelihood over travel time.

Likelihoods come from UsualPlace individuals (``ontologies/searching.omn``, or the map); where the robot believes such a
thing to be is likeliest. Each place comes with the base pose that shows most of it. The inside of furniture behind a
closed door, or of a closed drawer, is a separate place, which has to be opened first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.shut_ways import behind_doors
from executive.locations.standing import Standing
from executive.locations.views import NO_SCREENS, Size, Views
from executive.maps.classes import MapObject
from executive.maps.hollow import room_behind
from planlang.designators import Object
from planlang.failures import BehindClosedDoor, ObjectNowhereToBeFound
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.ontology import Literal, Ontology, expand
from planlang.records import dataclass
from planlang.units import stated_number
from sim.joints import JointKind

BELIEVED = 1.0
"""Likelihood of the place where such a thing is believed to be: above any usual place."""
LOOKING = 1.0
"""Time to look at a place, besides travel [s]."""
AROUND = 2.5
"""Distance from a place within which base poses are compared [m]: small things are visible from there."""
SPACING = 0.25
"""Spacing of these base poses [m]."""
MOST = 60
"""Base poses compared per place, the nearest to the robot."""
LEAST = 0.1
"""Points of a place that another view has to add, as a share of those already seen."""
ENOUGH = 0.9
"""Share of the best view that suffices: of such base poses the nearest to the robot is chosen."""
ABOVE = 0.06
"""Height above a surface at which to look for things on it [m]."""
APART = 0.3
"""Spacing of heights at which to look inside a place [m]: typical for shelves."""
TOO_HIGH = 1.9
"""Height of a top above which nothing is looked for [m]."""
OPENING = 40.0
"""Approximate time to open and close a door or drawer [s]."""
NOTHING = np.zeros((0, 3))
"""No points: those of a closed place are invisible."""
UNKNOWN = "HumanScaleObject"
"""Class assumed for things whose class is not in the vocabulary."""


@dataclass(frozen=True, slots=True)
class LikelyPlace:
    """Place to look at: a body, the likelihood of the thing there, the base pose, and what is visible from it."""

    name: str
    likelihood: float
    base: BasePose
    points: Array
    """Points (n, 3) of the map that are visible from there."""
    seconds: float
    """Travel time, plus the time to open and close it if it is closed [s]."""
    is_shut: bool = False
    """True for a closed door or drawer, to be opened first; then ``base`` is the robot's present pose."""
    behind: BehindClosedDoor | None = None
    """The doors between rooms that are to be opened first, if any; then ``base`` is the robot's present pose."""

    @property
    def worth(self) -> float:
        """Likelihood per second."""
        return self.likelihood / (self.seconds + LOOKING)


@dataclass(slots=True)
class Search:
    """Search for a thing, perhaps within a place, and the places visited so far, in order."""

    what: Object
    within: Object | None = None
    size: Size | None = None
    """Size of the thing [m], if known."""
    visited: dict[str, BasePose] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    """Places that could not be searched, and why."""
    left_open: list[str] = field(default_factory=list)
    """Doors and drawers that could not be closed again."""
    opened_for: list[str] = field(default_factory=list)
    """Places for which doors between rooms were opened, or were to be, or which these do not hide."""
    stuck: list[str] = field(default_factory=list)
    """Doors between rooms that could not be opened."""


class UsualPlaces:
    """Usual places of things, as ontologies state them."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology

    @cached_property
    def _table(self) -> Mapping[tuple[str, str], float]:
        """(thing, place), classes or individuals -> likelihood."""
        likelihoods: dict[tuple[str, str], float] = {}
        for one in self._ontology.individuals(expand("UsualPlace")):
            things, places, values = (
                self._ontology.values(one, expand(name)) for name in ("ofThing", "usuallyAt", "likelihood")
            )
            numbers = [_number(value) for value in values]
            for thing in things:
                for place in places:
                    if isinstance(thing, str) and isinstance(place, str) and numbers:
                        likelihoods[thing, place] = numbers[0]
        return likelihoods

    def likelihood(self, thing: Sequence[str], place: Sequence[str]) -> float:
        """Likelihood of a thing at a place; each is given by its IRI, if it is an individual, and its classes.

        A thing without any UsualPlace, such as one of a class that only the map knows, is likely where any small thing
        is.
        """
        things, places = self._levels(thing), self._levels(place)
        if {thing for thing, _ in self._table}.isdisjoint(things):
            things = self._levels((expand(UNKNOWN),))
        return next((self._table[one, at] for one in things for at in places if (one, at) in self._table), 0.0)

    def is_usual(self, place: Sequence[str]) -> bool:
        """Check whether things are usual at a place, by its classes."""
        levels = self._levels(place)
        return any(at in levels and value > 0 for (_, at), value in self._table.items())

    def things_at(self, place: str) -> tuple[str, ...]:
        """Classes (IRIs) of things that are usual at places of a class (an IRI)."""
        levels = self._levels((place,))
        return tuple(dict.fromkeys(thing for thing, at in self._table if at in levels))

    def _levels(self, iris: Sequence[str]) -> Sequence[str]:
        return tuple(dict.fromkeys(above for iri in iris for above in (iri, *self._ontology.ancestors(iri))))


def _number(value: object) -> float:
    try:
        return max(0.0, stated_number(value, "Unitless")) if isinstance(value, Literal) else 0.0
    except ValueError:
        return 0.0


class Searches:
    """Searches of a run, by the plan's name for the next place, or by what is searched for."""

    def __init__(self, scene: PlanningScene, seconds: Callable[[BasePose], float | None]) -> None:
        """Prepare; ``seconds`` estimates the time to drive to a base pose, None without a path."""
        self.scene, self._seconds = scene, seconds
        self.views, self._standing = Views(scene), Standing(scene)
        self._usual = UsualPlaces(scene.belief.map.ontology)
        self.begun: dict[str, Search] = {}

    def begin(self, name: str, what: Object, within: Object | None = None) -> Search:
        """Begin a search: from now on each use of ``name`` means the next place."""
        self.begun[name] = Search(what, within, self._size(what))
        return self.begun[name]

    def of(self, what: Object) -> Search | None:
        """Last search for something, if any."""
        return next((one for one in reversed(self.begun.values()) if one.what == what), None)

    def next(self, search: Search, *, opens: bool = False) -> LikelyPlace:
        """Select the unvisited place with the highest likelihood over travel time, and mark it as visited.

        With ``opens``, closed doors and drawers are places, too, and so are those behind closed doors between rooms,
        which are not marked: with these open, other base poses show them. Raises ObjectNowhereToBeFound if there is
        none left.
        """
        place = self._best(search, opens)
        if place is None:
            raise ObjectNowhereToBeFound(self._report(search), what=str(search.what))
        if place.behind is None:
            search.visited[place.name] = place.base
        else:
            search.opened_for.append(place.name)
        return place

    def view(self, search: Search, name: str, unseen: Array, screens: Array = NO_SCREENS) -> LikelyPlace | None:
        """Find the base pose that shows most of a place's unseen points (n, 3).

        ``screens`` (k, 3) hide what is behind them. None if hardly any of the points are visible from anywhere.
        """
        place = (
            self._place(search, name, 0.0, self._standing.all_over(SPACING), unseen, screens) if len(unseen) else None
        )
        seen = len(self.points_of(name)) - len(unseen)
        return place if place is not None and len(place.points) >= LEAST * seen else None

    def inside(self, name: str) -> Block:
        """Space in which to look for things: in a drawer, behind a door, else a body with what is on it."""
        joint, world = self.scene.belief.joints.get(name), self.scene.world
        if joint is None or joint.holder is None or joint.kind is JointKind.PRISMATIC:
            return self.scene.bodies.block(name)
        furniture = world.scene.body(joint.holder)
        room = room_behind(world.scene.body(name), furniture)
        return Block.of(furniture.pose @ Pose(room.centre), room.size)

    def _report(self, search: Search) -> str:
        """Describe where a search has looked and where it could not."""
        searched = ", ".join(self._called(name) for name in search.visited if name not in search.failed)
        report = f"{search.what} was not found in any likely place; looked at: {searched or 'none'}"
        for name, problem in search.failed.items():
            report += f"; not {self._called(name)} ({problem})"
        if unseen := [name for name in self._candidates(search, opens=False) if name not in search.failed]:
            names = ", ".join(map(self._called, unseen))
            report += f"; not {names}: seen from no base pose that the robot gets to"
        return report + "".join(f"; {name} was opened and could not be closed again" for name in search.left_open)

    def _called(self, name: str) -> str:
        """Describe which part of a place is searched."""
        joints = self.scene.belief.joints
        if (joint := joints.get(name)) is not None:
            return f"in {name}" if joint.kind is JointKind.PRISMATIC else f"behind {name}"
        closes = any(one.holder == name and not one.is_knob for one in joints.values())
        return f"the outside of {name}" if closes else name

    def typical_things(self, place: str | None) -> tuple[str, ...]:
        """Classes (IRIs) of things usually found in a class of places or, if no class is given, in any room."""
        return self._usual.things_at(expand(place or "RoomInAConstruction"))

    def _size(self, what: Object) -> Size | None:
        """Size of the smallest thing that a designator may mean, if known."""
        belief = self.scene.belief
        matching = [
            one
            for one in belief.map.objects
            if one.iri == what.iri or (what.iri is None and belief.is_a(one, what.type))
        ]
        sizes = (one.size for one in matching if one.size is not None)
        return min(sizes, key=lambda size: math.prod(size), default=None)

    # Selection of the place

    def _best(self, search: Search, opens: bool) -> LikelyPlace | None:
        """Select the best place; a lower bound of the travel time limits how many are evaluated."""
        base, limits = self.scene.base(), self.scene.robot.base
        bounds = []
        for name, likelihood in self._candidates(search, opens).items():
            distance = self.scene.bodies.block(name).distance(np.array([base[:2]]))[0]
            shortest = max(0.0, float(distance) - AROUND) / limits.speed + (OPENING if self._is_shut(name) else 0.0)
            bounds.append((likelihood / (shortest + LOOKING), name, likelihood, shortest))
        best: LikelyPlace | None = None
        floor = self._standing.all_over(SPACING) if bounds else np.zeros((0, 2))
        for bound, name, likelihood, shortest in sorted(bounds, key=lambda one: -one[0]):
            if best is not None and bound <= best.worth:
                break
            if self._is_shut(name):
                place: LikelyPlace | None = LikelyPlace(name, likelihood, base, NOTHING, shortest, is_shut=True)
            else:
                place = self._place(search, name, likelihood, floor, self.points_of(name))
            if place is not None and (best is None or place.worth > best.worth):
                best = place
        if opens and (best is None or best.is_shut):
            least = 0.0 if best is None else best.worth
            open_ones = (one for one in bounds if not self._is_shut(one[1]))
            best = self._behind_doors(search, open_ones, least) or best
        return best

    def _behind_doors(
        self, search: Search, bounds: Iterable[tuple[float, str, float, float]], least: float
    ) -> LikelyPlace | None:
        """Select the best place that is visible once doors between rooms are open, if it is worth more than ``least``.

        ``bounds`` has likelihoods and travel times of places that are not visible as it is. To open these doors takes
        as long as to open furniture, and shows a whole room.
        """
        if not any(one.frame and one.leaf not in search.stuck for one in self.scene.belief.joints.values()):
            return None
        timed = (LikelyPlace(name, odds, self.scene.base(), NOTHING, time + OPENING) for _, name, odds, time in bounds)
        for one in sorted(timed, key=lambda one: (-one.worth, one.name)):
            if one.worth <= least:
                return None
            if (name := one.name) in search.opened_for:
                continue

            def is_visible(scene: PlanningScene, name: str = name) -> bool:
                then = Searches(scene, lambda base: 0.0)
                floor = Standing(scene).all_over(SPACING)
                return then._place(search, name, 0.0, floor, then.points_of(name)) is not None

            behind = behind_doors(self.scene, is_visible, name, f"a view of {name}", search.stuck)
            if behind is not None:
                return replace(one, behind=behind)
            search.opened_for.append(name)
        return None

    def _is_shut(self, name: str) -> bool:
        """Check whether a place is a closed door or drawer, which hides its contents."""
        belief = self.scene.belief
        return name in belief.joints and not belief.is_left_open(name)

    def _candidates(self, search: Search, opens: bool) -> dict[str, float]:
        """Collect unvisited places with their likelihoods."""
        scene, belief = self.scene, self.scene.belief
        types = [expand(search.what.type)]
        things = [one for one in belief.things if search.what.iri is not None and one.iri == search.what.iri]
        thing = [*(iri for one in things for iri in (one.iri, *one.types)), *types]
        candidates: dict[str, float] = {}
        for place in belief.map.objects:
            if place.name not in scene.world.names() or place.size is None or place.name in search.visited:
                continue
            if scene.bodies.is_room(place.name) or scene.bodies.is_graspable(place.name):
                continue
            if place.name in belief.joints and not self._opens_a_room(place.name, opens):
                continue
            likelihood = max(self._usual.likelihood(thing, one) for one in self._kinds(place))
            if likelihood > 0 and self._is_within(place.name, search.within):
                candidates[place.name] = likelihood
        for name in [one for one in belief.of_class(search.what) if one not in belief.held]:
            support = scene.bodies.closed_before(name) or scene.world.support(name)
            if support in candidates and not belief.looked_in_vain(name):
                candidates[support] = BELIEVED
        return candidates

    def _opens_a_room(self, leaf: str, opens: bool) -> bool:
        """Check for a door or drawer of furniture, not of a room, that is open or may be opened."""
        belief = self.scene.belief
        joint = belief.joints[leaf]
        if joint.is_knob or joint.holder is None or self.scene.bodies.is_room(joint.holder):
            return False
        return belief.is_left_open(leaf) or (opens and joint.handle is not None)

    def _kinds(self, place: MapObject) -> Iterator[tuple[str, ...]]:
        """Yield IRI and classes of a place; of a door or drawer, also those of its furniture."""
        yield (place.iri, *place.types)
        belief = self.scene.belief
        joint = belief.joints.get(place.name)
        holder = None if joint is None or joint.holder is None else belief.map.find(joint.holder)
        if holder is not None:
            yield (holder.iri, *holder.types)

    def _is_within(self, name: str, place: Object | None) -> bool:
        """Check whether a body is a place, is a part of it, or stands on or in it."""
        if place is None:
            return True
        target = self.scene.bodies.bind(place)
        if self.scene.bodies.is_room(target):
            block = self.scene.bodies.block(name)
            return bool(self.scene.bodies.block(target).distance(np.array([[block.x, block.y]]))[0] <= 0)
        seen: dict[str, None] = {}
        at: str = name
        while at in self.scene.world.names() and at not in seen:
            if at == target:
                return True
            seen[at] = None
            thing = self.scene.belief.map.find(at)
            holder = None if thing is None else self.scene.belief.map.holder(thing)
            at = (holder.name if holder is not None else self.scene.world.support(at)) or ""
        return False

    # Selection of the base pose

    def _place(
        self,
        search: Search,
        name: str,
        likelihood: float,
        floor: Array,
        points: Array,
        screens: Array = NO_SCREENS,
    ) -> LikelyPlace | None:
        """Find the base pose from which to see points (n, 3) of a place; None if there is none that can be reached."""
        block, here = self.inside(name), self.scene.base()
        spots = floor[block.distance(floor) <= AROUND]
        spots = spots[np.argsort(np.hypot(*(spots - here[:2]).T).round(6), kind="stable")][:MOST]
        headings = np.arctan2(block.y - spots[:, 1], block.x - spots[:, 0])
        bases = np.vstack([[here], np.column_stack([spots, headings])])
        shown = self.views.seen(bases, points, search.size, screens)
        counts = shown.sum(axis=1)
        while counts.any():  # if the best poses are unreachable, the best of the rest
            for row in np.flatnonzero(counts >= ENOUGH * counts.max()).tolist():
                x, y, yaw = bases[row].tolist()
                counts[row] = 0
                if row and not self._standing.poses.has_room((x, y, yaw)):
                    continue
                seconds = self._seconds((x, y, yaw)) if row else 0.0
                if seconds is not None:
                    return LikelyPlace(name, likelihood, (x, y, yaw), points[shown[row]], seconds)
        return None

    def points(self, search: Search, name: str, base: BasePose) -> Array:
        """Points (n, 3) of a place that are visible from a base pose and where the thing could be."""
        points = self.points_of(name)
        return np.asarray(points[self.views.seen(np.array([base]), points, search.size)[0]])

    def points_of(self, name: str) -> Array:
        """Points (n, 3) of a place where small things may be."""
        return points_of(self.inside(name), over=name not in self.scene.belief.joints)


def points_of(block: Block, *, over: bool = True) -> Array:
    """Sample points (n, 3) of a place where small things may be: above its top, if low enough, and inside."""
    across = block.grid(0.15, 0.06)
    heights = np.arange(block.low + ABOVE, block.high - ABOVE, APART).tolist()
    heights += [block.high + ABOVE] if over and block.high < TOO_HIGH else []
    heights = heights or [(block.low + block.high) / 2]
    return np.vstack([np.column_stack([across, np.full(len(across), height)]) for height in heights])
