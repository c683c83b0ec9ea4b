"""Doors in the doorways of a flat: hinged on either side, opening into a room and not into a hall, or sliding."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from planlang.geometry import Pose
from tests.benchmarks.homes import sizes
from tests.benchmarks.homes.flats import Flat
from tests.benchmarks.homes.furnishing import Home, Rectangle, Thing

LEAF, PLAY = 0.04, 0.02
"""Thickness of a leaf, and by how much it is smaller than its doorway [m]."""
SLIDER, OVERLAP, BEFORE = 0.03, 0.06, 0.02
"""Thickness of a leaf that slides, by how much it is wider than its doorway, and its distance from the wall [m]."""
GRIP, CLEAR = 0.1, 0.04
"""Distance of a handle's middle from the edge of its leaf, and from its face [m]."""


@dataclass(frozen=True)
class RoomDoor:
    """A door between two rooms."""

    name: str
    doorway: str
    slides: bool


def room_door(made: Flat, doorway: str, *, sliding: bool, is_open: bool = False) -> RoomDoor:
    """Hang a door into a doorway, closed or open; it is hinged where no wall beside has room for one that slides.

    It is hung before furniture is put: what it sweeps over is kept free.
    """
    home, frame = made.home, made.home.things[doorway]
    assert frame.pose is not None
    assert frame.size is not None
    _, width, height = frame.size
    name = home.named("door")
    ways = [way for way in itertools.product((1.0, -1.0), repeat=2) if _slides_to(home, frame.pose, width, *way)]
    if sliding and ways:
        side, end = ways[int(home.rng.integers(len(ways)))]
        home.kept_free.append(_beside(frame.pose, width, side, end))
        size = (SLIDER, width + OVERLAP, height)
        pose = frame.pose @ Pose((side * (sizes.PARTITION / 2 + BEFORE + SLIDER / 2), 0.0, 0.0))
        rail = home.add(Thing(home.named("rail"), "PrismaticJoint", None, None))
        _hang(home, name, pose, size, -end, (rail,), (0.02, 0.02, 0.3), f"knowrob:jointPosition {width:.3f}" * is_open)
        return RoomDoor(name, doorway, True)
    faces = [
        face for face in (1.0, -1.0) if _room_at(made, frame.pose @ Pose((face * 0.5, 0.0, 0.0))) not in made.halls
    ]
    face = faces[int(home.rng.integers(len(faces)))]
    pose = frame.pose @ Pose.planar(0.0, 0.0, 0.0 if face > 0 else math.pi)
    swept = frame.pose @ Pose((face * width / 2, 0.0, 0.0))
    home.kept_free.append(Rectangle(*swept.position[:2], frame.pose.yaw, ((width + 0.1) / 2, width / 2)))
    side = 1.0 if home.chance(0.5) else -1.0
    size = (LEAF, width - PLAY, height - PLAY)
    _hang(home, name, pose, size, side, (), (0.02, 0.12, 0.02), "knowrob:jointPosition 1.57" * is_open)
    return RoomDoor(name, doorway, False)


def _hang(
    home: Home,
    name: str,
    pose: Pose,
    size: tuple[float, float, float],
    side: float,
    parts: tuple[str, ...],
    bar: tuple[float, float, float],
    position: str,
) -> None:
    """Add a leaf with a handle on both faces, near the edge on a ``side``."""
    handles = {f"handle{number}_of_{name}": face for number, face in ((1, 1.0), (2, -1.0))}
    home.add(Thing(name, "Door", pose, size, (*handles, *parts), (position,) if position else ()))
    z = home.between(sizes.DOOR_HANDLE) - pose.position[2]
    for handle, face in handles.items():
        at = Pose((face * (size[0] / 2 + CLEAR), side * (size[1] / 2 - GRIP), z))
        home.add(Thing(handle, "Handle", pose @ at, bar))


def _room_at(made: Flat, place: Pose) -> str:
    """Return the room in which a place is."""
    point = np.array([place.position[:2]])
    return next(name for name, area in made.home.rooms.items() if area.distances(point)[0] == 0)


def _beside(doorway: Pose, width: float, side: float, end: float) -> Rectangle:
    """Return the floor over which a sliding leaf goes, before the wall beside its doorway."""
    place = doorway @ Pose((side * (sizes.PARTITION / 2 + 0.1), end * (width + OVERLAP), 0.0))
    return Rectangle(place.position[0], place.position[1], doorway.yaw, (0.1, (width + OVERLAP) / 2))


def _slides_to(home: Home, doorway: Pose, width: float, side: float, end: float) -> bool:
    """Return True if the wall on an ``end`` of a doorway is long enough for the leaf, on a ``side`` of the wall."""
    swept = _beside(doorway, width, side, end)
    corners = swept.corners()
    is_in = any(bool((area.distances(corners) < 1e-6).all()) for area in home.rooms.values())
    return is_in and not any(swept.overlaps(other) for other in home.kept_free)
