"""Flats: two to five rooms that grow from one another, with or without a hall, joined by doorways at drawn places.

A room is put beside one that is there already, and a doorway cut where they share a wall: the rooms of a flat are a
tree, so that there is one way between two of them. Doorways of a room are hardly ever opposite each other.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from planlang.geometry import Pose
from tests.benchmarks.homes import sizes
from tests.benchmarks.homes.furnishing import TRIES, Home, NoRoom, Rectangle, Thing

KINDS = ("LivingRoom", "Kitchen", "BedRoom", "DiningRoom")
HALL = "Hall"
"""Class of halls; their names begin so, in small letters."""
FROM_HALL = 0.7
"""Share of rooms that lie at the hall of a flat that has one."""
PASSING = 0.9
"""Floor on both sides of a doorway where nothing stands [m]."""
ALONG_HALL = 0.35
"""Distance of a person in a hall from its ends, at least [m]."""


@dataclass
class Flat:
    """The rooms of a home in the order in which they were put, and what joins them."""

    home: Home
    rooms: list[str] = field(default_factory=list)
    parents: dict[str, tuple[str, str]] = field(default_factory=dict)
    """Room -> the room that it was put beside, and the doorway between them."""

    @property
    def farthest(self) -> str:
        """The room with most doorways on the way from the first."""
        return max((room for room in self.rooms if room not in self.halls), key=lambda room: len(self.ways(room)))

    @property
    def halls(self) -> list[str]:
        """The halls."""
        return [room for room in self.rooms if room.startswith(HALL.lower())]

    def beyond(self, hall: str) -> str:
        """The room with most doorways on the way from the first that leads through a hall; raises NoRoom."""
        behind = [room for room in self.rooms if room != hall and self.parents[hall][1] in self.ways(room)]
        if not behind:
            raise NoRoom(f"no room lies behind {hall}")
        return max(behind, key=lambda room: len(self.ways(room)))

    def ways(self, room: str, begin: str = "") -> list[str]:
        """Return the doorways on the way to a room, from the first or another."""
        one, two = (self._upwards(name) for name in (begin or self.rooms[0], room))
        return [*(door for door in one if door not in two), *reversed([door for door in two if door not in one])]

    def _upwards(self, room: str) -> list[str]:
        found = []
        while room in self.parents:
            room, doorway = self.parents[room]
            found.append(doorway)
        return found


def flat(home: Home, rooms: int, *, hall: bool) -> Flat:
    """Build a flat of so many rooms, with its hall if there is one; raises NoRoom if they find no place.

    The robot begins in the first, which is never the hall; furniture goes there until another is entered.
    """
    made = Flat(home)
    home.classes["LivingRoom"] = home.classes[HALL] = "knowrob:RoomInAConstruction"
    home.inside = home.size_of(sizes.ROOM)
    kinds = [home.one_of(KINDS) for _ in range(rooms)]
    if hall:
        kinds[1] = HALL
    _build(made, kinds[0], Rectangle(0.0, 0.0, 0.0, (home.inside[0] / 2, home.inside[1] / 2)))
    for kind in kinds[1:]:
        _put_beside(made, kind)
    home.enter(made.rooms[0])
    return made


def _build(made: Flat, kind: str, area: Rectangle) -> str:
    home, height = made.home, made.home.inside[2]
    name = home.named(kind.lower())
    home.rooms[name] = area
    size = (2 * area.half[0], 2 * area.half[1], height)
    made.rooms.append(home.add(Thing(name, kind, Pose((area.x, area.y, height / 2)), size)))
    return name


def _put_beside(made: Flat, kind: str) -> None:
    """Put a room beside another, and a doorway between them; raises NoRoom."""
    home = made.home
    for _ in range(TRIES):
        halls = [] if kind == HALL else made.halls
        parent = halls[0] if halls and home.chance(FROM_HALL) else home.one_of(made.rooms)
        at, extents = home.rooms[parent], home.size_of(sizes.HALL if kind == HALL else sizes.ROOM)[:2]
        half = (extents[0] / 2, extents[1] / 2) if home.chance(0.5) else (extents[1] / 2, extents[0] / 2)
        axis, sign = int(home.rng.integers(2)), 1.0 if home.chance(0.5) else -1.0
        width = home.between(sizes.NARROW if home.chance(sizes.NARROW_ONES) else sizes.DOORWAY)
        slack = at.half[1 - axis] + half[1 - axis] - width - 2 * sizes.POST
        shift = home.between((-slack, slack))
        middle = [at.x, at.y]
        middle[axis] += sign * (at.half[axis] + sizes.PARTITION + half[axis])
        middle[1 - axis] += shift
        area = Rectangle(middle[0], middle[1], 0.0, half)
        walled = Rectangle(area.x, area.y, 0.0, _grown(half, sizes.PARTITION - 1e-6))
        if any(walled.overlaps(other) for other in home.rooms.values()):
            continue
        low = max(-at.half[1 - axis], shift - half[1 - axis]) + sizes.POST + width / 2
        high = min(at.half[1 - axis], shift + half[1 - axis]) - sizes.POST - width / 2
        along = home.between((low, high)) if high > low else (low + high) / 2
        place = [at.x, at.y]
        place[axis] += sign * (at.half[axis] + sizes.PARTITION / 2)
        place[1 - axis] += along
        doorway = _doorway(home, (place[0], place[1]), axis, width)
        made.parents[_build(made, kind, area)] = parent, doorway
        return
    raise NoRoom(f"no wall has room for a {kind}")


def _doorway(home: Home, at: tuple[float, float], axis: int, width: float) -> str:
    """Cut a doorway of a width into the wall whose normal is an axis, and keep the floor on both sides free."""
    yaw, height = axis * math.pi / 2, home.between(sizes.DOOR_HEIGHT)
    home.kept_free.append(Rectangle(at[0], at[1], yaw, (PASSING, width / 2)))
    pose = Pose.planar(at[0], at[1], yaw, height / 2)
    return home.add(Thing(home.named("doorway"), "Doorway", pose, (sizes.PARTITION, width, height)))


def _grown(half: tuple[float, float], by: float) -> tuple[float, float]:
    return half[0] + by, half[1] + by


def person_in_hall(home: Home, hall: str) -> str:
    """Let somebody stand in a hall, at a wall or in the middle, and look along it or across; raises NoRoom.

    Nobody stands about before a doorway.
    """
    area = home.rooms[hall]
    home.enter(hall)
    for _ in range(TRIES):
        yaw = int(home.rng.integers(4)) * math.pi / 2
        depth, width = (0.3, 0.5) if round(yaw / (math.pi / 2)) % 2 == 0 else (0.5, 0.3)
        slack = np.array(area.half) - (depth / 2, width / 2)
        place = [home.between((-float(one), float(one))) for one in slack]
        along = 0 if area.half[0] > area.half[1] else 1
        if home.chance(0.7):
            place[1 - along] = math.copysign(float(slack[1 - along]) - 0.02, place[1 - along])
        if area.half[along] - abs(place[along]) < ALONG_HALL:
            continue
        footprint = Rectangle(area.x + place[0], area.y + place[1], yaw, (0.15, 0.25))
        if any(footprint.overlaps(other) for other in (*home.floor, *home.kept_free)):
            continue
        home.floor.append(footprint)
        size = (0.3, 0.5, home.between(sizes.STANDING))
        return home.add(Thing("person1", "Person", Pose.planar(footprint.x, footprint.y, yaw, size[2] / 2), size))
    raise NoRoom(f"{hall} has no room for a person")
