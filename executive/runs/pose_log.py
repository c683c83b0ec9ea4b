"""A log of where bodies and the robot's links are while a run goes on, for ``planlang export``.

It is written as the run goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from planlang.diagnostics import BadInput, error
from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines, transform_lines
from planlang.geometry import Pose
from planlang.outputs import write_text
from sim.truth import Truth

RATE = 10
"""Times a second that poses are noted, of what has moved; NEEMs have about as many."""
MOVED = 1e-6
"""Less than this [m, or of a quaternion] is no movement: links in their parents' frames are computed."""


class PoseLog:
    """Called with the true world after each of its steps; ``header`` is that of the run's trace.

    It is a hidden file until :meth:`begin`: a run that repeats another one destroys nothing if it does something else.

    Links are told in the frames of the links that they hang on, so that those of an arm at rest do not move with the
    base; the root link and bodies in the map, limbs of people in the frames of their bodies.
    """

    def __init__(self, world: Truth, path: Path, header: Mapping[str, object]) -> None:
        self._rate = world.rate
        self._above = world.links()
        self._last: dict[str, tuple[float, ...]] = {}
        self._count = 0
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

    def __call__(self, world: Truth) -> None:
        """Write what has moved; raises BadInput if that cannot be written."""
        if world.steps % max(1, world.rate // RATE):
            return
        found = []
        for frame, name, pose in self._placed(world):
            now, last = (*pose.position, *pose.orientation), self._last.get(name)
            if last is None or max(abs(one - other) for one, other in zip(now, last, strict=True)) > MOVED:
                self._last[name] = now
                found.append(Transform(world.steps, frame, name, pose.position, pose.orientation, "log"))
        if found:
            self._write("".join(transform_lines(found, self._rate, None, self._count)))
            self._count += len(found)

    def _write(self, lines: str) -> None:
        try:
            self._file.write(lines.encode())
        except OSError as problem:
            raise BadInput([error("C004", f"{self._path} cannot be written: {problem.strerror}")]) from None

    def _placed(self, world: Truth) -> Iterator[tuple[str, str, Pose]]:
        for name in world.names():
            yield MAP, name, world.pose(name)
            for number, (part, pose) in enumerate(world.pieces(name)):
                if part.limb:
                    yield name, f"{name}/limb{number}", pose
        links = {name: world.link_pose(name) for name in self._above}
        for name, pose in links.items():
            above = self._above[name]
            if above is None:
                yield MAP, name, pose
            else:
                yield above, name, links[above].inverse() @ pose

    def close(self) -> None:
        """End the log; one that has not begun is no log."""
        self._file.close()
        if self._coming is not self._path:
            self._coming.unlink()
