"""The robot as process modules command it: motions in the real world, planned and judged in the believed one."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np

from executive.belief import Belief
from executive.belief.believed_bodies import Block
from executive.belief.free_floor import BasePose
from executive.belief.planning_scene import PlanningScene
from executive.locations import ReachSolution, Resolver
from executive.modules.arm_choice import ArmChoices
from executive.motion import (
    Grid,
    JointSpace,
    MotionError,
    NoPath,
    cartesian_path,
    clearance_at,
    clearance_field,
    keeps_line,
    plan_base_path,
    plan_path,
    time_curve,
    time_path,
)
from executive.robots import Gripper, Robot
from executive.robots.arms import ArmModel
from planlang import Fluent, checkpoint, wait_for
from planlang.designators import Location, Object
from planlang.failures import ActionUnresolvable, LookingGoalUnreachable, ObjectUnresolvable
from planlang.geometry import Array, Pose, matrices
from planlang.protocols import Motion, Trajectory, World

STEPS = (1.0, 0.5, 0.25)
"""A path whose every sample is not free is planned anew with checks this much closer to each other."""
ROOMY = 0.01
"""Where a standing robot, taken for round, has as much room as this it touches nothing [m]."""
CARRYING = "carrying"
"""The posture in which the robot drives, and from which another place can be tried."""
BACK_OFF = (0.1, 0.2, 0.3, 0.45, 0.6)
"""Distances at which room for the carrying posture is looked for [m]."""
BACKWARDS = (math.pi, 0.75 * math.pi, -0.75 * math.pi, 0.5 * math.pi, -0.5 * math.pi)
"""Directions in which the base backs off, relative to its heading [rad]."""


@dataclass(slots=True)
class Platform:
    """What all process modules share."""

    world: World
    """The real one: commanded, and known only by what can be sensed of it. Planning is done in that of ``around``."""
    robot: Robot
    belief: Belief
    scene: PlanningScene
    resolver: Resolver
    ancestors: Callable[[str], Sequence[str]]
    """Action class -> itself and its superclasses, nearest first; local names."""
    releasing: frozenset[str]
    """Action classes that let go of something."""
    rng: np.random.Generator
    choices: ArmChoices = field(default_factory=ArmChoices)
    """Arms that were chosen where the plan left the choice."""
    begun_grasps: dict[str, tuple[int, BasePose, ReachSolution]] = field(default_factory=dict)
    """Arm -> revision, base and grasp whose pre-grasp was taken."""

    # Where things are

    def base(self) -> BasePose:
        """Where the base is, by odometry."""
        return self.world.configuration().base

    def arm_joints(self, arm: ArmModel) -> Array:
        """Joint values (d,) of an arm and what carries it, by encoders."""
        joints = self.world.configuration().joints
        return np.array([joints[name] for name in arm.joints])

    def sync(self) -> None:
        """Make the planning world equal to what is believed."""
        self.belief.sync(self.scene.world, self.world.configuration())

    # Motions

    async def follow(self, group: str, trajectory: Trajectory) -> Motion:
        """Command a motion and wait for its end; stopped when the caller is evaporated or suspended."""
        self.world.start(group, trajectory)
        try:
            await wait_for(Fluent(read=lambda: self.world.motion(group).state != "moving", name=f"{group} at rest"))
            return self.world.motion(group)
        finally:
            self.world.halt(group)
            self.sync()

    def base_path(self, goal: BasePose) -> Trajectory:
        """A timed path for the base through the believed world; raises a MotionError."""
        self.sync()
        scene, drive, start = self.scene, self.robot.base, self.base()
        x_min, y_min, x_max, y_max = scene.world.scene.bounds
        grid = Grid.over((x_min, y_min), (x_max, y_max))
        obstacles, silhouette = scene.collisions.obstacles(), scene.collisions.silhouette()
        room = clearance_field(grid, obstacles, silhouette)

        def touching(x: float, y: float, yaw: float) -> list[tuple[str, str]]:
            return [(contact.part, contact.body) for contact in scene.collisions.contacts((x, y, yaw))]

        for step in STEPS:
            trajectory = time_path(
                ("x", "y", "yaw"),
                plan_base_path(start, goal, grid, room, touching, resolution=0.08 * step),
                velocity=(drive.speed, drive.speed, drive.turn_speed),
                acceleration=(drive.acceleration, drive.acceleration, drive.turn_acceleration),
                jerk=drive.jerk,
                rate=self.world.rate,
            )
            rows = trajectory.positions[1:]
            doubtful = rows[clearance_at(rows[:, :2], obstacles, silhouette) < ROOMY]
            if not any(touching(*row) for row in doubtful.tolist()):
                return trajectory
        raise NoPath(start, goal, {"finer checks": len(STEPS)})

    def arm_path(self, arm: ArmModel, goal: Array, touches: str | None = None) -> Trajectory:
        """A timed path of an arm through the believed world; raises a MotionError."""
        self.sync()
        chain, base, start = arm.solver.chain, self.base(), self.arm_joints(arm)
        space = JointSpace.of(arm.lower, arm.upper, continuous=chain.continuous, resolution=arm.resolution)
        quick = self.scene.collisions.quick_check(arm, touches)

        def touching(q: Array) -> list[tuple[str, str]]:
            # at the start all of the robot is looked at; later on what stands still touches nothing new
            among = None if np.array_equal(q, start) else quick.doubtful(q)
            contacts = self.scene.collisions.contacts(base, arm, q, touches, among=among)
            return [(contact.part, contact.body) for contact in contacts]

        def moments(path: Array) -> Array:
            """Where the arm is looked at exactly: at each of the world's steps, and at the resolution of checks."""
            return np.concatenate([space.points(path), self._timed(arm.joints, path).positions[1:]])

        path = plan_path(start, goal, space, quick, touching, self.rng, moments=moments)
        return self._timed(arm.joints, path)

    def straight_path(self, arm: ArmModel, pose: Array, q: Array, touches: str | None) -> Trajectory:
        """A timed straight line of the tip to a pose (4, 4) of the map; raises a MotionError with the reason."""
        self.sync()
        start, base = self.arm_joints(arm), self.base()
        quick = self.scene.collisions.quick_check(arm, touches)

        def is_free(row: Array) -> bool:
            return not self.scene.collisions.contacts(base, arm, row, touches, among=quick.doubtful(row))

        chain = arm.solver.chain
        beginning, end = chain.fk(start)[0], matrices.product(Pose.planar(*base).inverse().matrix(), pose)
        line = cartesian_path(arm.solver, start, beginning, end, is_free)
        if line.waypoints is None:
            raise MotionError(line.reason)
        for timing in (time_curve, time_path):  # a curve swings out, also over the limits of a joint
            trajectory = self._timed(arm.joints, line.waypoints, timing)
            rows = trajectory.positions[1:]
            straight = keeps_line(chain.fk(trajectory.positions), beginning, end)
            if straight and chain.within(rows, 1e-6).all() and all(map(is_free, rows)):
                return trajectory
        raise MotionError("in collision or off the line between two steps")

    def _timed(self, joints: Sequence[str], path: Array, timing: Callable[..., Trajectory] = time_path) -> Trajectory:
        limits = [self.robot.limits[name] for name in joints]
        return timing(
            tuple(joints),
            path,
            velocity=[limit.speed for limit in limits],
            acceleration=[limit.acceleration for limit in limits],
            jerk=[limit.jerk for limit in limits],
            rate=self.world.rate,
        )

    # Hands

    def in_order(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """The arm that was chosen before first: a choice is kept; those last that others are using."""
        mine, others = self.choices.mine(), self.choices.others()
        return sorted(arms, key=lambda arm: (arm.name != mine, arm.name in others))

    def holding(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Those that hold something, and not for somebody else, the one that was chosen before first."""
        others = self.choices.others()
        return [arm for arm in self.in_order(arms) if self.scene.arms.held(arm.name) and arm.name not in others]

    def free(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Those that hold nothing: they take hold of things. In order as all arms are."""
        return [arm for arm in self.in_order(arms) if self.scene.arms.held(arm.name) is None]

    def in_hand(self, what: Object) -> bool:
        """Whether the robot holds a thing, as far as it is known which that is."""
        try:
            return self.scene.bodies.bind(what) in self.belief.held
        except ObjectUnresolvable:
            return False

    def use(self, arm: ArmModel, way: ReachSolution) -> None:
        """Remember which arm was chosen, and the grasp that was begun."""
        self.choices.choose(arm.name)
        if way.reach.kind == "grasp":
            self.begun_grasps[arm.name] = (self.belief.revision, self.base(), way)

    def begun(self, arm: ArmModel, location: Location) -> ReachSolution | None:
        """The grasp whose pre-grasp the arm has taken, if it is the one that the location asks for and still holds."""
        if not any(relation.name == "in_center_of" for relation in location.relations):
            return None
        revision, base, way = self.begun_grasps.get(arm.name, (-1, (0.0, 0.0, 0.0), None))
        meant = [self.scene.bodies.bind(r.reference) for r in location.relations if isinstance(r.reference, Object)]
        if way is None or revision != self.belief.revision or base != self.base() or way.reach.body not in meant:
            return None
        return way

    def is_at(self, arm: ArmModel, q: Array) -> bool:
        """Whether the arm is where joint values (d,) say."""
        return bool(np.allclose(self.arm_joints(arm), q, atol=1e-3))

    def posture(self, arm: ArmModel, name: str) -> Array:
        """Joint values (d,) of a named posture for an arm and what carries it; unnamed joints stay.

        A name that contains that of a posture means it ("parkingpose"), any other one the carrying posture. Raises
        ActionUnresolvable if the robot has no such posture.
        """
        known = self.robot.postures
        meant = name if name in known else next((one for one in known if one in name.lower()), CARRYING)
        if meant not in known:
            message = f"{self.robot.name} has no posture {name}; it has {', '.join(known) or 'none'}"
            raise ActionUnresolvable(message, designator=f"posture {name}")
        now = zip(arm.joints, self.arm_joints(arm), strict=True)
        return np.array([known[meant].get(joint, value) for joint, value in now])

    def room_to_tuck(self, arms: Sequence[ArmModel]) -> BasePose | None:
        """The nearest place, here or straight away from it, where these arms can go to the carrying posture."""
        x, y, yaw = self.base()
        postures = [(arm, self.posture(arm, CARRYING)) for arm in arms]
        for step, turn in [(0.0, 0.0), *product(BACK_OFF, BACKWARDS)]:
            place = (x + step * math.cos(yaw + turn), y + step * math.sin(yaw + turn), yaw)
            if self.scene.collisions.contacts(place) and step:
                continue
            if not any(self.scene.collisions.contacts(place, arm, posture) for arm, posture in postures):
                return place
        return None

    def gripper(self, arm: ArmModel) -> Gripper | None:
        """The gripper of an arm."""
        return self.robot.arm(arm.name).gripper

    async def move_gripper(self, arm: ArmModel, *, closed: bool) -> Motion:
        """Open or close the fingers as far as they go."""
        gripper = self.gripper(arm)
        assert gripper is not None
        joints = self.world.configuration().joints
        now = np.array([joints[name] for name in gripper.joints])
        wanted = gripper.closed if closed else gripper.opened
        goal = np.array([wanted[name] for name in gripper.joints])
        return await self.follow(f"gripper of {arm.name}", self._timed(gripper.joints, np.stack([now, goal])))

    def between_fingers(self, arm: ArmModel) -> str | None:
        """The body that the closed fingers feel."""
        gripper = self.gripper(arm)
        return self.world.between_fingers(gripper.finger_links) if gripper is not None else None

    def grasp(self, arm: ArmModel, name: str) -> None:
        """The fingers have closed on a body: it moves with the hand from now on."""
        link = self.robot.arm(arm.name).tip
        self.world.attach(link, name)
        offset = self.world.link_pose(link).inverse() @ self.belief.pose(name)
        self.belief.grasped(name, arm.name, link, offset)
        self.begun_grasps.pop(arm.name, None)
        self.sync()

    def let_go(self, name: str, *, to: str | None = None) -> None:
        """Let a held body go: it comes down on what is below, or a person has it."""
        self.sync()
        believed = self.scene.world.pose(name)
        x, y, z = believed.position
        sinks = self.scene.world.height_above_support(name)
        self.world.release(name)
        self.belief.released(name, Pose((x, y, z - sinks if sinks < z else 0.0), believed.orientation), to=to)
        self.sync()

    async def settled(self, name: str) -> None:
        """Wait until a body that was let go has come to rest."""
        await wait_for(Fluent(read=lambda: not self.world.falling(name), name=f"{name} at rest"))

    def taken(self, name: str) -> Fluent[str | None]:
        """The person who pulls at a held body, None while nobody does: what the wrist feels."""
        return Fluent(read=lambda: self.world.taken(name), name=f"{name} taken")

    # Sensing

    async def look_at(self, point: Array, name: str) -> None:
        """Turn the neck so that a map point (3,) is in the picture; raises LookingGoalUnreachable."""
        camera = self.robot.camera
        if self.scene.visibility.gaze is None or camera is None:
            await checkpoint()
            return
        neck, beyond, _ = self.scene.visibility.gaze.at(
            matrices.moved(Pose.planar(*self.base()).inverse().matrix(), point)
        )
        if beyond > camera.half_angle:
            raise LookingGoalUnreachable(what=name)
        if not self.scene.visibility.gaze.joints:
            await checkpoint()
            return
        joints = self.world.configuration().joints
        now = np.array([joints[joint] for joint in self.scene.visibility.gaze.joints])
        await self.follow("head", self._timed(self.scene.visibility.gaze.joints, np.stack([now, neck])))

    def see(self) -> tuple[str, ...]:
        """Take a picture; everything recognised changes the belief. Names of what was seen."""
        if self.robot.camera is None:
            return ()
        detections = self.world.detect(self.robot.camera.link)
        self.belief.see(detections)
        self.sync()
        return tuple(detection.name for detection in detections)

    def not_seen(self, name: str) -> None:
        """Remember that a body was looked for in vain from here."""
        self.belief.not_seen(name, self.base())

    def must_look(self, what: Object) -> bool:
        """Whether a thing to grasp, or a person to give to, has not been seen since the base last moved."""
        name = self.scene.bodies.bind(what)
        if name in self.belief.held or self.belief.seen_from_here(name):
            return False
        return self.scene.bodies.is_graspable(name) or self.scene.bodies.is_person(name)

    def base_moved(self) -> None:
        """Tell the belief that things have to be looked at again."""
        self.belief.base_moved()
        self.sync()

    def bump(self, name: str | None) -> None:
        """Feel where a body is that was not believed to be there."""
        if name is not None and name in self.world.names():
            self.belief.bump(name, self.world.pose(name))
            self.sync()

    def support_of(self, name: str) -> Block | None:
        """The body that something is believed to stand on."""
        support = self.scene.world.support(name)
        return self.scene.bodies.block(support) if support in self.scene.world.names() else None

    def believed_pose(self, name: str) -> Pose:
        """Where a body is believed to be."""
        return self.belief.pose(name)
