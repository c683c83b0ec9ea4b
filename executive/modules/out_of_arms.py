"""Correct camera detections by the arms' encoders: no object can be where a hand or an arm is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from executive.belief.planning_scene import PlanningScene
from planlang.geometry import Pose

STEP, STEPS, HEADINGS = 0.005, 10, 16
"""Step [m], steps and directions by which to shift an object: cameras err by a few centimetres."""


def out_of_arms(seen: Iterable[str], scene: PlanningScene) -> dict[str, Pose]:
    """Find seen objects that overlap an arm, each with the nearest free pose at its height.

    Graspable objects only, without held ones; those that penetrate too deeply to be moved out are left out.
    """
    overlapping = frozenset(_in_arms(scene))
    inside = [one for one in seen if one in overlapping and scene.bodies.is_graspable(one)]
    shifted = {one: _beside(one, scene) for one in inside if not scene.bodies.is_held(one)}
    return {name: pose for name, pose in shifted.items() if pose is not None}


def _in_arms(scene: PlanningScene) -> Iterator[str]:
    """Yield the bodies that overlap an arm in its current configuration."""
    joints = scene.world.configuration().joints
    for arm in scene.arms.all:
        now = np.array([joints[one] for one in arm.joints])
        yield from (contact.body for contact in scene.collisions.contacts(scene.base(), arm, now))


def _beside(name: str, scene: PlanningScene) -> Pose | None:
    """Find the nearest horizontally shifted pose of an object that overlaps no arm; None if none is in range."""
    believed = scene.world.pose(name)
    x, y, z = believed.position
    for number in range(1, STEPS + 1):
        for heading in range(HEADINGS):
            angle, away = heading * 2 * math.pi / HEADINGS, number * STEP
            pose = Pose((x + away * math.cos(angle), y + away * math.sin(angle), z), believed.orientation)
            if name not in _in_arms(scene.supposing(scene.belief.state.placed({name: pose}))):
                return pose
    return None
