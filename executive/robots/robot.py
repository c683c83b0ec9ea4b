"""The robot as the executive knows it: arms, grippers, torso, neck, camera, and the numbers of moving them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

from executive.robots.self_model import Part, SelfModel
from planlang.designators import Device, Object, local_name
from planlang.diagnostics import Diagnostic, Span
from sim import CameraModel, RobotBody

Axis = tuple[float, float, float]

CARRYING = "carrying"
"""The posture in which the robot drives, and from which another base pose can be tried."""


@dataclass(frozen=True, slots=True)
class Gripper:
    """The hand of an arm. Positions are joint values [rad, m] by joint name."""

    name: str
    iri: str | None
    joints: tuple[str, ...]
    opened: Mapping[str, float]
    closed: Mapping[str, float]
    finger_links: tuple[str, ...]
    max_opening: float
    """Widest thing that fits between the opened fingers [m]."""


@dataclass(frozen=True, slots=True)
class Arm:
    """One arm, from the robot's base to its tip frame."""

    name: str
    iri: str | None
    side: str | None
    """"left", "right" or None."""
    joints: tuple[str, ...]
    """Actuated joints from base to tip, the torso left out."""
    base_link: str
    """Parent link of the first joint."""
    tip: str
    """Link whose frame is the grip point."""
    hand_link: str
    """Link that carries the fingers; held objects are attached to it."""
    approach: Axis
    """Unit vector in the tip frame along which the hand moves towards what it grasps."""
    closing: Axis
    """Unit vector in the tip frame along which the fingers close."""
    gripper: Gripper | None


@dataclass(frozen=True, slots=True)
class BaseDrive:
    """How the base moves; ``radius`` of its outline [m], speeds [m/s, rad/s], accelerations [m/s2, rad/s2]."""

    radius: float
    speed: float
    acceleration: float
    turn_speed: float
    turn_acceleration: float
    jerk: float
    """Of translation [m/s3] and rotation [rad/s3]."""


@dataclass(frozen=True, slots=True)
class JointLimits:
    """Limits of a joint's motion [rad/s, rad/s2, rad/s3], of a sliding one [m/s, m/s2, m/s3]."""

    speed: float
    acceleration: float
    jerk: float


@dataclass(frozen=True, slots=True)
class Robot:
    """A self-model bound to a URDF. What the robot does not have is None or empty."""

    name: str
    iri: str | None
    urdf: Path
    base_link: str
    """Root link of the URDF; stands on the floor at the base pose."""
    base: BaseDrive
    torso: str | None
    """Sliding joint that carries all arms."""
    arms: tuple[Arm, ...]
    neck: tuple[str, ...]
    """Joints between the body and the camera that no arm moves."""
    camera: CameraModel | None
    postures: Mapping[str, Mapping[str, float]]
    """Name -> joint positions; joints not named stay."""
    limits: Mapping[str, JointLimits]
    """For every actuated joint of torso, arms, grippers and neck."""
    allowed_contacts: tuple[tuple[str, str], ...] = ()
    """Pairs of links that may touch."""
    parts: tuple[Part, ...] = ()
    """What it is made of, software included; without self-model, what its shape implies."""
    claims: Mapping[str, Span | None] = field(default_factory=dict)
    """Capabilities (IRIs of classes) that it claims, and where."""
    model: SelfModel | None = field(default=None, compare=False, repr=False)
    """The self-model that was bound, if there is one."""
    diagnostics: tuple[Diagnostic, ...] = field(default=(), compare=False)
    """What was repaired, assumed or left out when binding."""

    def arm(self, name: str) -> Arm:
        """Return the arm of that name; ``KeyError`` lists those there are."""
        for arm in self.arms:
            if arm.name == name:
                return arm
        raise KeyError(f"{self.name} has no arm {name!r}; it has {', '.join(a.name for a in self.arms) or 'none'}")

    def arms_of(self, device: Object | None) -> tuple[Arm, ...]:
        """Return the arms that a device designator may mean, in the robot's order; all of them without designator.

        A part of this robot is itself. Any other device is taken by side (left or right in its name or class) and, if
        it is a gripper or hand, only on arms that have one; no side means any.
        """
        if device is None:
            return self.arms
        known = (device.iri, device.type)
        exact = tuple(a for a in self.arms if {a.iri, a.gripper and a.gripper.iri} & {device.iri} - {None})
        if exact:
            return exact
        side = side_of(*(local_name(text) for text in known if text))
        graspers = any(re.search(r"gripper|hand|finger", text, re.IGNORECASE) for text in known if text)
        return tuple(a for a in self.arms if (side is None or a.side == side) and (a.gripper or not graspers))

    def holder(self, link: str) -> Arm | None:
        """Return the arm whose hand a link is."""
        return next((a for a in self.arms if link in (a.hand_link, a.tip)), None)

    def body(self, posture: str | None = None) -> RobotBody:
        """Return what the simulator needs, in a named posture to begin with (default: ``carrying``, if there is one).

        Fingers of one hand may touch each other.
        """
        camera = self.camera or CameraModel(self.base_link, near=0.0, far=0.0)
        hands = {arm.hand_link: arm.gripper.finger_links for arm in self.arms if arm.gripper}
        start = self.postures.get(posture or CARRYING, {}) if posture is None else self.postures[posture]
        fingers = tuple(pair for links in hands.values() for pair in combinations(links, 2))
        return RobotBody(self.urdf, camera, hands, (*self.allowed_contacts, *fingers), start, tuple(self.limits))

    def posture(self, name: str) -> Mapping[str, float] | None:
        """Return the joint positions of a named posture; None if the robot knows none of that name."""
        return self.postures.get(name)


def side_of(*names: str) -> str | None:
    """ "left" or "right" if the names say one of them and not the other."""
    sides = {word.lower() for name in names for word in re.findall(r"(?<![Uu]p)(?:[Ll]eft|[Rr]ight)|LEFT|RIGHT", name)}
    return sides.pop() if len(sides) == 1 else None


def is_device(what: Object) -> bool:
    """Return whether a designator is a part of the robot."""
    return isinstance(what, Device)
