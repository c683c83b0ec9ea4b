"""Things dropped into open containers, as rubbish into a bin: whether that may be done, and why not.

A container takes what is let go above its rim if it, or its class, states a ``largestDrop``. What holds something
itself is not dropped.
"""

from __future__ import annotations

import math

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.maps.supports import ROUNDING
from planlang.geometry import Pose
from planlang.geometry.areas import Block
from planlang.relations.demands import HEIGHTS, Reach, ReachKind


def insides(name: str, scene: PlanningScene) -> list[Block]:
    """List the spaces inside a body, above its floor and shelves; none if it is solid."""
    pose, (x, y, z) = scene.bodies.pose(name), scene.bodies.size(name)
    rooms = []
    for cavity in scene.world.scene.body(name).cavities:  # they may extend beyond the body where it is open
        ends = [np.array(cavity.centre) + sign * np.array(cavity.size) / 2 for sign in (-1, 1)]
        low, high = np.clip(ends, (-x / 2, -y / 2, -z / 2), (x / 2, y / 2, z / 2))
        if (high > low).all():
            rooms.append(Block.of(pose @ Pose(tuple(((low + high) / 2).tolist())), tuple((high - low).tolist())))
    return rooms


def open_above(name: str, scene: PlanningScene) -> list[Block]:
    """List the spaces inside a body that are open at its top."""
    top = scene.bodies.block(name).high
    return [room for room in insides(name, scene) if room.high >= top - ROUNDING]


def drop_heights(reach: Reach, thing: str, scene: PlanningScene) -> tuple[float, ...]:
    """List the heights above the rim of a container at which a thing may be let go, lowest first [m]; else none."""
    if not reach.inside or undroppable(reach, thing, scene):
        return ()
    largest, block = scene.world.scene.body(reach.body).largest_drop, scene.bodies.block(reach.body)
    deepest = max((block.high - room.low for room in open_above(reach.body, scene)), default=math.inf)
    return tuple(height for height in HEIGHTS if deepest + height <= largest)


def undroppable(reach: Reach, thing: str, scene: PlanningScene) -> str:
    """Say why a thing is not dropped into a container, and what to change; "" if it may be, or none is meant."""
    if reach.kind is not ReachKind.PLACE or not reach.inside or reach.body in scene.belief.joints:
        return ""
    container, rooms = scene.world.scene.body(reach.body), open_above(reach.body, scene)
    if not container.largest_drop:
        return f"if things may be dropped into {reach.body}, state its largestDrop" if rooms else ""
    if scene.belief.state.matter.total(thing) > 0:
        return f"{thing} is not dropped into {reach.body}, as there is something in it: empty it first"
    if not rooms:
        return f'nothing is dropped into {reach.body}, which is closed at the top: state openSide "+z" if it is open'
    deep = scene.bodies.block(reach.body).high - min(room.low for room in rooms)
    if deep + HEIGHTS[0] > container.largest_drop:
        return (
            f"{thing} is not dropped into {reach.body}, which is {deep:.2f} m deep: "
            f"its largestDrop is {container.largest_drop:g} m"
        )
    return ""
