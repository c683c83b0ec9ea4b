"""Views: which points of the map the robot would see from base poses."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from planlang.geometry import Array, Pose, matrices
from sim import CameraModel

NEARLY = 0.02
"""Distance before a point at which lines of sight end, as the point may lie on a surface [m]."""
PIXELS = 12.0
"""Pixels sufficient to recognise a thing, with a margin for partial occlusion."""
FRAME = 0.5
"""Share of the camera's half angle within which points count as visible, so that things there fit the picture."""

SCREEN = 0.08
"""Distance of lines of sight from measured surfaces in front of a point [m]: points are 0.15 m apart."""
PIXEL = 0.02
"""Angle between a point and the nearest pixel of a picture that contains the point [rad]."""
BEFORE = 0.05
"""Difference in distance above which a nearer surface hides a point [m]."""
NO_SCREENS = np.zeros((0, 3))
"""No measured surfaces besides those in the believed world."""

Size = tuple[float, float, float]


class Views:
    """Pictures that the camera would take in the believed world; the true one is not queried."""

    def __init__(self, scene: PlanningScene) -> None:
        self.scene = scene

    def seen(
        self, bases: Array, points: Array, size: Size | None = None, screens: Array = NO_SCREENS
    ) -> NDArray[np.bool_]:
        """Check which points (m, 3) the camera can be turned to from bases (n, 3) with a clear line of sight, (n, m).

        With the ``size`` (x, y, z) of a thing [m], it must also have enough pixels there to be recognised. ``screens``
        (k, 3) are points of the map at which something unknown hides what is behind it.
        """
        camera, gaze = self.scene.robot.camera, self.scene.visibility.gaze
        shown = np.zeros((len(bases), len(points)), bool)
        if camera is None or gaze is None or not shown.size:
            return shown
        for row, base in enumerate(bases.tolist()):
            frame = Pose.planar(*base).matrix()
            local = matrices.moved(matrices.inverse(frame), points)
            distances = np.hypot(local[:, 0], local[:, 1])
            near = np.flatnonzero(distances <= camera.far)
            if not len(near):
                continue
            beyond, eyes = gaze.at_all(local[near])
            distances = np.linalg.norm(local[near] - eyes, axis=1)
            fits = (beyond <= FRAME * camera.half_angle) & (distances >= camera.near) & (distances <= camera.far)
            if size is not None:
                fits &= _pixels(camera, local[near] - eyes, size) >= PIXELS
            near, eyes = near[fits], matrices.moved(frame, eyes[fits])
            lines = points[near] - eyes
            ends = points[near] - lines * (NEARLY / np.maximum(np.linalg.norm(lines, axis=1), NEARLY))[:, None]
            shown[row, near] = self.scene.world.clear_lines(eyes, ends) & ~_crossed(eyes, ends, screens)
        return shown

    def gazes(self, base: BasePose, points: Array) -> Iterator[Array]:
        """Yield some of the points (m, 3) to look at, so that pictures from a base pose cover all of them."""
        camera, gaze = self.scene.robot.camera, self.scene.visibility.gaze
        if camera is None or gaze is None:
            return
        local = matrices.moved(matrices.inverse(Pose.planar(*base).matrix()), points)
        eye = gaze.at_all(local.mean(axis=0)[None])[1][0] if len(local) else np.zeros(3)
        arrows = local - eye
        arrows /= np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)[:, None]
        covers = arrows @ arrows.T >= np.cos(FRAME * camera.half_angle)
        uncovered = np.ones(len(points), bool)
        while uncovered.any():
            best = int(np.argmax((covers & uncovered).sum(axis=1) * uncovered))
            uncovered &= ~covers[best]
            yield points[best]


def hiding(eye: Array, points: Array, ends: Array, at_surface: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], Array]:
    """Find which points (n, 3) are hidden in a depth picture taken at ``eye`` (3,), (n,), and by what.

    The picture's lines of sight end at ``ends`` (m, 3), on a surface where ``at_surface`` (m,). The second array (k, 3)
    holds those ends in front of hidden points. A picture without depth tells of none.
    """
    if not len(ends):
        return np.zeros(len(points), bool), ends
    nearest, cosines, lengths, distances = _nearest_lines(eye, points, ends)
    hides = (cosines >= np.cos(PIXEL)) & at_surface[nearest] & (lengths < distances - BEFORE)
    return hides, ends[nearest[hides]]


def passed(eye: Array, points: Array, ends: Array, within: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find which points (n, 3) a depth picture taken at ``eye`` (3,) shows, and at which of them nothing is, (n,) each.

    The picture's lines of sight end at ``ends`` (m, 3). One shows a point if it goes by ``within`` a distance [m], and
    ends no nearer; nothing is there if it goes on behind it. A picture without depth shows none.
    """
    if not len(ends):
        return np.zeros(len(points), bool), np.zeros(len(points), bool)
    _, cosines, lengths, distances = _nearest_lines(eye, points, ends)
    sines = np.sqrt(np.clip(1.0 - cosines**2, 0.0, 1.0))
    shown = (distances * sines <= within) & (lengths >= distances - BEFORE)
    return shown, shown & (lengths > distances + BEFORE)


def _nearest_lines(eye: Array, points: Array, ends: Array) -> tuple[NDArray[np.intp], Array, Array, Array]:
    """Find the line of sight nearest to each of n points: its number, the cosine of the angle to it, and its length.

    And the distances of the points from the eye; (n,) each.
    """
    lines, away = ends - eye, points - eye
    lengths, distances = np.linalg.norm(lines, axis=1), np.linalg.norm(away, axis=1)
    cosines = (away / np.maximum(distances, 1e-9)[:, None]) @ (lines / np.maximum(lengths, 1e-9)[:, None]).T
    nearest = cosines.argmax(axis=1)
    return nearest, cosines[np.arange(len(points)), nearest], lengths[nearest], distances


def _crossed(starts: Array, ends: Array, screens: Array) -> NDArray[np.bool_]:
    """Check which lines from starts (n, 3) to ends (n, 3) pass points (k, 3) that hide what is behind them, (n,)."""
    lines = ends - starts
    offsets = screens[None] - starts[:, None]
    along = np.einsum("nkd,nd->nk", offsets, lines) / np.maximum(np.einsum("nd,nd->n", lines, lines), 1e-9)[:, None]
    apart = np.linalg.norm(offsets - np.clip(along, 0.0, 1.0)[:, :, None] * lines[:, None], axis=2)
    return np.asarray((apart < SCREEN).any(axis=1))


def _pixels(camera: CameraModel, arrows: Array, size: Size) -> Array:
    """Estimate the pixels of an upright box centred at arrows (n, 3) from the eye, (n,)."""
    distances = np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)
    x, y, z = size
    area = (x * y * np.abs(arrows[:, 2]) + min(x, y) * z * np.hypot(arrows[:, 0], arrows[:, 1])) / distances
    focal = camera.width / (2.0 * np.tan(camera.fov / 2))
    return np.asarray(area * (focal / distances) ** 2)
