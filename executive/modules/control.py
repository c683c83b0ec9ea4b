"""Commanding the true world by subject: base, fingers, camera; the planning scene is kept equal to the belief."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from executive.belief import Belief
from executive.belief.believed_bodies import Block
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.motion import Grid, NoPath, clearance_at, clearance_field, plan_base_path, time_path
from executive.robots import Gripper, Robot
from executive.robots.arms import ArmModel
from planlang import Fluent, checkpoint, wait_for
from planlang.designators import Object
from planlang.failures import LookingGoalUnreachable, ObjectUnresolvable
from planlang.geometry import Array, Pose, matrices
from planlang.protocols import Motion, MotionState, Trajectory, World


@dataclass
class Control:
    """A robot in a true world, with a belief about it and the scene in which its motions are planned."""

    world: World
    """The true one: commanded, and known only by what can be sensed of it."""
    robot: Robot
    belief: Belief
    scene: PlanningScene

    def base(self) -> BasePose:
        """Return the pose of the base, by odometry."""
        return self.world.configuration().base

    def joints(self, names: Sequence[str]) -> Array:
        """Return the positions (d,) of joints, by encoders [rad, m]."""
        now = self.world.configuration().joints
        return np.array([now[name] for name in names])

    def arm_joints(self, arm: ArmModel) -> Array:
        """Return the positions (d,) of the joints of an arm and of what carries it [rad, m]."""
        return self.joints(arm.joints)

    def sync(self) -> None:
        """Make the planning scene equal to what is believed."""
        self.belief.sync(self.scene.world, self.world.configuration())

    async def follow(self, group: str, trajectory: Trajectory) -> Motion:
        """Command a motion and wait for its end; it is halted when the caller is evaporated or suspended."""
        self.world.start(group, trajectory)
        try:
            await wait_for(
                Fluent(read=lambda: self.world.motion(group).state is not MotionState.MOVING, name=f"{group} at rest")
            )
            return self.world.motion(group)
        finally:
            self.world.halt(group)
            self.sync()

    def timed(self, joints: Sequence[str], path: Array, timing: Callable[..., Trajectory] = time_path) -> Trajectory:
        """Return a path (n, d) of joints with times, within their limits of speed, acceleration and jerk."""
        limits = [self.robot.limits[name] for name in joints]
        return timing(
            tuple(joints),
            path,
            velocity=[limit.speed for limit in limits],
            acceleration=[limit.acceleration for limit in limits],
            jerk=[limit.jerk for limit in limits],
            rate=self.world.rate,
        )


CHECKS = 0.08
"""Distance of the poses at which a path of the base is checked at first [m]; the timed path is checked again."""
FINER = (1.0, 0.5, 0.25)
"""Factors of that distance: a timed path that touches something between checks is planned again with closer ones."""
ROOMY = 0.01
"""A pose with this much room around the robot's outline, taken for round, touches nothing and is not checked [m]."""
BACK_OFF = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Distances at which room for the carrying posture is looked for [m]; the base is to stay near its work."""
BACKWARDS = (math.pi, 0.75 * math.pi, -0.75 * math.pi, 0.5 * math.pi, -0.5 * math.pi)
"""Directions in which the base backs off, relative to its heading [rad]: straight back first, never ahead."""


class Drive:
    """Plans motions of the base."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def path(self, goal: BasePose) -> Trajectory:
        """Return a timed path of the base through the planning scene; raises a MotionError."""
        control = self._control
        control.sync()
        scene, limits, start = control.scene, control.robot.base, control.base()
        x_min, y_min, x_max, y_max = scene.world.scene.bounds
        grid = Grid.over((x_min, y_min), (x_max, y_max))
        obstacles, silhouette = scene.collisions.obstacles(), scene.collisions.silhouette()
        room = clearance_field(grid, obstacles, silhouette)

        def touching(x: float, y: float, yaw: float) -> list[tuple[str, str]]:
            return [(contact.part, contact.body) for contact in scene.collisions.contacts((x, y, yaw))]

        for factor in FINER:
            trajectory = time_path(
                ("x", "y", "yaw"),
                plan_base_path(start, goal, grid, room, touching, resolution=CHECKS * factor),
                velocity=(limits.speed, limits.speed, limits.turn_speed),
                acceleration=(limits.acceleration, limits.acceleration, limits.turn_acceleration),
                jerk=limits.jerk,
                rate=control.world.rate,
            )
            rows = trajectory.positions[1:]
            doubtful = rows[clearance_at(rows[:, :2], obstacles, silhouette) < ROOMY]
            if not any(touching(*row) for row in doubtful.tolist()):
                return trajectory
        raise NoPath(start, goal, {"finer checks": len(FINER)})

    def room_for(self, postures: Sequence[tuple[ArmModel, Array]]) -> BasePose | None:
        """Return the nearest base pose, here or behind, where arms can go to postures (d,); None if there is none."""
        x, y, yaw = self._control.base()
        scene = self._control.scene
        back = [] if self._control.robot.base.fixed else product(BACK_OFF, BACKWARDS)
        for step, turn in [(0.0, 0.0), *back]:
            pose = (x + step * math.cos(yaw + turn), y + step * math.sin(yaw + turn), yaw)
            if step and scene.collisions.contacts(pose):
                continue
            if not any(scene.collisions.contacts(pose, arm, posture) for arm, posture in postures):
                return pose
        return None

    def moved(self) -> None:
        """Record that the base has moved: things have to be looked at again before they are handled."""
        self._control.belief.base_moved()
        self._control.sync()


class Hands:
    """Moves fingers, and tells the belief what they hold."""

    def __init__(self, control: Control) -> None:
        self._control = control

    def gripper(self, arm: ArmModel) -> Gripper | None:
        """Return the gripper of an arm."""
        return self._control.robot.arm(arm.name).gripper

    def hold(self, what: Object) -> bool:
        """Return whether the robot holds a thing; False if it is not known which that is."""
        try:
            return self._control.scene.bodies.bind(what) in self._control.belief.held
        except ObjectUnresolvable:
            return False

    async def move(self, arm: ArmModel, *, closed: bool) -> Motion:
        """Open or close the fingers as far as they go."""
        gripper = self.gripper(arm)
        assert gripper is not None
        wanted = gripper.closed if closed else gripper.opened
        path = np.stack([self._control.joints(gripper.joints), [wanted[name] for name in gripper.joints]])
        return await self._control.follow(f"gripper of {arm.name}", self._control.timed(gripper.joints, path))

    def between_fingers(self, arm: ArmModel) -> str | None:
        """Return the body that the closed fingers feel."""
        gripper = self.gripper(arm)
        return self._control.world.between_fingers(gripper.finger_links) if gripper is not None else None

    def grasp(self, arm: ArmModel, name: str) -> None:
        """Attach a body on which the fingers have closed: it moves with the hand from now on."""
        control, link = self._control, self._control.robot.arm(arm.name).tip
        control.world.attach(link, name)
        offset = control.world.link_pose(link).inverse() @ control.belief.pose(name)
        control.belief.grasped(name, arm.name, link, offset)
        control.sync()

    def let_go(self, name: str, *, to: str | None = None) -> None:
        """Let a held body go: it comes down on what is below, or a person has it."""
        control = self._control
        control.sync()
        believed = control.scene.world.pose(name)
        x, y, z = believed.position
        sinks = control.scene.world.height_above_support(name)
        control.world.release(name)
        # A body above nothing, or above the void beside a map, is believed to lie on the floor.
        control.belief.released(name, Pose((x, y, z - sinks if sinks < z else 0.0), believed.orientation), to=to)
        control.sync()

    async def settled(self, name: str) -> None:
        """Wait until a body that was let go has come to rest."""
        await wait_for(Fluent(read=lambda: not self._control.world.falling(name), name=f"{name} at rest"))

    def taken(self, name: str) -> Fluent[str | None]:
        """Return a fluent of the person who pulls at a held body, None while nobody does: what the wrist feels."""
        return Fluent(read=lambda: self._control.world.taken(name), name=f"{name} taken")


class Sensing:
    """Turns the camera; everything that is sensed changes the belief."""

    def __init__(self, control: Control) -> None:
        self._control = control

    async def look_at(self, point: Array, name: str) -> None:
        """Turn the neck so that a map point (3,) is in the picture; raises LookingGoalUnreachable."""
        control, camera, gaze = self._control, self._control.robot.camera, self._control.scene.visibility.gaze
        if gaze is None or camera is None:
            await checkpoint()
            return
        neck, beyond, _ = gaze.at(matrices.moved(Pose.planar(*control.base()).inverse().matrix(), point))
        if beyond > camera.half_angle:
            raise LookingGoalUnreachable(what=name)
        if not gaze.joints:
            await checkpoint()
            return
        await control.follow("head", control.timed(gaze.joints, np.stack([control.joints(gaze.joints), neck])))

    def see(self) -> tuple[str, ...]:
        """Take a picture and return the names of what was recognised; without camera, what the map is trusted about."""
        camera, belief = self._control.robot.camera, self._control.belief
        if camera is None:
            return self._control.scene.world.names() if belief.trusts_map else ()
        detections = self._control.world.detect(camera.link)
        belief.see(detections)
        self._control.sync()
        return tuple(detection.name for detection in detections)

    def not_seen(self, name: str) -> None:
        """Remember that a body was looked for in vain from here."""
        self._control.belief.not_seen(name, self._control.base())

    def must_look(self, what: Object) -> bool:
        """Return whether a thing to grasp, or a person to give to, has not been seen since the base last moved."""
        scene, belief = self._control.scene, self._control.belief
        name = scene.bodies.bind(what)
        if name in belief.held or belief.seen_from_here(name):
            return False
        return scene.bodies.is_graspable(name) or scene.bodies.is_person(name)

    def bump(self, name: str | None) -> None:
        """Learn the pose of a body that the robot ran into: contacts report the true pose of the whole object."""
        if name is not None and name in self._control.world.names():
            self._control.belief.bump(name, self._control.world.pose(name))
            self._control.sync()

    def support_of(self, name: str) -> Block | None:
        """Return the shape of the body that something is believed to stand on."""
        world = self._control.scene.world
        support = world.support(name)
        return self._control.scene.bodies.block(support) if support is not None and support in world.names() else None
