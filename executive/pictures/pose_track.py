"""Where bodies, limbs and the robot's links are over a run: noted once, for pose logs, recordings and pages alike."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.urdf import read_urdf
from planlang.records import dataclass
from sim.robot import Robot
from sim.truth import Truth

RATE = 10
"""Times a second of plan time that poses are noted; NEEMs have about as many."""
MAP: tuple[str, ...] = ()
"""The path of the map as a frame."""


@dataclass(frozen=True, slots=True)
class Placed:
    """Something that has moved, appeared or, with no pose, gone. Paths are those of :class:`Drawn`.

    The frame is the map for bodies and the robot's root link, the body for a limb, and for other links the link that
    they hang on: so those of an arm at rest do not move with the base.
    """

    path: tuple[str, ...]
    frame: tuple[str, ...]
    pose: Pose | None


Watcher = Callable[[int, Sequence[Placed]], None]
"""Called with the world step and all that has moved until then, at the first step with everything."""


class PoseTrack:
    """Called with the true world after each of its steps; watchers receive what has moved, :data:`RATE` times a second.

    Relative poses of links follow from joint values, so that PyBullet is asked for them at the first step only.
    """

    def __init__(self, watchers: Sequence[Watcher]) -> None:
        self._watchers = watchers
        self._links: _Links | None = None
        self._poses: Mapping[str, Pose] = {}
        self._limbs: dict[str, list[int]] = {}
        """People, with the numbers of the pieces of their arms."""
        self._last: dict[tuple[str, int], Pose] = {}
        self._noted = -1

    def __call__(self, world: Truth) -> None:
        """Note what has moved if it is time to."""
        if world.steps % max(1, world.rate // RATE) == 0:
            self.note(world)

    def note(self, world: Truth) -> None:
        """Note what has moved, as at the end of a run; nothing happens if that is done."""
        if self._noted == world.steps:
            return
        self._noted = world.steps
        found = [*self._bodies(world), *self._robot(world)]
        if found:
            for watcher in self._watchers:
                watcher(world.steps, found)

    def _bodies(self, world: Truth) -> Iterator[Placed]:
        poses = world.poses()
        if poses.keys() != self._poses.keys():
            for name in [name for name in poses if name not in self._poses]:
                limbs = [k for k, (part, _) in enumerate(world.pieces(name)) if part.limb]
                if limbs:
                    self._limbs[name] = limbs
            for name in [name for name in self._poses if name not in poses]:
                yield Placed(("bodies", name), MAP, None)
        for name, pose in poses.items():
            last = self._poses.get(name)
            if pose is not last and pose != last:  # most have not even been placed anew
                yield Placed(("bodies", name), MAP, pose)
        self._poses = poses
        for name, limbs in self._limbs.items():
            if name in poses:
                pieces = world.pieces(name)
                for k in limbs:
                    offset = pieces[k][1]
                    if self._last.get((name, k)) is not offset:
                        self._last[name, k] = offset
                        yield Placed(("bodies", name, f"limb{k}"), ("bodies", name), offset)

    def _robot(self, world: Truth) -> Iterator[Placed]:
        now = world.configuration()
        if self._links is None:
            self._links = _Links(world.robot)
            yield from self._links.fixed
        yield from self._links.moved(now.base, now.joints)


@dataclass(frozen=True, slots=True)
class _Driven:
    """A link that a joint moves: where it is at zero, and how it goes from there."""

    link: Placed
    axis: tuple[float, float, float]
    """Unit vector in the frame of the link."""
    slides: bool
    multiplier: float = 1.0
    offset: float = 0.0
    """Of a joint that mimics another: its value follows from that of the other."""

    def at(self, value: float) -> Placed:
        """Where it is at a joint value [rad, m]."""
        value = self.multiplier * value + self.offset
        zero, (a, b, c) = self.link.pose, self.axis
        assert zero is not None
        if self.slides:
            way = rotated(zero.rotation, value * np.array(self.axis)).tolist()
            x, y, z = (one + by for one, by in zip(zero.position, way, strict=True))
            return Placed(self.link.path, self.link.frame, Pose((x, y, z), zero.orientation))
        sine, w = math.sin(value / 2), math.cos(value / 2)
        x, y, z = a * sine, b * sine, c * sine
        i, j, k, r = zero.orientation
        turned = (
            r * x + i * w + j * z - k * y,
            r * y - i * z + j * w + k * x,
            r * z + i * y - j * x + k * w,
            r * w - i * x - j * y - k * z,
        )
        return Placed(self.link.path, self.link.frame, Pose(zero.position, turned))


class _Links:
    """The frames of a robot's links in those of the links that they hang on, computed from joint values."""

    def __init__(self, robot: Robot) -> None:
        names, joints = robot.link_names, read_urdf(robot.body.urdf).joints
        self._root, self._base = ("robot", names[-1]), (math.nan, 0.0, 0.0)
        self._joints: dict[str, float] = {}
        self._driven: dict[str, list[_Driven]] = {name: [] for name in robot.joints}
        """Joint -> the links that it moves, itself or through joints that mimic it."""
        masters = {name: (name, 1.0, 0.0) for name in robot.joints}
        for name, followers in robot.followers.items():
            masters |= {one.joint: (name, one.multiplier, one.offset) for _, one in followers}
        self.fixed: list[Placed] = []
        """Links that no joint moves."""
        for joint in joints:
            link = Placed(("robot", joint.child), ("robot", joint.parent), Pose.from_matrix(joint.origin))
            if joint.name in masters:
                master, multiplier, offset = masters[joint.name]
                a, b, c = joint.axis.tolist()
                self._driven[master].append(_Driven(link, (a, b, c), joint.kind == "prismatic", multiplier, offset))
            else:
                self.fixed.append(link)

    def moved(self, base: tuple[float, float, float], joints: Mapping[str, float]) -> Iterator[Placed]:
        """Yield what has moved since this was asked last, at first what joints and base can move."""
        if base != self._base:
            self._base = base
            yield Placed(self._root, MAP, Pose.planar(*base))
        for joint, value in joints.items():
            if self._joints.get(joint) != value:
                self._joints[joint] = value
                for driven in self._driven[joint]:
                    yield driven.at(value)


@dataclass(slots=True)
class Track:
    """Where one thing is over time, in one frame."""

    frame: tuple[str, ...]
    steps: list[int] = field(default_factory=list)
    poses: list[Pose | None] = field(default_factory=list)
    """The pose from the step of the same number on; None while it is not there."""

    def arrays(self) -> tuple[NDArray[np.int64], Array]:
        """Steps (n,), and positions and quaternions (n, 7); NaN while it is not there."""
        rows = [(math.nan,) * 7 if one is None else one.position + one.orientation for one in self.poses]
        return np.array(self.steps, np.int64), np.array(rows, float).reshape(-1, 7)


class Tracks(dict[tuple[str, ...], Track]):
    """A watcher that keeps everything: a track for each path, in the order of their appearance."""

    def __call__(self, step: int, found: Sequence[Placed]) -> None:
        """Keep what has moved."""
        for placed in found:
            track = self.get(placed.path)
            if track is None:
                track = self[placed.path] = Track(placed.frame)
            track.steps.append(step)
            track.poses.append(placed.pose)
