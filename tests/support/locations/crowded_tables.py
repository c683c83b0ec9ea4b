"""Tables crowded with glasses, bowls and boxes among which the bottle stands, one for each seed."""

from __future__ import annotations

import math

from planlang.designators import Location, a_location
from planlang.geometry import Pose
from sim import Body
from tests.support.locations.rooms import PLACE, THE_BOTTLE, Furnisher, Room, box

KIND = "crowded table"
ASKED: Location = a_location(in_reach_of=THE_BOTTLE, grasp="side")
APART = 0.012
"""Least distance between things on the table [m]."""
TRIES = 40


def crowded_table(seed: int) -> Room:
    """Return a room with a table, some things on it, boxes on the floor, and at times a wall of shelves beside it."""
    room = Furnisher(KIND, seed)
    between = room.between
    length, width, height = between(0.7, 1.5), between(0.6, 0.9), between(0.6, 0.85)
    x, y, yaw = between(-0.6, 0.6), between(-0.4, 0.4), between(-math.pi, math.pi)
    table = room.add(box("table", (length, width, 0.04), (x, y, height - 0.02), yaw))
    for number, (sx, sy) in enumerate(((1, 1), (1, -1), (-1, 1), (-1, -1))):
        at = table.pose @ Pose((sx * (length / 2 - 0.05), sy * (width / 2 - 0.05), -height / 2 + 0.01))
        room.add(Body(f"leg{number}", at, (0.05, 0.05, height - 0.06), type="Thing"))
    placed = [(between(-1, 1) * (length / 2 - 0.08), between(-1, 1) * (width / 2 - 0.08), 0.033)]
    room.put_bottle(table.pose @ Pose((placed[0][0], placed[0][1], 0.12)))
    for number in range(int(room.rng.integers(6, 17))):
        _put_down(room, table, placed, number)
    if room.rng.uniform() < 0.4:
        side = table.pose @ Pose((0.0, width / 2 + between(0.05, 0.4), 0.0))
        room.add(box("shelves", (length, 0.3, 1.8), (side.position[0], side.position[1], 0.9), yaw))
    room.clutter(int(room.rng.integers(0, 7)))
    return room.room()


def _put_down(room: Furnisher, table: Body, placed: list[tuple[float, float, float]], number: int) -> None:
    """Put one more thing near the bottle or anywhere on the table, where it is clear of the others."""
    length, width, _ = table.size
    across, high = room.between(0.05, 0.11), room.between(0.05, 0.25)
    round_ = room.rng.uniform() < 0.7
    radius = across / 2 if round_ else across / math.sqrt(2)
    for _ in range(TRIES):
        if room.rng.uniform() < 0.6:
            away, turn = room.between(0.07, 0.25), room.between(-math.pi, math.pi)
            px, py = placed[0][0] + away * math.cos(turn), placed[0][1] + away * math.sin(turn)
        else:
            px, py = room.between(-0.5, 0.5) * length, room.between(-0.5, 0.5) * width
        inside = abs(px) + radius < length / 2 and abs(py) + radius < width / 2
        if inside and all(math.dist((px, py), one[:2]) > radius + one[2] + APART for one in placed):
            placed.append((px, py, radius))
            at = table.pose @ Pose((px, py, 0.02 + high / 2))
            size, shape = (across, across, high), "cylinder" if round_ else "box"
            name, kind = f"glass{number}", "DrinkingGlass" if round_ else "Thing"
            room.add(Body(name, at, size, shape, PLACE + name, kind, movable=True))
            return
