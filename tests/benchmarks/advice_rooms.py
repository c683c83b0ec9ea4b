"""Rooms in which a thing is out of reach for one reason that a change of the map would mend; each drawn by a seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from planlang.geometry import Pose
from tests.benchmarks.homes import goals
from tests.benchmarks.homes.closed import chest, cupboard
from tests.benchmarks.homes.furnishing import Home, NoRoom, Thing
from tests.benchmarks.homes.tasks import REDRAWN, Need, Task, some_table, something, step, task_of

TRANSPORTED = 0.5
"""Share of tasks in which the thing is brought elsewhere, not only fetched."""


def _far(home: Home) -> str:
    """In the middle of a table so large that no arm reaches it."""
    wide, high = home.between((2.0, 2.6)), home.between((0.7, 0.78))
    size = (wide, home.between((2.0, 2.6)), high)
    pose = home.free_standing(size, 0.9)
    table = home.add(Thing(home.named("table"), "DiningTable", pose, size))
    home.surface(table, pose, size)
    thing = home.thing(something(home), table)
    return _moved(home, thing, table, (home.between((-0.3, 0.3)), home.between((-0.3, 0.3))))


def _high(home: Home) -> str:
    """High over its table, as maps have it whose heights are wrong."""
    table = some_table(home)
    thing = home.thing(something(home), table, where="front")
    return _lifted(home, thing, home.between((0.8, 1.4)))


def _covered(home: Home) -> str:
    """Inside a box that stands on the same table."""
    table = some_table(home)
    thing = home.thing(home.one_of(("cup", "can", "glass")), table, where="front")
    at, size = home.things[thing].pose, home.things[thing].size
    assert at is not None
    assert size is not None
    x, y, z = at.position
    wide, high = max(size[:2]) + home.between((0.04, 0.1)), size[2] + home.between((0.03, 0.1))
    pose = Pose.planar(x, y, at.yaw, z - size[2] / 2 + high / 2)
    home.add(Thing(home.named("cover"), "CardboardBox", pose, (wide, wide, high)))
    return thing


def _surrounded(home: Home) -> str:
    """Among other things on a table, some of which stand close around it."""
    table = some_table(home)
    thing = home.thing(home.one_of(("can", "cup", "glass")), table, where="front")
    at = home.things[thing].pose
    assert at is not None
    for number in range(8):
        turn, away = number * math.pi / 4, home.between((0.085, 0.1))
        x, y, _ = at.position
        high = home.between((0.3, 0.4))
        low = _top(home, table)
        pose = Pose.planar(x + away * math.cos(turn), y + away * math.sin(turn), turn, low + high / 2)
        home.add(Thing(home.named("post"), "CardboardBox", pose, (0.03, 0.05, high)))
    return thing


def _behind(home: Home) -> str:
    """On a table behind a screen from wall to wall."""
    table = some_table(home, ("side_table", "sideboard", "kitchen_table"))
    thing = home.thing(something(home), table, where="front")
    depth, width, _ = home.inside
    x, y, _ = home.things[table].pose.position  # type: ignore[union-attr]
    along = x if depth > width else y
    side = math.copysign(1.0, along)
    at, length = side * (abs(along) - 1.0), width if depth > width else depth
    if abs(along) < 1.2:
        raise NoRoom("the table is in the middle of the room")
    pose = Pose.planar(at, 0.0, 0.0, 0.6) if depth > width else Pose.planar(0.0, at, math.pi / 2, 0.6)
    home.add(Thing(home.named("screen"), "Sideboard-PieceOfFurniture", pose, (0.06, length - 0.02, 1.2)))
    return thing


def _beside_open(home: Home) -> str:
    """On a cupboard or chest of which a door or drawer is open."""
    closed = (
        cupboard(home, "base", doors=(home.one_of(("1", "2")) == "2" and 2) or 1) if home.chance(0.5) else chest(home)
    )
    leaf = closed.leaves[0]
    slides = "drawer" in leaf
    value = home.between((0.25, 0.35)) if slides else home.between((0.9, 1.5))
    for name in closed.leaves:
        one = home.things[name]
        home.things[name] = replace(one, facts=(*one.facts, f"knowrob:jointPosition {value:.3f}"))
    if closed.name not in home.surfaces:
        body = home.things[closed.name]
        assert body.pose is not None
        assert body.size is not None
        home.surface(closed.name, body.pose, body.size)
    return home.thing(something(home), closed.name, where="back")


def _top(home: Home, name: str) -> float:
    return home.surfaces[name].height


def _moved(home: Home, thing: str, table: str, to: tuple[float, float]) -> str:
    """Put a thing on a table where it is said, in the table's frame; return its name."""
    one, board = home.things[thing], home.things[table]
    assert one.pose is not None
    assert board.pose is not None
    place = (board.pose @ Pose((*to, 0.0))).position
    home.things[thing] = replace(one, pose=replace(one.pose, position=(place[0], place[1], one.pose.position[2])))
    return thing


def _lifted(home: Home, thing: str, by: float) -> str:
    one = home.things[thing]
    assert one.pose is not None
    x, y, z = one.pose.position
    home.things[thing] = replace(one, pose=replace(one.pose, position=(x, y, z + by)))
    return thing


KINDS: Mapping[str, Callable[[Home], str]] = {
    "far": _far,
    "high": _high,
    "covered": _covered,
    "surrounded": _surrounded,
    "behind": _behind,
    "beside_open": _beside_open,
}
"""Kind -> what makes the room, and returns the thing to take."""


def hard_room(kind: str, seed: int) -> Task:
    """Return the task to take a thing, and to bring it to another table at times. Raises NoRoom."""
    for again in range(REDRAWN):
        home = Home(np.random.default_rng([seed, [*KINDS].index(kind), again]))
        try:
            home.room("Kitchen")
            other = some_table(home) if home.chance(TRANSPORTED) else None
            thing = KINDS[kind](home)
        except NoRoom:
            continue
        needs = [Need("grasp", thing)]
        if other is None:
            return task_of(home, kind, [step("FetchingAnObject", what=thing)], goals.held(thing), [thing], needs)
        steps = [step("TransportingAnObject", what=thing, to=f"on-Physical {other}")]
        return task_of(home, kind, steps, goals.on(thing, other), [thing], needs)
    raise NoRoom(f"{kind} {seed}: {REDRAWN} homes are too full")
