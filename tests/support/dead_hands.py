"""Robots with a dead hand: its fingers never move, and the robot or the process module says so each time."""

from __future__ import annotations

from typing import Any

from executive.runs.assembly import RobotExecutive
from planlang.designators import Action
from planlang.failures import GripperGoalNotReached
from planlang.language.process_module import WrappedModule
from planlang.protocols import Group, GroupKind, Motion, MotionState, RobotInterface, Trajectory

REPORTS = {
    "blocked": Motion(MotionState.BLOCKED),
    "failed": Motion(MotionState.FAILED, reason="motor off"),
}
"""What the robot may report of a motion of the dead fingers."""
RAISED = "raised"
"""The fingers would move, but the process module of the grippers raises each time."""


class DeadHand:
    """Decorator of a robot interface: the fingers of one arm never move, and each motion ends as ``report`` says."""

    def __init__(self, robot: RobotInterface, arm: str, report: Motion) -> None:
        self._robot, self._group, self._report = robot, Group(GroupKind.FINGERS, arm), report

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion, unless it is one of the dead fingers."""
        if group != self._group:
            self._robot.start(group, trajectory, pushes=pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""
        return self._report if group == self._group else self._robot.motion(group)

    def halt(self, group: str) -> None:
        """Stop the group where it is."""
        if group != self._group:
            self._robot.halt(group)


def kill(executive: RobotExecutive, side: str, how: str) -> None:
    """Make the hand on one side of a robot dead; ``how`` is a key of ``REPORTS``, or ``RAISED``."""
    platform = executive.platform
    arm = next(arm.name for arm in platform.robot.arms if arm.side == side)
    if how != RAISED:
        platform.world = DeadHand(platform.world, arm, REPORTS[how])
        return
    broken: Any = next(module for module in executive.modules if module.name == "gripper")
    while isinstance(broken, WrappedModule):
        broken = broken.wrapped
    perform = broken.execute

    async def execute(action: Action) -> Any:
        if broken.resources(action) == (arm,):
            raise GripperGoalNotReached(arm=arm)
        return await perform(action)

    broken.execute = execute
