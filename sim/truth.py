"""What is really so in a simulated world: for goals, reports, pictures and tests. A robot does not know it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from planlang.geometry import Pose
from planlang.protocols import Configuration
from sim.bodies import Part
from sim.robot import Robot
from sim.scene import Scene

ROBOT = "robot"
"""The name by which :func:`held_by` calls the robot."""

RESTS = 0.005
"""Height above its support at which a body still rests on it [m]."""


class Truth(Protocol):
    """A simulated world as it is now; poses are in the map, names are those of the scene."""

    rate: int
    """Steps per second."""
    steps: int
    """Steps since the beginning."""
    scene: Scene
    """What it began with, and what has come into being since."""

    @property
    def robot(self) -> Robot:
        """The links and joints of its robot."""

    @property
    def changed(self) -> int:
        """The number of changes of what there is, by whomever."""

    @property
    def has_robot(self) -> bool:
        """Return whether there is a robot in it."""

    def configuration(self) -> Configuration:
        """Return where the robot is."""

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link frame of the robot."""

    def names(self) -> tuple[str, ...]:
        """Return the bodies that are there, in the order of the scene."""

    def pose(self, name: str) -> Pose:
        """Return the pose of the centre of a body's box."""

    def poses(self) -> Mapping[str, Pose]:
        """Return the poses of all bodies that are there."""

    def pieces(self, name: str) -> tuple[tuple[Part, Pose], ...]:
        """Return the primitives of a body, each with its pose in the body's frame; those of limbs change."""

    def joint(self, leaf: str) -> float:
        """Return how far a door, drawer or lid is open [rad, m]."""

    def contents(self, name: str) -> Mapping[str, float]:
        """Return class of substance -> amount of it in a body [ml]."""

    def condition(self, name: str) -> str | None:
        """Return the state of a body, such as on or clean; None if it has none."""

    def attached(self) -> Mapping[str, str]:
        """Return body -> link of the robot that holds it, the first of several, or what it stands on."""

    def led(self) -> Mapping[str, str]:
        """Return door or drawer -> link of the robot that moves it."""

    def taken(self, name: str) -> str | None:
        """Return the person who pulls at a body or has it."""

    def falling(self, name: str) -> bool:
        """Return whether a body is on its way down."""

    def support(self, name: str) -> str | None:
        """Return what a body rests on, or would if it were let go; None if there is nothing below."""

    def height_above_support(self, name: str) -> float:
        """Return how far a body is above that [m]."""


def held_by(world: Truth, name: str) -> str | None:
    """Return who holds a body: "robot" as long as it does, else the person who has taken it, else None."""
    return ROBOT if name in world.attached() else world.taken(name)


def at_rest_on(world: Truth, name: str) -> str | None:
    """Return the body that a body stands on; None while it is held, falls, or has nothing below it within 5 mm."""
    if held_by(world, name) or world.falling(name):
        return None
    return world.support(name) if world.height_above_support(name) <= RESTS else None
