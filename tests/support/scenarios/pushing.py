"""Pushing: things that no hand held are elsewhere on what they stood on, by poses of the world alone."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim.truth import at_rest_on, held_by, tilt
from tests.support.scenarios import Scenario, Watched

FAR, NEAR = 0.15, 0.02
"""How far the cup should be from where it stood, and how much that may be missed [m]."""
DOOR = "cabinet_door1"
BESIDE = 0.3
"""Largest gap between the sponge and the pot [m]."""
UPRIGHT = math.radians(5)


def watch_hands(watched: Watched) -> None:
    """Note what the robot holds."""
    for name in watched.world.attached():
        watched.notes[f"held {name}"] = True


def moved(watched: Watched, name: str) -> float:
    """Return how far a thing is from where it was [m]."""
    return math.dist(watched.world.pose(name).position, watched.start[name].position)


def stands(watched: Watched, name: str, support: str) -> Iterator[str]:
    """Yield what is wrong with a thing that was pushed along a support."""
    if f"held {name}" in watched.notes or held_by(watched.world, name) is not None:
        yield f"{name} was in a hand"
    if at_rest_on(watched.world, name) != support:
        yield f"{name} is on {at_rest_on(watched.world, name)}"
    if tilt(watched.world.pose(name)) > UPRIGHT:
        yield f"{name} does not stand upright"
    for other in watched.start:
        if other != name and other in watched.world.names() and moved(watched, other) > 0.005:
            yield f"{other} was moved by {moved(watched, other):.3f} m"


def cup_is_away(watched: Watched) -> Iterator[str]:
    """The cup stands as far from where it stood as the recipe says."""
    yield from stands(watched, "cup1", "table1")
    if abs(moved(watched, "cup1") - FAR) > NEAR:
        yield f"the cup was moved by {moved(watched, 'cup1'):.3f} m"


def sponge_is_near(watched: Watched) -> Iterator[str]:
    """The sponge lies on the counter near the pot."""
    yield from stands(watched, "sponge1", "counter1")
    world = watched.world
    apart = np.subtract(world.pose("sponge1").position, world.pose("pot1").position)[:2]
    gap = math.hypot(*apart) - world.size("pot1")[0] / 2 - world.size("sponge1")[0] / 2
    if gap > BESIDE:
        yield f"the sponge is {gap:.2f} m from the pot"
    if moved(watched, "sponge1") < 0.05:
        yield "the sponge lies where it lay"


def watch_the_door(watched: Watched) -> None:
    """Note how far the door was open, and whether a hand held its handle after it was open."""
    world, open_before = watched.world, watched.notes.get("opened", 0.0)
    assert isinstance(open_before, float)
    value = world.joint(DOOR)
    watched.notes["opened"] = max(open_before, value)
    if DOOR in world.led() and value < open_before - 0.05:
        watched.notes["led back"] = True


def door_is_shut(watched: Watched) -> Iterator[str]:
    """The door was opened, and is shut, though no hand led it back."""
    opened = watched.notes.get("opened", 0.0)
    assert isinstance(opened, float)
    if opened < math.radians(60):
        yield f"{DOOR} was opened by {math.degrees(opened):.0f} degrees"
    if watched.world.joint(DOOR) > math.radians(3):
        yield f"{DOOR} is open by {math.degrees(watched.world.joint(DOOR)):.0f} degrees"
    if "led back" in watched.notes:
        yield f"{DOOR} was closed by its handle"


KITCHEN = ("--robot", "pr2", "--environment", "soup_kitchen")
SCENARIOS = [
    Scenario("push_the_cup", ("push_the_cup", *KITCHEN), cup_is_away, (watch_hands,), seconds=7.0),
    Scenario(
        "push_the_sponge",
        ("docs/examples/push_the_sponge.omn", *KITCHEN),
        sponge_is_near,
        (watch_hands,),
        seconds=8.0,
    ),
    Scenario(
        "push_the_door_shut",
        ("docs/examples/push_the_door_shut.omn", "--robot", "amigo", "--environment", "kitchenette"),
        door_is_shut,
        (watch_the_door,),
        seconds=8.0,
    ),
]
