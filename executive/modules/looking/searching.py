"""Process modules that look for something in several places, check conditions, and start and stop software."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from executive.belief.recognition import EXPLORATION, VISION
from executive.belief.scene_collisions import BasePose
from executive.locations.likely_places import LikelyPlace, Search
from executive.locations.views import NO_SCREENS
from executive.modules.looking.exploring import look_around
from executive.modules.platform import Platform, PlatformModule
from planlang import checkpoint, perform
from planlang.designators import Action, Location, Object, Situation, action, local_name
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    EnvironmentManipulationFailure,
    LookingFailure,
    LookingGoalUnreachable,
    ManipulationFailure,
    NavigationFailure,
    ObjectNowhereToBeFound,
    PerceptionFailure,
)
from planlang.geometry import Array
from planlang.kernel import now
from planlang.language.process_module import process_module
from planlang.records import dataclass

ABOUT = 2.0
"""Distance from the robot of the points that it looks at where it does not know what there is [m]."""
AROUND = 7
"""Headings in which it looks then: with 50 degrees in a picture they overlap."""
HEIGHTS = (1.0, 0.3)
"""Heights of these points [m]."""
NEAR_IT = 0.1
"""A thing whose middle is no farther from the inside of furniture is in it [m]."""
VIEWS = 3
"""Base poses from which one place is looked at, at most."""
MOST_UNSEEN = 0.5
"""Share of a place that may stay hidden although it counts as looked at."""
IN_VAIN = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure)
"""Failures to open or close a door or drawer after which the search goes on."""


@dataclass(slots=True)
class Shown:
    """What pictures from one base pose show of points at which something may be."""

    points: Array
    """Points (n, 3) of the map that should be seen, by what is believed."""
    screens: Array = field(default_factory=NO_SCREENS.copy)
    """Points (k, 3) of the map at which something hides what is behind it."""
    hidden: NDArray[np.bool_] = field(init=False)
    """Which of the points are hidden, (n,)."""

    def __post_init__(self) -> None:
        self.hidden = np.zeros(len(self.points), bool)

    def add(self, hidden: NDArray[np.bool_], screens: Array) -> None:
        """Add what one picture shows."""
        self.hidden |= hidden
        self.screens = np.vstack([self.screens, screens])


@process_module
class Software(PlatformModule):
    """Starts and stops software parts, and loads models of what is to be recognised."""

    name = "software"
    actions = ("StartSoftwareModules", "StopSoftwareModules", "LoadTypicalObjectModels")
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> None:
        """Believe that the part that the class names runs, or not; or that things typical of a place are recognised."""
        await checkpoint()
        ancestors, recognition = self.platform.ancestors(action.type), self.platform.belief.recognition
        if "LoadTypicalObjectModels" in ancestors:
            recognition.load(self.platform.searches.typical_things(_place(action)))
            return
        running = "StartSoftwareModules" in ancestors
        parts = {"VisionModules": VISION, "ExplorationModules": EXPLORATION}
        named = next((part for words, part in parts.items() for one in ancestors if one.endswith(words)), None)
        recognition.set_running(named or local_name(action.type), running=running)


def _place(action: Action) -> str | None:
    """Return the class of the place that models are wanted for."""
    place = action.get("models_for_place")
    return place.type if isinstance(place, Object) else place if isinstance(place, str) else None


@process_module
class Inference(PlatformModule):
    """Works out where something is likely to be."""

    name = "inference"
    actions = ("InferLikelyObjectLocations",)
    failures = (DesignatorFailure,)

    async def execute(self, action: Action) -> Location | None:
        """Begin a search for ``object_acted_on``; what ``outputs_created`` names is its next place at each use."""
        await checkpoint()
        what, made = action.get("object_acted_on"), action.get("outputs_created")
        if not isinstance(what, Object):
            raise ActionUnresolvable("inferring where something is needs object_acted_on", designator=str(action))
        name = made.name if isinstance(made, Location | Object) else None
        self.platform.searches.begin(name or str(what), what, _searched(action))
        return made if isinstance(made, Location) else None


def _searched(action: Action) -> Object | None:
    """Return the place within which is to be searched."""
    where = action.get("location_searched") or action.get("search_space")
    if isinstance(where, Location):
        return next(where.things(), None)
    return where if isinstance(where, Object) else None


@process_module
class Checking(PlatformModule):
    """Finds out whether a condition holds."""

    name = "checking"
    actions = ("CheckingWhetherConditionObtains",)
    failures = (PerceptionFailure, LookingFailure, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the head."""
        return ("head",)

    async def execute(self, action: Action) -> bool:
        """Return whether ``object_acted_on``, or what the condition is about, is seen from here.

        Of what an exploration has made: whether it is finished.
        """
        await checkpoint()
        made, exploring = action.get("object_acted_on"), self.platform.exploring
        name = made.name if isinstance(made, Location | Object) else made
        if exploring is not None and name in exploring.names:
            return exploring.finished
        what = self._sought(action)
        if what is None:
            raise ActionUnresolvable("nothing here decides this condition", designator=str(action))
        return await seen_from_here(self.platform, what) is not None

    def _sought(self, action: Action) -> Object | None:
        """Return what is to be seen."""
        condition = action.get("condition_evaluated")
        if isinstance(condition, Situation) and "VisualPerception" in self.platform.ancestors(condition.type):
            seen = condition.get("detected_object")
            if isinstance(seen, Object):
                return seen
        what = action.get("object_acted_on")
        return what if isinstance(what, Object) else None


async def found_in_places(platform: Platform, wanted: Action, what: Object) -> str:
    """Go from place to place where something is likely until it is seen; return its name.

    Doors and drawers are opened, looked into, and closed again, unless the thing is there. Where the map lacks places
    for things, the robot explores what it lacks once no place is left.
    """
    if platform.robot.camera is None:
        told = f"it is not known where {what} is, and a robot without camera cannot look for it"
        raise ObjectNowhereToBeFound(f"{told}; it takes from the map (--trust-map) what --unknown does not name")
    search = platform.searches.begin(str(what), what, _searched(wanted))
    while (name := await _seen_or_gone_on(platform, search)) is None:
        pass
    return name


async def _seen_or_gone_on(platform: Platform, search: Search) -> str | None:
    """Go to the next place, or the next view; return the name of what is looked for once it is seen."""
    try:
        place = platform.searches.next(search, opens=True)
    except ObjectNowhereToBeFound:
        if not _lacks_places(platform, search) or search.within is not None:
            raise
        await look_around(platform)
        if (name := _found(platform, search.what)) is not None:
            return name
        goal = platform.exploration.goal
        if goal is None:
            raise
        before = now()
        if not await _drives(goal) or now() == before:  # nothing new is seen from where the robot is already
            platform.exploration.missed()
        return None
    if place.is_shut:
        return await _seen_inside(platform, search, place.name)
    return await _seen_at(platform, search, place.name, place)


def _lacks_places(platform: Platform, search: Search) -> bool:
    """Return True if furniture is unknown, or none that is known is a likely place: then exploring finds more."""
    return not search.visited or any(not platform.scene.bodies.is_graspable(name) for name in platform.belief.unknown)


async def _seen_at(platform: Platform, search: Search, name: str, first: LikelyPlace | None) -> str | None:
    """Look at a place from one base pose after another until all of it was seen that is seen from anywhere.

    What the pictures show before it hides what is behind, be it known or not: that is looked at from elsewhere. Return
    the name of what is looked for as soon as it is seen, be it on the way.
    """
    searches = platform.searches
    place, unseen = first or searches.view(search, name, searches.points_of(name)), searches.points_of(name)
    whole, screens = len(unseen), NO_SCREENS
    for _ in range(VIEWS):
        if place is None:
            break
        if place.seconds and not await _drives(place.base):
            search.failed[name] = "the base does not get to where it is seen"
            return _found(platform, search.what)
        points = searches.points(search, name, platform.base())
        shown = Shown(points)
        if found := _found(platform, search.what) or await seen_from_here(platform, search.what, shown):
            return found
        seen, screens = points[~shown.hidden], np.vstack([screens, shown.screens])
        unseen = unseen[~(unseen[:, None] == seen[None]).all(axis=2).any(axis=1)]
        place = searches.view(search, name, unseen, screens)
    if name in platform.belief.joints and len(unseen) > MOST_UNSEEN * whole:
        search.failed[name] = f"{100 * len(unseen) / whole:.0f} % of it is not seen from anywhere"
    return None


async def _seen_inside(platform: Platform, search: Search, leaf: str) -> str | None:
    """Open a door or drawer and look inside; close it again, unless what is looked for is there. Return its name."""
    belief, bodies = platform.belief, platform.scene.bodies
    what = bodies.designator(leaf)
    try:
        await perform(action("OpeningAContainerArtifact", object_acted_on=what))
    except IN_VAIN as failure:
        search.failed[leaf] = str(failure)
    name = _found(platform, search.what)
    if name is None and belief.is_left_open(leaf):
        name = await _seen_at(platform, search, leaf, None)
    if name is not None and _is_in(platform, name, leaf):
        return name
    if belief.is_left_open(leaf):
        try:
            await perform(action("ClosingAContainerArtifact", object_acted_on=what))
        except IN_VAIN:
            search.left_open.append(leaf)
    return name


def _is_in(platform: Platform, name: str, leaf: str) -> bool:
    """Return whether a thing is behind a door or in a drawer, and in none beside it."""
    centre, inside = platform.scene.bodies.block(name).centre, platform.searches.inside
    away = inside(leaf).away(centre)
    return away < NEAR_IT and all(away <= inside(other).away(centre) for other in platform.belief.joints)


def _found(platform: Platform, what: Object) -> str | None:
    """Return the name of what is looked for if it was seen, from wherever, and has not been moved since."""
    name = platform.scene.bodies.known(what)
    return name if name is not None and platform.belief.remembers(name) else None


async def _drives(base: BasePose) -> bool:
    """Drive to a base pose; return whether the robot arrived: if not, the search goes on from where it is."""
    x, y, yaw = base
    with suppress(NavigationFailure):
        await perform(action("Translation-LocationChange", x=x, y=y, yaw=yaw))
        return True
    return False


async def seen_from_here(platform: Platform, what: Object, shown: Shown | None = None) -> str | None:
    """Look where something is likely, from here; return its name, None if it is not seen.

    ``shown`` learns which of its points something hides.
    """
    before = _seen(platform, what)
    if before is not None:
        return before
    for point in _gazes(platform, what):
        with suppress(LookingGoalUnreachable):
            await platform.sensing.look_at(point, str(what))
            platform.sensing.see()
            if shown is not None:
                shown.add(*platform.sensing.hidden(shown.points))
        if (name := _seen(platform, what)) is not None:
            return name
    known = platform.scene.bodies.known(what)
    if known is not None:
        platform.sensing.not_seen(known)
    return None


def _seen(platform: Platform, what: Object) -> str | None:
    name = platform.scene.bodies.known(what)
    return name if name is not None and platform.belief.seen_from_here(name) else None


def _gazes(platform: Platform, what: Object) -> Iterator[Array]:
    """Yield points (3,) to look at: where it is believed to be, at the place that was gone to last, or all around."""
    searches, base = platform.searches, platform.base()
    known = platform.scene.bodies.known(what)
    if known is not None:
        yield platform.scene.bodies.block(known).centre
    search = searches.of(what)
    last = None if search is None else next(reversed(search.visited), None)
    if search is not None and last is not None:
        yield from searches.views.gazes(base, searches.points(search, last, base))
        return
    for height in HEIGHTS:
        for turn in sorted(np.linspace(-np.pi, np.pi, AROUND, endpoint=False).tolist(), key=abs):
            x, y, yaw = base
            yield np.array([x + ABOUT * np.cos(yaw + turn), y + ABOUT * np.sin(yaw + turn), height])
