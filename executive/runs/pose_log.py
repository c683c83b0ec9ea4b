"""A log of where bodies and the robot's links are while a run goes on, for ``planlang export``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from executive.pictures.recording import Drawn, drawn_in
from planlang.experience.poses import IDENTITY, MAP, Transform, pose_lines
from planlang.geometry import Pose
from sim import PyBulletWorld

RATE = 10
"""Times a second that poses are noted, of what has moved; NEEMs have about as many."""


class PoseLog:
    """Called with the true world after each of its steps; ``header`` is that of the run's trace."""

    def __init__(self, world: PyBulletWorld, header: Mapping[str, object]) -> None:
        self._names: tuple[str, ...] = ()
        self._drawn: tuple[Drawn, ...] = ()
        self._rate, self._known = world.rate, {key: header.get(key) for key in IDENTITY}
        self._last: dict[str, Pose] = {}
        self._transforms: list[Transform] = []

    def __call__(self, world: PyBulletWorld) -> None:
        """Note what has moved."""
        if world.steps % max(1, world.rate // RATE):
            return
        if world.names() != self._names:  # something came to be, or is gone
            self._names, self._drawn = world.names(), drawn_in(world)
        for thing in self._drawn:
            name, pose = "/".join(thing.path[1:]), thing.pose()
            if self._last.get(name) != pose:
                self._last[name] = pose
                frame = "/".join(thing.path[1:-1]) or MAP
                self._transforms.append(Transform(world.steps, frame, name, pose.position, pose.orientation, "log"))

    def save(self, path: Path) -> None:
        """Write the log."""
        with path.open("w", encoding="utf-8", newline="\n") as file:
            file.writelines(pose_lines(self._transforms, self._rate, None, **self._known))
