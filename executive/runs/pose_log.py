"""A log of where bodies and the robot's links are while a run goes on, for ``planlang export``."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines
from planlang.geometry import Pose
from sim import PyBulletWorld

RATE = 10
"""Times a second that poses are noted, of what has moved; NEEMs have about as many."""
MOVED = 1e-6
"""Less than this [m, or of a quaternion] is no movement: links in their parents' frames are computed."""


class PoseLog:
    """Called with the true world after each of its steps; ``header`` is that of the run's trace.

    Links are told in the frames of the links that they hang on, so that those of an arm at rest do not move with the
    base; the root link and bodies in the map, limbs of people in the frames of their bodies.
    """

    def __init__(self, world: PyBulletWorld, header: Mapping[str, object]) -> None:
        self._rate, self._known = world.rate, {key: header.get(key) for key in IDENTITY}
        links = world.robot.links
        names = {index: name for name, index in links.items()}
        self._above = {name: names.get(world.robot.parent[index]) for name, index in links.items()}
        self._last: dict[str, tuple[float, ...]] = {}
        self._transforms: list[Transform] = []

    def __call__(self, world: PyBulletWorld) -> None:
        """Note what has moved."""
        if world.steps % max(1, world.rate // RATE):
            return
        for frame, name, pose in self._placed(world):
            now, last = (*pose.position, *pose.orientation), self._last.get(name)
            if last is None or max(abs(one - other) for one, other in zip(now, last, strict=True)) > MOVED:
                self._last[name] = now
                self._transforms.append(Transform(world.steps, frame, name, pose.position, pose.orientation, "log"))

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

    def save(self, path: Path) -> None:
        """Write the log."""
        with path.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(pose_lines(self._transforms, self._rate, None, **self._known))
