"""Flats drawn by a seed: rooms in a row, around a hall or in an L, with doorways that are not in line."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace

import numpy as np

from executive.maps import MapObject, SemanticMap, scene_of
from executive.modules.platform import Platform
from executive.robots import Robot
from executive.runs.assembly import platform_of, world_at_start
from planlang.geometry import Pose
from sim import PyBulletWorld
from tests.support.leaves import robot_of, thing, vocabulary

WALL, HIGH = 0.1, 2.6
"""Thickness of the walls between rooms, and height of the rooms [m]."""
MUG = (0.08, 0.08, 0.1)
"""Size of what is carried [m]."""


@dataclass(frozen=True, slots=True)
class Flat:
    """Rooms with doorways, where a robot begins, and a place in the last room."""

    name: str
    things: tuple[MapObject, ...]
    widths: tuple[float, ...]
    """Widths of the doorways [m]."""
    start: tuple[float, float, float]
    goal: tuple[float, float, float]


def room_of(name: str, low: tuple[float, float], high: tuple[float, float]) -> MapObject:
    """A room between two corners."""
    (x0, y0), (x1, y1) = low, high
    middle = Pose(((x0 + x1) / 2, (y0 + y1) / 2, HIGH / 2))
    return thing(name, "Kitchen", middle, (x1 - x0, y1 - y0, HIGH))


def doorway(name: str, x: float, y: float, width: float, along: str = "y") -> MapObject:
    """A doorway in a wall across x, or across y."""
    size = (WALL, width, 2.0) if along == "y" else (width, WALL, 2.0)
    return thing(name, "Doorway", Pose((x, y, 1.0)), size)


def _middle(room: MapObject) -> tuple[float, float]:
    assert room.pose is not None
    return room.pose.position[0], room.pose.position[1]


def flat(seed: int, widths: tuple[float, float] = (0.8, 1.4)) -> Flat:
    """Draw a flat; ``widths``: least and largest width of its doorways [m]."""
    rng = np.random.default_rng([0xF1A7, seed])
    kind = ("row", "hall", "corner")[seed % 3]

    def wide() -> float:
        return round(float(rng.uniform(*widths)), 2)

    things, gaps = (_row, _hall, _corner)[seed % 3](rng, wide)
    rooms = [one for one in things if one.name.startswith("room")]
    ends = []
    for room in (rooms[0], rooms[-1]):
        x, y = _middle(room)
        ends.append((round(x, 2), round(y, 2), round(float(rng.uniform(-3.0, 3.0)), 2)))
    return Flat(f"{kind} {seed}", tuple(things), tuple(gaps), ends[0], ends[1])


def _row(rng: np.random.Generator, wide: Callable[[], float]) -> tuple[list[MapObject], list[float]]:
    """Two to four rooms behind each other; neighbouring doorways are 0.5 to 2.4 m apart, across the way."""
    things, gaps, x, at = [], [], 0.0, float(rng.uniform(-1.2, 1.2))
    for number in range(int(rng.integers(2, 5))):
        deep = round(float(rng.uniform(2.4, 4.0)), 2)
        if number:
            gaps.append(wide())
            things.append(doorway(f"doorway{number}", x - WALL / 2, round(at, 2), gaps[-1]))
            shift = float(rng.uniform(0.5, 2.4))
            at = at - shift if at > 0.0 else at + shift
            at = min(max(at, -1.2), 1.2)
        things.append(room_of(f"room{number}", (x, -2.0), (x + deep, 2.0)))
        x += deep + WALL
    if len(things) > 3:  # a table in the middle of the second room
        x, y = _middle(things[2])
        things.append(thing("table", "KitchenTable", Pose((x, y, 0.37)), (0.5, 0.9, 0.74)))
    return things, gaps


def _hall(rng: np.random.Generator, wide: Callable[[], float]) -> tuple[list[MapObject], list[float]]:
    """Two rooms on one side of a hall, or on both."""
    deep, gaps = round(float(rng.uniform(1.2, 1.8)), 2), [wide(), wide()]
    side = float(rng.choice((-1.0, 1.0)))
    things = [
        room_of("room0", (-3.2, -3.6), (-0.05, 0.0)),
        room_of("hall", (-3.2, WALL), (3.2, deep)),
        room_of("room1", (0.05, -3.6), (3.2, 0.0)) if side < 0 else room_of("room1", (-0.2, deep + WALL), (3.2, 4.6)),
    ]
    first, second = float(rng.uniform(-2.5, -0.75)), float(rng.uniform(0.75, 2.5))
    things.append(doorway("doorway1", round(first, 2), WALL / 2, gaps[0], "x"))
    there = WALL / 2 if side < 0 else deep + WALL / 2
    things.append(doorway("doorway2", round(second, 2), there, gaps[1], "x"))
    return things, gaps


def _corner(rng: np.random.Generator, wide: Callable[[], float]) -> tuple[list[MapObject], list[float]]:
    """A hall around a corner between two rooms."""
    deep, gaps = round(float(rng.uniform(1.2, 1.8)), 2), [wide(), wide(), wide()]
    things = [
        room_of("room0", (-3.4, -1.6), (0.0, 1.6)),
        room_of("hall1", (WALL, -1.2), (4.0, -1.2 + deep)),
        room_of("hall2", (4.0 - deep, deep - 1.2 + WALL), (4.0, 3.2)),
        room_of("room1", (0.6, 3.2 + WALL), (4.6, 6.4)),
    ]
    things.append(doorway("doorway1", WALL / 2, round(deep / 2 - 1.2, 2), gaps[0]))
    things.append(doorway("doorway2", round(4.0 - deep / 2, 2), deep - 1.2 + WALL / 2, min(gaps[1], deep), "x"))
    things.append(doorway("doorway3", round(4.0 - deep / 2, 2), 3.2 + WALL / 2, min(gaps[2], deep), "x"))
    return things, gaps


def in_flat(stack: ExitStack, drawn: Flat, robot: str | Robot, *, carries: bool = False) -> Platform:
    """A robot in the posture in which it drives, with a mug in its first hand if it ``carries`` one."""
    bound = robot_of(robot) if isinstance(robot, str) else robot
    things = drawn.things
    if carries:
        x, y, _ = drawn.start  # it is put into the hand below
        things = (*things, thing("mug", "DrinkingMug", Pose((x - 1.0, y - 1.0, MUG[2] / 2)), MUG))
    semantic_map = SemanticMap(None, vocabulary(), things, ())
    scene = replace(scene_of(semantic_map), start=drawn.start)
    believed = world_at_start(scene, bound, drawn.start, stack)
    truth = PyBulletWorld(scene, bound.body())
    stack.callback(truth.close)
    platform = platform_of(bound, semantic_map, truth, believed, 0)
    if carries:
        arm = bound.arms[0]
        there = truth.link_pose(arm.tip)
        truth.set_pose("mug", Pose.planar(*there.position[:2], there.yaw, there.position[2]))
        offset = there.inverse() @ truth.pose("mug")
        truth.attach(arm.tip, "mug")
        platform.belief.grasped("mug", arm.name, arm.tip, offset)
    platform.observe()
    return platform
