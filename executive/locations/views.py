"""Places where the robot could stand to look at points of the map, and the points that it would see from there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from planlang.geometry import Array, Pose, matrices
from sim import CameraModel

NEARLY = 0.02
"""Lines of sight end this far before a point, which may lie on a surface [m]."""
PIXELS = 12.0
"""Pixels of a thing that are enough to recognise it, with some to spare for what hides a part of it."""
FRAME = 0.5
"""Share of the camera's half angle in which points count as shown: a thing about them is to be in the picture whole."""

SCREEN = 0.08
"""Lines of sight keep this far from what a picture of depths shows before a point [m]: points are 0.15 m apart."""
PIXEL = 0.02
"""Angle between the lines of sight to a point and to the nearest pixel, in a picture that shows the point [rad]."""
BEFORE = 0.05
"""A surface that is so much nearer to the camera than a point hides it [m]."""
NO_SCREENS = np.zeros((0, 3))
"""Nothing was measured that the world of the belief does not have."""

Size = tuple[float, float, float]


class Views:
    """Pictures that the camera would take in the believed world; nothing of the true one is asked."""

    def __init__(self, scene: PlanningScene) -> None:
        self.scene = scene

    def seen(
        self, bases: Array, points: Array, size: Size | None = None, screens: Array = NO_SCREENS
    ) -> NDArray[np.bool_]:
        """Return which points (m, 3) the neck can turn the camera to from bases (n, 3) with nothing between, (n, m).

        With the ``size`` (x, y, z) of a thing [m]: only those at which it would have enough pixels to be recognised.
        ``screens`` (k, 3) are points of the map at which something unknown hides what is behind it.
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
            shown[row, near] = self.scene.world.clear_lines(eyes, ends) & ~_crossed(eyes, ends, screens)
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


def hiding(eye: Array, points: Array, ends: Array, at_surface: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Array]:
    """Return which points (n, 3) a picture of depths taken at ``eye`` (3,) shows to be hidden, (n,), and by what.

    The picture's lines of sight end at ``ends`` (m, 3), on a surface where ``at_surface`` (m,). The second array
    (k, 3) are those ends before the hidden points.
    """
    lines, away = ends - eye, points - eye
    long, far = np.linalg.norm(lines, axis=1), np.linalg.norm(away, axis=1)
    alike = (away / np.maximum(far, 1e-9)[:, None]) @ (lines / np.maximum(long, 1e-9)[:, None]).T
    nearest = alike.argmax(axis=1)
    is_shown = alike[np.arange(len(points)), nearest] >= np.cos(PIXEL)
    hides = is_shown & at_surface[nearest] & (long[nearest] < far - BEFORE)
    return hides, ends[nearest[hides]]


def _crossed(starts: Array, ends: Array, screens: Array) -> NDArray[np.bool_]:
    """Return which lines from starts (n, 3) to ends (n, 3) pass points (k, 3) that hide what is behind them, (n,)."""
    lines = ends - starts
    away = screens[None] - starts[:, None]
    along = np.einsum("nkd,nd->nk", away, lines) / np.maximum(np.einsum("nd,nd->n", lines, lines), 1e-9)[:, None]
    apart = np.linalg.norm(away - np.clip(along, 0.0, 1.0)[:, :, None] * lines[:, None], axis=2)
    return np.asarray((apart < SCREEN).any(axis=1))


def _pixels(camera: CameraModel, arrows: Array, size: Size) -> Array:
    """Return about how many pixels an upright box has whose middle is at arrows (n, 3) from the eye, (n,)."""
    away = np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)
    x, y, z = size
    area = (x * y * np.abs(arrows[:, 2]) + min(x, y) * z * np.hypot(arrows[:, 0], arrows[:, 1])) / away
    focal = camera.width / (2.0 * np.tan(camera.fov / 2))
    return np.asarray(area * (focal / away) ** 2)
