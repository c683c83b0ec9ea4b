"""Rooms in which the bottle can be reached from nowhere, each for one reason that is known from how it is built."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping

from planlang.designators import Location, a_location
from planlang.geometry import Pose
from sim import Body
from tests.support.locations.rooms import PLACE, THE_BOTTLE, Furnisher, Room, box

HIGHEST = 2.3
"""Height of a bottle that no robot here reaches [m]."""


def _too_high(room: Furnisher) -> None:
    """On top of a pole."""
    x, y = room.between(-1.0, 1.0), room.between(-1.0, 1.0)
    room.add(box("pole", (0.1, 0.1, HIGHEST - 0.1), (x, y, HIGHEST / 2 - 0.05)))
    room.put_bottle(Pose((x, y, HIGHEST)))
    room.clutter(3)


def _caged(room: Furnisher) -> None:
    """On a post, between bars that can be looked through, under a lid."""
    x, y = room.between(-1.0, 1.0), room.between(-1.0, 1.0)
    room.add(box("post", (0.24, 0.24, 0.7), (x, y, 0.35)))
    room.put_bottle(Pose((x, y, 0.8)))
    for index in range(8):
        turn = index * math.pi / 4
        at = (x + 0.1 * math.cos(turn), y + 0.1 * math.sin(turn), 0.85)
        room.add(box(f"bar{index}", (0.015, 0.015, 0.3), at, turn))
    room.add(box("lid", (0.24, 0.24, 0.02), (x, y, 1.01)))
    room.clutter(3)


def _moat(room: Furnisher) -> None:
    """On a table in the middle of a pallet on which nothing can drive."""
    x, y = room.between(-0.5, 0.5), room.between(-0.3, 0.3)
    room.add(box("pallet", (4.2, 4.0, 0.15), (x, y, 0.075)))
    room.add(box("table", (0.5, 0.5, 0.55), (x, y, 0.425)))
    room.put_bottle(Pose((x, y, 0.8)))


def _too_wide(room: Furnisher) -> None:
    """A drum that no hand here gets its fingers around, wide in all directions but movable."""
    x, y = room.between(-1.0, 1.0), room.between(-1.0, 1.0)
    room.add(box("table", (0.8, 0.8, 0.7), (x, y, 0.35)))
    size = (0.119, 0.119, 0.2)
    room.add(Body("bottle", Pose((x, y, 0.8)), size, "cylinder", PLACE + "bottle", "DrinkingBottle", movable=True))
    room.clutter(3)


def _hidden(room: Furnisher) -> None:
    """Behind screens on all four sides, as high as the room: nothing sees it."""
    x, y = room.between(-1.0, 1.0), room.between(-1.0, 1.0)
    room.add(box("table", (0.6, 0.6, 0.7), (x, y, 0.35)))
    room.put_bottle(Pose((x, y, 0.8)))
    for index, (dx, dy, size) in enumerate(
        ((0.45, 0, (0.04, 0.94, 2.6)), (-0.45, 0, (0.04, 0.94, 2.6)), (0, 0.45, (0.86, 0.04, 2.6)),
         (0, -0.45, (0.86, 0.04, 2.6)))
    ):  # fmt: skip
        room.add(box(f"screen{index}", size, (x + dx, y + dy, 1.3)))


REASONS: Mapping[str, tuple[Callable[[Furnisher], None], str, Location]] = {
    "too high": (_too_high, "out of reach", a_location(in_reach_of=THE_BOTTLE)),
    "in a cage": (_caged, "in collision", a_location(in_reach_of=THE_BOTTLE)),
    "no floor before it": (_moat, "no room for the base", a_location(in_reach_of=THE_BOTTLE)),
    "too wide": (_too_wide, "too wide for the gripper", a_location(in_reach_of=THE_BOTTLE)),
    "behind screens": (_hidden, "not visible", a_location(visible_from=THE_BOTTLE)),
}
"""How it is built -> what furnishes it, the reason that an answer has to give first, what is asked."""


def infeasible_rooms(number: int) -> Iterator[tuple[Room, Location]]:
    """Rooms of every reason in turn, with what is asked in each."""
    for seed in range(number):
        for kind, (furnish, reason, location) in REASONS.items():
            furnisher = Furnisher(kind, seed)
            furnish(furnisher)
            yield furnisher.room(reason), location
