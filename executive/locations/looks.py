"""Looks beforehand: at things that a base pose depends on, and that the robot knows only from the map.

They stand beside the search, whose base poses hold if the map is right; a look may show that it is not.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from executive.belief.memory import Source
from executive.belief.scene_collisions import BasePose
from executive.locations.demands import BaseDemand
from executive.locations.floor_search import FloorSearch
from executive.locations.questions import Question
from executive.locations.validation import BaseValidator
from planlang.designators import Action, action
from planlang.protocols import Solution
from planlang.relations.demands import Reach, ReachKind


class Looks:
    """Finds where to look from, and puts looks before base poses."""

    def __init__(self, validator: BaseValidator) -> None:
        self._validator, self._scene = validator, validator.scene

    def before(self, solutions: Iterable[Solution], wanted: Sequence[Reach]) -> Iterator[Solution]:
        """Put before base poses the looks at what is around the places of some reaches, as long as it is unsure."""
        unsure, here = self._unsure(wanted), self._scene.base()
        # look from here first: if that shows nothing new, the map is trusted for the rest, too
        hidden = self._scene.visibility.hidden
        views: dict[str, BasePose | None] = {name: here for name in unsure if hidden(here, name) is None}
        views = views or {name: self.view(name) for name in unsure}
        for solution in solutions:
            still = self._unsure(wanted) if views else ()
            yield self.first({name: view for name, view in views.items() if name in still}, solution)

    def instead(self, wanted: Sequence[Reach]) -> Solution | None:
        """Find a look at a thing to grasp that is known only from the map; None without."""
        scene = self._scene
        for name in [reach.body for reach in wanted if reach.kind is ReachKind.GRASP]:
            belief, is_shut = scene.belief, scene.bodies.closed_before(name) is not None
            if belief.knowledge(name).source is not Source.MAP or belief.looked_in_vain(name) or is_shut:
                continue
            is_seen = scene.visibility.sighted() and scene.visibility.hidden(scene.base(), name) is None
            view = scene.base() if is_seen else self.view(name) if scene.visibility.sighted() else None
            if view is not None:
                return replace(self.first({name: view}, Solution(view, scene.belief.revision, {})), provisional=True)
        return None

    def view(self, name: str) -> BasePose | None:
        """Find the best base pose to see a thing; None if there is none, or if the base cannot drive."""
        if self._scene.robot.base.fixed:
            return None
        places = FloorSearch(self._validator, BaseDemand(seen=(name,)), Question()).places()
        return next((view.base for view in places), None)

    def first(self, views: Mapping[str, BasePose | None], solution: Solution) -> Solution:
        """Put looks at things from base poses before a solution."""
        looks: list[Action] = []
        distant = [view for view in views.values() if view is not None and view != self._scene.base()]
        for name, view in views.items():
            if view in distant and view is not None:
                looks.append(action("Translation-LocationChange", x=view[0], y=view[1], yaw=view[2]))
            if view is not None:
                looks.append(action("LookingForSomething", object_acted_on=self._scene.bodies.designator(name)))
        seen = {"looks": [list(view) for view in distant]} if distant else {}
        return replace(solution, before=tuple(looks), detail={**solution.detail, **seen}) if looks else solution

    def _unsure(self, wanted: Sequence[Reach]) -> list[str]:
        """List the bodies to put things on or beside that are known only from the map and may stand elsewhere."""
        belief, bodies = self._scene.belief, self._scene.bodies
        around = [name for reach in wanted if reach.kind is ReachKind.PLACE for name in reach.bodies()]
        return [
            name
            for name in dict.fromkeys(around if self._scene.visibility.sighted() else ())
            if bodies.is_movable(name) and belief.knowledge(name).source in (Source.MAP, Source.FELT)
            if not belief.looked_in_vain(name)
        ]
