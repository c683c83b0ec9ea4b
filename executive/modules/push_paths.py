"""Paths of a closed hand that pushes a button: along its normal, or leaning from it, until a finger meets it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import base_matrices
from executive.modules.control import Control
from executive.modules.leaf_paths import LeafPath, LeafPaths
from executive.motion import cartesian_path
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, inverse, product, rigid
from sim import controls

LEANINGS = (0.0, 0.4, 0.8)
"""Angles between the way of the hand and the normal of the button [rad]."""
BEFORE, AT, BEYOND = 0.10, 0.05, -0.02
"""Distances of the tip from the button: where the push begins, before it is met, and where it would end [m]."""
DEEPER = 0.01
"""Way on which the hand goes on after it is believed to meet the button [m]: it is stopped by the real one."""
SAMPLES = 24
"""Parts of the way in which the button is looked for."""


class PushPaths(LeafPaths):
    """Looks for ways to push one button with the fingers as they are."""

    def __init__(self, control: Control, button: controls.Control) -> None:
        self._control, self._button = control, button

    def with_arm(self, arm: ArmModel) -> Iterator[LeafPath | None]:
        """Yield ways with one arm, the best places of the base first, None after some of them."""
        self._control.sync()
        yield from self._of_arm(arm, np.zeros(2))

    def _grasps(self, arm: ArmModel, values: Array) -> Array:
        """Return the poses of the tip for each way, before the button, near it and beyond, (g, 3, 4, 4)."""
        pose = self._control.scene.bodies.pose(self._button.body).matrix()
        normal = pose[:3, :3] @ self._button.normal
        point = pose[:3, :3] @ self._button.point + pose[:3, 3]
        up = np.array([0.0, 0.0, 1.0]) if abs(normal[2]) < 0.9 else pose[:3, 0]
        across = np.cross(up, normal)
        across /= np.linalg.norm(across)
        ways = []
        for angle in LEANINGS:
            for axis in (across, -across, np.cross(normal, across), -np.cross(normal, across))[: 4 if angle else 1]:
                away = _about(axis, -angle) @ normal
                for closing in (across, np.cross(away, across)):
                    closing = closing - float(closing @ away) * away
                    rotation = arm.frame.rotation(-away, closing / np.linalg.norm(closing))
                    ways.append([rigid(rotation, point + distance * away) for distance in (BEFORE, AT, BEYOND)])
        return np.array(ways)

    def _beside(self, bases: Array, values: Array) -> NDArray[np.bool_]:
        return np.ones(len(bases), bool)

    def _checked(self, arm: ArmModel, base: BasePose, grasp: Array, values: Array, joints: Array) -> LeafPath | None:
        """Return the way from before the button to where a finger has met it, None if something else is met."""
        collisions, body = self._control.scene.collisions, self._button.body
        fingers = self._control.robot.arm(arm.name).gripper
        assert fingers is not None
        if collisions.contacts(base) or collisions.contacts(base, arm, joints[0]):
            return None
        ends = product(inverse(base_matrices(np.array([base]))[0]), grasp[[0, 2]])
        line = cartesian_path(arm.solver, joints[0], ends[0], ends[1], lambda q: True, steps=SAMPLES)
        if line.waypoints is None:
            return None
        met: int | None = None
        tips = arm.solver.chain.fk(line.waypoints)[:, :3, 3]
        for number, row in enumerate(line.waypoints):
            contacts = collisions.contacts(base, arm, row)
            if any(one.body != body or one.part not in fingers.finger_links for one in contacts):
                break
            if contacts and met is None:
                met = number
            if met is not None and np.linalg.norm(tips[number] - tips[met]) > DEEPER:
                break
        if met is None:
            return None
        last = max(met, number - 1)
        share = np.linalg.norm(tips[last] - tips[0]) / np.linalg.norm(tips[-1] - tips[0])
        end = grasp[2].copy()
        end[:3, 3] = grasp[0][:3, 3] + share * (grasp[2][:3, 3] - grasp[0][:3, 3])
        poses = np.stack([grasp[0], end])
        return LeafPath(arm, base, joints[0], poses, np.zeros(1), line.waypoints[last][None])


def _about(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) about a unit vector (Rodrigues)."""
    cross = cross_matrix(axis)
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * product(cross, cross))
