"""Process modules that search several places for an object, check conditions, and start and stop software."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from executive.belief.memory import EXPLORATION, VISION
from executive.belief.scene_collisions import BasePose
from executive.locations.likely_places import LikelyPlace, Search
from executive.locations.views import NO_SCREENS
from executive.modules.looking.exploring import look_around
from executive.modules.platform import Platform, PlatformModule
from planlang.designators import Action, Location, Object, Situation, action, local_name
from planlang.failures import (
    ActionUnresolvable,
    BehindClosedDoor,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    LocationUnresolvable,
    LookingFailure,
    LookingGoalUnreachable,
    ManipulationFailure,
    NavigationFailure,
    ObjectNowhereToBeFound,
    PerceptionFailure,
    StateUnknown,
)
from planlang.geometry import Array
from planlang.kernel import checkpoint, now
from planlang.language.performing import perform
from planlang.language.process_module import process_module
from planlang.language.recovery import Recovery
from planlang.language.tidying import passed
from planlang.records import dataclass
from planlang.recoveries import NOT_OPERATED, open_what_is_in_the_way, step_back_and_repeat

ABOUT = 2.0
"""Distance of the points to look at in unknown surroundings [m]."""
HEIGHTS = (1.0, 0.3)
"""Heights of these points [m]."""
NEAR_IT = 0.1
"""Largest distance between an object's centre and the interior of furniture that contains it [m]."""
VIEWS = 3
"""Most base poses from which to look at one place."""
MOST_UNSEEN = 0.5
"""Share of a place that may stay hidden before the search of it counts as failed."""
IN_VAIN = (EnvironmentManipulationFailure, LocationUnresolvable, ManipulationFailure, NavigationFailure, StateUnknown)
"""Failures to open or close a door or drawer after which the search continues."""


@dataclass(slots=True)
class Shown:
    """Points of a place that the images from one base pose hide."""

    points: Array
    """Points (n, 3) of the map that the planning scene predicts to be visible."""
    screens: Array = field(default_factory=NO_SCREENS.copy)
    """Points (k, 3) of the map on the surfaces of occluders."""
    hidden: NDArray[np.bool_] = field(init=False)
    """Mask (n,) of the points that are hidden."""

    def __post_init__(self) -> None:
        self.hidden = np.zeros(len(self.points), bool)

    def add(self, hidden: NDArray[np.bool_], screens: Array) -> None:
        """Add the hidden points and the occluders of one image."""
        self.hidden |= hidden
        self.screens = np.vstack([self.screens, screens])


@process_module
class Software(PlatformModule):
    """Starts and stops software components, and loads recognition models."""

    name = "software"
    actions = ("StartSoftwareModules", "StopSoftwareModules", "LoadTypicalObjectModels")
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> None:
        """Start or stop the component that the action class names, or load models of a place's typical objects."""
        await checkpoint()
        ancestors, belief = self.platform.ancestors(action.type), self.platform.belief
        recognition = belief.memory.recognition
        if "LoadTypicalObjectModels" in ancestors:
            place = action.get("models_for_place")
            cls = place.type if isinstance(place, Object) else place if isinstance(place, str) else None
            belief.recognises_by(recognition.with_models(self.platform.searches.typical_things(cls)))
            return
        running = "StartSoftwareModules" in ancestors
        components = {"VisionModules": VISION, "ExplorationModules": EXPLORATION}
        bundled = next((part for suffix, part in components.items() for one in ancestors if one.endswith(suffix)), None)
        component = bundled or local_name(action.type)
        belief.recognises_by(recognition.running(component) if running else recognition.without(component))


@process_module
class Inference(PlatformModule):
    """Infers where an object is likely to be."""

    name = "inference"
    actions = ("InferLikelyObjectLocations",)
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> Location | None:
        """Begin a search for ``object_acted_on``; ``outputs_created`` names its next likely place at each use."""
        await checkpoint()
        what, output = self.object_of(action, "locate"), action.get("outputs_created")
        name = output.name if isinstance(output, Location | Object) else None
        self.platform.searches.begin(name or str(what), what, _search_space(action))
        return output if isinstance(output, Location) else None


def _search_space(action: Action) -> Object | None:
    """Read the furniture or room to which the action restricts the search; None if it does not."""
    where = action.get("location_searched") or action.get("search_space")
    if isinstance(where, Location):
        return next(where.things(), None)
    return where if isinstance(where, Object) else None


@process_module
class Checking(PlatformModule):
    """Checks whether a condition holds."""

    name = "checking"
    actions = ("CheckingWhetherConditionObtains",)
    failures = (PerceptionFailure, LookingFailure, DesignatorFailure)
    needs = ("head",)

    async def execute(self, action: Action) -> bool:
        """Check whether the object of the condition, or else ``object_acted_on``, is seen from here.

        For the name of an exploration, check whether the exploration is finished. Raises ActionUnresolvable for other
        conditions.
        """
        await checkpoint()
        checked, exploring = action.get("object_acted_on"), self.platform.exploring
        name = checked.name if isinstance(checked, Location | Object) else checked
        if exploring is not None and name in exploring.names:
            return exploring.finished
        what = self._object(action)
        if what is None:
            raise ActionUnresolvable(
                "cannot check this condition: name an object to see, or an exploration", designator=str(action)
            )
        return await seen_from_here(self.platform, what) is not None or self._another_seen(what)

    def _another_seen(self, what: Object) -> bool:
        """Check whether another thing of the class than the nearest one is seen from here, which is meant from now on.

        For a thing in a hand nobody has to look.
        """
        belief, by_class = self.platform.belief, what.iri is None and type(what) is Object
        things = [one for one in belief.of_class(what) if one not in belief.held] if by_class else []
        seen = next((name for name in things if belief.seen(name)), None)
        if seen is not None:
            belief.bound_to(what, seen)
        return seen is not None

    def _object(self, action: Action) -> Object | None:
        """Read the object whose visibility decides the condition."""
        condition = action.get("condition_evaluated")
        if isinstance(condition, Situation) and "VisualPerception" in self.platform.ancestors(condition.type):
            detected = condition.get("detected_object")
            if isinstance(detected, Object):
                return detected
        what = action.get("object_acted_on")
        return what if isinstance(what, Object) else None


async def found_in_places(platform: Platform, searching: Action, what: Object) -> str:
    """Search one likely place after another until an object is seen; return its name.

    Opens doors and drawers and closes them again unless the object is inside. Explores unknown space once no known
    place is left. Raises ObjectNowhereToBeFound if the object is not seen anywhere.
    """
    if platform.robot.camera is None:
        raise ObjectNowhereToBeFound(
            f"the place of {what} is unknown, and a robot without a camera cannot search for it; "
            "have it trust a map in which the place is known"
        )
    search = platform.searches.begin(str(what), what, _search_space(searching))
    while (name := await _search_next(platform, search)) is None:
        pass
    return name


async def _search_next(platform: Platform, search: Search) -> str | None:
    """Search the next place or, without one, explore the next view; return the object's name once it is seen."""
    try:
        place = platform.searches.next(search, opens=True)
    except ObjectNowhereToBeFound:
        if not _lacks_places(platform, search) or search.within is not None:
            raise
        await look_around(platform)
        if (name := _remembered(platform, search.what)) is not None:
            return name
        goal = platform.exploration.goal
        if goal is None:
            raise
        before = now()
        if not await _drives(goal) or now() == before:  # a view from where the robot already is shows nothing new
            platform.exploration.missed()
        return None
    if place.behind is not None:
        await _open_rooms(platform, search, place.name, place.behind)
        return None
    if place.is_shut:
        return await _seen_inside(platform, search, place.name)
    return await _seen_at(platform, search, place.name, place)


async def _open_rooms(platform: Platform, search: Search, name: str, behind: BehindClosedDoor) -> None:
    """Open the doors between rooms that hide a place; those that were shut are closed again after the plan."""
    doors = (one for one in (behind.door, *behind.further) if one is not None)
    shut = [door for door in doors if door in dict(behind.beyond)]
    # without the other sides of the doors: nobody knows yet in which room the search will end
    hidden = BehindClosedDoor(designator=behind.designator, what=name, door=behind.door, further=behind.further)
    try:
        await open_what_is_in_the_way(platform.scene.bodies.designator(name))(hidden)
    except IN_VAIN as failure:
        search.failed[name] = str(failure)
        leaves = map(platform.scene.bodies.bind, shut)
        search.stuck.extend(leaf for leaf in leaves if not platform.belief.is_left_open(leaf))
    for door in shut:
        if platform.belief.is_left_open(platform.scene.bodies.bind(door)):
            await passed(door, None)


def _lacks_places(platform: Platform, search: Search) -> bool:
    """Check whether exploring may find more places: furniture is unknown, or no known one was a likely place."""
    return not search.visited or any(
        not platform.scene.bodies.is_graspable(name) for name in platform.belief.memory.unknown
    )


async def _seen_at(platform: Platform, search: Search, name: str, first: LikelyPlace | None) -> str | None:
    """Look at a place from several base poses until everything visible of it was seen; return the object once seen.

    Occluders that the images show, known bodies or not, leave points unseen for the next base pose. The object may
    also be seen on the way.
    """
    searches = platform.searches
    place, unseen = first or searches.view(search, name, searches.points_of(name)), searches.points_of(name)
    whole, screens = len(unseen), NO_SCREENS
    for _ in range(VIEWS):
        if place is None:
            break
        if place.seconds and not await _drives(place.base):
            search.failed[name] = "the base cannot reach a pose from which it is visible"
            return _remembered(platform, search.what)
        points = searches.points(search, name, platform.base())
        shown = Shown(points)
        if found := _remembered(platform, search.what) or await seen_from_here(platform, search.what, shown):
            return found
        seen, screens = points[~shown.hidden], np.vstack([screens, shown.screens])
        unseen = unseen[~(unseen[:, None] == seen[None]).all(axis=2).any(axis=1)]
        place = searches.view(search, name, unseen, screens)
    if name in platform.belief.joints and len(unseen) > MOST_UNSEEN * whole:
        search.failed[name] = f"{100 * len(unseen) / whole:.0f} % of it could not be seen"
    return None


async def _seen_inside(platform: Platform, search: Search, leaf: str) -> str | None:
    """Open a door or drawer and look inside; return the object if seen. Close it again unless the object is inside.

    The trace says why one stays open.
    """
    belief, bodies = platform.belief, platform.scene.bodies
    what = bodies.designator(leaf)
    try:
        way = Recovery(BehindClosedDoor, open_what_is_in_the_way(what))
        await perform(action("OpeningAContainerArtifact", object_acted_on=what), recoveries=[way])
    except IN_VAIN as failure:
        search.failed[leaf] = str(failure)
    name = _remembered(platform, search.what)
    if name is None and belief.is_left_open(leaf):
        name = await _seen_at(platform, search, leaf, None)
    if name is not None and _is_in(platform, name, leaf):
        return name
    if belief.is_left_open(leaf):
        again = Recovery(NOT_OPERATED, step_back_and_repeat(what))
        try:
            await perform(action("ClosingAContainerArtifact", object_acted_on=what), recoveries=[again])
        except IN_VAIN as failure:
            search.left_open.append(leaf)
            belief.tell("stays open", {"name": leaf, "because": str(failure)})
    return name


def _is_in(platform: Platform, name: str, leaf: str) -> bool:
    """Check whether an object is behind this door or in this drawer rather than a neighbouring one."""
    centre, inside = platform.scene.bodies.block(name).centre, platform.searches.inside
    away = inside(leaf).away(centre)
    return away < NEAR_IT and all(away <= inside(other).away(centre) for other in platform.belief.joints)


def _remembered(platform: Platform, what: Object) -> str | None:
    """Find the name of an object that was seen, from anywhere, and has not been moved since."""
    name = platform.scene.bodies.known(what)
    return name if name is not None and platform.belief.remembers(name) else None


async def _drives(base: BasePose) -> bool:
    """Drive to a base pose; return False if the robot did not arrive, so that the search continues from where it is."""
    x, y, yaw = base
    with suppress(NavigationFailure):
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))
        return True
    return False


async def seen_from_here(platform: Platform, what: Object, shown: Shown | None = None) -> str | None:
    """Look for an object from the current base pose; return its name, None if it is not seen.

    Adds the hidden points of each image to ``shown``.
    """

    def is_seen(recognised: object) -> bool:
        if shown is not None:
            shown.add(*platform.sensing.hidden(shown.points))
        return _seen_here(platform, what) is not None

    if _seen_here(platform, what) is None:
        with suppress(LookingGoalUnreachable):
            await platform.sensing.shows(_gazes(platform, what), str(what), is_seen)
    if (name := _seen_here(platform, what)) is not None:
        return name
    known = platform.scene.bodies.known(what)
    if known is not None:
        platform.sensing.not_seen(known)
    return None


def _seen_here(platform: Platform, what: Object) -> str | None:
    name = platform.scene.bodies.known(what)
    return name if name is not None and platform.belief.seen_from_here(name) else None


def _gazes(platform: Platform, what: Object) -> Iterator[Array]:
    """Yield points (3,) to look at: the object's believed position, then the place visited last, else all around."""
    searches, base = platform.searches, platform.base()
    known = platform.scene.bodies.known(what)
    if known is not None:
        yield platform.scene.bodies.block(known).centre
    search = searches.of(what)
    last = None if search is None else next(reversed(search.visited), None)
    if search is not None and last is not None:
        yield from searches.views.gazes(base, searches.points(search, last, base))
        return
    camera = platform.robot.camera
    around = 1 if camera is None else math.ceil(2 * np.pi / camera.fov)  # without a gap between images
    for height in HEIGHTS:
        for turn in sorted(np.linspace(-np.pi, np.pi, around, endpoint=False).tolist(), key=abs):
            x, y, yaw = base
            yield np.array([x + ABOUT * np.cos(yaw + turn), y + ABOUT * np.sin(yaw + turn), height])
