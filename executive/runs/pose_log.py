"""A log of where bodies and the robot's links are while a run goes on, for ``planlang export``.

It is written as the run goes on, so that a run that was killed can be resumed with a log of all of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines, read_log, transform_lines
from planlang.geometry import Pose
from planlang.outputs import write_text
from sim import PyBulletWorld

RATE = 10
"""Times a second that poses are noted, of what has moved; NEEMs have about as many."""
MOVED = 1e-6
"""Less than this [m, or of a quaternion] is no movement: links in their parents' frames are computed."""


def earlier_poses(path: Path, header: Mapping[str, object], until: int, found: list[Diagnostic]) -> list[Transform]:
    """Return the poses that an interrupted run has logged up to a world step, from which it is resumed.

    Without such a log ``found`` gets a warning; raises BadInput for one of another run.
    """
    if not path.exists():
        message = "the poses up to where the run is resumed are not known: the interrupted run has logged none here"
        found.append(warning("K081", message, Span(str(path)), "name the file that it was given by --poses"))
        return []
    return [one for one in read_log(path, header) if one.step <= until]


class PoseLog:
    """Called with the true world after each of its steps; ``header`` is that of the run's trace.

    Links are told in the frames of the links that they hang on, so that those of an arm at rest do not move with the
    base; the root link and bodies in the map, limbs of people in the frames of their bodies. ``earlier`` poses are
    those of the run before it was resumed.
    """

    def __init__(
        self, world: PyBulletWorld, path: Path, header: Mapping[str, object], earlier: Sequence[Transform] = ()
    ) -> None:
        self._rate = world.rate
        links = world.robot.links
        names = {index: name for name, index in links.items()}
        self._above = {name: names.get(world.robot.parent[index]) for name, index in links.items()}
        self._last = {one.child: (*one.position, *one.orientation) for one in earlier}
        self._count = len(earlier)
        known = {key: header.get(key) for key in IDENTITY}
        write_text(path, "".join(pose_lines(earlier, self._rate, None, **known)))
        self._path, self._file = path, path.open("ab", buffering=0)

    def __call__(self, world: PyBulletWorld) -> None:
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

    def _placed(self, world: PyBulletWorld) -> Iterator[tuple[str, str, Pose]]:
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
        """End the log."""
        self._file.close()
