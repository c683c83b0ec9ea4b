"""Ground truth of a simulated world, for goals, reports, pictures and tests; the robot has no access to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Protocol

import numpy as np

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim.bodies import Part
from sim.leaves import inside
from sim.robot import Robot
from sim.scene import BodyShape, Scene
from sim.tolerances import RESTS, SHUT_SHARE, TILT

if TYPE_CHECKING:
    from sim.people import ComfortZone

ROBOT = "robot"
"""Name of the robot in the results of :func:`held_by`."""


class Truth(Protocol):
    """Current state of a simulated world; poses are in the map, names are those of the scene."""

    rate: int
    """Steps per second."""
    steps: int
    """Steps since the start."""
    scene: Scene
    """The initial scene, with the bodies created since."""

    @property
    def robot(self) -> Robot:
        """Links and joints of the robot."""

    @property
    def changed(self) -> int:
        """Number of changes of things, whoever made them."""

    @property
    def has_robot(self) -> bool:
        """Whether the world has a robot."""

    def configuration(self) -> Configuration:
        """Current configuration of the robot."""

    def link_pose(self, link: str) -> Pose:
        """Pose of a link frame of the robot."""

    def names(self) -> tuple[str, ...]:
        """Bodies that exist, in the order of the scene."""

    def pose(self, name: str) -> Pose:
        """Pose of the centre of a body's box."""

    def poses(self) -> Mapping[str, Pose]:
        """Poses of all bodies that exist."""

    def pieces(self, name: str) -> tuple[tuple[Part, Pose], ...]:
        """Primitives of a body, each with its pose in the body's frame; the poses of limbs change."""

    def joint(self, leaf: str) -> float:
        """Opening of a door, drawer or lid [rad, m]."""

    def contents(self, name: str) -> Mapping[str, float]:
        """Class of substance -> amount of it in a body [ml]."""

    def condition(self, name: str) -> str | None:
        """State of a body, such as on or clean; None if it has none."""

    def attached(self) -> Mapping[str, str]:
        """Held body -> link of the robot that holds it (the first of several), or that holds what it stands on."""

    def carrier(self, name: str) -> str | None:
        """Held body on which a body stands, so that it moves with it; None for one in a hand, or a free one."""

    def led(self) -> Mapping[str, str]:
        """Door or drawer -> link of the robot that moves it."""

    def taken(self, name: str) -> str | None:
        """Person who pulls at a body or has it, if any."""

    def person(self, name: str) -> ComfortZone:
        """Comfort zone of a person, in which the person takes things."""

    def falling(self, name: str) -> bool:
        """Whether a body is falling."""

    def support(self, name: str) -> str | None:
        """Body on which a body rests, or would rest if released; None if nothing is below."""

    def height_above_support(self, name: str) -> float:
        """Distance that a body would fall if released [m]."""

    def obstacle(self, group: str) -> str | None:
        """Body, or link of the robot itself, that has blocked the last motion of a group."""

    def stands(self, name: str) -> bool:
        """Whether a body surely stands on a box, within 3 cm: quick, and not always told."""


def held_by(world: Truth, name: str) -> str | None:
    """Name the holder of a body: "robot" as long as the robot holds it, else the person who has taken it, else None."""
    return ROBOT if name in world.attached() else world.taken(name)


def at_rest_on(world: Truth, name: str) -> str | None:
    """Find the body that a body stands on; None while it is held, falls, or has nothing below it within 5 mm."""
    if held_by(world, name) or world.falling(name):
        return None
    return world.support(name) if world.height_above_support(name) <= RESTS else None


def is_inside(world: Truth, name: str, other: str) -> bool:
    """Check whether the centre of a body is within the box of another that is hollow: open above, or furniture.

    A room is no such body: what is on its floor is on it.
    """
    body = world.scene.body(other)
    if body.shape is BodyShape.ROOM or not (body.cavities or body.wall):
        return False
    return bool(inside(world.pose(other), body.size, np.array([world.pose(name).position]))[0])


def is_centred_in(world: Truth, name: str, other: str) -> bool:
    """Check whether the centre of a body is within the box of another; a room's is its interior."""
    size = world.scene.body(other).size
    return bool(inside(world.pose(other), size, np.array([world.pose(name).position]))[0])


def is_on(world: Truth, name: str, support: str, before: Pose | None = None) -> bool:
    """Check whether a body is at rest on another, and not toppled since it had a pose ``before``."""
    return at_rest_on(world, name) == support and not is_toppled(world, name, before)


def is_toppled(world: Truth, name: str, before: Pose | None) -> bool:
    """Check whether a body is tilted by more than the tolerance beyond its tilt ``before``."""
    return tilt(world.pose(name)) > TILT + (0.0 if before is None else tilt(before))


def tilt(pose: Pose) -> float:
    """Return the angle between up and the z axis of a pose [rad]."""
    x, y, _, _ = pose.orientation
    return math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y)))


def opened(world: Truth, leaf: str) -> float:
    """Return how far a door, drawer or lid is open, as a share of its range; ``KeyError`` if there is none."""
    joints = {joint.leaf: joint for joint in world.scene.joints}
    return abs(world.joint(leaf)) / joints[leaf].upper


def is_closed(world: Truth, leaf: str) -> bool:
    """Check whether a door, drawer or lid is closed, within the tolerance."""
    return opened(world, leaf) <= SHUT_SHARE
