"""Says why no hand gets to a button, and how its device would have to stand in the map."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.explanations import called
from executive.modules.platform import Platform
from executive.modules.stances import distances
from executive.robots.arms import ArmModel
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array, Pose
from sim.controls import Control

STEP = 0.05
"""A device is supposed to stand nearer to an edge by multiples of this [m]."""
FROM_EDGE = 0.02
"""A device is not supposed to stand nearer to an edge than this [m]."""
UPRIGHT = 0.7
"""Vertical part of the normal of a button from which on it is on top of its device: this has no front."""
ROUND = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""Half a turn about the vertical."""

Reaches = Callable[[], bool]
"""Tells whether a hand gets to the button, as the scene is supposed to be."""


def button_failure(
    button: Control, arms: Sequence[ArmModel], platform: Platform, reaches: Reaches
) -> LocationUnresolvable:
    """Return why no base pose was found from which one of ``arms`` pushes a button, with what would do."""
    figures = "; ".join(filter(None, (_too_far(button, arms, platform), _otherwise(button, platform.scene, reaches))))
    return LocationUnresolvable(designator=f"the base with a hand at {button.body}", figures=figures)


def _too_far(button: Control, arms: Sequence[ArmModel], platform: Platform) -> str:
    """Return how near the shoulders get to a button, if that is farther than arms reach; "" else."""
    pose = platform.scene.bodies.pose(button.body) @ Pose(button.point)
    away = {arm.name: distances(platform, [np.array([pose.position[:2]])], [arm])[0] for arm in arms}
    if not arms or any(away[arm.name] < arm.reach for arm in arms):
        return ""
    arm = min(arms, key=lambda one: away[one.name] - one.reach)
    near = f"the shoulder of {called(arm.name)} gets no nearer than {away[arm.name]:.2f} m to it"
    return f"{near}, and the arm reaches {arm.reach:.2f} m"


def _otherwise(button: Control, scene: PlanningScene, reaches: Reaches) -> str:
    """Return what would do: the device nearer to the edge that its button faces, or turned; "" if neither."""
    bodies, device = scene.bodies, button.device
    normal = bodies.pose(button.body).rotation @ np.array(button.normal)
    support = bodies.support(device)
    if abs(float(normal[2])) > UPRIGHT or support is None or bodies.is_room(support):
        return ""

    def does(poses: Mapping[str, Pose | None]) -> bool:
        with scene.supposing(poses):
            return reaches()

    steps = _steps_to_edge(device, support, normal, scene)
    if steps and does(_moved(button, steps[-1] * normal, scene)):
        first = bisect_left(steps, True, key=lambda step: does(_moved(button, step * normal, scene)))
        step = steps[min(first, len(steps) - 1)]
        x, y, _ = _moved(button, step * normal, scene)[device].position
        return f"with {device} moved {step:.2f} m, to x = {x:.2f}, y = {y:.2f}, it could be reached"
    if does(_turned(button, scene)):
        return f"with {device} turned by 180 degrees it could be reached"
    edge = f"moving {device} to the edge of {support} that it faces or " if steps else ""
    return f"{edge}turning {device} by 180 degrees would not help"


def _steps_to_edge(device: str, support: str, normal: Array, scene: PlanningScene) -> list[float]:
    """Return distances by which a device may stand nearer to an edge of its support, the way its button shows [m]."""
    block, thing = scene.bodies.block(support), scene.bodies.block(device)
    heading = math.atan2(normal[1], normal[0])
    over = block.support(heading) - float(normal[:2] @ [thing.x - block.x, thing.y - block.y])
    most = over - thing.support(heading) - FROM_EDGE
    return [*np.arange(STEP, most, STEP).tolist(), math.floor(100 * most) / 100] if most > 0 else []


def _moved(button: Control, by: Array, scene: PlanningScene) -> dict[str, Pose]:
    """Return the poses of a device and its button, moved horizontally by a vector (3,) [m]."""
    found = {}
    for name in dict.fromkeys((button.device, button.body)):
        pose = scene.bodies.pose(name)
        x, y, z = pose.position
        found[name] = replace(pose, position=(x + float(by[0]), y + float(by[1]), z))
    return found


def _turned(button: Control, scene: PlanningScene) -> dict[str, Pose]:
    """Return the poses of a device and its button with the device turned by half a turn about the vertical."""
    x, y, _ = scene.bodies.pose(button.device).position
    about = Pose((x, y, 0.0)) @ ROUND @ Pose((-x, -y, 0.0))
    return {name: about @ scene.bodies.pose(name) for name in dict.fromkeys((button.device, button.body))}
