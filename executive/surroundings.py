"""The believed world as location resolving and motion planning see it: a planning world kept equal to the belief."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from executive.capabilities import Robot
from executive.knowledge import Belief
from executive.locations import ArmModel, Base, Block, ComfortZone, Held
from executive.motion import Boxes, Gaze, clearance_at
from executive.motion.clearance import Band
from planlang.designators import Device, Object
from planlang.protocols import Array, Configuration, Contact
from sim import PyBulletWorld

SEEN_SHARE = 0.3
"""Share of an object that must be visible for a place to count as one from where it is seen."""
BEYOND = 0.2
"""How far the neck's limits may keep an object from the middle of the picture [rad]."""


class BelievedSurroundings:
    """Implements :class:`executive.locations.Surroundings` over a planning world; nothing here touches the truth."""

    def __init__(
        self,
        world: PyBulletWorld,
        robot: Robot,
        belief: Belief,
        arms: Sequence[ArmModel],
        gaze: Gaze | None,
    ) -> None:
        self.world, self.robot, self.belief, self.gaze = world, robot, belief, gaze
        self.arms: tuple[ArmModel, ...] = tuple(arms)

    def arms_of(self, device: Device) -> Sequence[ArmModel]:
        """Arms that a device designator may mean: by the robot's part, else by type and side."""
        names = [arm.name for arm in self.robot.arms_of(device)]
        return [arm for arm in self.arms if arm.name in names]

    def bind(self, what: Object) -> str:
        """The body that an object designator means; raises ObjectUnresolvable."""
        return self.belief.bind(what, self.base())

    def block(self, name: str) -> Block:
        """The believed shape of a body; for a held one where it was grasped."""
        cylinder = self.world.scene.body(name).shape == "cylinder"
        return Block.of(self.belief.reference_pose(name), self.world.size(name), cylinder=cylinder)

    def is_person(self, name: str) -> bool:
        """Whether the body is a person."""
        return self.world.scene.body(name).shape == "person"

    def is_graspable(self, name: str) -> bool:
        """Whether the body can be taken into a hand."""
        return self.world.scene.body(name).graspable

    def zone(self, name: str) -> ComfortZone:
        """Where the person takes things."""
        person = self.world.person(name)
        heading = math.atan2(person.facing[1], person.facing[0])
        return ComfortZone(
            person.shoulders, heading, person.arm_length, lambda point: person.comfortable(tuple(map(float, point)))
        )

    def held(self, arm: str) -> Held | None:
        """What the arm holds."""
        for name, grip in self.belief.held.items():
            if grip.arm == arm:
                return Held(name, grip.offset, self.world.size(name))
        return None

    def grasped_at(self, name: str) -> Array:
        """The tip pose (4, 4) in the map at which a held body was grasped."""
        grip = self.belief.held[name]
        return (self.belief.reference_pose(name) @ grip.offset.inverse()).matrix()

    def base(self) -> Base:
        """Where the base is."""
        return self.world.configuration().base

    def revision(self) -> int:
        """Revision of the belief."""
        return self.belief.revision

    def clearance(self, bases: Array) -> Array:
        """Room (m,) [m] around all but the arms at bases (m, 3), inside the bounds of the map."""
        joints = [name for arm in self.robot.arms for name in arm.joints]
        x_min, y_min, x_max, y_max = self.world.scene.bounds
        inside = (bases[:, 0] > x_min) & (bases[:, 0] < x_max) & (bases[:, 1] > y_min) & (bases[:, 1] < y_max)
        return np.where(inside, clearance_at(bases[:, :2], self.obstacles(), self.world.silhouette(joints)), -np.inf)

    def obstacles(self) -> Boxes:
        """Boxes around the pieces of all bodies that are not held, the floor left out."""
        poses, sizes = self.world.obstacles()
        return Boxes.around(poses, np.array(sizes).reshape(-1, 3))

    def silhouette(self) -> tuple[Band, ...]:
        """What the robot needs of room when it stands or turns, with what it holds, in its present posture."""
        return self.world.silhouette()

    def contacts(
        self,
        base: Base,
        arm: ArmModel | None = None,
        q: Array | None = None,
        touches: str | None = None,
        opened: bool = False,
    ) -> tuple[Contact, ...]:
        """Penetrations with an arm at ``q``, all else as it is; its hand may touch the body ``touches``.

        ``opened``: with the fingers of the arm open.
        """
        joints = dict(self.world.configuration().joints)
        if arm is not None and q is not None:
            gripper = self.robot.arm(arm.name).gripper
            joints |= gripper.opened if opened and gripper is not None else {}
            joints |= zip(arm.joints, map(float, q), strict=True)
        ignore = [(link, touches) for link in sorted(arm.hand_links)] if arm is not None and touches is not None else []
        return self.world.contacts(Configuration(base, joints), ignore=ignore)

    def looked_in_vain(self, name: str) -> Sequence[Base]:
        """Places from where the body was looked for and not seen."""
        return self.belief.looked_in_vain(name)

    def sighted(self) -> bool:
        """Whether the robot has a camera."""
        return self.gaze is not None

    def sees(self, base: Base, name: str) -> bool:
        """Whether the camera could see the body from a base: the neck can turn there and nothing is in between."""
        if self.gaze is None or self.robot.camera is None:
            return False
        x, y, yaw = base
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        centre = self.block(name).centre
        neck, beyond, camera = self.gaze.at(turn.T @ (centre - np.array([x, y, 0.0])))
        away = float(np.linalg.norm(centre - (turn @ camera + np.array([x, y, 0.0]))))
        if beyond > BEYOND or not self.robot.camera.near <= away <= self.robot.camera.far:
            return False
        joints = {**self.world.configuration().joints, **dict(zip(self.gaze.joints, map(float, neck), strict=True))}
        return self.world.visible(name, configuration=Configuration(base, joints)) >= SEEN_SHARE
