"""Commanding the true world by subject: base, fingers, camera; the planning scene is kept equal to the belief."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from executive.belief import Belief
from executive.belief.believed_bodies import MEANT, Block
from executive.belief.obstacles import EDGE, NAMES, behind
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose, pinched
from executive.locations.views import NO_SCREENS, hiding
from executive.modules.out_of_arms import out_of_arms
from executive.motion import time_path
from executive.robots import Gripper, Robot
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang import Fluent, checkpoint, now, sleep, using, wait_for
from planlang.designators import Object
from planlang.failures import (
    GraspSlipped,
    GripperGoalNotReached,
    LookingFailure,
    LookingGoalUnreachable,
    ManipulationGoalNotReached,
    NavigationGoalNotReached,
    ObjectLost,
    ObjectUnresolvable,
    PlanFailure,
)
from planlang.geometry import Array, Pose, matrices
from planlang.protocols import Motion, MotionState, RobotInterface, Touch, Trajectory
from planlang.records import dataclass
from sim.falling import falling_time

T = TypeVar("T")

SAME = 0.01
"""Share of the opening of a hand by which two are the same."""

HEIGHTS = (0.0, 0.3, 0.6, 0.9)
"""Heights above a touch at which the camera looks for what was touched [m]: a base touches things below the neck."""
ASIDE, FARTHER = 0.01, 8
"""Steps in which a body that was felt is moved out of the robot [m], and how many of them."""


@dataclass
class Control:
    """A robot in a true world, with a belief about it and the scene in which its motions are planned."""

    world: RobotInterface
    """The robot among what is really there: commanded, and known only by what it senses."""
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
        """Make the planning scene equal to what is believed; from what a hand has slipped off it holds no more."""
        for leaf in [leaf for leaf, link in self.belief.led.items() if not self.world.feels(link)]:
            self.belief.let_go(leaf)
        self.belief.sync(self.scene.world, self.world.configuration())

    async def follow(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> Motion:
        """Command a motion and wait for its end; it is halted when the caller is evaporated or suspended.

        ``pushes``: the link of the hand that pushes what it meets, None if that stops it. Raises ObjectLost as soon as
        a hand of :meth:`watched` no longer feels what it holds, and what the robot itself says that it did not make.
        """
        self.world.start(group, trajectory, pushes=pushes)
        try:
            at_rest = partial(self._is_at_rest, group)
            await self.wait_holding(self.watched(group), at_rest, f"{group} at rest")
            motion = self.world.motion(group)
            if motion.state is MotionState.FAILED:
                raise _failed(group, motion.reason)
            return motion
        finally:
            self.world.halt(group)
            self.sync()

    def _is_at_rest(self, group: str) -> bool:
        return self.world.motion(group).state is not MotionState.MOVING

    # What the hands hold

    def watched(self, group: str) -> Sequence[str]:
        """Return the arms that must not lose what they hold while a group moves."""
        return [arm for grip in self.belief.held.values() for arm in grip.arms]

    async def wait_holding(
        self, arms: Sequence[str], true: Callable[[], T], name: str, timeout: float | None = None
    ) -> T | None:
        """Wait until something is true of the world, and return that, None after the timeout.

        Raises ObjectLost as soon as one of the arms no longer feels what it is believed to hold.
        """
        found = await wait_for(Fluent(read=lambda: true() or self._emptied(arms), name=name), timeout=timeout)
        self.check_hold(arms)
        return None if found is None else true()

    def check_hold(self, arms: Sequence[str]) -> None:
        """Raise ObjectLost if an arm does not feel what it is believed to hold: then that is believed to lie below."""
        if (arm := self._emptied(arms)) is not None:
            self._lose(next(name for name, grip in self.belief.held.items() if arm in grip.arms), arm)

    def check_shift(self, touch: Touch) -> None:
        """Raise ObjectLost if a hand is pressed by what it is believed to hold: that does not move with it any more."""
        for name, arm in [(name, arm) for name, grip in self.belief.held.items() for arm in grip.arms]:
            gripper = self.robot.arm(arm).gripper
            if gripper is not None and touch.link in gripper.finger_links:
                there = Block.of(self.scene.world.pose(name), self.scene.world.size(name))
                if there.away(np.array(touch.point)) <= MEANT:
                    self._lose(name, arm)

    def _lose(self, what: str, arm: str) -> NoReturn:
        self.belief.lost(what, self.below(what))
        self.sync()
        raise ObjectLost(what=what) from GraspSlipped(arm=arm, what=what)

    def _emptied(self, arms: Sequence[str]) -> str | None:
        holding = [hand for grip in self.belief.held.values() for hand in grip.hands if hand.arm in arms]
        return next((hand.arm for hand in holding if not self.world.feels(hand.link)), None)

    def between_fingers(self, arm: str) -> Array | None:
        """Return the point (3,) of the map about which fingers of an arm feel something; None if they feel nothing."""
        gripper = self.robot.arm(arm).gripper
        return pinched(self.world.touches(gripper.finger_links)) if gripper is not None else None

    def below(self, name: str) -> Pose:
        """Return where a body is believed to come down when it leaves the hand."""
        self.sync()
        believed = self.scene.world.pose(name)
        x, y, z = believed.position
        sinks = self.scene.world.height_above_support(name)
        # A body above nothing, or above the void beside a map, is believed to lie on the floor.
        return Pose((x, y, z - sinks if sinks < z else 0.0), believed.orientation)

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


def _failed(group: str, reason: str | None) -> PlanFailure:
    """Return the failure of a motion that the robot did not make."""
    about = "" if reason is None else f": {reason}"
    match group.partition(" of "):
        case ("base", *_):
            return NavigationGoalNotReached(f"{NavigationGoalNotReached.text}{about}")
        case ("head", *_):
            return LookingFailure(f"{LookingFailure.text}{about}")
        case ("gripper", _, arm) if arm:
            return GripperGoalNotReached(f"{GripperGoalNotReached.text}{about}", arm=arm)
    return ManipulationGoalNotReached(f"{ManipulationGoalNotReached.text}{about}", arm=group)


class Hands:
    """Moves fingers, and tells the belief what they hold."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._at_rest: dict[str, float] = {}
        """Thing that was let go -> plan time at which it has come down as far as it was believed to [s]."""

    def gripper(self, arm: ArmModel) -> Gripper | None:
        """Return the gripper of an arm."""
        return self._control.robot.arm(arm.name).gripper

    def hold(self, what: Object) -> bool:
        """Return whether the robot holds a thing; False if it is not known which that is."""
        try:
            return self._control.scene.bodies.bind(what) in self._control.belief.held
        except ObjectUnresolvable:
            return False

    async def move(self, arm: ArmModel, *, closed: bool, fingers: Fingers = ()) -> Motion:
        """Close the fingers, or open them: as far as they go, or to ``fingers``. Those that open let go of a handle."""
        gripper = self.gripper(arm)
        assert gripper is not None
        if not closed:
            self._leave(arm)
        wanted = gripper.closed if closed else dict(fingers) or gripper.opened
        path = np.stack([self._control.joints(gripper.joints), [wanted[name] for name in gripper.joints]])
        return await self._control.follow(f"gripper of {arm.name}", self._control.timed(gripper.joints, path))

    async def close(self, arm: ArmModel) -> Motion:
        """Close the fingers until they are closed, or something that they feel stops them.

        Raises GripperGoalNotReached if they end elsewhere: what open fingers are near to is not held.
        """
        motion = await self.move(arm, closed=True)
        now = dict(zip(arm.openings.joints, self._control.joints(arm.openings.joints), strict=True))
        if motion.touch is None and now and arm.openings.share(now) > SAME:
            raise GripperGoalNotReached(arm=arm.name, blocked_by=motion.blocked_by)
        return motion

    async def shape(self, arm: ArmModel, fingers: Fingers) -> None:
        """Bring the fingers of a free hand, closed or not, to the opening for which a hand pose was checked, if any."""
        if not fingers or self._control.scene.arms.held(arm.name) is not None:
            return
        now = dict(zip(arm.openings.joints, self._control.joints(arm.openings.joints), strict=True))
        if abs(arm.openings.share(now) - arm.openings.share(dict(fingers))) > SAME:
            await self.move(arm, closed=False, fingers=fingers)

    def lead(self, arm: ArmModel, leaf: str) -> None:
        """Let a door or drawer, on the handle of which the fingers have closed, move with the hand from now on."""
        control, link = self._control, self._control.robot.arm(arm.name).tip
        control.world.grip(link)
        control.belief.leads(leaf, link)
        control.sync()

    def _leave(self, arm: ArmModel) -> None:
        control, link = self._control, self._control.robot.arm(arm.name).tip
        control.world.loosen(link)
        for leaf in [leaf for leaf, leader in control.belief.led.items() if leader == link]:
            control.belief.let_go(leaf)
        control.sync()

    def is_on(self, arm: ArmModel, name: str) -> bool:
        """Return whether what the closed fingers feel is where a body is believed to be."""
        point = self._control.between_fingers(arm.name)
        return point is not None and self._control.scene.bodies.block(name).away(point) <= MEANT

    def between_fingers(self, arm: ArmModel) -> str | None:
        """Return the body that the closed fingers feel: of the believed ones that which explains what they feel."""
        point = self._control.between_fingers(arm.name)
        return None if point is None else self._control.scene.bodies.graspable_at(point)

    def grasp(self, arm: ArmModel, name: str) -> None:
        """Grip what the fingers have closed on; what that is believed to be moves with the hand from now on."""
        control, link = self._control, self._control.robot.arm(arm.name).tip
        control.world.grip(link)
        offset = control.world.link_pose(link).inverse() @ control.belief.pose(name)
        control.belief.grasped(name, arm.name, link, offset)
        control.sync()
        if riders := control.scene.world.riders(name):
            control.belief.loaded(name, riders)

    def let_go(self, name: str, *, to: str | None = None) -> None:
        """Let a held body go: it comes down on what is below, or a person has it."""
        control = self._control
        place = control.below(name)
        fall = control.scene.world.pose(name).position[2] - place.position[2]
        self._at_rest[name] = now() + falling_time(fall)
        for hand in control.belief.held[name].hands:
            control.world.loosen(hand.link)
        control.belief.released(name, place, to=to)
        control.sync()

    async def settled(self, name: str) -> None:
        """Wait until a body that was let go has had the time to fall as far as it is believed to."""
        await sleep(max(0.0, self._at_rest.pop(name) - now()))

    async def offer(self, arm: ArmModel, name: str, patience: float) -> bool:
        """Wait until somebody pulls at a held body, which the wrist feels; False if nobody does in ``patience`` [s].

        Raises ObjectLost when it leaves the hand otherwise.
        """
        pulled = partial(self._control.world.pulled, self._control.robot.arm(arm.name).tip)
        return bool(await self._control.wait_holding([arm.name], pulled, f"{name} taken", patience))


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
            return tuple(name for name in self._control.scene.world.names() if belief.seen_from_here(name))
        seen = self._control.world.detect(camera.link)
        detections = [one for one in seen if belief.recognises(one.name)]
        belief.see(detections)
        self._control.sync()
        if corrected := out_of_arms(detections, self._control.scene):
            belief.see(corrected)
            self._control.sync()
        self._explain()
        return tuple(detection.name for detection in detections)

    def scan(self) -> None:
        """Take a picture of depths: the belief learns which space is free."""
        control, camera, space = self._control, self._control.robot.camera, self._control.scene.space
        if camera is not None and space is not None:
            eye = np.array(control.world.link_pose(camera.link).position)
            space.integrate(eye, *control.world.scan(camera.link))

    def hidden(self, points: Array) -> tuple[NDArray[np.bool_], Array]:
        """Take a picture of depths: return which points (n, 3) something hides from the camera, (n,), and where.

        The latter, (k, 3), are the points of the map at which the lines of sight to the hidden ones end.
        """
        control, camera = self._control, self._control.robot.camera
        if camera is None or not len(points):
            return np.zeros(len(points), bool), NO_SCREENS
        eye = np.array(control.world.link_pose(camera.link).position)
        return hiding(eye, points, *control.world.scan(camera.link))

    async def _look_over(self, point: Array) -> None:
        """Look at what was touched at a map point (3,), or, where the neck cannot bend that far, as low as it can."""
        async with using("head"):
            for height in HEIGHTS:
                with suppress(LookingGoalUnreachable):
                    await self.look_at(point + np.array([0.0, 0.0, height]), "what was touched")
                    break
        self.see()

    def _explain(self) -> None:
        """Forget the obstacles where a thing is that has been seen from here."""
        belief, bodies = self._control.belief, self._control.scene.bodies
        felt = {name: np.array(belief.pose(name).position) for name in belief.names() if name in NAMES}
        seen = [
            bodies.block(name) for name in belief.names() if felt and name not in felt and belief.seen_from_here(name)
        ]
        belief.forget([name for name, at in felt.items() if any(block.away(at) <= EDGE for block in seen)])
        self._control.sync()

    def not_seen(self, name: str) -> None:
        """Remember that a body was looked for in vain from here.

        A thing that was looked for in vain before and would be seen from here is not where it was believed to be.
        """
        scene, belief = self._control.scene, self._control.belief
        again = bool(belief.looked_in_vain(name))
        belief.not_seen(name, self._control.base())
        if again and scene.bodies.is_graspable(name) and scene.visibility.hidden(scene.base(), name) is None:
            belief.not_there(name)
            self._control.sync()

    def is_out_of_sight(self, name: str) -> bool:
        """Return True for what was seen from elsewhere, was not touched since, and cannot be seen from here."""
        scene = self._control.scene
        return self._control.belief.remembers(name) and scene.visibility.hidden(scene.base(), name) is not None

    def must_look(self, what: Object) -> bool:
        """Return whether a thing to grasp, or a person to give to, has not been seen since the base last moved.

        False for what was seen from elsewhere and cannot be seen from here.
        """
        scene, belief = self._control.scene, self._control.belief
        name = scene.bodies.bind(what)
        if name in belief.held or belief.seen_from_here(name) or self.is_out_of_sight(name):
            return False
        return scene.bodies.is_graspable(name) or scene.bodies.is_person(name)

    async def bump(self, motion: Motion) -> None:
        """Learn from what a motion was blocked by: a touch at a point, and what the camera shows there.

        Where a believed thing explains the touch it is believed to stand so much nearer; else there is an obstacle. An
        obstacle that turns out to be a known thing is forgotten. Raises ObjectLost as :meth:`Control.check_shift` does.
        """
        control, touch = self._control, motion.touch
        if touch is None:
            return
        control.check_shift(touch)
        await self._look_over(np.array(touch.point))
        explained, belief = control.scene.bodies.explained(touch), control.belief
        if explained is None:
            belief.obstacle(behind(touch), motion.blocked_by)
        elif not (belief.seen(explained[0]) or control.scene.bodies.is_person(explained[0])):
            self._felt(*explained, np.array(touch.normal) * [1.0, 1.0, 0.0])
        control.sync()

    def _felt(self, name: str, pose: Pose, normal: Array) -> None:
        """Believe a body at a pose, or as much farther against a normal (3,) that no arm is inside of it."""
        control, collisions = self._control, self._control.scene.collisions
        for number in range(FARTHER):
            x, y, z = (np.array(pose.position) - number * ASIDE * normal).tolist()
            control.belief.bump(name, Pose((x, y, z), pose.orientation))
            control.sync()
            arms = [(arm, control.arm_joints(arm)) for arm in control.scene.arms.all]
            met = (contact for arm, q in arms for contact in collisions.contacts(control.base(), arm, q))
            if all(contact.body != name for contact in met):
                return

    def support_of(self, name: str) -> Block | None:
        """Return the shape of the body that something is believed to stand on."""
        world = self._control.scene.world
        support = world.support(name)
        return self._control.scene.bodies.block(support) if support is not None and support in world.names() else None
