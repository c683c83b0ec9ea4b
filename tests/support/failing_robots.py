"""Robots of which a part fails, or before which the world does: decorators of a robot interface."""

from __future__ import annotations

import math
from typing import Any

from planlang.geometry import Pose
from planlang.protocols import Group, GroupKind, Motion, MotionState, RobotInterface, Trajectory

SLIPS_AT = 0.03
"""Distance from where it has closed at which a hand slips off the handle of a stuck leaf [m]."""


class Decorated:
    """A robot interface that passes everything on."""

    def __init__(self, robot: RobotInterface) -> None:
        self._robot = robot

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)


class StuckNeck(Decorated):
    """The first ``times`` motions of the neck do not begin, and end as ``report`` says."""

    def __init__(self, robot: RobotInterface, report: MotionState = MotionState.HALTED, times: int = 10**6) -> None:
        super().__init__(robot)
        self._report, self._left, self._is_stuck = Motion(report), times, False

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion, unless it is one of the neck that fails."""
        if Group.of(group).kind is GroupKind.HEAD:
            self._is_stuck = self._left > 0
            self._left -= 1
            if self._is_stuck:
                return
        self._robot.start(group, trajectory, pushes=pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""
        if Group.of(group).kind is GroupKind.HEAD and self._is_stuck:
            return self._report
        return self._robot.motion(group)


class SlippingHandles(Decorated):
    """Hands slip off the handles of leaves: the first ``times`` ones, ``after`` so much of their way [m].

    A leaf that ``moves`` follows the hand so far; one that does not is stuck.
    """

    def __init__(self, robot: RobotInterface, *, moves: bool, after: float = SLIPS_AT, times: int = 10**6) -> None:
        super().__init__(robot)
        self._moves, self._after, self._left = moves, after, times
        self._gripped: dict[str, Pose] = {}

    def grip(self, link: str) -> None:
        """Close the grip of a hand; one that will slip is watched."""
        if self._left > 0:
            self._left -= 1
            self._gripped[link] = self._robot.link_pose(link)
            if not self._moves:
                return
        self._robot.grip(link)

    def loosen(self, link: str) -> None:
        """Release what a hand holds."""
        self._gripped.pop(link, None)
        self._robot.loosen(link)

    def feels(self, link: str) -> bool:
        """Check whether the hand at a link still feels something; it has slipped once it is too far away."""
        at = self._gripped.get(link)
        if at is not None and math.dist(at.position, self._robot.link_pose(link).position) > self._after:
            self._robot.loosen(link)
            return False
        return at is not None or self._robot.feels(link)


class ClosedFingers(Decorated):
    """The first ``times`` openings fail: the fingers stay where they are, and hold what they hold."""

    def __init__(self, robot: RobotInterface, times: int = 1) -> None:
        super().__init__(robot)
        self._left, self._is_stuck = times, False

    def loosen(self, link: str) -> None:
        """Release what a hand holds, if its fingers will open."""
        if self._left <= 0:
            self._robot.loosen(link)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion, unless it is one of fingers that fails."""
        self._is_stuck = Group.of(group).kind is GroupKind.FINGERS and self._left > 0
        if self._is_stuck:
            self._left -= 1
        else:
            self._robot.start(group, trajectory, pushes=pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""
        if Group.of(group).kind is GroupKind.FINGERS and self._is_stuck:
            return Motion(MotionState.FAILED, reason="motor off")
        return self._robot.motion(group)


class StallingPair(Decorated):
    """The motions of both arms together of some numbers, from 1, stop half-way, and report that."""

    def __init__(self, robot: RobotInterface, *numbers: int) -> None:
        super().__init__(robot)
        self._numbers, self._count, self._has_stalled = numbers, 0, False

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion, or the first half of one."""
        if len(Group.of(group).arms) == 2:
            self._count += 1
            self._has_stalled = self._count in self._numbers
            if self._has_stalled:
                trajectory = Trajectory(trajectory.names, trajectory.positions[: len(trajectory.positions) // 2])
        self._robot.start(group, trajectory, pushes=pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""
        motion = self._robot.motion(group)
        stalls = self._has_stalled and len(Group.of(group).arms) == 2 and motion.state is MotionState.DONE
        return Motion(MotionState.FAILED, reason="the following error is too large") if stalls else motion


class Refusing(Decorated):
    """Nobody takes what the robot offers."""

    def pulled(self, link: str) -> bool:
        """Nobody pulls."""
        return False
