"""The ways of one arm for what a location asks of the hand, filtered by its other conjuncts."""

from __future__ import annotations

from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.locations.areas import OF_A_THING, area_of
from executive.locations.block import Block
from executive.locations.hand import Held
from executive.locations.reach import Reach
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.locations.relations import ThingDemand, block_of
from executive.locations.resting import thing_poses
from executive.locations.surroundings import ArmModel, Surroundings
from executive.locations.ways import (
    CLASSES,
    HEADINGS,
    Ways,
    above_ways,
    grasp_ways,
    offer_ways,
    place_ways,
    retreat_ways,
)

NATURAL = (GraspClass.SIDE,)
"""Classes of grasps that are tried first."""
MOST_SPOTS = 24
"""Places on a surface that a hand is asked to put something on."""
AT_CENTRE = 0.01
"""How far from the centre a grip point may be [m]."""


def ways_of(reach: Reach, arm: ArmModel, around: Surroundings, rejections: Rejections, *, fine: bool) -> Ways | None:
    """Ways to satisfy a reach with an arm, more if ``fine``; None, with the reason counted, if there are none."""
    ways = _made(reach, arm, around, rejections, fine=fine)
    if ways is None or not len(ways):
        return None
    for name, body, first, second, negated in reach.also:
        kept = _satisfied(name, body, (first, second), ways, arm, around) != negated
        if not kept.all():
            rejections.add(f"{'' if negated else 'not '}{name.strip('_').replace('_', ' ')} {body}", int((~kept).sum()))
        ways = ways.chosen(kept)
    return ways if len(ways) else None


def _made(reach: Reach, arm: ArmModel, around: Surroundings, rejections: Rejections, *, fine: bool) -> Ways | None:
    held = around.held(arm.name)
    match reach.kind:
        case "grasp":
            return _grasps(reach, arm, around, rejections, fine=fine)
        case "retreat":
            return retreat_ways(reach.body, around.grasped_at(reach.body), arm.frame)
        case "above":
            ways = above_ways(
                reach.body, block_of(reach.body, around), arm.frame, held, arm.hand_radius, reach.heights, fine=fine
            )
            return _of_class(ways, reach)
        case "offer":
            return _of_class(offer_ways(reach.body, around.zone(reach.body), arm.frame, held, fine=fine), reach)
    if held is None:
        rejections.add("nothing in the hand to put down")
        return None
    demand = ThingDemand(None if reach.inside else reach.body, reach.body if reach.inside else None, (), ())
    spots = islice(thing_poses(held.name, held.size, demand, around, rejections), MOST_SPOTS)
    centres = np.array([spot.position for spot in spots]).reshape(-1, 3)
    return place_ways(reach.body, centres, arm.frame, held, fine=fine) if len(centres) else None


def _grasps(reach: Reach, arm: ArmModel, around: Surroundings, rejections: Rejections, *, fine: bool) -> Ways | None:
    block = block_of(reach.body, around)
    classes = (GraspClass(reach.grasp),) if reach.grasp is not None else CLASSES if fine else NATURAL
    headings = 2 * HEADINGS if fine else HEADINGS
    ways = grasp_ways(reach.body, block, arm.frame, arm.max_opening, classes, headings)
    if not len(ways):
        rejections.add("no gripper" if arm.max_opening <= 0 else "too wide for the gripper")
        return None
    return ways


def _of_class(ways: Ways, reach: Reach) -> Ways:
    if reach.grasp is None:
        return ways
    return ways.chosen(ways.grasps == CLASSES.index(GraspClass(reach.grasp)))


def _satisfied(
    name: str,
    body: str,
    bounds: tuple[float | None, float | None],
    ways: Ways,
    arm: ArmModel,
    around: Surroundings,
) -> NDArray[np.bool_]:
    """Which ways also satisfy a relation (or the kind of another reach) about a body."""
    held = around.held(arm.name)
    middles = ways.points if held is None else ways.points + held.offsets(ways.rotations)
    block = block_of(body, around)
    match name:
        case "offer" | "in_reach_of":
            zone = around.zone(body)
            return np.array([zone.contains(point) for point in middles], bool)
        case "above":
            low, high = bounds[0] or 0.02, 0.15 if bounds[1] is None else bounds[1]
            over = (_lowest(ways, arm, held) - block.high).round(6)
            return np.asarray((over >= low) & (over <= high) & (block.distance(middles[:, :2]) <= 0))
        case "grasp" | "retreat" | "in_center_of":
            return np.asarray(np.linalg.norm(ways.points - block.centre, axis=1) <= AT_CENTRE)
        case "place" | "on" | "in_":
            return _resting(name, middles, block)
        case _:
            most, least = bounds
            default = OF_A_THING[name]
            limits = (default[0] if least is None else least, default[1] if most is None else most)
            x, y, _ = around.base()
            area = area_of(name, name, body, block, around.front(body), (x, y), 0.0, limits)
            return np.asarray(area.score(middles[:, :2]) > 0)


def _lowest(ways: Ways, arm: ArmModel, held: Held | None) -> NDArray[np.float64]:
    lowest = np.full(len(ways), -arm.hand_radius) if held is None else held.lowest_of(ways.rotations)
    return np.asarray(ways.points[:, 2] + lowest)


def _resting(name: str, middles: NDArray[np.float64], block: Block) -> NDArray[np.bool_]:
    over = block.distance(middles[:, :2]) <= 0
    if name == "in_":
        return np.asarray(over & (middles[:, 2] > block.low) & (middles[:, 2] < block.high))
    return np.asarray(over & (middles[:, 2] > block.high))
