"""Faults of motions: arms, head and base that stop short, wheels that slip, and something that stands in the way."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import count

import numpy as np

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Kind, Opportunity
from planlang.geometry import Pose
from planlang.protocols import Group, GroupKind, Motion, MotionState, Trajectory
from sim.faults.injection import Injection
from sim.faults.things import Things
from sim.scene import Body

OBSTACLE = "something"
"""Name of a body that stands in the way for a while; others at the same time are numbered."""
OBSTACLE_SIZE = (0.3, 0.3, 1.0)
"""Its extents [m]."""
_ROOM = 0.15
"""Least distance of it from the robot when it appears [m]."""
_SHORT = (0.1, 0.9)
"""Shares of a motion after which it stops short."""
_DRIFT = (0.03, 0.08)
"""Distances by which a base ends beside its goal [m]; it turns by as many times :data:`_ASKEW` radians."""
_ASKEW = 0.5
_LEAST_WAY = 0.3
"""Length of a way on which wheels slip, or on which something stands [m]."""
_STAYS = (8.0, 20.0)
"""Time for which something stands in the way [s]."""
_PLACES = 12
"""Number of places on a way that are tried for it."""
OPPORTUNITIES = {
    GroupKind.ARMS: Opportunity.ARM,
    GroupKind.HEAD: Opportunity.HEAD,
    GroupKind.BASE: Opportunity.BASE,
}


class Motions:
    """What goes wrong with motions of arms, head and base."""

    def __init__(self, injection: Injection, things: Things) -> None:
        self._injection, self._truth, self._things = injection, injection.truth, things
        self._cut: dict[str, Drawn] = {}
        """Groups -> what their last motion stops short by."""
        self.failed: dict[str, str] = {}
        """Groups whose motion ends before its goal -> the reason that their drivers report."""

    def start(self, group: Group, names: Sequence[str], trajectory: Trajectory) -> Trajectory:
        """Return the trajectory that the group follows in truth; ``names`` are what its arms are called."""
        self.failed.pop(group, None)
        opportunity = OPPORTUNITIES[group.kind]
        fault = self._injection.begins(opportunity, names, partial(self._can, trajectory=trajectory))
        if fault is None:
            return trajectory
        match str(fault.kind):
            case "base:drifts":
                self._injection.later(partial(self._has_drifted, group, fault))
                return _drifting(trajectory, fault)
            case "base:blocked":
                self._block(trajectory, fault)
            case "thing:moves" | "thing:is_gone":
                self._things.happen(fault)
            case _:
                rows = max(1, round(fault.between(*_SHORT) * len(trajectory.positions)))
                return self.cut(group, trajectory, fault, rows, "the following error is too large")
        return trajectory

    def cut(self, group: Group, trajectory: Trajectory, fault: Drawn, rows: int, reason: str) -> Trajectory:
        """Cut a trajectory off after some rows; the group's driver reports a reason then."""
        self.failed[group] = reason
        short = Trajectory(trajectory.names, trajectory.positions[:rows])
        self._cut[group] = fault
        if rows == 1:  # it does not even begin
            self._injection.happens(fault)
            return short

        def stops() -> bool:
            if self._cut.get(group) is not fault:
                return True  # a newer motion has replaced it before
            state = self._truth.motion(group).state
            if state is MotionState.DONE:
                self._injection.happens(fault)
            return state is not MotionState.MOVING

        self._injection.later(stops)
        return short

    def _has_drifted(self, group: Group, fault: Drawn) -> bool:
        """Record, once the base stands, that its wheels have slipped."""
        if self._truth.motion(group).state is MotionState.MOVING:
            return False
        self._injection.happens(fault)
        return True

    def motion(self, group: str) -> Motion:
        """Return the state of a group's motion, as its driver reports it."""
        motion = self._truth.motion(group)
        if motion.state is MotionState.DONE and (reason := self.failed.get(group)) is not None:
            return Motion(MotionState.FAILED, reason=reason)
        return motion

    def _can(self, kind: Kind, of: str | None, value: str | None, trajectory: Trajectory) -> bool:
        match str(kind):
            case "base:drifts":
                return _way(trajectory) >= _LEAST_WAY
            case "base:blocked":
                return self._place(trajectory) is not None
            case "thing:moves" | "thing:is_gone":
                return self._things.can(kind, of)
        return len(trajectory.positions) > 2

    def _place(self, trajectory: Trajectory) -> Pose | None:
        """Find a place on the way of the base where nothing is, nearest to its middle."""
        if _way(trajectory) < _LEAST_WAY:
            return None
        rows = np.asarray(trajectory.positions, dtype=float)
        for number in sorted(range(1, _PLACES + 1), key=lambda one: abs(one - _PLACES / 2)):
            x, y = rows[(len(rows) - 1) * number // _PLACES, :2].tolist()
            pose = Pose.planar(x, y, 0.0, OBSTACLE_SIZE[2] / 2 + 0.02)
            if self._truth.has_room(pose, OBSTACLE_SIZE, _ROOM):
                return pose
        return None

    def _block(self, trajectory: Trajectory, fault: Drawn) -> None:
        """Put something in the way; it goes away after a while."""
        pose = self._place(trajectory)
        assert pose is not None
        standing = self._truth.names()
        name = next(one for n in count(1) if (one := OBSTACLE if n == 1 else f"{OBSTACLE} {n}") not in standing)
        self._truth.add(Body(name, pose, OBSTACLE_SIZE))
        self._injection.happens(fault)
        until = self._injection.now + fault.between(*_STAYS)

        def goes() -> bool:
            if self._injection.now < until:
                return False
            self._truth.remove(name)
            return True

        self._injection.later(goes)


def _way(trajectory: Trajectory) -> float:
    """Length of a way of the base [m]."""
    places = np.asarray(trajectory.positions, dtype=float)[:, :2]
    return float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())


def _drifting(trajectory: Trajectory, fault: Drawn) -> Trajectory:
    """Let a way of the base lead beside its goal."""
    rows = np.array(trajectory.positions, dtype=float)
    far, angle = fault.between(*_DRIFT), 2 * math.pi * fault.share("direction")
    turn = far * _ASKEW * (1 if fault.share("turn") < 0.5 else -1)
    aside = np.array([far * math.cos(angle), far * math.sin(angle), turn])
    columns = [trajectory.names.index(name) for name in ("x", "y", "yaw")]
    rows[:, columns] += np.linspace(0.0, 1.0, len(rows))[:, None] * aside
    return replace(trajectory, positions=rows)
