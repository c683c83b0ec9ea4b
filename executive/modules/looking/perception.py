"""The process modules of the head, which points the camera at things, and of perception, which looks for them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from executive.belief.recognition import VISION
from executive.maps.recognition_models import missing_model, needs_model
from executive.modules.platform import PlatformModule
from planlang.designators import Action, Object
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LookingFailure,
    LookingGoalUnreachable,
    NavigationFailure,
    ObjectLost,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    PerceptionFailure,
    RecognitionModelMissing,
)
from planlang.geometry import Array, Pose
from planlang.language.process_module import process_module
from planlang.ontology import expand


@process_module
class Head(PlatformModule):
    """Turns the neck so that an object is in the middle of the picture."""

    name = "head"
    actions = ("LookingAtSomething",)
    failures = (LookingFailure, ObjectLost, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the head."""
        return ("head",)

    async def execute(self, action: Action) -> None:
        """Look at ``object_acted_on``; raises LookingGoalUnreachable beyond the neck's limits."""
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("looking at something needs object_acted_on", designator=str(action))
        scene = self.platform.scene
        name = scene.bodies.bind(what)
        await self.platform.sensing.look_at(scene.bodies.block(name).centre, name)


MOST_GAZES = 6
"""Directions that are looked into before an object counts as not found; 0.3 m apart they cover 0.6 m by 0.9 m."""


@process_module
class Perception(PlatformModule):
    """Turns the head and asks the camera; everything seen changes the belief."""

    name = "perception"
    actions = ("Perceiving",)
    failures = (PerceptionFailure, LookingFailure, DesignatorFailure, NavigationFailure, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the head, and the whole robot if places have to be gone to, and opened."""
        return self.whole_robot() if self._goes(action) else ("head",)

    def _goes(self, action: Action) -> bool:
        """Return whether something is looked for of which it is not known where it is."""
        what, bodies = action.get("object_acted_on"), self.platform.scene.bodies
        seeks = "LookingForAThingOrTypeOfThing" in self.platform.ancestors(action.type)
        return seeks and isinstance(what, Object) and bodies.known(what) is None

    async def execute(self, action: Action) -> Pose:
        """Look for ``object_acted_on``; return its pose as seen, or raise ObjectNotFound.

        What was seen from elsewhere and cannot be seen from here is where it was seen.
        Where it is not known where the thing is, it is looked for in all places where it is likely, those within
        ``location_searched``; raises ObjectNowhereToBeFound when it is at none.
        """
        what = action.get("object_acted_on")
        if not isinstance(what, Object):
            raise ActionUnresolvable("perceiving needs object_acted_on", designator=str(action))
        platform = self.platform
        if not platform.belief.recognition.runs(VISION):
            raise PerceptionFailure(f"{what} cannot be seen: what recognises things is stopped")
        name = platform.scene.bodies.known(what)
        try:
            self._check_model(what, name)
        except RecognitionModelMissing as failure:
            if self._goes(action):
                raise ObjectNowhereToBeFound(what=str(what)) from failure
            raise
        if name is None:
            return platform.belief.pose(await self._search(action, what))
        beyond: LookingGoalUnreachable | None = None
        for count, point in enumerate(self._gazes(name)):
            if count == MOST_GAZES:
                break
            try:
                await platform.sensing.look_at(point, name)
            except LookingGoalUnreachable as failure:
                beyond = beyond or failure
                continue
            if name in platform.sensing.see():
                return platform.belief.pose(name)
        if platform.sensing.is_out_of_sight(name):
            return platform.belief.pose(name)
        platform.sensing.not_seen(name)
        raise ObjectNotFound(what=name) from beyond

    def _check_model(self, what: Object, name: str | None) -> None:
        """Raise RecognitionModelMissing for what would not be recognised wherever it is."""
        belief = self.platform.belief
        thing = None if name is None else belief.map.find(name)
        known = belief.recognition.may_recognise([expand(what.type)]) if name is None else belief.recognises(name)
        if known:
            return
        types = (expand(what.type),) if thing is None else thing.types
        if not needs_model(belief.map.ontology, types):
            return
        raise RecognitionModelMissing(missing_model(name or str(what), types), what=name or str(what))

    async def _search(self, action: Action, what: Object) -> str:
        """Look for something from here, or, if that is asked for, at one likely place after another."""
        from executive.modules.looking.searching import (  # known things are looked at directly
            found_in_places,
            seen_from_here,
        )

        if self._goes(action):
            return await found_in_places(self.platform, action, what)
        name = await seen_from_here(self.platform, what)
        if name is None:
            raise ObjectNotFound(what=str(what))
        return name

    def _gazes(self, name: str) -> Iterator[Array]:
        """Yield points (3,) to look at: the believed place, then over its support, nearest to that place first."""
        block = self.platform.scene.bodies.block(name)
        yield block.centre
        support = self.platform.sensing.support_of(name)
        if support is None:
            return
        points = support.grid(0.3, 0.1)
        away = np.hypot(points[:, 0] - block.x, points[:, 1] - block.y)
        for point in points[np.argsort(away, kind="stable")]:
            yield np.array([point[0], point[1], support.high + (block.high - block.low) / 2])
