"""Whether a hand is where a location wants it: a predicate for each relation, of ways and of the present pose."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import HEIGHTS, OF_A_THING, area_of
from executive.locations.bounds import bounds
from executive.locations.reach import HandTerm
from executive.locations.reachability import GraspClass
from executive.locations.relations import ThingDemand, hand_terms
from executive.locations.resting import thing_holds
from executive.locations.ways import APPROACH, CLASSES, LIFTS, classified
from executive.robots.arms import ArmModel, Held
from planlang.designators import Location
from planlang.geometry import Array, Pose

AT_CENTRE = 0.01
"""How far from the centre a grip point may be [m]."""
AT_POSE = 0.02
"""How far the hand may be from where it stands before a thing [m]."""
LEVEL = 0.2
"""How far a level hand, or an upright thing in it, may lean [rad]."""
HAIR = 1e-6

Mask = NDArray[np.bool_]


def hand_holds(location: Location, arm: ArmModel, scene: PlanningScene, viewer: tuple[float, float]) -> bool:
    """Whether an arm's hand is at a location now; raises LocationUnresolvable for what means nothing of a hand."""
    terms = hand_terms(location, scene, viewer)
    tip = scene.arms.tip(arm)
    points, rotations = tip[None, :3, 3], tip[None, :3, :3]
    if location.grasp is not None and CLASSES[classified(tip[:3, :3], arm.frame)[0]] is not GraspClass(location.grasp):
        return False
    return all(bool(satisfied(term, points, rotations, arm, scene)[0]) for term in terms)


def satisfied(term: HandTerm, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    """For which tip poses, points (n, 3) and rotations (n, 3, 3) in the map, a conjunct holds, (n,)."""
    return np.asarray(_holds(term, points, rotations, arm, scene) != term.negated)


def _holds(term: HandTerm, points: Array, rotations: Array, arm: ArmModel, scene: PlanningScene) -> Mask:
    held = scene.arms.held(arm.name)
    middles = points if held is None else points + held.offsets(rotations)
    block = scene.bodies.block(term.body)
    handled = scene.bodies.is_graspable(term.body) or scene.arms.is_held(term.body)
    match term.name:
        case "in_reach_of" if scene.bodies.is_person(term.body):
            zone = scene.bodies.zone(term.body)
            return np.array([zone.contains(point) for point in middles], bool)
        case "in_reach_of" | "in_center_of" if handled or term.name == "in_center_of":
            return np.asarray(np.linalg.norm(points - block.centre, axis=1) <= AT_CENTRE)
        case "in_reach_of" | "above":
            low, high = bounds(term.within, term.beyond, HEIGHTS) if term.name == "above" else HEIGHTS
            over = points[:, 2] + arm.lowest(rotations, held) - block.high
            inside = block.distance(middles[:, :2]) <= 0
            return np.asarray((over >= low - HAIR) & (over <= high + HAIR) & inside & _level(rotations, arm, held))
        case "on" | "in_":
            if held is None or held.name == term.body:
                return np.zeros(len(points), bool)
            demand = ThingDemand(term.body) if term.name == "on" else ThingDemand(None, term.body)
            offset = held.pose.matrix()[:3, :3]
            poses = (
                Pose.from_matrix(_matrix(turn @ offset, middle))
                for turn, middle in zip(rotations, middles, strict=True)
            )
            return np.array([thing_holds(held.name, pose, held.size, demand, scene) for pose in poses], bool)
        case "in_front_of" if handled:
            ahead = points + APPROACH * (rotations @ np.asarray(arm.frame.approach)) - block.centre
            raised = max(LIFTS) if scene.arms.is_held(term.body) else 0.0
            near = np.linalg.norm(ahead[:, :2], axis=1) <= AT_POSE
            return np.asarray(near & (ahead[:, 2] >= -AT_POSE) & (ahead[:, 2] <= raised + AT_POSE))
        case name:
            limits = bounds(term.within, term.beyond, OF_A_THING[name])
            viewer = term.viewer or scene.base()[:2]
            area = area_of(name, name, term.body, block, scene.bodies.front(term.body), viewer, 0.0, limits)
            return np.asarray(area.score(middles[:, :2]) > 0)


def _level(rotations: Array, arm: ArmModel, held: Held | None) -> Mask:
    """Whether the hand is level, or what it holds upright."""
    if held is not None:
        return np.asarray((rotations @ held.pose.matrix()[:3, 2])[:, 2] >= math.cos(LEVEL))
    axes = [rotations @ np.asarray(axis) for axis in (arm.frame.approach, arm.frame.closing)]
    return np.asarray(np.max([np.abs(axis[:, 2]) for axis in axes], axis=0) <= math.sin(LEVEL))


def _matrix(rotation: Array, point: Array) -> Array:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, point
    return matrix
