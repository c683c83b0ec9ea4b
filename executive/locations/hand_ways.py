"""The ways of one arm for what a location asks of the hand, filtered by its other conjuncts."""

from __future__ import annotations

from functools import partial
from itertools import islice

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.effort import Extent
from executive.locations.hand_terms import satisfied
from executive.locations.reach import Reach
from executive.locations.reachability import GraspClass
from executive.locations.rejections import Rejections
from executive.locations.relations import ThingDemand
from executive.locations.resting import thing_poses
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
from executive.robots.arms import ArmModel

NATURAL = (GraspClass.SIDE,)
"""Classes of grasps that are tried first."""
MOST_SPOTS = 24
"""Places on a surface that a hand is asked to put something on."""


def ways_of(reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, extent: Extent) -> Ways | None:
    """Ways to satisfy a reach with an arm; None, with the reason counted, if there are none."""
    ways = _made(reach, arm, scene, rejections, extent)
    if ways is None or not len(ways):
        return None
    step = ways.key if not reach.before else 0 if reach.kind == "grasp" else -1
    for term in reach.also:
        kept = satisfied(term, ways.points + ways.offsets[:, step], ways.rotations, arm, scene)
        if not kept.all():
            said = f"{term.name.strip('_').replace('_', ' ')} {term.body}"
            rejections.add(said if term.negated else f"not {said}", int((~kept).sum()))
        ways = ways.chosen(kept)
    return ways if len(ways) else None


def _made(reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, extent: Extent) -> Ways | None:
    held, fine = scene.arms.held(arm.name), extent > Extent.NATURAL
    match reach.kind:
        case "grasp":
            return _grasps(reach, arm, scene, rejections, extent)
        case "retreat":
            return retreat_ways(reach.body, scene.arms.grasped_at(reach.body), arm.frame)
        case "above":
            block, lowest = scene.bodies.block(reach.body), partial(arm.lowest, held=held)
            ways = above_ways(
                reach.body, block, arm.frame, held, lowest, reach.heights, inset=arm.hand_radius, fine=fine
            )
            return _of_class(ways, reach, rejections)
        case "offer":
            return _of_class(
                offer_ways(reach.body, scene.bodies.zone(reach.body), arm.frame, held, fine=fine), reach, rejections
            )
    if held is None:
        rejections.add("nothing in the hand to put down")
        return None
    if held.name == reach.body:
        rejections.add("nothing rests on itself")
        return None
    demand = ThingDemand(None if reach.inside else reach.body, reach.body if reach.inside else None)
    spots = islice(thing_poses(held.name, held.size, demand, scene, rejections), MOST_SPOTS)
    centres = np.array([spot.position for spot in spots]).reshape(-1, 3)
    return place_ways(reach.body, centres, arm.frame, held, fine=fine) if len(centres) else None


def _grasps(reach: Reach, arm: ArmModel, scene: PlanningScene, rejections: Rejections, extent: Extent) -> Ways | None:
    block = scene.bodies.block(reach.body)
    classes = (GraspClass(reach.grasp),) if reach.grasp is not None else CLASSES if extent else NATURAL
    headings = HEADINGS * 2**extent
    ways = grasp_ways(reach.body, block, arm.frame, arm.max_opening, classes, headings)
    if not len(ways):
        rejections.add("no gripper" if arm.max_opening <= 0 else "too wide for the gripper")
        return None
    return ways


def _of_class(ways: Ways, reach: Reach, rejections: Rejections) -> Ways:
    if reach.grasp is None:
        return ways
    kept = ways.grasps == CLASSES.index(GraspClass(reach.grasp))
    rejections.add(f"not by a {reach.grasp} grasp", int((~kept).sum()))
    return ways.chosen(kept)
