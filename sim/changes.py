"""What has become of the things of one world, and questions about that: what is below, what heats, what is baked.

The changes themselves are computed by :mod:`planlang.state.applying`, which asks :class:`EngineQueries`. The questions
at the end are answered alike for the true world and a believed one.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

import numpy as np

from planlang.geometry import Pose
from planlang.geometry.shapes import half_extents
from planlang.state import Matter, WorldState
from planlang.state.applying import Point
from planlang.state.rules import Rules
from sim.bodies import Bodies
from sim.camera import Rays
from sim.contact import HeldObject
from sim.falling import Falling
from sim.leaves import inside
from sim.scene import Body

REST = 0.005
"""Gap below which a thing lies on what is below it [m]."""
_INTO = 0.002
"""Height above a thing's lowest point from which to look for its support [m]: it may sink in a little."""
_DEEP = 100.0
"""Depth through which poured substances can fall [m]."""


class Changes:
    """What has become of the things of one world, as it is shown in its engine."""

    def __init__(self, bodies: Bodies, rules: Rules, rays: Rays, falling: Falling, held: dict[str, HeldObject]) -> None:
        self.bodies, self.rules = bodies, rules
        self.matter = Matter()
        """What things hold, and how they are, now."""
        self.count = 0
        """Number of changes made by actions; those that time brings are not counted."""
        self.rays, self.falling, self.held = rays, falling, held
        self._heats: dict[str, tuple[str, bool] | None] = {}
        """Results of :meth:`heated_by`, valid until something moves or a device is switched."""
        self._heats_at: object = None

    def type_of(self, name: str) -> str:
        """Class of a thing now, after changes by heat."""
        return self.matter.types[name][0] if name in self.matter.types else self.bodies.bodies[name].type

    def was_ever(self, name: str, type: str) -> bool:
        """Check whether a thing is of a class, or was before heat changed it."""
        types = self.matter.types.get(name, (self.bodies.bodies[name].type,))
        return any(self.rules.is_a(one, type) for one in types)

    def is_vessel(self, name: str) -> bool:
        """Check whether a thing holds what is poured into it."""
        return self.bodies.bodies[name].capacity > 0

    def under(self, name: str, but: Iterable[str] = ()) -> str | None:
        """Find what a thing lies on; the things in ``but`` count as absent."""
        body, pose = self.bodies.bodies[name], self.bodies.poses[name]
        x, y, z = pose.position
        low = z - float(half_extents(pose, body.size)[2])
        start, end = np.array([[x, y, low + _INTO]]), np.array([[x, y, low - REST]])
        with contextlib.ExitStack() as stack:
            for other in (name, *but):
                stack.enter_context(self.rays.without(other))
            return self.rays.down(start, end)[0][0]

    def heated_by(self, name: str) -> tuple[str, bool] | None:
        """Find the device that heats a thing, and whether the thing is inside it.

        A thing is heated by a device below it, also through other things in between, or by one that it is inside of.
        """
        now = self.bodies.moves, self.bodies.carries, tuple(self.matter.states.items())
        if now != self._heats_at:
            self._heats, self._heats_at = {}, now
        if name not in self._heats:
            self._heats[name] = self._heat_of(name)
        return self._heats[name]

    def _heat_of(self, name: str) -> tuple[str, bool] | None:
        below, seen = self.under(name), {name}
        while below is not None and below not in seen and below in self.bodies.bodies:
            if self.matter.is_on(below):
                return below, False
            seen.add(below)
            below = self.under(below)
        place = np.array([self.bodies.poses[name].position])
        for device in self.matter.states:
            body, on = self.bodies.bodies[device], device != name and self.matter.is_on(device)
            if on and inside(self.bodies.poses[device], body.size, place)[0]:
                return device, True
        return None

    def below(self, point: Point, but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the thing ``but`` counts as absent."""
        start = np.array([point])
        with self.rays.without(but):
            names, heights = self.rays.down(start, start - np.array([0.0, 0.0, _DEEP]))
        return names[0], float(heights[0])


class Shown(Protocol):
    """An engine in which a state is shown."""

    changes: Changes

    def pose(self, name: str) -> Pose:
        """Locate a body in the map."""


class EngineQueries:
    """Implements :class:`planlang.state.Queries`: an engine is brought to the state that is asked about."""

    def __init__(self, at: Callable[[WorldState], Shown], rules: Rules, things: Iterable[Body]) -> None:
        """``at`` shows a state in the engine; ``things`` are those of the start."""
        self._at, self.rules = at, rules
        self._things = {body.name: body for body in things}

    def thing(self, name: str) -> Body | None:
        """Look up a thing of the start; None for a name that had no thing then."""
        return self._things.get(name)

    def pose(self, state: WorldState, name: str) -> Pose:
        """Locate a thing in the map; one that is held is in the hand."""
        return self._at(state).pose(name)

    def under(self, state: WorldState, name: str) -> str | None:
        """Find what a thing lies on."""
        return self._at(state).changes.under(name)

    def below(self, state: WorldState, point: Point, but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the thing ``but`` counts as absent."""
        return self._at(state).changes.below(point, but)

    def rest(self, state: WorldState, name: str) -> Pose | None:
        """Find where a thing would come to rest if released; None if nothing is below."""
        rest, support = self._at(state).changes.falling.rest(name)
        return None if support is None else rest

    def heated_by(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        """Find the device that heats a thing, and whether the thing is inside it."""
        return self._at(state).changes.heated_by(name)


def amount_of(changes: Changes, name: str, type: str) -> float:
    """Sum the volume of a class of substances in a thing, and in foods that lie on it [ml]."""
    lying = (food for food in changes.matter.origins if _is_there(changes, food) and changes.under(food) == name)
    return sum(_amount_in(changes, one, type) for one in (name, *lying))


def _amount_in(changes: Changes, name: str, type: str) -> float:
    content = changes.matter.contents.get(name, {}).values()
    was_of_type = name in changes.matter.types and changes.was_ever(name, type)
    return sum(portion.amount for portion in content if was_of_type or changes.rules.is_a(portion.type, type))


def _is_there(changes: Changes, name: str) -> bool:
    return name in changes.bodies.bodies and name not in changes.bodies.removed


def is_baked(changes: Changes, name: str, seconds: float | None = None) -> bool:
    """Check whether both sides of a thing were heated for some time [s], by default as long as its class needs."""
    sides = changes.matter.heated.get(name, (0.0, 0.0))
    needed = seconds if seconds is not None else min(_needed(changes, name), default=float("inf"))
    return min(sides) >= needed - 1e-6


def _needed(changes: Changes, name: str) -> Iterator[float]:
    """Yield the baking times [s] of rules whose output is the class of a thing or of its contents."""
    types = {changes.type_of(name), *changes.matter.contents.get(name, {})}
    for rule in changes.rules.heating:
        if any(changes.rules.is_a(one, rule.output) for one in types):
            yield rule.seconds


def came_to_be(changes: Changes, type: str) -> tuple[str, ...]:
    """List what was created of a class and still exists: things, and vessels that hold it."""
    things = [name for name in changes.matter.origins if _is_there(changes, name) and changes.was_ever(name, type)]
    holding = [
        name
        for name, content in changes.matter.contents.items()
        if any(one.origins and changes.rules.is_a(one.type, type) for one in content.values())
    ]
    return tuple(dict.fromkeys((*things, *holding)))


def origins_of(changes: Changes, name: str) -> tuple[str, ...]:
    """Name everything that went into a thing or its contents."""
    return changes.matter.went_into(name)
