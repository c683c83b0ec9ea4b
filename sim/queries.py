"""Answers of an engine about any state of its world: it is brought to the state that is asked about."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

import numpy as np

from planlang.geometry import Pose
from planlang.state import WorldState
from planlang.state.questions import Point, thing_of
from planlang.state.rules import Rules
from sim.falling import Falling
from sim.leaves import inside
from sim.scene import Body


class Shown(Protocol):
    """An engine in which a state is shown."""

    gravity: Falling

    def pose(self, name: str) -> Pose:
        """Locate a body in the map."""


class EngineQueries:
    """Implements :class:`planlang.state.Queries` by the rays and bodies of an engine."""

    def __init__(self, at: Callable[[WorldState], Shown], rules: Rules, things: Iterable[Body]) -> None:
        """``at`` shows a state in the engine; ``things`` are those of the start."""
        self._at, self.rules = at, rules
        self._things = {body.name: body for body in things}
        self._heats: dict[str, tuple[str, bool] | None] = {}
        """Results of :meth:`heated_by`, valid until something moves or a device is switched."""
        self._heats_at: object = None

    def thing(self, name: str) -> Body | None:
        """Look up a thing of the start; None for a name that had no thing then."""
        return self._things.get(name)

    def pose(self, state: WorldState, name: str) -> Pose:
        """Locate a thing in the map; one that is held is in the hand."""
        return self._at(state).pose(name)

    def under(self, state: WorldState, name: str) -> str | None:
        """Find what a thing lies on."""
        return self._at(state).gravity.under(name)

    def below(self, state: WorldState, point: Point, but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the thing ``but`` counts as absent."""
        return self._at(state).gravity.below(point, but)

    def rest(self, state: WorldState, name: str) -> Pose | None:
        """Find where a thing would come to rest if released; None if nothing is below."""
        rest, support = self._at(state).gravity.rest(name)
        return None if support is None else rest

    def heated_by(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        """Find the device that heats a thing, and whether the thing is inside it.

        A thing is heated by a device below it, also through other things in between, or by one that it is inside of.
        """
        bodies = self._at(state).gravity.bodies
        now = bodies.moves, bodies.carries, tuple(state.matter.states.items())
        if now != self._heats_at:
            self._heats, self._heats_at = {}, now
        if name not in self._heats:
            self._heats[name] = self._heat_of(state, name)
        return self._heats[name]

    def _heat_of(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        below, seen = self.under(state, name), {name}
        while below is not None and below not in seen:
            if state.matter.is_on(below):
                return below, False
            seen.add(below)
            below = self.under(state, below)
        place = np.array([self.pose(state, name).position])
        for device in filter(state.matter.is_on, state.matter.states):
            size = thing_of(state, device, self).size
            if device != name and inside(self.pose(state, device), size, place)[0]:
                return device, True
        return None
