"""Promises that relations about the floor make of a place, checked without the resolver, by the table of words."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from executive.robots import Robot
from planlang.designators import Location, Object, Relation
from planlang.geometry import Array
from sim import Body
from tests.support.locations.oracle import BasePose
from tests.support.locations.rooms import Room, thing

HAIR = 2e-3
"""Places are told to a tenth of a millimetre [m]."""
SIDES = {"in_front_of": 0.0, "behind": math.pi, "left_of": math.pi / 2, "right_of": -math.pi / 2}
FACING = math.radians(30)


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances that relations mean for a kind of place where nothing bounds them [m]."""

    near: float
    far: float
    beside: tuple[float, float]


OF_A_BASE, OF_A_THING = Distances(1.0, 2.0, (0.1, 1.1)), Distances(0.3, 0.6, (0.0, 0.3))

CHECKED = (*SIDES, "next_to", "near", "far_from", "facing", "clear_of")
"""Relations that are checked here; what is in reach or visible is checked by the oracle."""


def objections(
    room: Room, robot: Robot, base: BasePose, location: Location, viewer: tuple[float, float]
) -> Iterator[str]:
    """Yield what of a location a place does not keep; ``viewer``: where the robot was when it asked."""
    for relation in location.relations:
        if relation.name in CHECKED and isinstance(relation.references[0], Object):
            body = _body(room, relation.references[0])
            hair = -HAIR if relation.negated else HAIR
            if keeps(relation, body, robot.base.radius, base, viewer, hair=hair) == relation.negated:
                yield f"{base} is {'' if relation.negated else 'not '}{relation.name} {body.name}: {relation}"


def _body(room: Room, what: Object) -> Body:
    return next(body for body in room.bodies if thing(body).iri == what.iri)


def keeps(
    relation: Relation,
    body: Body,
    radius: float,
    base: BasePose,
    viewer: tuple[float, float],
    usual: Distances = OF_A_BASE,
    *,
    hair: float = HAIR,
) -> bool:
    """Return whether something round of a radius [m] keeps a relation to a body, its negation left aside."""
    gap = outline_distance(body, base[0], base[1]) - radius
    least, most = relation.beyond, relation.within
    match relation.name:
        case "near":
            low = least or 0.0
            high = most if most is not None else math.inf if low > usual.near else usual.near
            return low - hair <= max(gap, 0.0) <= high + hair
        case "far_from":
            low = least if least is not None else 0.0 if most is not None and most < usual.far else usual.far
            return low - hair <= gap <= (math.inf if most is None else most) + hair
        case "facing":
            x, y = body.pose.position[:2]
            miss = math.remainder(math.atan2(y - base[1], x - base[0]) - base[2], 2 * math.pi)
            return abs(miss) <= FACING + hair
        case "clear_of":
            return gap > 0
        case "next_to":
            return any(
                _at_side(relation, body, side, radius, base, viewer, usual, hair) for side in ("left_of", "right_of")
            )
    return _at_side(relation, body, relation.name, radius, base, viewer, usual, hair)


def outline_distance(body: Body, x: float, y: float) -> float:
    """Distance of a point from the outline of a body seen from above, 0 inside [m]; bodies here stand upright."""
    dx, dy = x - body.pose.position[0], y - body.pose.position[1]
    if body.shape == "cylinder":
        return max(math.hypot(dx, dy) - max(body.size[:2]) / 2, 0.0)
    c, s = math.cos(body.pose.yaw), math.sin(body.pose.yaw)
    along, across = abs(c * dx + s * dy) - body.size[0] / 2, abs(c * dy - s * dx) - body.size[1] / 2
    return math.hypot(max(along, 0.0), max(across, 0.0))


def is_between(point: tuple[float, float] | Array, one: Body, other: Body) -> bool:
    """Return whether a point is on a straight line between two outlines, and outside of both; axes are the map's.

    What is at a share of the way is as large and as round as the outlines, mixed by this share.
    """
    x, y = float(point[0]), float(point[1])
    if min(outline_distance(one, x, y), outline_distance(other, x, y)) <= 0:
        return False
    shares = np.linspace(0.0, 1.0, 2001)
    ends = []
    for body in (one, other):
        is_round = body.shape == "cylinder"
        half = np.zeros(2) if is_round else np.array(body.size[:2]) / 2
        ends.append((np.array(body.pose.position[:2]), half, max(body.size[:2]) / 2 if is_round else 0.0))
    (start, half, radius), (end, other_half, other_radius) = ends
    middles, halves = (a + np.outer(shares, b - a) for a, b in ((start, end), (half, other_half)))
    out = np.maximum(np.abs([x, y] - middles) - halves, 0.0)
    return bool((np.hypot(*out.T) <= radius + shares * (other_radius - radius) + HAIR).any())


def _at_side(
    relation: Relation,
    body: Body,
    side: str,
    radius: float,
    base: BasePose,
    viewer: tuple[float, float],
    usual: Distances,
    hair: float,
) -> bool:
    front, seen = _front(body, viewer)
    heading = front + (-SIDES[side] if seen else SIDES[side])
    ahead = np.array([math.cos(heading), math.sin(heading)])
    offset = np.array([base[0] - body.pose.position[0], base[1] - body.pose.position[1]])
    forward, aside = float(offset @ ahead), float(ahead[0] * offset[1] - ahead[1] * offset[0])
    out = forward - _extent(body, heading)
    least = relation.beyond if relation.beyond is not None else usual.beside[0]
    most = relation.within if relation.within is not None else usual.beside[1]
    if relation.beyond is None and least > most:
        least = 0.0
    if relation.within is None and most < least:
        most = math.inf
    return least - hair <= out - radius <= most + hair and abs(aside) <= out + hair


def _front(body: Body, viewer: tuple[float, float]) -> tuple[float, bool]:
    """Heading of the front; whether it is the viewer's, whose left is the other side."""
    if body.shape == "person":
        return _ahead(body), False
    if body.graspable or body.shape == "cylinder":
        x, y = body.pose.position[:2]
        return math.atan2(viewer[1] - y, viewer[0] - x), True
    return body.pose.yaw, False


def _ahead(body: Body) -> float:
    """Heading of a person: the x axis of the box; of one who lies (1.2 m long, longer than high) its longer axis."""
    length, width, height = body.size
    lies = max(length, width) >= 1.2 and max(length, width) > height
    return body.pose.yaw + (math.pi / 2 if lies and width > length else 0.0)


def _extent(body: Body, heading: float) -> float:
    """Return how far the outline reaches from its middle in a direction [m]."""
    if body.shape == "cylinder":
        return max(body.size[:2]) / 2
    turn = heading - body.pose.yaw
    return abs(math.cos(turn)) * body.size[0] / 2 + abs(math.sin(turn)) * body.size[1] / 2
