"""Whether the base gets away from where it works: from beside a drawer that is open then, with a thing in the hand."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from typing import TypeVar

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations import HandSolution
from executive.locations.standing import AWAY
from executive.motion.base_path import poses_along
from executive.robots import CARRYING
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, WorldState

T = TypeVar("T")

MOST_QUESTIONS = 6
"""Candidates of one decision about which it is asked whether the base gets away; more differ little."""
FAR_ENOUGH = 0.35
"""Length of a straight way out [m]: the hand is then no longer over the drawer beside which the base stands."""
STRIDE = 0.05
"""Spacing of the exact checks along it [m]."""
NEAR = 0.8
"""Distance from an open door or drawer within which it may close the base's way [m]."""


def leaving_first(candidates: Iterable[T], leaves: Callable[[T], bool]) -> Iterator[T]:
    """Yield candidates in their order, but those from which the base does not get away last.

    ``leaves`` is asked until :data:`MOST_QUESTIONS` were put off. A failure that ends the candidates is raised after
    those that were put off.
    """
    put_off, ended = list[T](), list[LocationUnresolvable]()
    for candidate in _until_failure(candidates, ended):
        if len(put_off) == MOST_QUESTIONS or leaves(candidate):
            yield candidate
            continue
        put_off.append(candidate)
        if len(put_off) == MOST_QUESTIONS:
            yield from put_off
    if len(put_off) < MOST_QUESTIONS:
        yield from put_off
    if ended:
        raise ended[0]


def _until_failure(candidates: Iterable[T], ended: list[LocationUnresolvable]) -> Iterator[T]:
    """Yield candidates up to the failure that ends them, which is noted."""
    try:
        yield from candidates
    except LocationUnresolvable as problem:
        ended.append(problem)


def gets_away(scene: PlanningScene, state: WorldState) -> bool:
    """Check whether the base can drive straight out of where it stands in a state, in one of a few directions.

    True also if no open door or drawer is near. What the robot touches at the start does not count: where a hand
    cannot be parked, the base backs off before.
    """
    then = scene.supposing(state)
    base = then.base()
    if scene.robot.base.fixed or not any(_is_open_near(leaf, base, then) for leaf in then.belief.joints):
        return True
    touched = _pairs(then, base)
    x, y, yaw = base
    for turn in AWAY:
        out = x + FAR_ENOUGH * math.cos(yaw + turn), y + FAR_ENOUGH * math.sin(yaw + turn), yaw
        if all(_pairs(then, pose) <= touched for pose in poses_along(np.array([base, out]), STRIDE)):
            return True
    return False


def _is_open_near(leaf: str, base: BasePose, scene: PlanningScene) -> bool:
    block = scene.bodies.block(leaf)
    return scene.belief.is_left_open(leaf) and block.away(np.array([*base[:2], block.centre[2]])) < NEAR


def _pairs(scene: PlanningScene, base: BasePose) -> set[tuple[str, str]]:
    return {(contact.part, contact.body) for contact in scene.collisions.contacts(base)}


def at_rest(scene: PlanningScene, state: WorldState, base: BasePose) -> WorldState:
    """Make the state that differs from another by the base's pose, and by empty arms in their carrying posture."""
    robot = scene.belief.robot
    posture = scene.robot.postures.get(CARRYING, {})
    empty = {name for arm in scene.arms.all if scene.arms.held(arm.name) is None for name in arm.joints}
    tucked = {name: value for name, value in posture.items() if name in empty}
    return state.with_robot(robot, Configuration(base, {**state.robots[robot].joints, **tucked}))


def with_in_hand(scene: PlanningScene, state: WorldState, grasp: HandSolution) -> WorldState:
    """Make the state in which a hand has grasped a thing as a solution says, and has brought it to the base."""
    arm, thing = grasp.arm, grasp.reach.body
    offset = Pose.from_matrix(grasp.plan.poses[min(1, len(grasp.plan.poses) - 1)]).inverse() @ scene.bodies.pose(thing)
    return replace(state.gripped(thing, Hold(arm.name, arm.tip, offset)), led={})
