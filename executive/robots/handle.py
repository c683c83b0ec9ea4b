"""A robot as plans command it: its name, its interface, and what planning knows of its body."""

from __future__ import annotations

from executive.motion import Gaze
from executive.robots.arms import ArmModel, arm_models, gaze_of
from executive.robots.robot import Robot
from planlang.protocols import RobotInterface
from planlang.records import dataclass
from sim import PlanningWorld


@dataclass(frozen=True, slots=True)
class RobotModel:
    """A bound robot with the models of its arms and of its neck, as planning sees it. Equal in every world."""

    robot: Robot
    arms: tuple[ArmModel, ...]
    """All arms, in the robot's order."""
    gaze: Gaze | None
    """Points the camera; None for a robot without one."""

    @staticmethod
    def of(robot: Robot, world: PlanningWorld) -> RobotModel:
        """Build the model of a robot; ``world`` contains it, to measure its hands."""
        return RobotModel(robot, arm_models(robot, world), gaze_of(robot))


@dataclass(frozen=True, slots=True)
class RobotHandle:
    """One robot of a run. Nothing in it says that there is no other."""

    name: str
    """Its name in states of the world."""
    interface: RobotInterface
    """The real robot: it takes commands, and the world is known only by its sensors."""
    model: RobotModel
