"""Cavities of furniture: behind its doors, at its compartments, and where its drawers slide; drawers are open above.

Other furniture stays a solid box that nobody can reach into, unless the map states that it is open.
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
"""Default thickness of walls and shelves [m]."""
SHEET = 0.01
"""Default thickness of the walls of drawers [m]."""
BEYOND = 0.1
"""Length by which a cavity sticks out of the open side of its furniture, so that nothing closes it [m]."""
TOLERATED = 0.05
"""An object that penetrates a wall or shelf by less than this pushes it back: maps are no more accurate [m]."""


def hollowed(
    bodies: Sequence[Body],
    joints: Iterable[Articulation],
    stated: Callable[[Body], Sequence[Cavity]],
    compartments: Callable[[Body], Sequence[Body]],
    report: Callable[[Body, Sequence[Body], Sequence[str]], None],
) -> list[Body]:
    """Cut cavities into furniture behind its doors, at its compartments and in its drawers, empty or not.

    ``stated`` gives the cavities of a body that the map states to be open, ``compartments`` the parts of furniture that
    may contain objects. ``report`` receives furniture, the objects inside and the names of its openings: none if
    nobody can reach into it. Returns all bodies.
    """
    by_name = {body.name: body for body in bodies}
    joints = tuple(joints)
    slides = {joint.leaf for joint in joints if joint.kind is JointKind.PRISMATIC and not joint.frame}
    slide_cavities: dict[str, list[Cavity]] = {}
    for joint in joints:
        if joint.leaf in slides and joint.holder is not None:
            slide_cavities.setdefault(joint.holder, []).append(
                _slide_of(by_name[joint.leaf], by_name[joint.holder], joint)
            )
    doors: dict[str, list[Body]] = {}
    for joint in joints:
        if joint.kind is JointKind.HINGED and joint.holder is not None and not joint.is_knob:
            doors.setdefault(joint.holder, []).append(by_name[joint.leaf])
    movable = [body for body in bodies if body.movable]
    places = np.array([body.pose.position for body in movable]).reshape(-1, 3)
    contents: list[_Contents] = []
    for body in bodies:
        if body.movable or body.shape is not BodyShape.BOX:
            continue
        content = np.flatnonzero(inside(body.pose, body.size, places))
        things, cavity = [movable[index] for index in content.tolist()], stated(body)
        its_doors, is_drawer = doors.get(body.name, ()), body.name in slides
        parts = [] if cavity else [part for part in compartments(body) if part.name not in slides]
        if is_drawer and not cavity:
            rooms = [(body.name, _open_above(body))]
        else:
            rooms = _rooms(body, cavity, its_doors, [part for part in parts if part.name not in doors])
        reachable = [thing for thing in things if any(_is_in(room, body, thing) for _, room in rooms)]
        openings = list(dict(rooms))
        if things:
            contents.append(_Contents(body, things, openings if reachable else []))
        if body.name in slide_cavities:
            by_name[body.name] = replace(body, cavities=tuple(slide_cavities[body.name]))
        if rooms and (reachable or not things):
            cavities = tuple(_with_room(room, body, reachable) for _, room in rooms)
            by_name[body.name] = replace(body, cavities=(*cavities, *slide_cavities.get(body.name, ())))
            for part in parts:  # a compartment is a cavity of its furniture from here on, not a body
                if part.name in openings:
                    by_name[part.name] = replace(by_name[part.name], shape=BodyShape.MARKER, cavities=())
    for one in contents:
        if to_report := one.without_drawers(contents):
            report(one.body, to_report, one.openings)
    return list(by_name.values())


@dataclass(frozen=True, slots=True)
class _Contents:
    """Movable objects inside furniture, and the names of its openings: none if they are out of reach."""

    body: Body
    things: list[Body]
    openings: list[str]

    def without_drawers(self, others: Iterable[_Contents]) -> list[Body]:
        """Objects to report: all, or, without openings, those that do not lie in drawers of their own."""
        volume = np.prod(self.body.size)
        inner = [one for one in others if not self.openings and one.openings and np.prod(one.body.size) < volume]
        within = {thing.name for one in inner for thing in one.things}
        return [thing for thing in self.things if thing.name not in within]


def _rooms(
    body: Body, cavities: Sequence[Cavity], doors: Sequence[Body], parts: Iterable[Body]
) -> list[tuple[str, Cavity]]:
    """Cavities of a body with the name of what opens them: doors, compartments without a door, or the body itself.

    ``cavities`` are those that the map states, such as between boards, which divide what is behind a door, too.
    """
    front = face_of(doors[0], body) if doors else (0, 1.0)
    rooms = [(door.name, room) for door in doors for room in _divided(room_behind(door, body), cavities)]
    rooms += [(part.name, _compartment(part, body, *front)) for part in parts]
    return rooms or [(body.name, cavity) for cavity in cavities]


def _divided(room: Cavity, floors: Sequence[Cavity]) -> list[Cavity]:
    """Cut a cavity at the heights of others; the whole one without any at its height."""
    (low, high), parts = _ends(room), []
    for floor in floors:
        bottom, top = (float(end[2]) for end in _ends(floor))
        if min(top, high[2]) - max(bottom, low[2]) > TOLERATED:
            parts.append(_cavity(np.array([*low[:2], max(bottom, low[2])]), np.array([*high[:2], min(top, high[2])])))
    return parts or [room]


def _ends(room: Cavity) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of a cavity."""
    centre, half = np.asarray(room.centre), np.asarray(room.size) / 2
    return centre - half, centre + half


def open_at(
    size: Sequence[float], sides: Iterable[str], boards: Sequence[float] = (), walls: float = WALL
) -> list[Cavity]:
    """Cavities of a box that is open at sides such as "+x"; none if no side is valid or the walls leave no space.

    ``boards`` divide it: heights of their tops above its lower end, in ascending order [m]. It is then open in front.
    """
    sides = tuple(sides) or ("+x",) * bool(boards)
    low, high = -np.asarray(size) / 2 + walls, np.asarray(size) / 2 - walls
    openings = [(sign, axis) for side in sides for sign in "+-" for axis in "xyz" if side == sign + axis]
    for sign, axis in openings:
        if sign == "+":
            high["xyz".index(axis)] += walls + BEYOND
        else:
            low["xyz".index(axis)] -= walls + BEYOND
    floors = [height - size[2] / 2 for height in boards] or [low[2]]
    ceilings = [*(floor - walls for floor in floors[1:]), high[2]]
    rooms = [((*low[:2], floor), (*high[:2], ceiling)) for floor, ceiling in zip(floors, ceilings, strict=True)]
    return [_cavity(*map(np.array, room)) for room in rooms if openings and np.less(*room).all()]


def room_behind(leaf: Body, furniture: Body) -> Cavity:
    """Cavity of furniture, in its frame, behind a leaf: as high and wide as the leaf, and deep up to the back wall."""
    half, (axis, sign) = np.asarray(furniture.size) / 2, face_of(leaf, furniture)
    local = _in_frame(leaf, furniture)
    low, high = (np.clip(end, -half + WALL, half - WALL) for end in (local.min(axis=0), local.max(axis=0)))
    back, front = -half[axis] + WALL, half[axis] + BEYOND
    low[axis], high[axis] = (back, front) if sign > 0 else (-front, -back)
    return _cavity(low, high)


def face_of(leaf: Body, furniture: Body) -> tuple[int, float]:
    """Find the face of furniture that a closed leaf covers: an axis of the furniture, and 1 or -1 along it."""
    normal = leaf.pose.rotation[:, int(np.argmin(leaf.size))]
    axis = int(np.argmax(np.abs(furniture.pose.rotation.T @ normal)))
    local = (furniture.pose.inverse() @ leaf.pose).position
    return axis, 1.0 if local[axis] >= 0 else -1.0


def _compartment(part: Body, furniture: Body, axis: int, sign: float) -> Cavity:
    half, local = np.asarray(furniture.size) / 2, _in_frame(part, furniture)
    low, high = local.min(axis=0), local.max(axis=0)
    if sign > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _open_above(body: Body) -> Cavity:
    """Cavity of a drawer, open at the top."""
    half = np.asarray(body.size) / 2
    up = body.pose.rotation[2]
    axis = int(np.argmax(np.abs(up)))
    low, high = -half + SHEET, half - SHEET
    if up[axis] > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _slide_of(drawer: Body, furniture: Body, joint: Articulation) -> Cavity:
    """Cavity of furniture in which a drawer slides."""
    half, local = np.asarray(furniture.size) / 2, _in_frame(drawer, furniture)
    slide = furniture.pose.rotation.T @ np.asarray(joint.axis)
    axis = int(np.argmax(np.abs(slide)))
    low, high = local.min(axis=0), local.max(axis=0)
    if slide[axis] > 0:
        high[axis] = half[axis] + BEYOND
    else:
        low[axis] = -half[axis] - BEYOND
    return _cavity(low, high)


def _is_in(room: Cavity, body: Body, thing: Body) -> bool:
    local = np.array((body.pose.inverse() @ thing.pose).position) - room.centre
    return bool(np.all(np.abs(local) < np.asarray(room.size) / 2))


def _with_room(room: Cavity, body: Body, things: Iterable[Body]) -> Cavity:
    """Widen a cavity around the objects in it that penetrate its walls by less than :data:`TOLERATED`."""
    low, high = _ends(room)
    for thing in things:
        if _is_in(room, body, thing):
            local = _in_frame(thing, body)
            lower, upper = local.min(axis=0), local.max(axis=0)
            low = np.where((lower < low) & (lower > low - TOLERATED), lower, low)
            high = np.where((upper > high) & (upper < high + TOLERATED), upper, high)
    return _cavity(low, high)


def _in_frame(body: Body, furniture: Body) -> Array:
    """Corners (8, 3) of a body's box in the frame of furniture."""
    pose = furniture.pose.inverse() @ body.pose
    return corners(pose, body.size)


def _cavity(low: Array, high: Array) -> Cavity:
    (x, y, z), (dx, dy, dz) = ((low + high) / 2).tolist(), np.maximum(high - low, 0.0).tolist()
    return Cavity((x, y, z), (dx, dy, dz))
