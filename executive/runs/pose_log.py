"""A log of where bodies and the robot's links are while a run goes on, for ``planlang export``.

It is written as the run goes on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.pictures.pose_track import Placed
from planlang.diagnostics import BadInput, error
from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines, transform_lines
from planlang.outputs import write_text


class PoseLog:
    """A watcher of a :class:`PoseTrack`; ``header`` is that of the run's trace.

    It is a hidden file until :meth:`begin`: a run that repeats another one destroys nothing if it does something else.
    """

    def __init__(self, rate: int, path: Path, header: Mapping[str, object]) -> None:
        self._rate, self._count = rate, 0
        known = {key: header.get(key) for key in IDENTITY}
        self._path = path
        self._coming = path.with_name(f".{path.name}.new") if path.is_file() or not path.exists() else path
        write_text(self._coming, "".join(pose_lines((), self._rate, None, **known)))
        self._file = self._coming.open("ab", buffering=0)

    def begin(self) -> None:
        """Take the place of an older log."""
        if self._coming is not self._path:
            self._coming.replace(self._path)
            self._coming = self._path

    def __call__(self, step: int, found: Sequence[Placed]) -> None:
        """Write what has moved; raises BadInput if that cannot be written."""
        moved = [
            Transform(step, _name(one.frame), _name(one.path), one.pose.position, one.pose.orientation, "log")
            for one in found
            if one.pose is not None
        ]
        self._write("".join(transform_lines(moved, self._rate, None, self._count)))
        self._count += len(moved)

    def _write(self, lines: str) -> None:
        try:
            self._file.write(lines.encode())
        except OSError as problem:
            raise BadInput([error("C004", f"{self._path} cannot be written: {problem.strerror}")]) from None

    def close(self) -> None:
        """End the log; one that has not begun is no log."""
        self._file.close()
        if self._coming is not self._path:
            self._coming.unlink()


def _name(path: tuple[str, ...]) -> str:
    """The frame of a path: limbs of people are named after their bodies."""
    return "/".join(path[1:]) or MAP
