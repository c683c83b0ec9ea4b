"""Things that are fetched from refrigerators and cabinets, which are opened before and closed again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.shapes import SolidKind
from sim.truth import held_by
from tests.support.scenarios import Goal, Scenario, Watched

SHUT = math.radians(3.0)
"""Largest angle of a door that was closed [rad]."""
DEEP = 0.003
"""Depth from which on two boxes touch [m]."""
STRAIGHT = Pose((0.0, 0.0, 0.0))
EIGHTH = Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(math.pi / 8), math.cos(math.pi / 8)))
"""A turn about z by 45 degrees."""
EVERY = 5
"""Steps of 1/30 s between two looks."""


Box = tuple[Array, Array, Array]
"""Centre (3,), axes (3, 3) and half extents (3,)."""


def boxes(watched: Watched, name: str) -> list[tuple[Box, ...]]:
    """Return for each part of a body boxes of which it is the intersection: for what is round two that are turned."""
    body, found = watched.world.pose(name), []
    for part, offset in watched.world.pieces(name):
        pose = body @ offset
        turns = (STRAIGHT,) if part.kind is SolidKind.BOX else (STRAIGHT, EIGHTH)
        found.append(
            tuple((np.array(pose.position), (pose @ turn).rotation, np.asarray(part.size) / 2) for turn in turns)
        )
    return found


def deep(one: tuple[Box, ...], other: tuple[Box, ...]) -> bool:
    """Return whether two parts touch."""
    return all(depth(a, b) > DEEP for a, b in product(one, other))


def depth(one: Box, other: Box) -> float:
    """Return how deep a box is in another [m], negative when they are apart: the separating axis theorem."""
    arrow = other[0] - one[0]
    if (away := float(np.linalg.norm(arrow)) - sum(float(np.linalg.norm(box[2])) for box in (one, other))) > 0:
        return -away
    axes = [*one[1].T, *other[1].T, *(np.cross(a, b) for a, b in product(one[1].T, other[1].T))]
    least = math.inf
    for axis in axes:
        norm = float(np.linalg.norm(axis))
        if norm < 1e-6:
            continue
        reach = sum(float(np.abs(box[1].T @ axis) @ box[2]) for box in (one, other))
        least = min(least, (reach - abs(float(axis @ arrow))) / norm)
    return least


def touching(*names: str, but: Sequence[str] = ()) -> Callable[[Watched], None]:
    """Return a watcher that notes which bodies some bodies are in, and were not in from the beginning."""

    def watch(watched: Watched) -> None:
        counted = watched.notes["steps"] = int(str(watched.notes.get("steps", -1))) + 1
        if counted % EVERY:
            return
        mine = {name: boxes(watched, name) for name in names}
        others = {name: boxes(watched, name) for name in watched.world.names() if name not in (*names, *but)}
        pairs = {
            (name, other)
            for name, other in product(mine, others)
            if any(deep(a, b) for a, b in product(mine[name], others[other]))
        }
        watched.notes.setdefault("before", pairs)
        touched = watched.notes.setdefault("touched", set())
        before = watched.notes["before"]
        assert isinstance(touched, set)
        assert isinstance(before, set)
        touched |= pairs - before
        touched |= {(c.part, c.body) for c in watched.world.contacts() if c.body in names or c.part in names}

    return watch


def fetched(name: str, door: str) -> Goal:
    """Return the goal that the robot holds a thing from behind a door that is closed, and neither touched others."""

    def goal(watched: Watched) -> Iterator[str]:
        if (holder := held_by(watched.world, name)) != "robot":
            yield f"{name} is held by {holder}"
        if (angle := watched.world.joint(door)) > SHUT:
            yield f"{door} is open by {math.degrees(angle):.1f} degrees"
        touched = watched.notes.get("touched")
        if touched:
            yield f"touched: {touched}"

    return goal


SCENARIOS = [
    Scenario(
        "get_from_refrigerator",
        (
            *("corpus/recipes/GetFromRefrigerator@2010-11.owl", "--accept", "R042", "--robot", "pr2"),
            *("--environment", "corpus/environments/IAI_kitchen@iai_maps.urdf", "--environment", "iai_kitchen_milk"),
            *("--set", "PickingUpAnObject.objectActedOn=milk1"),
        ),
        fetched("milk1", "iai_fridge_door"),
        (touching("milk1", "iai_fridge_door"),),
        seconds=20.0,
    ),
    *(
        Scenario(
            f"fetch_from_cabinet with {robot}",
            ("fetch_from_cabinet", "--robot", robot),
            fetched("bottle1", "cabinet_door1"),
            (touching("bottle1", "cabinet_door1"),),
            seconds=seconds,
        )
        for robot, seconds in (("amigo", 8.0), ("pr2", 12.0))
    ),
]
