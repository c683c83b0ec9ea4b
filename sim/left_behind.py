"""What is left in a true world that harms later: devices that are on, things in the way of doors and drawers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.shapes import corners
from planlang.state.matter import ON
from sim.joints import Articulation
from sim.tolerances import MOVED
from sim.truth import Truth, at_rest_on, is_centred_in

STEPS = 12
"""Number of openings of a door or drawer at which things are in its way or not."""
TOUCHES = 0.002
"""Depth up to which boxes only touch [m]."""


def left_on(world: Truth) -> Iterator[str]:
    """Yield the devices that are on and were off at first."""
    for body in world.scene.bodies:
        if not body.is_on and body.name in world.names() and world.condition(body.name) == ON:
            yield body.name


def left_in_the_way(world: Truth) -> Iterator[tuple[str, str]]:
    """Yield each thing that was moved and is at rest where a door or drawer cannot pass, and that door or drawer."""
    joints = [joint for joint in world.scene.joints if not joint.is_knob]
    for name in world.names() if joints else ():
        body = world.scene.body(name)
        is_moved = body.movable and world.pose(name).distance(world.scene.first_pose(body)) > MOVED
        if is_moved and at_rest_on(world, name) is not None:
            for joint in joints:
                if name not in joint.bodies and _is_in_the_way(world, name, joint):
                    yield name, joint.leaf


def _is_in_the_way(world: Truth, name: str, joint: Articulation) -> bool:
    """Check whether a leaf touches a thing on its way between closed and open; what is in a drawer moves along."""
    if is_centred_in(world, name, joint.leaf):
        return False
    thing = _Box(world.pose(name), world.scene.body(name).size)
    parts = [(world.scene.body(part).pose, world.scene.body(part).size) for part in joint.bodies]
    for value in np.linspace(0.0, joint.first_open, STEPS).tolist():
        motion = joint.motion(value)
        if any(thing.meets(_Box(motion @ closed, size)) for closed, size in parts):
            return True
    return False


class _Box:
    """A box: its corners (8, 3) and axes (3, 3) in the map."""

    def __init__(self, pose: Pose, size: tuple[float, float, float]) -> None:
        self.corners, self.axes = corners(pose, size), pose.rotation.T

    def meets(self, other: _Box) -> bool:
        """Check whether two boxes overlap: no axis of either, nor one across both, separates them."""
        across = np.cross(self.axes[:, None], other.axes[None]).reshape(-1, 3)
        lengths = np.linalg.norm(across, axis=1)
        axes = np.concatenate([self.axes, other.axes, across[lengths > 1e-6] / lengths[lengths > 1e-6, None]])
        return not bool(_separated(axes, self.corners, other.corners).any())


def _separated(axes: Array, one: Array, other: Array) -> Array:
    """Tell for each axis (n, 3) whether the shadows of two sets of points (m, 3) on it are apart (n,)."""
    first, second = axes @ one.T, axes @ other.T
    gap = np.maximum(first.min(axis=1) - second.max(axis=1), second.min(axis=1) - first.max(axis=1))
    return np.asarray(gap > -TOUCHES)
