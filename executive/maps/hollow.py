"""Furniture that has an inside: behind its doors, at its compartments and where its drawers are, which are open above.

Furniture with none of these stays a solid box, unless the map states that it is open: nobody reaches into it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from planlang.geometry import Array
from planlang.geometry.shapes import corners
from planlang.records import dataclass
from sim import Body
from sim.joints import Articulation, JointKind
from sim.leaves import inside
from sim.scene import BodyShape, Cavity

WALL = 0.02
"""Thickness of walls and shelves of which nothing is known [m]."""
SHEET = 0.01
"""The same for drawers [m]."""
BEYOND = 0.1
"""Length by which the room of a compartment goes beyond the open side of its furniture [m]."""
ROOM_FOR_IT = 0.05
"""A thing that sticks into a shelf or a wall by no more than this has room there: maps are not better [m]."""


def hollowed(
    bodies: Sequence[Body],
    joints: Iterable[Articulation],
    stated: Callable[[Body], Sequence[Cavity]],
    compartments: Callable[[Body], Sequence[Body]],
    report: Callable[[Body, Sequence[Body], Sequence[str]], None],
) -> list[Body]:
    """Return all bodies, furniture hollow behind its doors, at its compartments and in its drawers, empty or not.

    ``stated``: the rooms inside a body of which the map says that it is open; it is hollow in any case, there or behind
    its doors. ``compartments`` are parts of furniture inside of which things may lie. ``report`` is told the furniture,
    what lies inside and the names of its openings, none if there is no way to reach into it.
    """
    by_name = {body.name: body for body in bodies}
    joints = tuple(joints)
    slides = {joint.leaf for joint in joints if joint.kind is JointKind.PRISMATIC}
    runs: dict[str, list[Cavity]] = {}
    for joint in joints:
        if joint.leaf in slides and joint.holder is not None:
            runs.setdefault(joint.holder, []).append(_run_of(by_name[joint.leaf], by_name[joint.holder], joint))
    doors: dict[str, list[Body]] = {}
    for joint in joints:
        if joint.kind is JointKind.HINGED and joint.holder is not None and not joint.is_knob:
            doors.setdefault(joint.holder, []).append(by_name[joint.leaf])
    movable = [body for body in bodies if body.movable]
    contents: list[_Filled] = []
    for body in bodies:
        if body.movable or body.shape is not BodyShape.BOX:
            continue
        things, own = _content(body, movable) if movable else [], stated(body)
        its_doors, is_drawer = doors.get(body.name, ()), body.name in slides
        parts = [] if own else [part for part in compartments(body) if part.name not in slides]
        rooms = _rooms(body, own, its_doors, [part for part in parts if part.name not in doors], is_drawer=is_drawer)
        held = [thing for thing in things if any(_is_in(room, body, thing) for _, room in rooms)]
        openings = list(dict(rooms))
        if things:
            contents.append(_Filled(body, things, openings if held else []))
        if body.name in runs:
            by_name[body.name] = replace(body, cavities=tuple(runs[body.name]))
        if rooms and (held or not things):
            cavities = tuple(_with_room(room, body, held) for _, room in rooms)
            by_name[body.name] = replace(body, cavities=(*cavities, *runs.get(body.name, ())))
            for part in parts:
                if part.name in openings:
                    by_name[part.name] = replace(by_name[part.name], shape=BodyShape.MARKER, cavities=())
    for one in contents:
        if left := one.without_drawers(contents):
            report(one.body, left, one.openings)
    return list(by_name.values())


@dataclass(frozen=True, slots=True)
class _Filled:
    """The movable things inside of furniture, and the names of its openings: none without a way to reach them."""

    body: Body
    things: list[Body]
    openings: list[str]

    def without_drawers(self, others: Iterable[_Filled]) -> list[Body]:
        """Return the things; if there is no way to them, without those that lie in its drawers, which can be opened."""
        volume = np.prod(self.body.size)
        inner = [one for one in others if not self.openings and one.openings and np.prod(one.body.size) < volume]
        within = {thing.name for one in inner for thing in one.things}
        return [thing for thing in self.things if thing.name not in within]


def _rooms(
    body: Body, own: Sequence[Cavity], doors: Sequence[Body], parts: Iterable[Body], *, is_drawer: bool
) -> list[tuple[str, Cavity]]:
    """Return the rooms in a body with what opens them: doors, compartments without one, or itself."""
    if is_drawer and not own:
        return [(body.name, _open_above(body))]
    front = _front(body, doors)
    rooms = [(door.name, room_behind(door, body)) for door in doors]
    rooms += [(part.name, _compartment(part, body, *front)) for part in parts]
    return rooms or [(body.name, room) for room in own]


def open_at(
    size: Sequence[float], sides: Iterable[str], boards: Sequence[float] = (), walls: float = WALL
) -> list[Cavity]:
    """Return the rooms inside a box, along its axes, that is open at sides such as "+x"; none if nothing is open.

    ``boards`` divide it: heights of their tops above its lower end, the lowest first [m]. It is then open in front.
    """
    sides = tuple(sides) or ("+x",) * bool(boards)
    low, high = -np.asarray(size) / 2 + walls, np.asarray(size) / 2 - walls
    known = [(sign, axis) for side in sides for sign in "+-" for axis in "xyz" if side == sign + axis]
    for sign, axis in known:
        if sign == "+":
            high["xyz".index(axis)] += walls + BEYOND
        else:
            low["xyz".index(axis)] -= walls + BEYOND
    floors = [height - size[2] / 2 for height in boards] or [low[2]]
    ceilings = [*(floor - walls for floor in floors[1:]), high[2]]
    rooms = [((*low[:2], floor), (*high[:2], ceiling)) for floor, ceiling in zip(floors, ceilings, strict=True)]
    return [_cavity(*map(np.array, room)) for room in rooms if known and np.less(*room).all()]


def room_behind(leaf: Body, furniture: Body) -> Cavity:
    """Return the room in furniture, in its frame, that a leaf closes: as high and wide as the leaf, up to the back."""
    half, (axis, sign) = np.asarray(furniture.size) / 2, face_of(leaf, furniture)
    local = _in_frame(leaf, furniture)
    low, high = (np.clip(end, -half + WALL, half - WALL) for end in (local.min(axis=0), local.max(axis=0)))
    back, front = -half[axis] + WALL, half[axis] + BEYOND
    low[axis], high[axis] = (back, front) if sign > 0 else (-front, -back)
    return _cavity(low, high)


def face_of(leaf: Body, furniture: Body) -> tuple[int, float]:
    """Return the face of furniture that a closed leaf is at: an axis of the furniture, and 1 or -1 along it."""
    normal = leaf.pose.rotation[:, int(np.argmin(leaf.size))]
    axis = int(np.argmax(np.abs(furniture.pose.rotation.T @ normal)))
    local = (furniture.pose.inverse() @ leaf.pose).position
    return axis, 1.0 if local[axis] >= 0 else -1.0


def _content(body: Body, movable: Sequence[Body]) -> list[Body]:
    """Return those of movable bodies whose centre is inside a piece of furniture."""
    found = inside(body.pose, body.size, np.array([other.pose.position for other in movable]))
    return [movable[index] for index in np.flatnonzero(found).tolist()]


def _front(body: Body, doors: Sequence[Body]) -> tuple[int, float]:
    """Return the open face of furniture: where its doors are, else its x axis."""
    return face_of(doors[0], body) if doors else (0, 1.0)


def _compartment(part: Body, furniture: Body, axis: int, sign: float) -> Cavity:
    half, local = np.asarray(furniture.size) / 2, _in_frame(part, furniture)
    low, high = local.min(axis=0), local.max(axis=0)
    if sign > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _open_above(body: Body) -> Cavity:
    """Return the inside of a drawer."""
    half = np.asarray(body.size) / 2
    up = body.pose.rotation[2]
    axis = int(np.argmax(np.abs(up)))
    low, high = -half + SHEET, half - SHEET
    if up[axis] > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _run_of(drawer: Body, furniture: Body, joint: Articulation) -> Cavity:
    """Return the room in furniture that a drawer leaves when it is pulled out."""
    half, local = np.asarray(furniture.size) / 2, _in_frame(drawer, furniture)
    way = furniture.pose.rotation.T @ np.asarray(joint.axis)
    axis = int(np.argmax(np.abs(way)))
    low, high = local.min(axis=0), local.max(axis=0)
    if way[axis] > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _is_in(room: Cavity, body: Body, thing: Body) -> bool:
    local = np.array((body.pose.inverse() @ thing.pose).position) - room.centre
    return bool(np.all(np.abs(local) < np.asarray(room.size) / 2))


def _with_room(room: Cavity, body: Body, things: Iterable[Body]) -> Cavity:
    """Return a cavity in which things are that belong there: a shelf into which one sticks a little gives way."""
    low, high = (np.asarray(room.centre) + sign * np.asarray(room.size) / 2 for sign in (-1.0, 1.0))
    for thing in things:
        if _is_in(room, body, thing):
            local = _in_frame(thing, body)
            lower, upper = local.min(axis=0), local.max(axis=0)
            low = np.where((lower < low) & (lower > low - ROOM_FOR_IT), lower, low)
            high = np.where((upper > high) & (upper < high + ROOM_FOR_IT), upper, high)
    return _cavity(low, high)


def _in_frame(body: Body, furniture: Body) -> Array:
    """Return the corners (8, 3) of a body's box in the frame of furniture."""
    pose = furniture.pose.inverse() @ body.pose
    return corners(pose, body.size)


def _cavity(low: Array, high: Array) -> Cavity:
    (x, y, z), (dx, dy, dz) = ((low + high) / 2).tolist(), np.maximum(high - low, 0.0).tolist()
    return Cavity((x, y, z), (dx, dy, dz))
