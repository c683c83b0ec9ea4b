"""Places where the robot could stand to look at points of the map, and the points that it would see from there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from planlang.geometry import Array, Pose, matrices
from sim import CameraModel

SPACING = 0.25
"""Distance of places of the base that are compared [m]."""
NEARLY = 0.02
"""Lines of sight end this far before a point, which may lie on a surface [m]."""
PIXELS = 12.0
"""Pixels of a thing that are enough to recognise it, with some to spare for what hides a part of it."""
FRAME = 0.5
"""Share of the camera's half angle in which points count as shown: a thing about them is to be in the picture whole."""

Size = tuple[float, float, float]


class Views:
    """Pictures that the camera would take in the believed world; nothing of the true one is asked."""

    def __init__(self, scene: PlanningScene) -> None:
        self.scene = scene

    def places(self, spacing: float = SPACING) -> Array:
        """Return places (n, 2) [m] on the floor where the base has room to turn and to which it can drive."""
        floor = self.scene.collisions.floor()
        x_min, y_min, x_max, y_max = floor.bounds
        xs, ys = (np.arange(low + spacing / 2, high, spacing) for low, high in ((x_min, x_max), (y_min, y_max)))
        points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        points = points[floor.at(points) > 0.0]
        return points[self.scene.collisions.drivable()(np.column_stack([points, np.zeros(len(points))]))]

    def seen(self, bases: Array, points: Array, size: Size | None = None) -> NDArray[np.bool_]:
        """Return which points (m, 3) the neck can turn the camera to from bases (n, 3) with nothing between, (n, m).

        With the ``size`` (x, y, z) of a thing [m]: only those at which it would have enough pixels to be recognised.
        """
        camera, gaze = self.scene.robot.camera, self.scene.visibility.gaze
        shown = np.zeros((len(bases), len(points)), bool)
        if camera is None or gaze is None or not shown.size:
            return shown
        for row, base in enumerate(bases.tolist()):
            frame = Pose.planar(*base).matrix()
            local = matrices.moved(matrices.inverse(frame), points)
            away = np.hypot(local[:, 0], local[:, 1])
            near = np.flatnonzero(away <= camera.far)
            if not len(near):
                continue
            beyond, eyes = gaze.at_all(local[near])
            away = np.linalg.norm(local[near] - eyes, axis=1)
            fits = (beyond <= FRAME * camera.half_angle) & (away >= camera.near) & (away <= camera.far)
            if size is not None:
                fits &= _pixels(camera, local[near] - eyes, size) >= PIXELS
            near, eyes = near[fits], matrices.moved(frame, eyes[fits])
            lines = points[near] - eyes
            ends = points[near] - lines * (NEARLY / np.maximum(np.linalg.norm(lines, axis=1), NEARLY))[:, None]
            shown[row, near] = self.scene.world.clear_lines(eyes, ends)
        return shown

    def gazes(self, base: BasePose, points: Array) -> Iterator[Array]:
        """Yield some of the points (m, 3) to turn the camera to, so that all of them get into a picture from a base."""
        camera, gaze = self.scene.robot.camera, self.scene.visibility.gaze
        if camera is None or gaze is None:
            return
        local = matrices.moved(matrices.inverse(Pose.planar(*base).matrix()), points)
        eye = gaze.at_all(local.mean(axis=0)[None])[1][0] if len(local) else np.zeros(3)
        arrows = local - eye
        arrows /= np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)[:, None]
        together = arrows @ arrows.T >= np.cos(FRAME * camera.half_angle)
        left = np.ones(len(points), bool)
        while left.any():
            best = int(np.argmax((together & left).sum(axis=1) * left))
            left &= ~together[best]
            yield points[best]


def _pixels(camera: CameraModel, arrows: Array, size: Size) -> Array:
    """Return about how many pixels an upright box has whose middle is at arrows (n, 3) from the eye, (n,)."""
    away = np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)
    x, y, z = size
    area = (x * y * np.abs(arrows[:, 2]) + min(x, y) * z * np.hypot(arrows[:, 0], arrows[:, 1])) / away
    focal = camera.width / (2.0 * np.tan(camera.fov / 2))
    return np.asarray(area * (focal / away) ** 2)
