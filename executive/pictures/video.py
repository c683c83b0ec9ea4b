"""Videos of runs: the world from a camera that follows the robot, beside the steps of the plan."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from executive.pictures.rendering import View
from executive.pictures.scene_picture import render_poses, stated_view
from executive.pictures.stage import Path, Stage, ends_of
from executive.pictures.steps import column, steps_in
from executive.pictures.viewpoints import Moment, best_direction, fitting, moment_of, overview, subjects
from planlang.geometry import Array, Pose
from planlang.outputs import MARK
from planlang.progress import Report, unreported
from planlang.report.wording import Wording
from planlang.runs.run_tree import RunTree

if TYPE_CHECKING:
    from sim.truth import Truth

SIZE, COLUMN = (560, 420), 270
"""Size of the picture, and width of the column beside it [pixels]."""
KEPT = 5
"""Initial sampling rate in plan time [Hz]."""
MOST = 110
"""Largest number of frames; longer runs are played faster."""
FRAME, LAST = 120, 4000
"""Duration of a frame, and of the last one [ms]."""
SHORTEST = 2
"""Shortest halt of the base at which the camera stops [samples]."""
GENTLE = 5
"""Half the width of the window that smooths the camera's motion [frames]."""
ROOM = 0.5
"""Margin of the camera at each side of the driving robot, as a fraction of the robot's width."""
STILL = 0.02
"""Largest movement of the base between two samples at which it counts as standing [m]."""
QUALITY = 62
"""WebP quality, 0..100: lines stay clean, and a video of 110 frames has less than 2 MB."""


class Video:
    """Video of one run, whose steps are in ``tree``; its samples are kept in memory until :meth:`save`."""

    def __init__(
        self, world: Truth, rate: int, title: str, tree: RunTree, view: str | None = None, *, wording: Wording
    ) -> None:
        self._stage, self._rate, self._title, self._tree, self._view = Stage(world), rate, title, tree, view
        self._wording = wording
        self._every = rate // KEPT
        self._kept: list[tuple[int, dict[Path, Pose]]] = []
        """Samples: world step, and the poses of all entities after it."""
        self._last = 0

    def frame(self, step: int) -> None:
        """Take a sample after ``step`` world steps, if one is due."""
        self._last = step
        if step % self._every:
            return
        self._kept.append((step, self._stage.poses()))
        if len(self._kept) >= 4 * MOST:  # a long run: halve the sampling rate
            self._kept, self._every = self._kept[::2], 2 * self._every

    def save(self, path: File, names: Collection[str], ending: Sequence[str] = (), report: Report = unreported) -> None:
        """Write an animated WebP; ``names`` are the bodies that the plan refers to.

        The last frame is shown for longer, with lines about the ``ending``.
        """
        self._kept.append((self._last + 1, self._stage.poses()))  # one step later, when all actions have ended
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
        image.paste(Image.fromarray(render_poses(self._stage, poses, view, SIZE)), (0, 0))
        size, time = (COLUMN, SIZE[1]), f"{step / self._rate:.1f} s"
        steps = steps_in(self._tree, self._wording)
        image.paste(column(steps, step, size, self._title, time, ending).finished(), (SIZE[0], 0))
        return image

    def _views(self, moments: Sequence[Mapping[Path, Pose]], names: Collection[str]) -> list[View]:
        """Choose the view of each sample: the direction is constant, and the camera moves while the base drives."""
        aspect, stage = SIZE[0] / SIZE[1], self._stage
        if self._view is not None:
            about = subjects(stage, moments[-1], names)
            return [stated_view(self._view, stage, moments[-1], about, aspect)] * len(moments)
        stops = _stops(np.array([self._base(poses) for poses in moments]))
        halts = [self._halt(moments[first : last + 1], names) for first, last in stops]
        if not any(len(one.points) for one in halts):
            return [overview(stage, moments[-1], aspect)] * len(moments)
        ahead = best_direction(stage, halts, aspect)
        raw = [fitting(self._robot_with_room(poses), ahead, aspect) for poses in moments]
        for (first, last), one in zip(stops, halts, strict=True):
            raw[first : last + 1] = [fitting(one.points, ahead, aspect)] * (last + 1 - first)
        return _smooth(raw)

    def _robot_with_room(self, poses: Mapping[Path, Pose]) -> Array:
        """Corners (8, 3) of the robot's bounding box, with a margin at its sides."""
        low, high = self._stage.bounds(poses, self._stage.robot(poses))
        room = (high - low) * [ROOM, ROOM, 0.0]
        return ends_of(low - room, high + room)

    def _base(self, poses: Mapping[Path, Pose]) -> tuple[float, float]:
        robot = self._stage.robot(poses)
        x, y, _ = poses[robot[0]].position if robot else (0.0, 0.0, 0.0)
        return x, y

    def _halt(self, moments: Sequence[Mapping[Path, Pose]], names: Collection[str]) -> Moment:
        """Last sample of a halt, whose points also contain the subjects' earlier poses during the halt."""
        about = subjects(self._stage, moments[-1], names)
        points = [moment_of(self._stage, poses, about).points for poses in moments[:: max(1, len(moments) // 4)]]
        last = moment_of(self._stage, moments[-1], about)
        return Moment(last.poses, last.about, np.concatenate([*points, last.points]))


def _stops(bases: Array) -> list[tuple[int, int]]:
    """First and last sample of each halt of the base; the whole run if it never halts."""
    still = np.linalg.norm(np.diff(bases, axis=0), axis=1) < STILL
    edges = np.flatnonzero(np.diff(np.r_[False, still, False].astype(int)))
    halts = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    return [(first, last) for first, last in halts if last - first >= SHORTEST] or [(0, len(bases) - 1)]


def _smooth(views: Sequence[View]) -> list[View]:
    """Smooth eyes and targets over time by a Hann window."""
    both = np.array([(*view.eye, *view.target) for view in views])
    padded = np.pad(both, [(GENTLE, GENTLE), (0, 0)], mode="edge")
    weights = 1 + np.cos(np.linspace(-np.pi, np.pi, 2 * GENTLE + 3)[1:-1])
    mean = sum(padded[k : k + len(both)] * weight for k, weight in enumerate(weights)) / weights.sum()
    return [View((a, b, c), (d, e, f)) for a, b, c, d, e, f in mean.tolist()]
