"""Commands to the true world for base, arms and camera; what they change is observed, and believed."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import field, replace
from typing import NoReturn, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from executive.belief import Belief
from executive.belief.believed_bodies import MEANT
from executive.belief.estimates import Estimate
from executive.belief.obstacles import EDGE, NAMES, behind
from executive.belief.planning_scene import SEEN_SHARE, PlanningScene
from executive.belief.scene_collisions import BasePose, pinched
from executive.locations.views import FRAME, NO_SCREENS, hiding, passed
from executive.modules.flowing import Flowing
from executive.modules.motion_failures import ARRIVED, failure_of
from executive.modules.out_of_arms import out_of_arms
from executive.motion import time_path
from executive.robots import Robot
from executive.robots.arms import ArmModel, RobotHandle
from planlang.designators import Object
from planlang.failures import (
    GraspSlipped,
    LookingFailure,
    LookingGoalUnreachable,
    ObjectLost,
)
from planlang.geometry import Array, Pose, matrices
from planlang.geometry.areas import Block
from planlang.geometry.matrices import rotated, upright
from planlang.kernel import Fluent, checkpoint, wait_for
from planlang.language.resources import using
from planlang.protocols import Configuration, Group, GroupKind, Motion, MotionState, RobotInterface, Touch, Trajectory
from planlang.records import dataclass

T = TypeVar("T")

SAME_GAZE = 0.05
"""Difference of joints of the neck from where it is to look, up to which it stays as it is [rad]."""
GLANCE = 0.25
"""Time between two looks whether a motion may go on [s]."""
HEIGHTS = (0.0, 0.3, 0.6, 0.9)
"""Heights above a touch at which to look for the body [m]: the neck cannot bend far enough to see beside the base."""
ASIDE, FARTHER = 0.01, 8
"""Step [m] and most steps by which to move a felt body out of the robot."""


@dataclass
class Control:
    """Robot in a true world, with a belief about that world and the scene in which motions are planned."""

    handle: RobotHandle
    belief: Belief
    scene: PlanningScene
    flowing: Flowing = field(init=False)
    """What flows out of vessels in the hands meanwhile."""
    is_supposed: bool = field(default=False, init=False)
    """Whether the robot is where its scene has it, and not where its sensors say."""

    @property
    def world(self) -> RobotInterface:
        """The real robot: it takes commands, and the world is known only by its sensors."""
        return self.handle.interface

    @world.setter
    def world(self, interface: RobotInterface) -> None:
        self.handle = replace(self.handle, interface=interface)

    @property
    def robot(self) -> Robot:
        """The bound robot."""
        return self.handle.model.robot

    def configuration(self) -> Configuration:
        """Read odometry and encoders."""
        return (self.scene.world if self.is_supposed else self.world).configuration()

    def base(self) -> BasePose:
        """Read the pose of the base from odometry."""
        return self.configuration().base

    def joints(self, names: Sequence[str]) -> Array:
        """Read the positions (d,) of joints from the encoders [rad, m]."""
        positions = self.configuration().joints
        return np.array([positions[name] for name in names])

    def arm_joints(self, arm: ArmModel) -> Array:
        """Read the positions (d,) of the joints of an arm, including a torso that carries it [rad, m]."""
        return self.joints(arm.joints)

    def observe(self) -> None:
        """Read encoders and touch: believe the robot, and the handles that its hands still feel, where they are now.

        Called at the end of a motion, after a hand has closed on a handle, before it is said where a lost body fell,
        and before a decision.
        """
        for leaf, _ in self._slipped():
            self.belief.let_go(leaf, "slipped off")
        self.belief.observed(self.world.configuration(), self.scene.mirror)

    def _slipped(self) -> list[tuple[str, str]]:
        """List the leaves whose handles the hands that lead them no longer feel, each with the link of its hand."""
        return [(leaf, link) for leaf, link in self.belief.led.items() if not self.world.feels(link)]

    def supposing(self, scene: PlanningScene) -> Self:
        """Make the same robot in a scene that is supposed, and where that has it, to plan there."""
        other = copy(self)
        other.scene, other.belief, other.is_supposed = scene, scene.belief, True
        return other

    async def follow(
        self,
        group: str,
        trajectory: Trajectory,
        *,
        pushes: str | None = None,
        closes: Callable[[Trajectory], bool] | None = None,
    ) -> Motion:
        """Execute a motion and wait for its end; halt it if the caller is evaporated or suspended.

        An arm stops once the handle that it leads has slipped out of its hand; the state is then "moving".
        ``pushes``: link of the hand that pushes bodies instead of being stopped by them. ``closes`` is asked every
        :data:`GLANCE` whether the motion has to stop; its state is then "moving". Raises ObjectLost as soon as a
        hand of :meth:`watched` no longer feels its object, and the failure of the group if the robot reports one.
        """
        group = Group.of(group)
        tips = {arm.tip for arm in self.scene.arms.all if arm.name in group.arms}

        def is_over() -> bool:
            is_loose = tips and any(link in tips for _, link in self._slipped())
            return is_loose or self.world.motion(group).state is not MotionState.MOVING

        with self.flowing.during(group.arms, trajectory):
            self.world.start(group, trajectory, pushes=pushes)
            try:
                while not await self.wait_holding(
                    self.watched(group),
                    is_over,
                    f"{group} at rest",
                    None if closes is None else GLANCE,
                ):
                    if closes is not None and closes(trajectory):
                        break
                motion = self.world.motion(group)
                if motion.state is MotionState.FAILED:
                    raise failure_of(group, motion.reason, trajectory, self.world.configuration(), self.robot.torso)
                return motion
            finally:
                self.world.halt(group)
                self.observe()

    # What the hands hold

    def watched(self, group: Group) -> Sequence[str]:
        """List the arms that must not lose what they hold while a group moves."""
        return [arm for grip in self.belief.held.values() for arm in grip.arms]

    async def wait_holding(
        self, arms: Sequence[str], condition: Callable[[], T], name: str, timeout: float | None = None
    ) -> T | None:
        """Wait until a condition of the world is true and return its value; None after the timeout [s].

        Raises ObjectLost as soon as one of the arms no longer feels what it is believed to hold.
        """
        value = await wait_for(Fluent(read=lambda: condition() or self._emptied(arms), name=name), timeout=timeout)
        self.check_hold(arms)
        return None if value is None else condition()

    def check_hold(self, arms: Sequence[str]) -> None:
        """Raise ObjectLost if an arm no longer feels its object, which is then believed to lie below the hand."""
        if (arm := self._emptied(arms)) is not None:
            self._lose(next(name for name, grip in self.belief.held.items() if arm in grip.arms), arm)

    def check_shift(self, touch: Touch) -> None:
        """Raise ObjectLost if a finger is pushed by its own object, which therefore no longer moves with the hand."""
        for name, arm in [(name, arm) for name, grip in self.belief.held.items() for arm in grip.arms]:
            gripper = self.robot.arm(arm).gripper
            if gripper is not None and touch.link in gripper.finger_links:
                block = Block.of(self.scene.world.pose(name), self.scene.world.size(name))
                if block.away(np.array(touch.point)) <= MEANT:
                    self._lose(name, arm)

    def _lose(self, what: str, arm: str) -> NoReturn:
        self.flowing.catch_up()
        self.belief.lost(what, self.below(what))
        raise ObjectLost(what=what) from GraspSlipped(arm=arm, what=what)

    def _emptied(self, arms: Sequence[str]) -> str | None:
        holding = [hand for grip in self.belief.held.values() for hand in grip.hands if hand.arm in arms]
        return next((hand.arm for hand in holding if not self.world.feels(hand.link)), None)

    def between_fingers(self, arm: str) -> Array | None:
        """Find the point (3,) of the map between the fingers of an arm that feel something; None if none does."""
        gripper = self.robot.arm(arm).gripper
        return pinched(self.world.touches(gripper.finger_links)) if gripper is not None else None

    def below(self, name: str) -> Pose:
        """Predict the pose at which a body comes to rest when it leaves the hand, where that is by now."""
        self.observe()
        state = self.belief.state
        world = self.scene.mirror.at(replace(state, away=state.away - {name}) if name in state.away else state)
        believed = world.pose(name)
        x, y, z = believed.position
        drop = world.height_above_support(name)
        # A body above nothing, or above the void beside a map, is believed to lie on the floor.
        return Pose((x, y, z - drop if drop < z else 0.0), believed.orientation)

    def timed(self, joints: Sequence[str], path: Array, timing: Callable[..., Trajectory] = time_path) -> Trajectory:
        """Time a joint path (n, d) within the joints' limits of speed, acceleration and jerk."""
        limits = [self.robot.limits[name] for name in joints]
        return timing(
            tuple(joints),
            path,
            velocity=[limit.speed for limit in limits],
            acceleration=[limit.acceleration for limit in limits],
            jerk=[limit.jerk for limit in limits],
            rate=self.world.rate,
        )


class Sensing:
    """Points the camera, and updates the belief with images and touches."""

    def __init__(self, control: Control) -> None:
        self._control = control

    async def look_at(self, point: Array, name: str) -> None:
        """Turn the neck so that a map point (3,) is in the image.

        Raises LookingGoalUnreachable beyond its limits, and LookingFailure if it stops where the point is not in the
        image. After the second time the neck is given up: the camera looks where it does now, and the base turns.
        """
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
        path = np.stack([control.joints(gaze.joints), neck])
        belief = control.belief
        try:
            await control.follow(Group(GroupKind.HEAD), control.timed(gaze.joints, path))
        except LookingFailure as failure:
            failure.what = name
            self._neck_failed(failure)
            raise
        if np.abs(control.joints(gaze.joints) - neck).max() <= ARRIVED:
            belief.neck_arrived()
        elif not self.frames(point, 1.0):
            message = f"the neck stopped before the camera pointed at {name}"
            raise self._neck_failed(LookingFailure(message, what=name))

    def _neck_failed(self, failure: LookingFailure) -> LookingFailure:
        """Note that the neck has not arrived; the failure says so, if it counts as stuck now."""
        belief = self._control.belief
        belief.neck_failed()
        if belief.memory.neck_given_up:
            failure.message = f"the neck is stuck: {failure}"
        return failure

    def frames(self, point: Array, share: float = FRAME) -> bool:
        """Check whether the camera, as it is, has a map point (3,) within a share of its half angle; False without one.

        By default such that a thing there fits the picture.
        """
        camera = self._control.robot.camera
        if camera is None:
            return False
        pose = self._control.world.link_pose(camera.link)
        axis, arrow = rotated(pose.rotation, np.asarray(camera.forward, float)), point - np.array(pose.position)
        missed = float(np.arccos(np.clip(axis @ arrow / max(float(np.linalg.norm(arrow)), 1e-9), -1.0, 1.0)))
        return missed <= share * camera.half_angle

    async def shows(self, points: Iterable[Array], name: str, is_seen: Callable[[tuple[str, ...]], bool]) -> bool:
        """Look at points (3,) of the map, one after the other, until an image shows what is looked for.

        ``is_seen`` decides by the names of the bodies recognised in an image. If none shows it, raises the first
        LookingGoalUnreachable; returns False if there is none.
        """
        unreachable: LookingGoalUnreachable | None = None
        for point in points:
            try:
                await self.look_at(point, name)
            except LookingGoalUnreachable as failure:
                unreachable = unreachable or failure
                continue
            if self.shows_here(is_seen):
                return True
        if unreachable is not None:
            raise unreachable
        return False

    def turn_towards(self, point: Array) -> None:
        """Begin to turn the neck towards a map point (3,), as far as it goes, and do not wait for its end."""
        control, gaze = self._control, self._control.scene.visibility.gaze
        if gaze is None or not gaze.joints or control.world.motion("head").state is MotionState.MOVING:
            return
        neck, _, _ = gaze.at(matrices.moved(Pose.planar(*control.base()).inverse().matrix(), point))
        now = control.joints(gaze.joints)
        if np.abs(neck - now).max() > SAME_GAZE:
            control.world.start("head", control.timed(gaze.joints, np.stack([now, neck])))

    def see(self) -> tuple[str, ...]:
        """Take an image and return the names of recognised bodies; without a camera, of those taken from the map.

        If the camera may have missed something, further images decide.
        """
        belief = self._control.belief
        seen = self._take_image()
        for _ in range(1, belief.camera_noise.pictures):
            if not belief.in_doubt:
                break
            seen = tuple(dict.fromkeys((*seen, *self._take_image())))
        return seen

    def shows_here(self, is_seen: Callable[[tuple[str, ...]], bool]) -> bool:
        """Take images from here until one shows what is looked for: as many as it takes to be sure that none does."""
        return any(is_seen(self.see()) for _ in range(self._control.belief.camera_noise.pictures))

    def _take_image(self) -> tuple[str, ...]:
        camera, belief = self._control.robot.camera, self._control.belief
        if camera is None:
            return tuple(name for name in self._control.scene.world.names() if belief.seen_from_here(name))
        pose_of = self._control.scene.world.pose
        in_hands = {name: pose_of(name) for name in sorted(belief.state.carried())}
        seen = belief.see(self._control.world.detect(camera.link), self._should_show, in_hands, self._at_rest)
        for name, pose in out_of_arms(seen, self._control.scene).items():
            belief.corrected(name, pose)
        self._explain()
        return tuple(seen)

    def _at_rest(self, name: str, seen: Estimate) -> Pose:
        """Put a thing that may be displaced down on what is below it, as far as what is seen leaves that open."""
        scene, within = self._control.scene, seen.slack()
        if not scene.world.scene.body(name).movable:
            return seen.pose
        (x, y, z), level = seen.pose.position, upright(seen.pose)
        turned = level if level.turn(seen.pose) <= seen.angle_slack() else seen.pose
        raised = Pose((x, y, z + within), turned.orientation)
        drop = scene.mirror.at(scene.belief.state.placed({name: raised})).height_above_support(name)
        return Pose((x, y, z + within - drop if drop <= 2 * within else z), turned.orientation)

    def _should_show(self, names: Collection[str]) -> list[str]:
        """Select the things that the camera would show now if they were where they are believed to be."""
        self._control.observe()
        world = self._control.scene.world
        return [name for name in names if world.sight(name)[0] >= SEEN_SHARE]

    def scan(self) -> None:
        """Take a depth image and mark the free space that it shows."""
        control, camera, space = self._control, self._control.robot.camera, self._control.scene.space
        if camera is not None and space is not None:
            eye = np.array(control.world.link_pose(camera.link).position)
            space.integrate(eye, *control.world.scan(camera.link))

    def hidden(self, points: Array) -> tuple[NDArray[np.bool_], Array]:
        """Take a depth image and find which points (n, 3) of the map are hidden from the camera.

        Returns a mask (n,), and the points (k, 3) of the map at which the lines of sight to hidden points end.
        """
        control, camera = self._control, self._control.robot.camera
        if camera is None or not len(points):
            return np.zeros(len(points), bool), NO_SCREENS
        eye = np.array(control.world.link_pose(camera.link).position)
        return hiding(eye, points, *control.world.scan(camera.link))

    def seen_through(self, points: Array, within: float) -> float:
        """Take a depth image and compute at which share of the points (n, 3) that it shows nothing is.

        0 if it shows none; one alone at the rim of the image tells little: at least a third of them count as shown.
        ``within``: distance from a point at which a line of sight counts as through it [m].
        """
        control, camera = self._control, self._control.robot.camera
        if camera is None:
            return 0.0
        eye = np.array(control.world.link_pose(camera.link).position)
        shown, empty = passed(eye, points, control.world.scan(camera.link)[0], within)
        return float(empty.sum() / max(shown.sum(), len(points) / 3, 1))

    async def _look_over(self, point: Array) -> None:
        """Look at a touched map point (3,), or as low above it as the neck can bend."""
        async with using("head"):
            for height in HEIGHTS:
                with suppress(LookingFailure):
                    await self.look_at(point + np.array([0.0, 0.0, height]), "what was touched")
                    break
        self.see()

    def _explain(self) -> None:
        """Forget the anonymous obstacles that a body seen from here explains."""
        belief, bodies = self._control.belief, self._control.scene.bodies
        obstacles = {name: np.array(belief.pose(name).position) for name in belief.names() if name in NAMES}
        others = (name for name in belief.names() if obstacles and name not in obstacles)
        seen = [bodies.block(name) for name in others if belief.seen_from_here(name)]
        belief.forget([name for name, at in obstacles.items() if any(block.away(at) <= EDGE for block in seen)])

    def not_seen(self, name: str) -> None:
        """Record that a body was not seen from here.

        After the second time, an object that should be visible from here is no longer believed to be at its place; at
        once if another one is seen there.
        """
        scene, belief = self._control.scene, self._control.belief
        again = bool(belief.looked_in_vain(name))
        belief.not_seen(name, self._control.base())
        if not scene.bodies.is_graspable(name):
            return
        is_taken = scene.bodies.stands_at_place_of(name) is not None
        if is_taken or (again and scene.visibility.hidden(scene.base(), name) is None):
            belief.not_there(name)

    def is_out_of_sight(self, name: str) -> bool:
        """Check whether a body was seen from elsewhere, not touched since, and is hidden from here."""
        scene = self._control.scene
        return self._control.belief.remembers(name) and scene.visibility.hidden(scene.base(), name) is not None

    def must_look(self, what: Object) -> bool:
        """Check whether a graspable object or a person has yet to be seen since the base last moved.

        False for a body that was seen from elsewhere and is hidden from here.
        """
        scene, belief = self._control.scene, self._control.belief
        name = scene.bodies.bind(what)
        if name in belief.held or belief.seen_from_here(name) or self.is_out_of_sight(name):
            return False
        return scene.bodies.is_graspable(name) or scene.bodies.is_person(name)

    def met(self, motion: Motion) -> str | None:
        """Conclude what has stopped a motion, in words, from where the robot was touched; None if it feels nothing."""
        return None if motion.touch is None else self._control.scene.bodies.met(motion.touch)

    async def bump(self, motion: Motion) -> str | None:
        """Update the belief from the touch that stopped a motion, and from an image of that point.

        If a believed body explains the touch, move it there; otherwise add an anonymous obstacle, which is forgotten
        once a body seen there explains it. Returns what stopped it, in words, as :meth:`met` does. Raises ObjectLost
        as :meth:`Control.check_shift` does.
        """
        control, touch = self._control, motion.touch
        if touch is None:
            return None
        control.check_shift(touch)
        await self._look_over(np.array(touch.point))
        explained, belief = control.scene.bodies.explained(touch), control.belief
        met = self.met(motion)
        if explained is None:
            belief.obstacle(behind(touch))
        elif not (belief.seen(explained[0]) or control.scene.bodies.is_person(explained[0])):
            self._felt(*explained, np.array(touch.normal) * [1.0, 1.0, 0.0])
        return met

    def _felt(self, name: str, pose: Pose, normal: Array) -> None:
        """Move a believed body to a pose, or on against the contact normal (3,) until it overlaps no arm."""
        control, collisions = self._control, self._control.scene.collisions
        for number in range(FARTHER):
            x, y, z = (np.array(pose.position) - number * ASIDE * normal).tolist()
            control.belief.bump(name, Pose((x, y, z), pose.orientation))
            arms = [(arm, control.arm_joints(arm)) for arm in control.scene.arms.all]
            contacts = (contact for arm, q in arms for contact in collisions.contacts(control.base(), arm, q))
            if all(contact.body != name for contact in contacts):
                return

    def support_of(self, name: str) -> Block | None:
        """Look up the block of the body that supports an object; None if there is none."""
        world = self._control.scene.world
        support = world.support(name)
        return self._control.scene.bodies.block(support) if support is not None and support in world.names() else None
