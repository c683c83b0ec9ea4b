"""Log of the poses of bodies and of the robot's links during a run, for ``planlang export``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.pictures.pose_track import Placed
from planlang.diagnostics import BadInput
from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines, transform_lines
from planlang.outputs import beside, is_device, open_output, unwritable, write_all

ROBOT = "robot"
"""Beginning of the paths of the robot's links."""


class PoseLog:
    """Watcher of a :class:`PoseTrack` that writes a log; ``header`` is that of the run's trace.

    The file is hidden until :meth:`begin`, so that an older log survives if a repeated run turns out to differ.
    """

    def __init__(self, rate: int, path: Path, header: Mapping[str, object]) -> None:
        self._rate, self._count = rate, 0
        self._links: set[str] = set()
        """Names of the robot's links."""
        known = {key: header.get(key) for key in IDENTITY}
        self._path = path
        self._coming = path if is_device(path) else beside(path, ".new", ".")
        try:
            if self._coming is not path:
                self._coming.unlink(missing_ok=True)
            self._file = open_output(self._coming)
        except OSError as problem:
            raise BadInput([unwritable(path, problem)]) from None
        try:
            self._write("".join(pose_lines((), self._rate, None, **known)))
        except BadInput:
            self.close()
            raise

    def begin(self) -> None:
        """Replace the older log."""
        if self._coming is not self._path:
            self._coming.replace(self._path)
            self._coming = self._path

    def __call__(self, step: int, poses: Sequence[Placed]) -> None:
        """Write the poses of what has moved. Raises BadInput if that fails."""
        self._links.update(one.path[-1] for one in poses if one.path[0] == ROBOT)
        moved = [
            Transform(step, self._name(one.frame), self._name(one.path), one.pose.position, one.pose.orientation, "log")
            for one in poses
            if one.pose is not None
        ]
        self._write("".join(transform_lines(moved, self._rate, None, self._count)))
        self._count += len(moved)

    def _write(self, lines: str) -> None:
        try:
            write_all(self._file, lines.encode())
        except OSError as problem:
            raise BadInput([unwritable(self._path, problem)]) from None

    def close(self) -> None:
        """Close the log; delete one that has not begun."""
        self._file.close()
        if self._coming is not self._path:
            self._coming.unlink()

    def _name(self, path: tuple[str, ...]) -> str:
        """Frame of a path: limbs of people are named after their bodies, a body named as a link after the map as well.

        So the links of another robot in the map are told from those of the robot that runs the plan.
        """
        if not path:
            return MAP
        is_link_too = path[0] != ROBOT and path[1] in self._links
        return "/".join((MAP, *path[1:]) if is_link_too else path[1:])
