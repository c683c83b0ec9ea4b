"""Things that are looked for in several places, and rooms that are explored."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from executive.maps import SemanticMap, read_map
from planlang.geometry import Pose
from planlang.ontology import load
from sim.likeness import is_like
from sim.scene import BodyShape
from tests.support.exploring import visible_at_all, watch_pictures
from tests.support.scenarios import Goal, Scenario, Watched

UPLOADED = Path("map.omn")
"""The file to which runs upload their maps, in the folder of the run."""
SEARCH = "corpus/recipes/object-search-recipe@hydro.owl"


def uploaded() -> SemanticMap:
    """Return the map that was uploaded last."""
    return read_map(load(UPLOADED))


def found(name: str) -> Goal:
    """Return the goal that the uploaded map has a thing within 5 cm of where it is."""

    def goal(watched: Watched) -> Iterator[str]:
        thing = uploaded().find(name) if UPLOADED.exists() else None
        if thing is None or thing.pose is None:
            yield f"{name} is not in the uploaded map"
        elif (away := thing.pose.distance(watched.world.pose(name))) > 0.05:
            yield f"{name} is believed {away:.3f} m from where it is"

    return goal


def explored(origin: tuple[float, float, float] | None) -> Goal:
    """Return the goal of an exploration: what can be seen was, the map is true, the robot is back at the origin.

    The origin is that of the map; for a room that it lies outside of (None) it is where the robot began.
    """

    def goal(watched: Watched) -> Iterator[str]:
        seen, far = watched.notes.get("seen", set()), watched.world.robot.body.camera.far
        assert isinstance(seen, set)
        possible, names = visible_at_all(watched.world, far)
        share = len(seen & possible) / len(possible)
        watched.notes["share"] = share
        if share < 0.9:
            yield f"{share:.3f} of the surfaces that can be seen were seen"
        yield from _untrue(watched, names)
        base, there = watched.world.configuration().base, origin or watched.base
        if math.dist(base[:2], there[:2]) > 0.02 or abs(math.remainder(base[2] - there[2], 2 * math.pi)) > 0.02:
            yield "the robot is at {:.3f}, {:.3f}, {:.3f}".format(*base)

    return goal


def _untrue(watched: Watched, visible: set[str]) -> Iterator[str]:
    """Yield what of the uploaded map is not so, and what it lacks of what can be seen."""
    if not UPLOADED.exists():
        yield "no map was uploaded"
        return
    told = {one.name: one for one in uploaded().objects if one.size is not None}
    real = {body.name: body for body in watched.world.scene.bodies if body.shape is not BodyShape.MARKER}
    yield from (f"{name} is invented" for name in told.keys() - real.keys())
    taken = set[str]()
    for name, body in real.items():
        pose, known = watched.world.pose(name), told.get(name)
        if known is None or known.pose is None:
            if name in visible:
                yield f"{name} is not in the uploaded map"
            continue
        alike = (one for one, other in real.items() if is_like(other, body))
        free = (one for one in alike if one not in taken and _is_at(known.pose, watched.world.pose(one)))
        if (found := next(free, None)) is not None:
            taken.add(found)
        else:
            yield f"{name} is {known.pose.distance(pose):.3f} m and {_angle(known.pose, pose):.3f} rad from where it is"


def _is_at(one: Pose, other: Pose) -> bool:
    return one.distance(other) <= 0.05 and _angle(one, other) <= math.radians(10)


def _angle(one: Pose, other: Pose) -> float:
    turned = one.matrix()[:3, :3].T @ other.matrix()[:3, :3]
    return math.acos(max(-1.0, min(1.0, (float(np.trace(turned)) - 1) / 2)))


EXPLORATION = "corpus/recipes/exploration-recipe@hydro.owl"


def _exploring(name: str, environment: str, origin: tuple[float, float, float] | None = (0.0, 0.0, 0.0)) -> Scenario:
    arguments = (EXPLORATION, "--robot", "amigo", "--environment", environment, "--unknown", "all")
    whole = (*arguments, "--upload", str(UPLOADED))
    return Scenario(f"exploration of {name}", whole, explored(origin), (watch_pictures,), seconds=40.0)


SCENARIOS = [
    Scenario(
        "object-search",
        (SEARCH, "--robot", "amigo", "--environment", "day_room", "--unknown", "bottle1", "--upload", str(UPLOADED)),
        found("bottle1"),
    ),
    _exploring("day_room", "day_room"),
    _exploring("ward_office", "ward_office"),
    _exploring(
        "ias_hospital_room_with_objects",
        "corpus/environments/ias_hospital_room_with_objects@re_stack.owl.in",
        None,
    ),
]
