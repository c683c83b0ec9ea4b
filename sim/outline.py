"""How much room things take, for planning the base's way: boxes around bodies, bands and outlines of the robot."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.outline import outline_of
from sim.bodies import Bodies
from sim.contact import Held
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


Band = tuple[float, float, float]
"""z_low, z_high and radius about the vertical through the base [m]."""
Outline = tuple[float, float, Array]
"""z_low, z_high [m] and a convex polygon (n, 2), counter-clockwise, in the frame of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A robot in a posture from above, without some links, one entry for each solid link."""

    bands: tuple[Band, ...]
    outlines: tuple[Outline, ...]
    """They hold no more than the links do."""


MOST_SHAPES = 64
"""Postures of which the shape is kept."""
_shapes: dict[object, Shape] = {}


def shape_of(robot: Robot, joints: Mapping[str, float], without: Collection[str], show: Callable[[], None]) -> Shape:
    """A robot at joint values, without links that a joint of ``without`` moves; worked out once in a process.

    ``show`` is called if it has to be: it shows the robot there, with its base at the origin of the map.
    """
    posture = tuple((name, value) for name, value in joints.items() if name not in without)
    key = robot.key, tuple(sorted(without)), posture
    if key not in _shapes:
        show()
        while len(_shapes) >= MOST_SHAPES:
            del _shapes[next(iter(_shapes))]
        _shapes[key] = _shown(robot, frozenset[int]().union(*(robot.moved_by(name) for name in without)))
    return _shapes[key]


def _shown(robot: Robot, left_out: frozenset[int]) -> Shape:
    numbers = [number for number in range(len(robot.solid)) if number not in left_out]
    lower, upper = (corners[:, 2].round(9).tolist() for corners in robot.boxes_of(numbers))
    radii = [round(robot.spread(number), 9) for number in numbers]
    polygons = [outline_of(points[:, :2].round(9)) for points in robot.points(numbers)]
    return Shape(tuple(zip(lower, upper, radii, strict=True)), tuple(zip(lower, upper, polygons, strict=True)))


def held_bands(robot: Robot, bodies: Bodies, held: Mapping[str, Held], without: Collection[str]) -> Iterator[Band]:
    """Those of held bodies, without what links hold that a joint of ``without`` moves.

    The robot must be shown with its base at the origin of the map.
    """
    left_out = frozenset[int]().union(*(robot.moved_by(name) for name in without))
    for name, grip in held.items():
        if not robot.carrier(grip.link) & left_out:
            low, high = bodies.box_of(name)
            radius = float(np.hypot(*np.maximum(np.abs(low[:2]), np.abs(high[:2]))))
            yield float(low[2]), float(high[2]), radius
