"""The planning scene: the believed world as location resolving and motion planning ask it."""

from __future__ import annotations

from collections.abc import Sequence

from executive.belief.belief import Belief
from executive.belief.believed_bodies import BelievedBodies
from executive.belief.free_floor import BasePose
from executive.belief.scene_collisions import SceneCollisions
from executive.belief.visibility import Visibility
from executive.motion import Gaze
from executive.robots import Robot
from executive.robots.arms import ArmModel, Held
from planlang.designators import Device
from planlang.geometry import Array
from sim import PlanningWorld


class RobotArms:
    """The robot's arms, with where they are and what they are believed to hold."""

    def __init__(self, world: PlanningWorld, robot: Robot, belief: Belief, arms: Sequence[ArmModel]) -> None:
        self._world, self._robot, self._belief = world, robot, belief
        self.all: tuple[ArmModel, ...] = tuple(arms)
        """In the robot's order."""

    def of(self, device: Device) -> Sequence[ArmModel]:
        """Return the arms that a device designator may mean: by the robot's part, else by type and side."""
        names = [arm.name for arm in self._robot.arms_of(device)]
        return [arm for arm in self.all if arm.name in names]

    def tip(self, arm: ArmModel) -> Array:
        """Return the pose (4, 4) of an arm's tip in the map."""
        return self._world.link_pose(self._robot.arm(arm.name).tip).matrix()

    def held(self, arm: str) -> Held | None:
        """Return what an arm holds."""
        for name, grip in self._belief.held.items():
            if grip.arm == arm:
                return Held(name, grip.offset, self._world.size(name))
        return None

    def is_held(self, body: str) -> bool:
        """Return whether one of the hands holds a body."""
        return any((held := self.held(arm.name)) is not None and held.name == body for arm in self.all)

    def grasped_at(self, body: str) -> Array:
        """Return the tip pose (4, 4) in the map at which a held body was grasped."""
        return (self._belief.reference_pose(body) @ self._belief.held[body].offset.inverse()).matrix()


class PlanningScene:
    """The planning world, kept equal to the belief, by subject: bodies, arms, collisions and visibility.

    Functions take the part that they need. Nothing here touches the true world.
    """

    def __init__(
        self, world: PlanningWorld, robot: Robot, belief: Belief, arms: Sequence[ArmModel], gaze: Gaze | None
    ) -> None:
        self.world, self.robot, self.belief = world, robot, belief
        self.bodies = BelievedBodies(world, belief)
        self.arms = RobotArms(world, robot, belief, arms)
        self.collisions = SceneCollisions(world, robot, belief, arms)
        self.visibility = Visibility(world, robot, belief, self.bodies, gaze)

    def base(self) -> BasePose:
        """Return where the base is."""
        return self.world.configuration().base

    @property
    def base_radius(self) -> float:
        """Radius of the base's outline [m]."""
        return self.robot.base.radius

    def revision(self) -> int:
        """Return the revision of the belief."""
        return self.belief.revision

    def posture(self) -> object:
        """Return the robot's configuration as a value that can be compared."""
        now = self.world.configuration()
        return now.base, tuple(now.joints.items())
