"""Process modules of the head, which points the camera, and of perception, which finds objects."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np

from executive.belief.memory import VISION
from executive.maps.recognition_models import missing_model, needs_model
from executive.modules.platform import PlatformModule
from planlang.designators import Action, Object
from planlang.failures import (
    AmbiguousPerception,
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
    """Turns the neck to centre an object in the image."""

    name = "head"
    actions = ("LookingAtSomething",)
    failures = (LookingFailure, ObjectLost, DesignatorFailure)
    needs = ("head",)

    async def execute(self, action: Action) -> None:
        """Look at ``object_acted_on``; raises LookingGoalUnreachable beyond the neck's limits."""
        what = self.object_of(action, "look at")
        scene = self.platform.scene
        name = scene.bodies.bind(what)
        await self.platform.sensing.look_at(scene.bodies.block(name).centre, name)


MOST_GAZES = 6
"""Gazes before an object counts as not found; 0.3 m apart, they cover 0.6 m by 0.9 m."""


@process_module
class Perception(PlatformModule):
    """Turns the head and updates the belief with everything that the camera recognises."""

    name = "perception"
    actions = ("Perceiving",)
    failures = (PerceptionFailure, LookingFailure, DesignatorFailure, NavigationFailure, ObjectNowhereToBeFound)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the head; for a search of several places, which are driven to and opened, the whole robot.

        So it is for what a robot without a camera feels for.
        """
        is_blind, what = self.platform.robot.camera is None, action.get("object_acted_on")
        name = self.platform.scene.bodies.known(what) if is_blind and isinstance(what, Object) else None
        is_felt = name is not None and self._feels_for(name)
        return self.whole_robot() if is_felt or self._searches_places(action) else ("head",)

    def _feels_for(self, name: str) -> bool:
        """Check whether a hand has to feel for a thing: it has missed it, and there is no camera."""
        if self.platform.robot.camera is not None or not self.platform.belief.looked_in_vain(name):
            return False
        return self.platform.scene.bodies.is_graspable(name) and name not in self.platform.belief.held

    def _searches_places(self, action: Action) -> bool:
        """Check whether the action searches for an object at an unknown place."""
        what, bodies = action.get("object_acted_on"), self.platform.scene.bodies
        searches = "LookingForAThingOrTypeOfThing" in self.platform.ancestors(action.type)
        return searches and isinstance(what, Object) and bodies.known(what) is None

    async def execute(self, action: Action) -> Pose:
        """Look for ``object_acted_on`` and return its pose in the map. Raises ObjectNotFound if it is not seen.

        Raises AmbiguousPerception if others look like it and its mark, which the map states, cannot be read from here.
        An object seen from elsewhere but hidden from here keeps its pose. An object at an unknown place is searched
        for at all likely places within ``location_searched``; raises ObjectNowhereToBeFound if it is at none of them.
        A robot without a camera feels for a thing that it has missed.
        """
        what = self.object_of(action, "perceive")
        platform = self.platform
        if not platform.belief.memory.recognition.runs(VISION):
            raise PerceptionFailure(f"cannot see {what}: the vision software is stopped; start it first")
        name = platform.scene.bodies.known(what)
        try:
            self._check_model(what, name)
        except RecognitionModelMissing as failure:
            if self._searches_places(action):
                raise ObjectNowhereToBeFound(what=str(what)) from failure
            raise
        if name is None:
            return platform.belief.pose(await self._search(action, what))
        if self._feels_for(name):
            from executive.modules.looking.feeling import Feeler  # most robots have a camera

            await Feeler(platform, name).find()
            return platform.belief.pose(name)
        unreachable: LookingGoalUnreachable | None = None
        try:
            gazes = islice(self._gazes(name), MOST_GAZES)
            if await platform.sensing.shows(gazes, name, lambda recognised: name in recognised):
                self._check_mark(name)
                return platform.belief.pose(name)
        except LookingGoalUnreachable as failure:
            unreachable = failure
        if platform.sensing.is_out_of_sight(name):
            return platform.belief.pose(name)
        platform.sensing.not_seen(name)
        raise ObjectNotFound(what=name) from unreachable or self._unmarked(name)

    def _check_mark(self, name: str) -> None:
        """Raise AmbiguousPerception if a mark has to be read by which the object is told from others seen with it."""
        belief = self.platform.belief
        alike = belief.alike(name)
        if alike is not None and alike.by is None:
            belief.not_seen(name, self.platform.base())
            raise AmbiguousPerception(what=name, candidates=(name, *alike.others))

    def _unmarked(self, name: str) -> AmbiguousPerception | None:
        """Make the failure that names things without the mark of an object; None unless several could be it."""
        belief = self.platform.belief
        others = belief.without_mark(name)
        if len(others) < 2:
            return None
        mark = belief.features(name).mark or belief.features(name).colour
        return AmbiguousPerception(f"none of {', '.join(others)} shows {mark!r}", what=name, candidates=others)

    def _check_model(self, what: Object, name: str | None) -> None:
        """Raise RecognitionModelMissing if the camera could not recognise the object anywhere."""
        belief = self.platform.belief
        thing = None if name is None else belief.map.find(name)
        recognised = (
            belief.memory.recognition.may_recognise([expand(what.type)]) if name is None else belief.recognises(name)
        )
        if recognised:
            return
        types = (expand(what.type),) if thing is None else thing.types
        if not needs_model(belief.map.ontology, types):
            return
        raise RecognitionModelMissing(missing_model(name or str(what), types), what=name or str(what))

    async def _search(self, action: Action, what: Object) -> str:
        """Search for an object from here or, if the action is a search, at one likely place after another."""
        from executive.modules.looking.searching import (  # imported late: objects at known places need no search
            found_in_places,
            seen_from_here,
        )

        lost = self.platform.belief.lost_of(what)
        if self._searches_places(action):
            try:
                return await found_in_places(self.platform, action, what)
            except ObjectNowhereToBeFound as failure:
                if lost is not None and failure.__cause__ is None:
                    failure.__cause__ = self._unmarked(lost)
                raise
        name = await seen_from_here(self.platform, what)
        if name is None:
            raise ObjectNotFound(what=str(what)) from None if lost is None else self._unmarked(lost)
        return name

    def _gazes(self, name: str) -> Iterator[Array]:
        """Yield points (3,) to look at: the believed position, then points over its support, nearest first."""
        block = self.platform.scene.bodies.block(name)
        yield block.centre
        support = self.platform.sensing.support_of(name)
        if support is None:
            return
        points = support.grid(0.3, 0.1)
        away = np.hypot(points[:, 0] - block.x, points[:, 1] - block.y)
        for point in points[np.argsort(away, kind="stable")]:
            yield np.array([point[0], point[1], support.high + (block.high - block.low) / 2])
