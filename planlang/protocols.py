"""Interface of a robot for the layers above it, and the value types that cross the borders between layers.

What the language asks of an executive and its process modules is :mod:`planlang.language.executive`.

Frames: ``map`` is right-handed with z up and the floor at z = 0. Lengths in metres, angles in radians.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from typing import Any, Protocol

from numpy.typing import NDArray

from planlang.designators import Action
from planlang.geometry import Array, Pose
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Configuration:
    """The position of a robot: base (x, y, yaw) in the map and its actuated joints by name."""

    base: tuple[float, float, float]
    joints: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Contact:
    """A penetration: a link of the robot (or a held object, by name) and what it touches; ``depth`` > 0 [m]."""

    part: str
    body: str
    depth: float


@dataclass(frozen=True, slots=True)
class Touch:
    """A touch that a link of the robot feels on its surface; it tells where it is touched, not by what."""

    link: str
    point: tuple[float, float, float]
    """The touched point, in the map."""
    normal: tuple[float, float, float]
    """Unit vector from what touches towards the link, in the map."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Positions sampled at the world's rate: row k is reached k world steps after the start, row 0 is the start.

    ``names`` are joint names, or ("x", "y", "yaw") for the base; ``positions`` is (n, len(names)).
    """

    names: tuple[str, ...]
    positions: Array


class MotionState(StrEnum):
    """The state of a commanded motion."""

    MOVING = "moving"
    DONE = "done"
    BLOCKED = "blocked"
    """It ended where it would have touched something."""
    HALTED = "halted"
    """It was stopped by command, or by a newer motion of the same joints."""
    FAILED = "failed"
    """The robot did not make it, for a reason of its own: a motor that is off, a following error."""


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a commanded motion, and what blocks it."""

    state: MotionState
    blocked_by: str | None = None
    """Its name for messages; nothing is concluded from it, and a robot that cannot know it leaves it out."""
    touch: Touch | None = None
    """The contact that blocked the robot, or what it holds."""
    reason: str | None = None
    """Why it failed, for messages."""


@dataclass(frozen=True, slots=True)
class Detection:
    """The camera's result for an object: its name, its pose and the visible share of its pixels (0..1)."""

    name: str
    pose: Pose
    visible: float


class RobotInterface(Protocol):
    """Commands and senses of a robot: motions, grippers, camera, time: what a real robot has, and no more.

    Only the camera names things, those that it recognises. Contacts elsewhere, lines of sight and room for the base are
    questions to the world that planning has for itself (``sim.PlanningWorld``), which is another object. The link of a
    hand is the one whose frame is its grip point.
    """

    rate: int
    """Steps per second in which motions are given."""

    def configuration(self) -> Configuration:
        """Return where the robot is."""

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link frame of the robot in the map."""

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Begin a motion of a group ("base", an arm, ...); it ends by itself, at an obstacle, or by :meth:`halt`.

        ``pushes`` is a link whose hand pushes meanwhile what it meets and can be moved; else that stops it.
        """

    def motion(self, group: str) -> Motion:
        """State of the group's last motion."""

    def halt(self, group: str) -> None:
        """Stop the group where it is."""

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera sees, unoccluded and within its limits, in the order of the scene."""

    def scan(self, camera_link: str) -> tuple[Array, NDArray[Any]]:
        """Return where lines through the camera's pixels end (n, 3) in the map, and whether at a surface, (n,)."""

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """Return what links of a hand feel on their skins, or by the currents of their motors."""

    def grip(self, link: str) -> None:
        """Press the closed fingers of the hand at a link on what is between them: what can move goes with the hand."""

    def loosen(self, link: str) -> None:
        """Take the force off the fingers of the hand at a link: they hold nothing any more. They open by a motion.

        Fingers that open without it hold nothing either, once they are off what they held.
        """

    def feels(self, link: str) -> bool:
        """Return whether something still keeps the fingers apart that grip; False if they do not grip."""

    def pulled(self, link: str) -> bool:
        """Return whether somebody pulls at what the hand at a link grips, by the forces at its wrist."""


@dataclass(frozen=True, slots=True)
class Solution:
    """One place for the base that satisfies a location: the planar pose and what was chosen with it."""

    base: tuple[float, float, float]
    revision: int
    """Revision of the belief it was computed from."""
    detail: Mapping[str, Any]
    """JSON-like: which arm, grasp, torso height; for the trace."""
    before: tuple[Action, ...] = ()
    """Actions to be done before going there: looking at what cannot be seen from there."""
    provisional: bool = False
    """True if there is nothing but these actions: after them it is looked for a place once more."""
