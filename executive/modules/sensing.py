"""The senses of a platform: where the camera looks, what it recognises, what the robot runs into."""

from __future__ import annotations

import numpy as np

from executive.belief.believed_bodies import Block
from executive.modules.control import Control
from planlang import checkpoint
from planlang.designators import Object
from planlang.failures import LookingGoalUnreachable
from planlang.geometry import Array, Pose, matrices


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
        """Take a picture and return the names of what was recognised."""
        camera = self._control.robot.camera
        if camera is None:
            return ()
        detections = self._control.world.detect(camera.link)
        self._control.belief.see(detections)
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
