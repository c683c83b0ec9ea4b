"""How much room things take, for planning the base's way: boxes around bodies, bands and outlines of the robot."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from planlang.protocols import Array, Pose
from sim.bodies import Bodies
from sim.contact import Held
from sim.geometry import hull
from sim.robot import Robot

Size = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex piece of a body where it is: "box", "cylinder" (about z) or "sphere", extents [m], pose in the map."""

    body: str
    kind: str
    size: Size
    pose: Pose
    limb: bool
    """Part of a person's arm that has left its rest, which hands may touch."""


def solids(bodies: Bodies, left_out: Iterable[str]) -> Iterator[Solid]:
    """The pieces of all bodies, floors and some bodies left out."""
    for index, piece in enumerate(bodies.pieces):
        if piece.body in left_out or piece.body in bodies.removed or bodies.upper[index, 2] < 1e-3:
            continue
        x, y, z = piece.part.size
        if piece.part.kind != "box":
            x = y = max(x, y)
        yield Solid(piece.body, piece.part.kind, (x, y, z), piece.pose, piece.yields)


def bands(
    robot: Robot, bodies: Bodies, held: Mapping[str, Held], without: Collection[str] = ()
) -> tuple[tuple[float, float, float], ...]:
    """(z_low, z_high, radius) [m] around the vertical through the base, for each solid link and held body.

    Links that a joint of ``without`` moves are left out, with what they hold. The robot must be shown with its base at
    the origin of the map.
    """
    left_out = frozenset[int]().union(*(robot.moved_by(name) for name in without))
    lower, upper = robot.boxes()
    found = [
        (float(lower[number, 2]), float(upper[number, 2]), robot.spread(number))
        for number in range(len(robot.solid))
        if number not in left_out
    ]
    for name, grip in held.items():
        if not robot.carrier(grip.link) & left_out:
            low, high = bodies.box_of(name)
            radius = float(np.hypot(*np.maximum(np.abs(low[:2]), np.abs(high[:2]))))
            found.append((float(low[2]), float(high[2]), radius))
    return tuple(found)


def outlines(robot: Robot, without: Collection[str] = ()) -> tuple[tuple[float, float, Array], ...]:
    """z_low, z_high [m] and convex outline from above (n, 2) of each solid link, as :func:`bands` without what is held.

    An outline holds no more than the link does.
    """
    left_out = frozenset[int]().union(*(robot.moved_by(name) for name in without))
    lower, upper = robot.boxes()
    numbers = [number for number in range(len(robot.solid)) if number not in left_out]
    return tuple(
        (float(lower[number, 2]), float(upper[number, 2]), hull(points[:, :2]))
        for number, points in zip(numbers, robot.points(numbers), strict=True)
    )
