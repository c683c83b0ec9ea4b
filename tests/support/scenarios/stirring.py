"""Stirring: the way of the tip of the tool through its vessel, by poses of the world alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim.truth import held_by
from tests.support.scenarios import Scenario, Watched

POT, SPOON = "pot1", "spoon1"
SECONDS, CIRCLES = 20.0, 5
"""How long and how often round the recipe says that the soup is stirred."""


def watch_the_tip(watched: Watched) -> None:
    """Note where the lower end of the spoon is in the pot's frame while it is below the pot's rim."""
    world = watched.world
    if held_by(world, SPOON) != "robot":
        return
    half = world.size(SPOON)[0] / 2
    spoon, pot = world.pose(SPOON).matrix(), world.pose(POT).matrix()
    ends = [spoon @ [sign * half, 0.0, 0.0, 1.0] for sign in (-1.0, 1.0)]
    tip = (np.linalg.inv(pot) @ min(ends, key=lambda end: float(end[2])))[:3]
    if abs(tip[2]) < world.size(POT)[2] / 2 and math.hypot(*tip[:2]) < world.size(POT)[0] / 2:
        way = watched.notes.setdefault("way", [])
        assert isinstance(way, list)
        way.append(tip)


def stirred(watched: Watched) -> Iterator[str]:
    """The tip went round as long and as often as it should, the pot stands where it stood, and nothing is spilled."""
    way = np.array(watched.notes.get("way", []))
    if len(way) < SECONDS * watched.world.rate:
        yield f"the spoon was in the pot for {len(way) / watched.world.rate:.1f} s"
    else:
        turns = np.ptp(np.unwrap(np.arctan2(way[:, 1], way[:, 0]))) / (2 * np.pi)
        if turns < CIRCLES - 0.05:
            yield f"the spoon went round {turns:.1f} times"
    moved = math.dist(watched.world.pose(POT).position, watched.start[POT].position)
    if moved > 0.005:
        yield f"the pot was moved by {moved:.3f} m"
    matter = watched.world.matter
    if matter.total(POT) < 1200.0:
        yield f"{matter.total(POT):.0f} ml are in the pot"
    if matter.states.get(POT) != "Mixed":
        yield f"the soup is {matter.states.get(POT)}"
    if held_by(watched.world, SPOON) is not None or watched.world.gravity.under(SPOON) != "counter1":
        yield "the spoon does not lie on the counter"


SCENARIOS = [
    Scenario(
        "stir_soup",
        ("stir_soup", "--robot", "pr2", "--environment", "soup_kitchen"),
        stirred,
        (watch_the_tip,),
        seconds=8.0,
    )
]
