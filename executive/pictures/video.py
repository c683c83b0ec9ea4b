"""Videos of runs: the world, seen by a camera that follows the robot, beside the steps of the plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from executive.pictures.rendering import View
from executive.pictures.scene_picture import stated_view, taken
from executive.pictures.stage import Path, Stage, ends_of
from executive.pictures.steps import Steps, column
from executive.pictures.viewpoints import Moment, best_direction, fitting, moment_of, overview, subjects
from planlang.geometry import Array, Pose
from planlang.outputs import MARK
from planlang.progress import Report, unreported

if TYPE_CHECKING:
    from sim.truth import Truth

SIZE, COLUMN = (560, 420), 270
"""Pixels of the picture, and the width of the column beside it."""
KEPT = 5
"""Moments that are kept of a second of plan time."""
MOST = 110
"""Frames of a video; a longer run is played faster."""
FRAME, LAST = 120, 4000
"""Time for which a frame is shown, and the last one [ms]."""
SHORTEST = 2
"""Moments for which the base stands at least where the camera stops."""
GENTLE = 5
"""Frames before and after one over which the movement of the camera is smoothed."""
ROOM = 0.5
"""Room that the camera leaves at each side of the robot while this drives, as a share of its width."""
STILL = 0.02
"""Movement of the base between two moments up to which it stands [m]."""
QUALITY = 62
"""Of the pictures, 0..100: lines stay clean, and a video of 110 frames has less than 2 MB."""


class Video:
    """The moments of one run, kept in memory until :meth:`save`."""

    def __init__(self, world: Truth, rate: int, title: str, view: str | None = None) -> None:
        self._stage, self._rate, self._title, self._view = Stage(world), rate, title, view
        self._every = rate // KEPT
        self._kept: list[tuple[int, dict[Path, Pose]]] = []
        """Steps of the world, and where everything was after them."""
        self._last = 0
        self.steps = Steps()

    def frame(self, step: int) -> None:
        """Keep where everything is after ``step`` world steps, if it is time."""
        self._last = step
        if step % self._every:
            return
        self._kept.append((step, self._stage.poses()))
        if len(self._kept) >= 4 * MOST:  # a long run is played faster
            self._kept, self._every = self._kept[::2], 2 * self._every

    def save(self, path: File, names: Collection[str], ending: Sequence[str] = (), report: Report = unreported) -> None:
        """Write an animated WebP; ``names`` are the bodies that the plan is about.

        The last frame stays for a while, with lines about the ``ending``.
        """
        self._kept.append((self._last + 1, self._stage.poses()))  # when every step has ended
        chosen = np.unique(np.linspace(0, len(self._kept) - 1, min(MOST, len(self._kept))).round().astype(int))
        kept = [self._kept[number] for number in chosen.tolist()]
        views = self._views([poses for _, poses in kept], names)
        endings = [()] * (len(kept) - 1) + [ending]
        frames = []
        for number, (one, *more) in enumerate(zip(kept, views, endings, strict=True)):
            report(f"drawing frame {number + 1} of {len(kept)} of {path.name}", number / len(kept))
            frames.append(self._frame(*one, *more))
        report("", 1.0)
        frames[0].save(
            path,
            format="WEBP",
            save_all=True,
            append_images=frames[1:],
            duration=[FRAME] * (len(frames) - 1) + [LAST],
            quality=QUALITY,
            method=4,
            xmp=MARK.encode(),
        )

    def _frame(self, step: int, poses: Mapping[Path, Pose], view: View, ending: Sequence[str]) -> Image.Image:
        image = Image.new("RGB", (SIZE[0] + COLUMN, SIZE[1]), "white")
        image.paste(Image.fromarray(taken(self._stage, poses, view, SIZE)), (0, 0))
        size, time = (COLUMN, SIZE[1]), f"{step / self._rate:.1f} s"
        image.paste(column(self.steps.all, step, size, self._title, time, ending).finished(), (SIZE[0], 0))
        return image

    def _views(self, moments: Sequence[Mapping[Path, Pose]], names: Collection[str]) -> list[View]:
        """Return the view of each moment: all in one direction, that moves on while the base drives."""
        aspect, stage = SIZE[0] / SIZE[1], self._stage
        if self._view is not None:
            about = subjects(stage, moments[-1], names)
            return [stated_view(self._view, stage, moments[-1], about, aspect)] * len(moments)
        stops = _stops(np.array([self._base(poses) for poses in moments]))
        shown = [self._shown(moments[first : last + 1], names) for first, last in stops]
        if not any(len(one.points) for one in shown):
            return [overview(stage, moments[-1], aspect)] * len(moments)
        ahead = best_direction(stage, shown, aspect)
        raw = [fitting(self._robot_with_room(poses), ahead, aspect) for poses in moments]
        for (first, last), one in zip(stops, shown, strict=True):
            raw[first : last + 1] = [fitting(one.points, ahead, aspect)] * (last + 1 - first)
        return _smooth(raw)

    def _robot_with_room(self, poses: Mapping[Path, Pose]) -> Array:
        """Return the corners (8, 3) of the box around the robot, with room at its sides."""
        low, high = self._stage.bounds(poses, self._stage.robot(poses))
        room = (high - low) * [ROOM, ROOM, 0.0]
        return ends_of(low - room, high + room)

    def _base(self, poses: Mapping[Path, Pose]) -> tuple[float, float]:
        robot = self._stage.robot(poses)
        x, y, _ = poses[robot[0]].position if robot else (0.0, 0.0, 0.0)
        return x, y

    def _shown(self, moments: Sequence[Mapping[Path, Pose]], names: Collection[str]) -> Moment:
        """Return the last moment of a stop, with all places that what it is about has been at."""
        about = subjects(self._stage, moments[-1], names)
        every = [moment_of(self._stage, poses, about).points for poses in moments[:: max(1, len(moments) // 4)]]
        last = moment_of(self._stage, moments[-1], about)
        return Moment(last.poses, last.about, np.concatenate([*every, last.points]))


def _stops(bases: Array) -> list[tuple[int, int]]:
    """Return the first and the last moment of each time for which the base stands; all of them if it never does."""
    still = np.linalg.norm(np.diff(bases, axis=0), axis=1) < STILL
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    found = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    return [(first, last) for first, last in found if last - first >= SHORTEST] or [(0, len(bases) - 1)]


def _smooth(views: Sequence[View]) -> list[View]:
    """Return views whose eyes and targets are means of those around them: the camera moves gently."""
    both = np.array([(*view.eye, *view.target) for view in views])
    padded = np.pad(both, [(GENTLE, GENTLE), (0, 0)], mode="edge")
    weights = 1 + np.cos(np.linspace(-np.pi, np.pi, 2 * GENTLE + 3)[1:-1])
    mean = sum(padded[k : k + len(both)] * weight for k, weight in enumerate(weights)) / weights.sum()
    return [View((a, b, c), (d, e, f)) for a, b, c, d, e, f in mean.tolist()]
