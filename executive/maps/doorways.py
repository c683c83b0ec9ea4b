"""Doorways between the rooms of a map: those that it places, and those implied by doors or by a topological map.

Rooms are connected if ``connectedTo`` or ``betweenContainers`` links them, directly or through a doorway.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.semantic_map import OPENINGS, SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.shapes import half_extents
from planlang.ontology import Ontology, expand
from sim import Body
from sim.bodies import WALL
from sim.joints import Articulation
from sim.scene import BodyShape, Cavity

WIDTH, HEIGHT = 1.0, 2.0
"""Default size of a doorway [m]."""
POST = 0.1
"""Wall left standing on each side of a default doorway [m]."""
THICKEST = 0.6
"""Greatest thickness of the wall between two rooms [m]."""
WALLS = ("WallOfAConstruction",)
"""Classes of walls that stand alone, as boxes."""
SEAM = 0.02
"""How much wider and higher than a leaf an opening is that is made for it [m]."""
DEEP = 0.15
"""Distance from a leaf up to which its opening cuts walls [m]."""
MOSTLY = 0.8
"""Least share of an opening's width that is within a wall which it cuts: a doorway may be as wide as its hall."""
PARALLEL = 0.999
"""Least cosine of the angle between adjoining walls of two rooms."""


def with_doorways(
    bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic], joints: Iterable[Articulation] = ()
) -> list[Body]:
    """Cut openings into the walls between connected rooms; assumed doorways are appended to ``notes``.

    ``joints`` are those of doors between rooms: one without a doorway has an opening of its size.
    """
    rooms = {body.iri: body for body in bodies if body.shape is BodyShape.ROOM}
    walls = {body.iri: body for body in bodies if is_wall(body, semantic_map)}
    placed = [thing for thing in semantic_map.objects if thing.pose and thing.size and is_doorway(thing, semantic_map)]
    openings: list[tuple[Pose, Sequence[float] | Array]] = [*map(_box, placed)]
    openings += _around_doors(bodies, joints, {thing.name for thing in placed})
    linked: set[frozenset[str]] = set()
    for pose, size in openings:
        walls = {iri: _opened(wall, through_wall(wall, pose, size)) for iri, wall in walls.items()}
        through = {iri: cut for iri, room in rooms.items() if (cut := cut_of(room, pose, size)) is not None}
        if len(through) > 1:
            rooms = {iri: _opened(room, through.get(iri)) for iri, room in rooms.items()}
            linked |= set(map(frozenset, combinations(through, 2)))
    for pair in _connected(semantic_map.ontology, list(rooms)):
        if frozenset(pair) not in linked:
            rooms |= _with_doorway(rooms[pair[0]], rooms[pair[1]], semantic_map, notes)
    return [(rooms | walls).get(body.iri, body) for body in bodies]


def _around_doors(
    bodies: Sequence[Body], joints: Iterable[Articulation], doorways: Container[str]
) -> Iterator[tuple[Pose, Array]]:
    """Yield the openings, poses and sizes (3,), of doors between rooms that hang in no doorway, shut as they are."""
    by_name = {body.name: body for body in bodies}
    for joint in joints:
        if joint.frame and joint.frame[0] not in doorways:
            leaf = by_name[joint.leaf]
            thickness = np.arange(3) == int(np.argmin(leaf.size))
            yield leaf.pose, leaf.size + np.where(thickness, 2 * DEEP, SEAM)


def is_wall(body: Body, semantic_map: SemanticMap) -> bool:
    """Check whether a body is a wall of its own, beside those of rooms."""
    thing = semantic_map.find(body.iri)
    return thing is not None and body.shape is BodyShape.BOX and semantic_map.is_a(thing, *WALLS)


def is_doorway(thing: MapObject, semantic_map: SemanticMap) -> bool:
    """Check whether an object is an opening in a wall rather than a body."""
    return semantic_map.is_a(thing, *OPENINGS)


def _connected(ontology: Ontology, rooms: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of rooms that are connected, directly or through an opening, in the order of the map."""
    neighbours: dict[str, dict[str, None]] = {}
    for name in ("connectedTo", "betweenContainers"):
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str) and isinstance(triple.object, str):
                neighbours.setdefault(triple.subject, {})[triple.object] = None
                neighbours.setdefault(triple.object, {})[triple.subject] = None
    portals = {iri for iri in neighbours if ontology.any_is_a((iri,), OPENINGS)}
    for one, other in combinations(rooms, 2):
        near = neighbours.get(one, {})
        if other in near or any(portal in portals and other in neighbours[portal] for portal in near):
            yield one, other


def _box(thing: MapObject) -> tuple[Pose, tuple[float, float, float]]:
    assert thing.pose is not None
    assert thing.size is not None
    return thing.pose, thing.size


def _opened(room: Body, cut: Cavity | None) -> Body:
    return room if cut is None else replace(room, cavities=(*room.cavities, cut))


def through_wall(wall: Body, pose: Pose, size: Sequence[float] | Array) -> Cavity | None:
    """Find the opening that a box cuts through a wall of its own; None if it does not reach into it."""
    local = wall.pose.inverse() @ pose
    centre, half, outer = np.array(local.position), half_extents(local, size), np.array(wall.size) / 2
    if (np.abs(centre) >= half + outer).any():
        return None
    normal = int(np.argmin(wall.size[:2]))
    centre[normal], half[normal] = 0.0, outer[normal] + WALL
    (x, y, z), (depth, width, height) = centre.tolist(), (2 * half).tolist()
    return Cavity((x, y, z), (depth, width, height))


def cut_of(room: Body, pose: Pose, size: Sequence[float] | Array) -> Cavity | None:
    """Find the opening that a box cuts into a wall of a room; None if it touches none."""
    local = room.pose.inverse() @ pose
    centre, half, inner = np.array(local.position), half_extents(local, size), np.array(room.size) / 2
    for axis, along in ((0, 1), (1, 0)):
        outside = abs(centre[axis]) - inner[axis]
        low, high = np.clip(centre[along] + half[along] * np.array([-1.0, 1.0]), -inner[along], inner[along])
        if -half[axis] <= outside <= half[axis] + THICKEST and high - low >= MOSTLY * 2 * half[along]:
            centre[along], half[along] = (low + high) / 2, (high - low) / 2
            centre[axis] = np.copysign(inner[axis] + WALL / 2, centre[axis])
            half[axis] = WALL  # sticks out of the wall on both sides, so that no film of it is left
            x, y, z = centre.tolist()
            depth, width, height = (2 * half).tolist()
            return Cavity((x, y, z), (depth, width, height))
    return None


def _with_doorway(one: Body, other: Body, semantic_map: SemanticMap, notes: list[Diagnostic]) -> dict[str, Body]:
    """Cut a doorway into the longest wall that two rooms share; both rooms by IRI, none if no wall is long enough."""
    thing, names = semantic_map.find(one.iri), f"{local_name(one.iri)} and {local_name(other.iri)}"
    span = None if thing is None else thing.span
    widest = max(_adjoining(one, other), key=lambda wall: wall[1], default=None)
    if widest is None or widest[1] < WIDTH + 2 * POST:
        message = f"{names} are connected, but share no wall of {WIDTH + 2 * POST} m: there is no way between them"
        notes.append(warning("M029", message, span, "place a Doorway between them, with a size"))
        return {}
    place = Pose((*widest[0][:2].tolist(), one.pose.position[2] - one.size[2] / 2 + HEIGHT / 2), one.pose.orientation)
    message = (
        f"{names} are connected, but no doorway is placed: one of {WIDTH} m in the middle of their wall is assumed"
    )
    notes.append(note("M029", message, span, "place a Doorway between them, with a size"))
    return {room.iri: _opened(room, cut_of(room, place, (WIDTH, WIDTH, HEIGHT))) for room in (one, other)}


def _adjoining(one: Body, other: Body) -> Iterator[tuple[Array, float]]:
    """Yield the midpoint (3,) of each wall section that two rooms share, with its length [m]."""
    for normal, along, face, half in _walls(one):
        for against, _, opposite, width in _walls(other):
            gap = float((opposite - face) @ normal)
            if float(normal @ against) > -PARALLEL or not -WALL <= gap <= THICKEST:
                continue
            offset = float((opposite - face) @ along)
            low, high = max(-half, offset - width), min(half, offset + width)
            yield face + (low + high) / 2 * along + gap / 2 * normal, high - low


def _walls(room: Body) -> Iterable[tuple[Array, Array, Array, float]]:
    """Yield each wall's outward normal, direction, midpoint of its inner face, and half its length [m]."""
    rotation, centre = room.pose.rotation, np.array(room.pose.position)
    for axis, along in ((0, 1), (1, 0)):
        for sign in (-1.0, 1.0):
            normal = sign * rotation[:, axis]
            yield normal, rotation[:, along], centre + room.size[axis] / 2 * normal, room.size[along] / 2
