"""Things of a map that move by themselves: other robots, on the routes that the map states."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

from executive.maps.measures import length, lengths, stated
from executive.maps.semantic_map import SemanticMap
from planlang.diagnostics import Diagnostic, warning
from sim import Body
from sim.movers import Mover
from sim.scene import BodyShape

SPEED = 0.3
"""Speed of a robot of which the map states none [m/s]."""
MOST = 1000.0
"""Length of a route beyond which a number in it is surely wrong [m]; places on routes are compared one by one."""


def movers_of(bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> Iterator[Mover]:
    """Yield what moves by itself: bodies with ``routePoints``, the points on the floor that they drive to, "x y x y".

    They begin where the map has them, and come back the same way. ``drivingSpeed`` is in metres per second.
    """
    ontology = semantic_map.ontology
    for body in bodies:
        triple = stated(ontology, body.iri, "routePoints")
        numbers = None if triple is None else lengths(triple, notes)
        if triple is None or numbers is None:
            continue
        points = (body.pose.position[:2], *zip(numbers[::2], numbers[1::2], strict=False))
        route = [points[0], *(point for before, point in pairwise(points) if math.dist(before, point) > 0)]
        if len(numbers) % 2 or len(route) < 2 or body.shape not in (BodyShape.BOX, BodyShape.CYLINDER):
            message = f"{body.name} does not move: a route is points on the floor, x and y of each, for a solid body"
            notes.append(warning("M002", message, triple.span))
            continue
        said = stated(ontology, body.iri, "drivingSpeed")
        speed = None if said is None else length(said, notes)
        mover = Mover(body.name, tuple(route), speed if speed is not None and speed > 0 else SPEED)
        if mover.length > MOST:
            message = f"{body.name} does not move: its route is {mover.length:.0f} m long, at most {MOST:.0f} m"
            notes.append(warning("M002", message, triple.span))
            continue
        yield mover
