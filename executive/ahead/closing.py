"""Whether a door between rooms that was opened may be shut: where the base is then, and where later steps need it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product

import numpy as np

from executive.belief.doorways import PAST
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.demands import things_in
from executive.motion.floods import Drivable
from planlang.designators import Action, FixedPose, Object
from planlang.geometry import Array
from planlang.language.performing import actions_around
from planlang.language.remaining import remaining_actions
from planlang.protocols import Configuration

FURTHER = (0.0, -0.2, 0.2, 0.4)
"""Distances from a pose beside a door at which the base may stand on that side, away from the door [m]."""
TURNS = (0.0, math.pi / 2, -math.pi / 2, math.pi)
"""Turns from that pose to try [rad]."""
REACH = 1.0
"""Distance from the sides of a thing within which the base works at it [m]; in a room it is inside."""


def leads_back(scene: PlanningScene, door: Object, beyond: BasePose) -> bool:
    """Check whether a step in progress, or one that remains, needs the base on the side of a door from which it comes.

    ``beyond`` is a pose on its other side that faces away from it. What is not known yet may be on either.
    """
    x, y, yaw = beyond
    before = (x - 2 * PAST * math.cos(yaw), y - 2 * PAST * math.sin(yaw))
    leaf = scene.bodies.bind(door)
    here, there = (reached_from(scene, leaf, pose) for pose in ((*before, yaw + math.pi), beyond))
    if here is None or there is None:
        return True
    return any(
        place is None or here.near(place[0], place[1]) >= max(there.near(place[0], place[1]), 1)
        for each in (*actions_around(), *remaining_actions())
        for place in _places(scene, each)
    )


def reached_from(scene: PlanningScene, leaf: str, side: BasePose) -> Drivable | None:
    """Compute where the base may drive from a side of a door that is shut; None without room for it there."""
    shut, robot, (x, y, yaw) = scene.belief.with_leaf(leaf, 0.0), scene.belief.robot, side
    for further, turn in product(FURTHER, TURNS):
        base = x + further * math.cos(yaw), y + further * math.sin(yaw), yaw + turn
        then = scene.supposing(shut.with_robot(robot, Configuration(base, shut.robots[robot].joints)))
        if not then.collisions.contacts(base):
            return then.collisions.drivable()
    return None


def _places(scene: PlanningScene, each: Action) -> Iterator[tuple[Array, float] | None]:
    """Yield positions (2,) and how near to them the base works, for all that an action mentions; None where unknown."""
    bodies = scene.supposing(scene.belief.state).bodies  # so that nothing is bound for good
    for what in things_in(filler for _, filler in each.properties):
        name = bodies.known(what)
        if name is None:
            yield None
        elif not bodies.is_held(name):
            block = bodies.block(name)
            halves = block.half_x, block.half_y
            yield np.array([block.x, block.y]), min(halves) if bodies.is_room(name) else max(halves) + REACH
    match each.get("x"), each.get("y"), each.get("to_location"):
        case (float(x), float(y), _) | (_, _, FixedPose(x=x, y=y)):
            yield np.array([x, y]), REACH
