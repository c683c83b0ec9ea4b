"""The ways between the rooms of a map: doorways that it places, and where a topological map says that rooms connect.

Rooms are nodes. They connect by ``connectedTo``, also by way of a doorway, and by that being ``betweenContainers``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from executive.maps.semantic_map import OPENINGS, MapObject, SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.shapes import half_extents
from planlang.ontology import Ontology, expand
from sim import Body
from sim.bodies import WALL
from sim.scene import BodyShape, Cavity

WIDTH, HEIGHT = 1.0, 2.0
"""Size of a doorway of which no map says one [m]."""
POST = 0.1
"""Wall that is left on both sides of it [m]."""
THICKEST = 0.6
"""Greatest thickness of the wall between two rooms [m]."""
PARALLEL = 0.999
"""Least cosine of the angle between the walls of two rooms that adjoin."""


def with_doorways(bodies: Sequence[Body], semantic_map: SemanticMap, found: list[Diagnostic]) -> list[Body]:
    """Return bodies with openings in the walls of rooms that connect; what is assumed is told."""
    rooms = {body.iri: body for body in bodies if body.shape is BodyShape.ROOM}
    placed = [thing for thing in semantic_map.objects if thing.pose and thing.size and is_doorway(thing, semantic_map)]
    joined: set[frozenset[str]] = set()
    for doorway in placed:
        through = {iri: cut for iri, room in rooms.items() if (cut := _cut(room, *_box(doorway))) is not None}
        if len(through) > 1:
            rooms = {iri: _opened(room, through.get(iri)) for iri, room in rooms.items()}
            joined |= set(map(frozenset, combinations(through, 2)))
    for pair in _connected(semantic_map.ontology, list(rooms)):
        if frozenset(pair) not in joined:
            rooms |= _joined(rooms[pair[0]], rooms[pair[1]], semantic_map, found)
    return [rooms.get(body.iri, body) for body in bodies]


def is_doorway(thing: MapObject, semantic_map: SemanticMap) -> bool:
    """Return whether a thing is an opening in a wall, and no body."""
    return semantic_map.is_a(thing, *OPENINGS)


def _is_opening(iri: str, ontology: Ontology) -> bool:
    return ontology.any_is_a((iri,), OPENINGS)


def _connected(ontology: Ontology, rooms: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of rooms that are connected, directly or by what has no place, in the order of the map."""
    near: dict[str, dict[str, None]] = {}
    for name in ("connectedTo", "betweenContainers"):
        for triple in ontology.triples(None, expand(name)):
            if isinstance(triple.subject, str) and isinstance(triple.object, str):
                near.setdefault(triple.subject, {})[triple.object] = None
                near.setdefault(triple.object, {})[triple.subject] = None
    portals = {iri for iri in near if _is_opening(iri, ontology)}
    for one, other in combinations(rooms, 2):
        ways = near.get(one, {})
        if other in ways or any(portal in portals and other in near[portal] for portal in ways):
            yield one, other


def _box(thing: MapObject) -> tuple[Pose, tuple[float, float, float]]:
    assert thing.pose is not None
    assert thing.size is not None
    return thing.pose, thing.size


def _opened(room: Body, cut: Cavity | None) -> Body:
    return room if cut is None else replace(room, cavities=(*room.cavities, cut))


def _cut(room: Body, pose: Pose, size: Sequence[float]) -> Cavity | None:
    """Return the opening that a box makes in the wall of a room that it is in; None if it is in none."""
    local = room.pose.inverse() @ pose
    centre, half, inner = np.array(local.position), half_extents(local, size), np.array(room.size) / 2
    for axis, along in ((0, 1), (1, 0)):
        beyond = abs(centre[axis]) - inner[axis]
        if -half[axis] <= beyond <= half[axis] + THICKEST and abs(centre[along]) + half[along] <= inner[along]:
            centre[axis] = np.copysign(inner[axis] + WALL / 2, centre[axis])
            half[axis] = WALL  # through the wall and beyond
            x, y, z = centre.tolist()
            depth, width, height = (2 * half).tolist()
            return Cavity((x, y, z), (depth, width, height))
    return None


def _joined(one: Body, other: Body, semantic_map: SemanticMap, found: list[Diagnostic]) -> dict[str, Body]:
    """Return two rooms, by IRI, with a doorway in the middle of where their walls adjoin; none if they do not."""
    thing, names = semantic_map.find(one.iri), f"{local_name(one.iri)} and {local_name(other.iri)}"
    span = None if thing is None else thing.span
    widest = max(_adjoining(one, other), key=lambda wall: wall[1], default=None)
    if widest is None or widest[1] < WIDTH + 2 * POST:
        message = f"{names} are connected, but no walls of theirs adjoin by {WIDTH + 2 * POST} m: there is no way"
        found.append(warning("M029", message, span, "place a Doorway between them, with a size"))
        return {}
    place = Pose((*widest[0][:2].tolist(), one.pose.position[2] - one.size[2] / 2 + HEIGHT / 2), one.pose.orientation)
    message = f"{names} are connected, nothing says where: a doorway {WIDTH} m wide in the middle of their walls"
    found.append(note("M029", message, span, "place a Doorway between them, with a size"))
    return {room.iri: _opened(room, _cut(room, place, (WIDTH, WIDTH, HEIGHT))) for room in (one, other)}


def _adjoining(one: Body, other: Body) -> Iterator[tuple[Array, float]]:
    """Yield the middles (3,) of where walls of two rooms adjoin, each with its length [m]."""
    for normal, along, face, half in _walls(one):
        for against, _, opposite, width in _walls(other):
            gap = float((opposite - face) @ normal)
            if float(normal @ against) > -PARALLEL or not -WALL <= gap <= THICKEST:
                continue
            offset = float((opposite - face) @ along)
            low, high = max(-half, offset - width), min(half, offset + width)
            yield face + (low + high) / 2 * along + gap / 2 * normal, high - low


def _walls(room: Body) -> Iterable[tuple[Array, Array, Array, float]]:
    """Yield for each wall its normal outwards, its direction, the middle of its inner face, and half its length."""
    rotation, centre = room.pose.rotation, np.array(room.pose.position)
    for axis, along in ((0, 1), (1, 0)):
        for sign in (-1.0, 1.0):
            normal = sign * rotation[:, axis]
            yield normal, rotation[:, along], centre + room.size[axis] / 2 * normal, room.size[along] / 2
