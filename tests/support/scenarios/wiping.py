"""Wiping: the surface that the lower side of a sponge was on, by poses of the world alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim.world import held_by
from tests.support.scenarios import Scenario, Watched

TABLE, SPONGE, CUP = "table1", "sponge1", "cup1"
CELL = 0.02
"""Side of the squares that the surface is divided into [m]."""
NEAR, FLAT = 0.01, 0.99
"""Largest distance of a side that wipes from the surface [m], and least cosine between the side and the surface."""
AROUND_CUP = 0.16
"""Room around the cup that need not be wiped: the sponge and the hand that holds it [m]."""
EDGE = 0.04
"""Margin of the table that need not be wiped [m]."""


def _squares(watched: Watched) -> np.ndarray:
    """Return the middles of the squares (n, 2) in the table's frame."""
    depth, width, _ = watched.world.size(TABLE)
    x, y = (np.arange(-extent / 2 + CELL / 2, extent / 2, CELL) for extent in (depth, width))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def watch_the_sponge(watched: Watched) -> None:
    """Note which squares of the table lie below a flat side of the sponge in a hand."""
    world = watched.world
    if held_by(world, SPONGE) != "robot":
        return
    pose = np.linalg.inv(world.pose(TABLE).matrix()) @ world.pose(SPONGE).matrix()
    half = np.array(world.size(SPONGE)) / 2
    down = int(np.argmax(np.abs(pose[2, :3])))
    low = pose[2, 3] - half[down] * abs(pose[2, down])
    if abs(pose[2, down]) < FLAT or abs(low - world.size(TABLE)[2] / 2) > NEAR:
        return
    squares = _squares(watched)
    inside = (np.column_stack([squares, np.full(len(squares), pose[2, 3])]) - pose[:3, 3]) @ pose[:3, :3]
    beside = [axis for axis in range(3) if axis != down]
    wiped = watched.notes.setdefault("wiped", np.zeros(len(squares), bool))
    assert isinstance(wiped, np.ndarray)
    wiped |= (np.abs(inside[:, beside]) <= half[beside]).all(axis=1)


def wiped(watched: Watched) -> Iterator[str]:
    """Most of the table that is free was under the sponge, and the cup stands where it stood."""
    squares = _squares(watched)
    size = np.array(watched.world.size(TABLE)[:2])
    cup = (np.linalg.inv(watched.start[TABLE].matrix()) @ watched.start[CUP].matrix())[:2, 3]
    due = (np.abs(squares) <= size / 2 - EDGE).all(axis=1) & (np.linalg.norm(squares - cup, axis=1) > AROUND_CUP)
    done = np.asarray(watched.notes.get("wiped", np.zeros(len(squares), bool)))
    share = float(done[due].mean())
    if share < 0.75:
        yield f"{share:.0%} of what is free on the table were wiped"
    moved = math.dist(watched.world.pose(CUP).position, watched.start[CUP].position)
    if moved > 0.005:
        yield f"the cup was moved by {moved:.3f} m"
    if watched.world.changes.matter.states.get(TABLE) != "Clean":
        yield f"the table is {watched.world.changes.matter.states.get(TABLE)}"


SCENARIOS = [
    Scenario(
        "wipe_table",
        ("wipe_table", "--robot", "pr2", "--environment", "soup_kitchen"),
        wiped,
        (watch_the_sponge,),
        seconds=20.0,
    )
]
