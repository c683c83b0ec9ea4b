"""Whether the base gets away from where it works: from beside a drawer that is open then, with a thing in the hand."""

from __future__ import annotations

import math

import numpy as np

from executive.ahead.spent import Spent
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.standing import AWAY
from executive.motion.base_path import poses_along
from planlang.state import WorldState

FAR_ENOUGH = 0.35
"""Length of a straight way out [m]: the hand is then no longer over the drawer beside which the base stands."""
STRIDE = 0.05
"""Spacing of the exact checks along it [m]."""
NEAR = 0.8
"""Distance from an open door or drawer within which it may close the base's way [m]."""


def gets_away(scene: PlanningScene, state: WorldState, spent: Spent) -> bool:
    """Check whether the base can drive straight out of where it stands in a state, in one of a few directions.

    True also if no open door or drawer is near. What the robot touches at the start does not count: where a hand
    cannot be parked, the base backs off before. ``spent`` counts the checks.
    """
    then = scene.supposing(state)
    base = then.base()
    if scene.robot.base.fixed or not any(_is_open_near(leaf, base, then) for leaf in then.belief.joints):
        return True
    touched = _pairs(then, base, spent)
    x, y, yaw = base
    for turn in AWAY:
        out = x + FAR_ENOUGH * math.cos(yaw + turn), y + FAR_ENOUGH * math.sin(yaw + turn), yaw
        if all(_pairs(then, pose, spent) <= touched for pose in poses_along(np.array([base, out]), STRIDE)):
            return True
    return False


def _is_open_near(leaf: str, base: BasePose, scene: PlanningScene) -> bool:
    block = scene.bodies.block(leaf)
    return scene.belief.is_left_open(leaf) and block.away(np.array([*base[:2], block.centre[2]])) < NEAR


def _pairs(scene: PlanningScene, base: BasePose, spent: Spent) -> set[tuple[str, str]]:
    spent.checks += 1
    return {(contact.part, contact.body) for contact in scene.collisions.contacts(base)}
