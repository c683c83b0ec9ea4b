"""Corrects what a camera measures by what the arms know: nothing is where a hand or an arm is."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from executive.belief.planning_scene import PlanningScene
from planlang.geometry import Pose
from planlang.protocols import Detection

STEP, STEPS, HEADINGS = 0.005, 10, 16
"""Distances by which a thing is shifted [m], and in how many directions: a camera is wrong by a few centimetres."""


def out_of_arms(detections: Iterable[Detection], scene: PlanningScene) -> list[Detection]:
    """Return those detected things that are believed inside an arm, at the nearest place beside where they are not.

    Only things that can be taken into a hand, which stay at their height; without those that are too deep inside.
    """
    met = frozenset(_met(scene))
    inside = [one for one in detections if one.name in met and scene.bodies.is_graspable(one.name)]
    moved = ((one, _beside(one.name, scene)) for one in inside if not scene.arms.is_held(one.name))
    return [replace(one, pose=pose) for one, pose in moved if pose is not None]


def _met(scene: PlanningScene) -> Iterator[str]:
    """Yield the bodies that arms are inside of as they are."""
    joints = scene.world.configuration().joints
    for arm in scene.arms.all:
        now = np.array([joints[one] for one in arm.joints])
        yield from (contact.body for contact in scene.collisions.contacts(scene.base(), arm, now))


def _beside(name: str, scene: PlanningScene) -> Pose | None:
    """Return the nearest pose of a thing, moved horizontally, with no arm inside of it; None if none is near."""
    believed = scene.world.pose(name)
    x, y, z = believed.position
    try:
        for number in range(1, STEPS + 1):
            for turn in range(HEADINGS):
                angle, away = turn * 2 * math.pi / HEADINGS, number * STEP
                pose = Pose((x + away * math.cos(angle), y + away * math.sin(angle), z), believed.orientation)
                scene.world.set_pose(name, pose)
                if name not in _met(scene):
                    return pose
        return None
    finally:
        scene.world.set_pose(name, believed)
