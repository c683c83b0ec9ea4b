"""What must hold in the simulator's truth at the end of a task, by the product's tolerances. Each goal yields what does
not hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from planlang.geometry import Pose
from sim.tolerances import MOVED, deviation
from sim.truth import at_rest_on, held_by, is_centred_in, is_closed, is_toppled, opened
from tests.support.scenarios import Watched

Goal = Callable[[Watched], Iterable[str]]

STANDS = 0.02
"""Height over the floor up to which a thing stands on it [m]."""
BESIDE = 0.3
"""Largest gap between things that were put beside each other [m]."""


def all_of(*goals: Goal) -> Goal:
    """Return the goal that all hold."""

    def goal(watched: Watched) -> Iterator[str]:
        for one in goals:
            yield from one(watched)

    return goal


def held(name: str, holder: str = "robot") -> Goal:
    """Return the goal that a thing is in somebody's hand."""

    def goal(watched: Watched) -> Iterator[str]:
        if (found := held_by(watched.world, name)) != holder:
            yield f"{name} is held by {found}, not by {holder}"

    return goal


def on(name: str, *supports: str) -> Goal:
    """Return the goal that a thing stands on one of some others, as upright as it was."""

    def goal(watched: Watched) -> Iterator[str]:
        if (found := at_rest_on(watched.world, name)) not in supports:
            yield f"{name} rests on {found}, not on {' or '.join(supports)}"
        if is_toppled(watched.world, name, watched.start[name]):
            yield f"{name} has toppled"

    return goal


def inside(name: str, furniture: str) -> Goal:
    """Return the goal that a thing is at rest within the box of furniture."""

    def goal(watched: Watched) -> Iterator[str]:
        world = watched.world
        if not is_centred_in(world, name, furniture):
            yield f"{name} is not inside {furniture}"
        if at_rest_on(world, name) is None:
            yield f"{name} is not at rest"

    return goal


def shut(*leaves: str) -> Goal:
    """Return the goal that doors and drawers are closed."""

    def goal(watched: Watched) -> Iterator[str]:
        for leaf in leaves:
            if not is_closed(watched.world, leaf):
                yield f"{leaf} is open by {opened(watched.world, leaf):.0%}"

    return goal


def in_room(room: str) -> Goal:
    """Return the goal that the base of the robot stands in a room."""

    def goal(watched: Watched) -> Iterator[str]:
        x, y, _ = watched.world.configuration().base
        here = watched.world.scene.body(room)
        local = np.array((here.pose.inverse() @ Pose((x, y, here.pose.position[2]))).position)
        if (np.abs(local) > np.asarray(here.size) / 2).any():
            yield f"the robot is not in {room}"

    return goal


def open_by(leaf: str, share: float) -> Goal:
    """Return the goal that a leaf is open by at least a share of its range."""

    def goal(watched: Watched) -> Iterator[str]:
        if opened(watched.world, leaf) < share:
            yield f"{leaf} is open by {opened(watched.world, leaf):.0%}"

    return goal


def was_open(*leaves: str) -> tuple[Goal, Callable[[Watched], None]]:
    """Return the goal that leaves were open by half of their range at some time, and the watcher that notes it."""

    def watch(watched: Watched) -> None:
        widest = watched.notes.setdefault("widest", {})
        assert isinstance(widest, dict)
        for leaf in leaves:
            widest[leaf] = max(widest.get(leaf, 0.0), opened(watched.world, leaf))

    def goal(watched: Watched) -> Iterator[str]:
        widest = watched.notes.get("widest", {})
        assert isinstance(widest, dict)
        for leaf in leaves:
            if widest.get(leaf, 0.0) < 0.5:
                yield f"{leaf} was open by at most {widest.get(leaf, 0.0):.0%}"

    return goal, watch


def contains(vessel: str, amount: float) -> Goal:
    """Return the goal that a vessel holds an amount [ml], within the tolerance."""

    def goal(watched: Watched) -> Iterator[str]:
        found = watched.world.matter.total(vessel)
        if abs(found - amount) > deviation(amount):
            yield f"{vessel} holds {found:.0f} ml, not {amount:.0f} ml"

    return goal


def switched(device: str, *, on: bool) -> Goal:
    """Return the goal that a device is on, or off."""

    def goal(watched: Watched) -> Iterator[str]:
        if watched.world.matter.is_on(device) != on:
            yield f"{device} is {'off' if on else 'on'}"

    return goal


def beside(one: str, other: str) -> Goal:
    """Return the goal that two things stand on one surface with at most 30 cm between their boxes."""

    def goal(watched: Watched) -> Iterator[str]:
        world = watched.world
        if at_rest_on(world, one) != at_rest_on(world, other) or at_rest_on(world, one) is None:
            yield f"{one} rests on {at_rest_on(world, one)}, {other} on {at_rest_on(world, other)}"
        apart = math.dist(world.pose(one).position[:2], world.pose(other).position[:2])
        reach = sum(math.hypot(*world.size(name)[:2]) / 2 for name in (one, other))
        if apart - reach > BESIDE:
            yield f"{one} is {apart - reach:.2f} m from {other}"

    return goal


def undisturbed(*moved: str) -> Goal:
    """Return the goal that all other things than these are where they were, and that nothing has fallen to the floor.

    Furniture stands on the floor from the beginning.
    """

    def goal(watched: Watched) -> Iterator[str]:
        world = watched.world
        for name, start in watched.start.items():
            if not world.scene.body(name).movable:
                continue
            stood = start.position[2] - world.size(name)[2] / 2 < STANDS
            if not stood and at_rest_on(world, name) == "floor":
                yield f"{name} is on the floor"
            if name not in moved and (far := world.pose(name).distance(start)) > MOVED:
                yield f"{name} was moved by {far:.2f} m"

    return goal


def level(*poured: str) -> Goal:
    """Return the goal that nothing leaned too far while the robot held it, but what was poured from."""

    def goal(watched: Watched) -> Iterator[str]:
        for name, angle in watched.tilts.items():
            largest = watched.world.scene.body(name).largest_tilt
            if name not in poured and largest is not None and angle > largest + 0.01:
                yield f"{name} leaned by {math.degrees(angle):.0f} degrees"

    return goal
