"""Tables that are set, and things that are put somewhere: what lies where, seen from the guest's chair."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim.truth import at_rest_on, tilt
from tests.support.scenarios import Scenario, Watched

THINGS = ("mat1", "napkin1", "plate1", "fork1", "knife1", "spoon1", "cup1")
SIDES = {"fork1": (1.0, 0.0), "knife1": (-1.0, 0.0), "spoon1": (-1.0, 0.0), "cup1": (0.0, 1.0)}
"""Thing -> the direction from the plate, to the guest's left and away from the guest."""
NEAR = 0.15
"""Largest distance of a thing from its place [m]."""
UPRIGHT = math.radians(15)


def extent(watched: Watched, name: str, direction: np.ndarray) -> float:
    """Return how far a thing reaches from its middle in a level direction of the map (2,) [m]."""
    size = np.array(watched.world.size(name))
    along = watched.world.pose(name).rotation[:2].T @ direction
    return float(np.abs(along) @ (size / 2))


def is_on_table(watched: Watched, name: str) -> bool:
    """Return whether a thing is at rest on the table, or on something that is."""
    support = at_rest_on(watched.world, name)
    return support == "table1" or (support in THINGS and support != name and is_on_table(watched, str(support)))


def off_its_side(watched: Watched, name: str) -> float:
    """Return how far a thing is from beside the plate, on its side and no farther than near [m]."""
    world = watched.world
    plate, guest = (np.array(world.pose(one).position[:2]) for one in ("plate1", "chair1"))
    away = (plate - guest) / np.linalg.norm(plate - guest)
    left = np.array([-away[1], away[0]])
    to_left, ahead = SIDES[name]
    side, across = to_left * left + ahead * away, abs(to_left) * away + abs(ahead) * left
    offset = np.array(world.pose(name).position[:2]) - plate
    gap = float(offset @ side) - extent(watched, "plate1", side) - extent(watched, name, side)
    beside = max(abs(float(offset @ across)) - extent(watched, "plate1", across), 0.0)
    return max(-gap, gap, beside)


def is_set(watched: Watched) -> Iterator[str]:
    """Yield what is wrong with the table."""
    for name in THINGS:
        if not is_on_table(watched, name):
            yield f"{name} is on {at_rest_on(watched.world, name)}"
    if at_rest_on(watched.world, "plate1") != "mat1":
        yield "the plate is not on the mat"
    for name in SIDES:
        if (off := off_its_side(watched, name)) > NEAR:
            yield f"{name} is {off:.2f} m off its place"
    if tilt(watched.world.pose("cup1")) > UPRIGHT:
        yield "the cup does not stand upright"


SCENARIOS = [
    Scenario(
        "table_setting",
        (
            "corpus/recipes/TableSetting@2011-10.owl.in",
            *("--accept", "R042", "--set", "@docs/examples/table_setting.set"),
            *("--robot", "pr2", "--environment", "breakfast_room"),
        ),
        is_set,
        seconds=30.0,
    ),
]
