"""The robot interface for the layers above it, and the value types that these layers exchange.

The interface between the language and an executive is :mod:`planlang.language.executive`.

Frames: ``map`` is right-handed with z up and the floor at z = 0. Lengths in metres, angles in radians.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from enum import StrEnum
from typing import Any, Protocol, Self

from numpy.typing import NDArray

from planlang.designators import Action
from planlang.geometry import Array, Pose
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Configuration:
    """Configuration of a robot: its base (x, y, yaw) in the map and its actuated joints by name."""

    base: tuple[float, float, float]
    joints: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Contact:
    """A penetration: a link of the robot or a held object, the body that it touches, and the ``depth`` > 0 [m]."""

    part: str
    body: str
    depth: float


@dataclass(frozen=True, slots=True)
class Touch:
    """A touch that a link of the robot feels: the robot knows where it is touched, not by what."""

    link: str
    point: tuple[float, float, float]
    """The touched point, in the map."""
    normal: tuple[float, float, float]
    """Unit vector from the touching body towards the link, in the map."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Positions sampled at the world's rate: row 0 is the start, row k is reached k world steps later.

    ``names`` are joint names, or ("x", "y", "yaw") for the base; ``positions`` is (n, len(names)).
    """

    names: tuple[str, ...]
    positions: Array


_FINGERS = "gripper of "


class GroupKind(StrEnum):
    BASE = "base"
    HEAD = "head"
    ARMS = "arms"
    FINGERS = "fingers"


class Group(str):
    """Joints of a robot that move together: a motion of a group replaces the last one of the same group.

    As text it is its name in traces, and what an interface may compare with: "base", "head", "right", "right and left",
    "gripper of right".
    """

    __slots__ = ("arms", "kind")
    kind: GroupKind
    arms: tuple[str, ...]
    """Names of the arms that move, or whose fingers do."""

    def __new__(cls, kind: GroupKind, *arms: str) -> Self:
        """Name the base, the head, one or several arms, or the fingers of an arm."""
        text = " and ".join(arms)
        group = super().__new__(cls, f"{_FINGERS}{text}" if kind is GroupKind.FINGERS else text or kind.value)
        group.kind, group.arms = kind, arms
        return group

    def __getnewargs__(self) -> tuple[Any, ...]:
        return (self.kind, *self.arms)

    @staticmethod
    def of(name: str) -> Group:
        """Read the group that a text means, as modules may name those of their own robot."""
        if isinstance(name, Group):
            return name
        if name in (GroupKind.BASE, GroupKind.HEAD):
            return Group(GroupKind(name))
        if name.startswith(_FINGERS):
            return Group(GroupKind.FINGERS, name.removeprefix(_FINGERS))
        return Group(GroupKind.ARMS, *name.split(" and "))


class MotionState(StrEnum):
    """The state of a commanded motion."""

    MOVING = "moving"
    DONE = "done"
    BLOCKED = "blocked"
    """It stopped just before a contact."""
    HALTED = "halted"
    """It was stopped by a command or by a newer motion of the same joints."""
    FAILED = "failed"
    """The robot could not execute it: a motor was off, or the following error too large."""


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a commanded motion. What blocked it, the belief finds out from where it was touched."""

    state: MotionState
    touch: Touch | None = None
    """The contact that blocked the robot or its load; None for one with itself, or that it does not feel."""
    reason: str | None = None
    """Reason of a failure, for messages only."""


@dataclass(frozen=True, slots=True)
class Detection:
    """What a camera recognises: a thing of a class at a pose, with what can be read off it, never which thing it is.

    The pose of a door, drawer, lid or knob shows how far it is open or turned. Which of the things that it knows a
    detection shows, the belief finds out: ``Belief.see``.
    """

    type: str
    """The recognised class, as the most specific one: local name or IRI."""
    pose: Pose
    visible: float
    """Visible share of its pixels (0..1)."""
    size: tuple[float, float, float]
    """Extents along its own axes [m]."""
    state: str | None = None
    """State that a device shows by a lamp or display, such as DeviceStateOn; None for other objects."""
    colour: str | None = None
    """Word for its colour, if it has one that maps may state."""
    label: str | None = None
    """What a label or mark on it says; None without one, or if less than half of the thing is visible."""
    face_of: str | None = None
    """Whose face it is: the mark of a person."""
    deviation: float = 0.0
    """Standard deviation of the position along each axis, as the camera states of itself [m]; 0 if it is exact."""
    angle_deviation: float = 0.0
    """The same of the rotation about each axis [rad]."""

    @property
    def name(self) -> str:
        """Always raises AttributeError: a camera does not know names."""
        raise AttributeError(
            "a detection has no name: read its type, pose, size, label or colour; "
            "platform.sensing.see() returns the names of the things that a picture shows, as they are believed"
        )


class RobotInterface(Protocol):
    """Commands and sensors of a robot: motions, grippers, camera, time; nothing that a real robot does not have.

    Nothing in it names things, not even the camera: which of them it shows is believed. Hypothetical contacts, lines of
    sight and free space for the base are computed in the planner's own world (``sim.PlanningWorld``). The link of a
    hand is the one whose frame is the grip point.
    """

    rate: int
    """World steps per second; trajectories are sampled at this rate."""

    def configuration(self) -> Configuration:
        """Return the current configuration."""

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link frame of the robot in the map."""

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion of a :class:`Group`; it ends at its goal, at an obstacle, or by :meth:`halt`.

        ``pushes`` is the link of a hand that pushes movable obstacles aside; otherwise every obstacle stops the motion.
        """

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""

    def halt(self, group: str) -> None:
        """Stop the group where it is."""

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera recognises within its limits, sorted by class and position."""

    def scan(self, camera_link: str) -> tuple[Array, NDArray[Any]]:
        """Return the end points (n, 3) of rays through the camera's pixels, in the map, and whether each hit, (n,)."""

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """Return the touches that links feel, with tactile skin or by the currents of their motors."""

    def grip(self, link: str) -> None:
        """Press the closed fingers of a hand on the object between them; a movable object then moves with the hand."""

    def loosen(self, link: str) -> None:
        """Release the force of the fingers of a hand, and with it the object; opening them takes a motion.

        Fingers that open under force lose the object as well, once they no longer touch it.
        """

    def feels(self, link: str) -> bool:
        """Check that an object still keeps the gripping fingers apart; False if they do not grip."""

    def pulled(self, link: str) -> bool:
        """Check by the forces at the wrist whether somebody pulls at the object in the hand."""


@dataclass(frozen=True, slots=True)
class Solution:
    """A base pose that satisfies a location, and the choices made with it."""

    base: tuple[float, float, float]
    revision: int
    """Revision of the belief from which it was computed."""
    detail: Mapping[str, Any]
    """The choices, as JSON-like data for the trace: arm, grasp, torso height."""
    before: tuple[Action, ...] = ()
    """Actions to perform before driving there: looking at objects that are not visible from there."""
    provisional: bool = False
    """True if only these actions are known yet: perform them, then search again."""
