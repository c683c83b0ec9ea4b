"""Wiping: the surface that the lower side of a sponge was on, by poses of the world alone."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from sim.scene import BodyShape
from sim.truth import held_by
from tests.support.scenarios import Goal, Scenario, Watched

CELL = 0.02
"""Side of the squares that the surface is divided into [m]."""
NEAR, FLAT = 0.01, 0.99
"""Largest distance of a side that wipes from the surface [m], and least cosine between the side and the surface."""
AROUND = 0.12
"""Room around what stands on the table that need not be wiped: the sponge and the hand that holds it [m]."""
EDGE = 0.04
"""Margin of the table that need not be wiped [m]."""
MOST = 0.75
"""Share of the rest that has to be wiped."""


def _squares(watched: Watched, table: str) -> np.ndarray:
    """Return the middles of the squares (n, 2) in the table's frame."""
    depth, width, _ = watched.world.size(table)
    x, y = (np.arange(-extent / 2 + CELL / 2, extent / 2, CELL) for extent in (depth, width))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def wiping(table: str, tool: str) -> Callable[[Watched], None]:
    """Return a watcher that notes which squares of a table lie below a flat side of a tool in a hand."""

    def watch(watched: Watched) -> None:
        world = watched.world
        if held_by(world, tool) != "robot":
            return
        pose = np.linalg.inv(world.pose(table).matrix()) @ world.pose(tool).matrix()
        half = np.array(world.size(tool)) / 2
        down = int(np.argmax(np.abs(pose[2, :3])))
        low = pose[2, 3] - half[down] * abs(pose[2, down])
        if abs(pose[2, down]) < FLAT or abs(low - world.size(table)[2] / 2) > NEAR:
            return
        squares = _squares(watched, table)
        inside = (np.column_stack([squares, np.full(len(squares), pose[2, 3])]) - pose[:3, 3]) @ pose[:3, :3]
        beside = [axis for axis in range(3) if axis != down]
        wiped = watched.notes.setdefault("wiped", np.zeros(len(squares), bool))
        assert isinstance(wiped, np.ndarray)
        wiped |= (np.abs(inside[:, beside]) <= half[beside]).all(axis=1)

    return watch


def wiped(table: str, tool: str) -> Goal:
    """Return the goal that most of what is free of a table was under the tool, and what stood there still does."""

    def goal(watched: Watched) -> Iterator[str]:
        squares = _squares(watched, table)
        size = np.array(watched.world.size(table)[:2])
        due = (np.abs(squares) <= size / 2 - EDGE).all(axis=1)
        for name in _standing(watched, table, tool):
            at = (np.linalg.inv(watched.start[table].matrix()) @ watched.start[name].matrix())[:2, 3]
            reach = max(watched.world.size(name)[:2]) / 2
            due &= np.linalg.norm(squares - at, axis=1) > reach + AROUND
            moved = math.dist(watched.world.pose(name).position, watched.start[name].position)
            if moved > 0.005:
                yield f"{name} was moved by {moved:.3f} m"
        done = np.asarray(watched.notes.get("wiped", np.zeros(len(squares), bool)))
        share = float(done[due].mean()) if due.any() else 1.0
        if share < MOST:
            yield f"{share:.0%} of what is free on {table} were wiped"
        if watched.world.matter.states.get(table) != "Clean":
            yield f"{table} is {watched.world.matter.states.get(table)}"

    return goal


def _standing(watched: Watched, table: str, tool: str) -> list[str]:
    """Return what stood on the table at the beginning."""
    bodies = watched.world.scene.bodies
    size = np.array(watched.world.size(table))
    found = []
    for body in bodies:
        is_thing = body.shape not in (BodyShape.ROOM, BodyShape.MARKER)
        if is_thing and body.name not in (table, tool) and body.name in watched.start:
            x, y, z = (watched.start[table].inverse() @ watched.start[body.name]).position
            if abs(x) < size[0] / 2 and abs(y) < size[1] / 2 and 0 < z - size[2] / 2 < body.size[2]:
                found.append(body.name)
    return found


SCENARIOS = [
    Scenario(
        "wipe_table",
        ("wipe_table", "--robot", "pr2", "--environment", "soup_kitchen"),
        wiped("table1", "sponge1"),
        (wiping("table1", "sponge1"),),
        seconds=20.0,
    )
]
