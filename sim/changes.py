"""Changes of things: they are created, destroyed, turned over and switched on; poured substances land below.

Nothing here happens by itself; ``processes.py`` is what does. The questions at the end are answered alike for the true
world and a believed one.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from planlang.changes import Change, Poured, Switched, Transformed, TurnedOver
from planlang.designators import local_name
from planlang.geometry import Pose
from planlang.geometry.shapes import half_extents
from planlang.state.matter import Matter, Portion, merged
from sim.bodies import Bodies
from sim.camera import Rays
from sim.contact import HeldObject
from sim.falling import Falling, upright
from sim.leaves import inside
from sim.rules import PUDDLE, Rules, Size
from sim.scene import Body, BodyShape

Point = tuple[float, float, float]

REST = 0.005
"""Gap below which a thing lies on what is below it [m]."""
STANDS = 0.5
"""Cosine of the largest tilt at which a vessel can be filled."""
BESIDE = 0.02
"""Distance from a vessel at which its overflow lands [m]."""
_INTO = 0.002
"""Height above a thing's lowest point from which to look for its support [m]: it may sink in a little."""
_DEEP = 100.0
"""Depth through which poured substances can fall [m]."""
ONE_PUDDLE = 0.2
"""Distance up to which a poured substance joins a puddle of the same [m]."""


class Changes:
    """Changes the things of one world. ``create`` and ``remove`` put bodies into the world and take them out."""

    def __init__(
        self,
        bodies: Bodies,
        rules: Rules,
        rays: Rays,
        falling: Falling,
        held: dict[str, HeldObject],
        create: Callable[[Body], None],
        remove: Callable[[str], None],
    ) -> None:
        self.bodies, self.rules = bodies, rules
        self.matter = Matter()
        """What things hold, and how they are, now."""
        self.count = 0
        """Number of changes made by actions; those that time brings are not counted."""
        self.rays, self.falling, self.held = rays, falling, held
        self._create, self._remove = create, remove
        self._heats: dict[str, tuple[str, bool] | None] = {}
        """Results of :meth:`heated_by`, valid until something moves or a device is switched."""
        self._heats_at: object = None
        self._heatable: dict[str, bool] = {}

    # Questions

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

    def can_heat(self, name: str) -> bool:
        """Check whether heat changes a thing or something in it, or has changed it."""
        return any(map(self._is_heatable, (self.type_of(name), *self.matter.contents.get(name, ()))))

    def _is_heatable(self, type: str) -> bool:
        if type not in self._heatable:
            self._heatable[type] = self.rules.can_heat(type)
        return self._heatable[type]

    # Effects of actions

    def do(self, change: Change) -> float:
        """Apply a change; return the volume that flowed [ml]."""
        match change:
            case Poured(source, target, amount):
                return self.pour(source, target, amount)
            case Transformed():
                self._transform(change)
            case TurnedOver(name):
                self.turn_over(name)
            case Switched(name, state):
                self.switch(name, state)
        return 0.0

    def _transform(self, what: Transformed) -> None:
        """Destroy inputs and create outputs; no effect if no input exists."""
        bodies = self.bodies
        inputs = {name: amount for name, amount in what.things if name in bodies.bodies and name not in bodies.removed}
        places = [bodies.poses[name] for name in (*inputs, *(name for name, _ in what.used))]
        sizes = [bodies.bodies[name].size for name in inputs]
        origins = merged(inputs, *(origins_of(self, name) for name in inputs))
        volume = sum(self.matter.total(name) or amount for name, amount in inputs.items())
        taken = [portion for name, type in what.used for portion in self.consume(name, type)]
        if (what.things or what.used) and not inputs and not taken:
            return
        for name in inputs:
            self.destroy(name)
        origins = merged(origins, *(portion.origins for portion in taken))
        volume += sum(portion.amount for portion in taken)
        place = places[0] if places else (bodies.poses[what.vessel] if what.vessel is not None else None)
        shift = 0.0
        for output in what.outputs:
            amount = volume if output.amount is not None and len(what.outputs) == 1 and volume else output.amount
            if what.vessel is not None and amount is not None:
                self.fill(what.vessel, Portion(output.type, amount, origins))
            elif place is not None:
                size = self.rules.size(output.type) or (sizes[0] if sizes else PUDDLE)
                at = Pose((place.position[0] + shift, *place.position[1:]))
                self.create(output.name, output.type, size, at, origins, amount)
                shift += size[0]

    # Things

    def create(self, name: str, type: str, size: Size, at: Pose, origins: Sequence[str], amount: float | None) -> None:
        """Create a thing, at rest on what is below a pose; ``amount`` [ml] of its class, if given."""
        shape = BodyShape.CYLINDER if math.isclose(size[0], size[1]) else BodyShape.BOX
        self._create(Body(name, at, size, shape, type=type, movable=True))
        self.matter = self.matter.created(name, origins)
        if amount is not None:
            self.matter = self.matter.put(name, Portion(type, amount, tuple(origins)))
        rest, support = self.falling.rest(name)
        if support is not None:
            self.bodies.place(name, rest)
        self.count += 1

    def destroy(self, name: str) -> None:
        """Destroy a thing and its contents."""
        self._remove(name)
        self.matter = self.matter.destroyed(name)
        self.count += 1

    def turn_over(self, name: str) -> None:
        """Turn a thing over in place; no effect on a held one."""
        pose, half_turn = self.bodies.poses[name], Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
        if name not in self.held:
            self.bodies.place(name, upright(pose @ half_turn))
            self.count += 1

    def switch(self, name: str, state: str) -> None:
        """Set the state of a device."""
        self.matter = self.matter.switched(name, state)
        self.count += 1

    # Contents

    def consume(self, name: str, type: str) -> list[Portion]:
        """Take everything of a class out of a thing."""
        content = self.matter.contents.get(name, {})
        taken = {key: portion for key, portion in content.items() if self.rules.is_a(key, type)}
        self.matter = self.matter.holding(name, {key: one for key, one in content.items() if key not in taken})
        self.count += 1
        return list(taken.values())

    def fill(self, name: str, portion: Portion) -> None:
        """Add a portion to a thing's contents."""
        self.give([portion], name, self.bodies.poses[name].position)
        self.count += 1

    def pour(self, source: str, target: str, amount: float) -> float:
        """Move an amount [ml] of a thing's contents onto or into another thing; return the amount moved."""
        self.matter, portions = self.matter.take(source, amount)
        if not self.is_vessel(source) and source not in self.matter.contents and portions:
            self.destroy(source)
        x, y, z = self.bodies.poses[target].position
        top = z + float(half_extents(self.bodies.poses[target], self.bodies.bodies[target].size)[2])
        self.give(portions, target, (x, y, top))
        self.count += 1
        return sum(portion.amount for portion in portions)

    def drop(self, portions: Sequence[Portion], point: Point, source: str) -> str | None:
        """Drop portions out of a thing from a point; return what they land on or in, None if nothing is below."""
        start = np.array([point])
        with self.rays.without(source):
            names, heights = self.rays.down(start, start - np.array([0.0, 0.0, _DEEP]))
        if names[0] is not None:
            self.give(portions, names[0], (point[0], point[1], float(heights[0])))
        return names[0]

    def give(self, portions: Sequence[Portion], target: str, point: Point) -> None:
        """Put portions into an upright vessel, up to its capacity, or on another thing, at a point."""
        if self.is_vessel(target) and self.bodies.poses[target].rotation[2, 2] > STANDS:
            self._fill(portions, target)
        elif target in self.matter.origins and target in self.matter.contents:
            for one in portions:
                self.matter = self.matter.put(target, one)
        else:
            for one in portions:
                self._spread(one, target, point)

    def _fill(self, portions: Sequence[Portion], vessel: str) -> None:
        """Put portions into a vessel; the overflow lands beside it."""
        body = self.bodies.bodies[vessel]
        volume, room = sum(one.amount for one in portions), max(0.0, body.capacity - self.matter.total(vessel))
        share = 1.0 if volume <= room else room / volume
        self.matter = self.matter.cooled(vessel)
        for one in portions:
            self.matter = self.matter.put(vessel, Portion(one.type, one.amount * share, one.origins))
        below = self.under(vessel) if share < 1 else None
        if below is not None:
            half_x, _, half_z = half_extents(self.bodies.poses[vessel], body.size).tolist()
            x, y, z = self.bodies.poses[vessel].position
            for one in portions:
                beside = (x + half_x + self._size(one.type)[0] / 2 + BESIDE, y, z - half_z)
                self._spread(Portion(one.type, one.amount * (1 - share), one.origins), below, beside)

    def _spread(self, portion: Portion, target: str, point: Point) -> None:
        """Put a portion on a thing: it joins a puddle of the same class, or becomes a new thing."""
        for name in self.matter.origins:
            x, y, z = self.bodies.poses[name].position
            near = math.dist((x, y), point[:2]) <= ONE_PUDDLE and z <= point[2] + ONE_PUDDLE / 2
            if near and name not in self.bodies.removed and portion.type == self.type_of(name):
                self.matter = self.matter.put(name, portion)
                return
        size = self._size(portion.type)
        name = self.new_name(f"{local_name(portion.type)}_on_{target}")
        at = Pose((point[0], point[1], point[2] + size[2] / 2))
        self.create(name, portion.type, size, at, portion.origins, portion.amount)

    def _size(self, type: str) -> Size:
        return self.rules.size(type) or PUDDLE

    def new_name(self, wish: str) -> str:
        """Find a name that nothing has or had here."""
        number, name = 1, wish
        while name in self.bodies.bodies:
            number += 1
            name = f"{wish}_{number}"
        return name


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
    content = changes.matter.contents.get(name, {}).values()
    return merged(changes.matter.origins.get(name, ()), *(portion.origins for portion in content))
