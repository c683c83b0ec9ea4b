"""Failures of motions that the robot itself reports as failed, by the joints that did not arrive."""

from __future__ import annotations

from planlang.failures import (
    GripperGoalNotReached,
    LookingFailure,
    ManipulationGoalNotReached,
    NavigationGoalNotReached,
    PlanFailure,
    TorsoGoalNotReached,
)
from planlang.protocols import Configuration, Group, GroupKind, Trajectory

ARRIVED = 0.01
"""Largest difference from its goal at which a joint counts as having arrived [rad, m]."""


def failure_of(
    group: Group, reason: str | None, trajectory: Trajectory, now: Configuration, torso: str | None
) -> PlanFailure:
    """Build the failure for a motion of a group that has ended at the configuration ``now``, for a ``reason``.

    If all joints of an arm have arrived but the ``torso``, it is the torso's.
    """
    suffix = "" if reason is None else f": {reason}"
    match group.kind:
        case GroupKind.BASE:
            return NavigationGoalNotReached(f"{NavigationGoalNotReached.text}{suffix}")
        case GroupKind.HEAD:
            return LookingFailure(f"the neck did not arrive{suffix}")
        case GroupKind.FINGERS:
            return GripperGoalNotReached(f"{GripperGoalNotReached.text}{suffix}", arm=group.arms[0])
    goals = dict(zip(trajectory.names, trajectory.positions[-1].tolist(), strict=True))
    if [name for name, goal in goals.items() if abs(now.joints[name] - goal) > ARRIVED] == [torso]:
        message = f"{TorsoGoalNotReached.text}{suffix}"
        return TorsoGoalNotReached(message, arm=str(group), height=goals[str(torso)])
    return ManipulationGoalNotReached(f"{ManipulationGoalNotReached.text}{suffix}", arm=str(group))
