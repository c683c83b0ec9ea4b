"""Doors between rooms: doors of a map that hang in a doorway, a wall or a room, not in furniture, and what they lack.

A door does so if the map states it (as a part, by ``hingedTo`` or by a joint), or if it stands in a doorway.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.doorways import SEAM, cut_of, is_wall, through_wall
from executive.maps.semantic_map import OPENINGS, SemanticMap
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Array, Pose
from planlang.records import dataclass
from sim import Body
from sim.scene import BodyShape

ROOM_DOORS = ("Door", "DoorwayCovering")
"""Classes of doors that may hang between rooms."""
BESIDE = 0.15
"""Distance of a leaf from the box of a doorway up to which it closes it [m]: sliding doors hang before the wall."""

LOOSE = 0.1
"""Most by which a doorway is wider or higher than its leaf [m]: a robot does not see through it."""


@dataclass(frozen=True, slots=True)
class Frame:
    """What a door between rooms hangs in."""

    body: Body
    """The doorway, wall or room."""
    around: tuple[Body, ...]
    """Rooms and walls that its opening leads through."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all these bodies, each once."""
        return tuple(dict.fromkeys((self.body.name, *(body.name for body in self.around))))

    def opens_into(self, leaf: Body) -> Array:
        """Unit vector (3,) in the map: into the room of which the leaf is stated to be a part, else along its box."""
        normal = leaf.pose.rotation[:, int(np.argmin(leaf.size))]
        inwards = np.array(self.body.pose.position) - leaf.pose.position
        is_behind = self.body.shape is BodyShape.ROOM and float(inwards @ normal) < 0
        return np.asarray(-normal if is_behind else normal)


def frame_of(leaf: Body, wholes: Iterable[str], bodies: Mapping[str, Body], semantic_map: SemanticMap) -> Frame | None:
    """Find what a closed leaf hangs in: one of ``wholes`` (IRIs), else the doorway in which it stands; None if nothing.

    ``bodies`` are those of the map, by IRI.
    """
    stated = (bodies[iri] for iri in wholes if iri in bodies)
    placed = (body for body in bodies.values() if _is_doorway(body, semantic_map) and min(body.size) > 0)
    holders = (one for one in stated if _is_frame(one, semantic_map))
    frame = next(holders, None) or next((one for one in placed if _stands_in(leaf, one)), None)
    if frame is None:
        return None
    if _is_doorway(frame, semantic_map) and min(frame.size) > 0:
        place, size = frame.pose, np.array(frame.size)
    else:
        place, size = leaf.pose, np.array(leaf.size)
        size[int(np.argmin(size))] += 2 * BESIDE
    rooms = (body for body in bodies.values() if body.shape is BodyShape.ROOM and cut_of(body, place, size) is not None)
    walls = (body for body in bodies.values() if is_wall(body, semantic_map) and through_wall(body, place, size))
    return Frame(frame, (*rooms, *walls))


def lacking(thing: MapObject, leaf: Body, frame: Frame, handles: Sequence[Body]) -> Iterator[Diagnostic]:
    """Yield what a door between rooms lacks to be opened from both sides."""
    if len(frame.around) < 2 and all(body.shape is BodyShape.ROOM for body in frame.around):
        where = f"in the wall of {frame.around[0].name} only" if frame.around else "in no wall of a room"
        help = f"place it, or its Doorway, between two rooms; their walls are at most 0.6 m from {leaf.name}"
        yield warning("M038", f"{leaf.name} leads nowhere: it is {where}", thing.span, help)
    yield from _misfit(thing, leaf, frame.body)
    if not handles:
        message = f"{leaf.name} has no handle: a robot can push it shut, but not open it"
        help = f"state a Handle for each side as a part of {leaf.name} (properPhysicalParts), with a pose and a size"
        yield warning("M038", message, thing.span, help)
        return
    normal = leaf.pose.rotation[:, int(np.argmin(leaf.size))]
    sides = {side_of(leaf, handle, normal) for handle in handles}
    if len(sides) == 1:
        beyond = (
            one for one in frame.around if one.shape is BodyShape.ROOM and side_of(leaf, one, normal) not in sides
        )
        other = next((f"in {one.name}" for one in beyond), "on the other side")
        message = f"{handles[0].name} is the only handle of {leaf.name}: a robot {other} cannot open it"
        yield note("M039", message, thing.span, "state a Handle for each side as a part of it (properPhysicalParts)")


def _misfit(thing: MapObject, leaf: Body, opening: Body) -> Iterator[Diagnostic]:
    """Yield the warning about a leaf that does not close its doorway."""
    if opening.shape is not BodyShape.MARKER or min(opening.size) == 0:
        return
    turned = np.abs(leaf.pose.rotation.T @ opening.pose.rotation)
    plane = [axis for axis in np.argsort(-np.abs(leaf.pose.rotation[2])).tolist() if axis != int(np.argmin(leaf.size))]
    (high, wide), size = plane, turned @ np.array(opening.size)
    if all(size[axis] - leaf.size[axis] <= LOOSE for axis in plane):
        return
    shut, free = (f"{one[wide]:.2f} m wide and {one[high]:.2f} m high" for one in (leaf.size, size))
    message = f"{leaf.name} is {shut}, and {opening.name} {free}: it does not close it"
    help = f'state its size, thickness first: boundingBoxSize "0.04 {size[wide] - SEAM:.2f} {size[high] - SEAM:.2f}"'
    yield warning("M038", message, thing.span, help)


def side_of(leaf: Body, other: Body, normal: Array) -> float:
    """Tell on which side of a leaf a body is: 1 or -1 along the normal (3,)."""
    return 1.0 if float((np.array(other.pose.position) - leaf.pose.position) @ normal) > 0 else -1.0


def without_frame(thing: MapObject) -> Diagnostic:
    """Write the warning about a door with a handle or a hinge that nothing holds."""
    message = f"{thing.name} hangs in nothing: it stands where it is and cannot be opened"
    help = (
        "place it in a Doorway, or state it as a part of a piece of furniture, a wall or a room (properPhysicalParts)"
    )
    return warning("M038", message, thing.span, help)


def unknown_hinge(leaf: Body, thing: MapObject) -> Diagnostic:
    """Write the note about a hinge whose side is assumed."""
    help = "state a handle, which is opposite the hinge, or the pose of a HingedJoint that is a part of it"
    return note("M039", f"the side of {leaf.name}'s hinge is not stated: one is assumed", thing.span, help)


def _is_doorway(body: Body, semantic_map: SemanticMap) -> bool:
    thing = semantic_map.find(body.iri)
    return thing is not None and semantic_map.is_a(thing, *OPENINGS)


def _is_frame(body: Body, semantic_map: SemanticMap) -> bool:
    return body.shape is BodyShape.ROOM or is_wall(body, semantic_map) or _is_doorway(body, semantic_map)


def _stands_in(leaf: Body, doorway: Body) -> bool:
    """Check whether a leaf closes a doorway: its middle is in the box of it, or just before it."""
    local = np.array((doorway.pose.inverse() @ Pose(leaf.pose.position)).position)
    return bool((np.abs(local) <= np.array(doorway.size) / 2 + BESIDE).all())
