"""Poses of bodies, limbs and the robot's links over a run, sampled once for pose logs, recordings and pages."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.geometry.urdf import Joint, displacement, master_of, read_urdf
from planlang.records import dataclass
from sim.robot import Robot
from sim.truth import Truth

RATE = 10
"""Sampling rate in plan time [Hz], about that of NEEMs."""
MAP: tuple[str, ...] = ()
"""Path of the map frame."""


@dataclass(frozen=True, slots=True)
class Placed:
    """New pose of an entity that moved or appeared; None for one that disappeared. Paths are those of :class:`Drawn`.

    The frame is the map for bodies and the robot's root link, the body for a limb, and the parent link for other links,
    so that the links of an arm at rest do not change while the base drives.
    """

    path: tuple[str, ...]
    frame: tuple[str, ...]
    pose: Pose | None


Watcher = Callable[[int, Sequence[Placed]], None]
"""Called with a world step and the entities that moved since the last call; the first call has all entities."""


class PoseTrack:
    """Samples the true world, which calls it after each step, and reports moved entities to watchers at :data:`RATE`.

    Relative poses of links are computed from joint values, which is cheaper than to query PyBullet.
    """

    def __init__(self, watchers: Sequence[Watcher]) -> None:
        self._watchers = watchers
        self._links: _Links | None = None
        self._poses: Mapping[str, Pose] = {}
        self._limbs: dict[str, list[int]] = {}
        """Indices of the pieces of people's arms."""
        self._last: dict[tuple[str, int], Pose] = {}
        self._noted = -1

    def __call__(self, world: Truth) -> None:
        """Take a sample if one is due."""
        if world.steps % max(1, world.rate // RATE) == 0:
            self.note(world)

    def note(self, world: Truth) -> None:
        """Take a sample now, as at the end of a run, unless this step has one already."""
        if self._noted == world.steps:
            return
        self._noted = world.steps
        moved = [*self._bodies(world), *self._robot(world)]
        if moved:
            for watcher in self._watchers:
                watcher(world.steps, moved)

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
            if pose is not last and pose != last:  # identity first: most poses are the same object
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


class _Links:
    """Poses of a robot's links in the frames of their parent links, computed from joint values."""

    def __init__(self, robot: Robot) -> None:
        self._root, self._base = ("robot", robot.link_names[-1]), (math.nan, 0.0, 0.0)
        self._joints: dict[str, float] = {}
        self._moved_by: dict[str, list[tuple[Joint, float, float]]] = {name: [] for name in robot.joints}
        """Joints that a joint moves: itself and those that mimic it, each with multiplier and offset of its value."""
        self.fixed: list[Placed] = []
        """Links that no joint moves."""
        every = {joint.name: joint for joint in read_urdf(robot.body.urdf).joints}
        for joint in every.values():
            master = master_of(joint, every)
            if master.joint in self._moved_by:
                self._moved_by[master.joint].append((joint, master.multiplier, master.offset))
            else:
                self.fixed.append(_placed(joint, joint.origin))

    def moved(self, base: tuple[float, float, float], joints: Mapping[str, float]) -> Iterator[Placed]:
        """Yield the links that moved since the last call; the first call yields all movable links."""
        if base != self._base:
            self._base = base
            yield Placed(self._root, MAP, Pose.planar(*base))
        for name, value in joints.items():
            if self._joints.get(name) != value:
                self._joints[name] = value
                for joint, multiplier, offset in self._moved_by[name]:
                    yield _placed(joint, product(joint.origin, displacement(joint, multiplier * value + offset)))


def _placed(joint: Joint, pose: Array) -> Placed:
    """The child of a joint at a pose (4, 4) in the frame of its parent."""
    return Placed(("robot", joint.child), ("robot", joint.parent), Pose.from_matrix(pose))


@dataclass(slots=True)
class Track:
    """Poses of one entity over time, in one frame."""

    frame: tuple[str, ...]
    steps: list[int] = field(default_factory=list)
    poses: list[Pose | None] = field(default_factory=list)
    """Pose from the step with the same index on; None while the entity does not exist."""

    def add(self, step: int, pose: Pose | None) -> None:
        """Add the pose from a step on."""
        self.steps.append(step)
        self.poses.append(pose)

    def arrays(self) -> tuple[NDArray[np.int64], Array]:
        """Steps (n,), and positions and quaternions (n, 7); NaN while the entity does not exist."""
        rows = [(math.nan,) * 7 if one is None else one.position + one.orientation for one in self.poses]
        return np.array(self.steps, np.int64), np.array(rows, float).reshape(-1, 7)


class Tracks(dict[tuple[str, ...], Track]):
    """A watcher that records a track for each path, in the order of appearance."""

    def __call__(self, step: int, moved: Sequence[Placed]) -> None:
        """Record the entities that moved."""
        for placed in moved:
            track = self.get(placed.path)
            if track is None:
                track = self[placed.path] = Track(placed.frame)
            track.add(step, placed.pose)
