"""What resolving a location needs to know: the believed world, the robot's arms, exact collision and sight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from executive.locations.block import Block
from executive.locations.field import Floor
from executive.locations.hand import ComfortZone, HandFrame, Held
from executive.locations.own_view import OwnView
from executive.locations.reachability import GraspClass, Lift, ReachabilityMap
from executive.motion import Boxes, InverseKinematics, QuickCheck
from executive.motion.solids import Solids
from planlang.designators import Device, Object
from planlang.geometry import Array, Pose
from planlang.protocols import Contact

Base = tuple[float, float, float]
"""Base pose (x [m], y [m], yaw [rad]) in the map."""


@dataclass(frozen=True, slots=True)
class ArmModel:
    """One arm (with the joints that carry it, e.g. the torso) as the resolver sees it."""

    name: str
    joints: tuple[str, ...]
    lower: Array
    upper: Array
    solver: InverseKinematics
    resolution: Array
    """Steps in which motions are checked, (d,) [rad, m]."""
    frame: HandFrame
    max_opening: float
    hand_links: frozenset[str]
    hand_radius: float
    """How far the hand extends around its tip frame across the approach direction [m]."""
    shoulder_low: Array
    """Shoulder in the base frame at the lowest posture of what carries the arm, (3,)."""
    shoulder_high: Array
    """The same at the highest, (3,)."""
    reach: float
    """Longest distance from shoulder to tip [m]."""
    seeds: Array
    """Postures to start inverse kinematics from, (s, d)."""
    lift: Lift | None = None
    """The torso that lifts it straight up."""
    hand_corners: Array = field(default_factory=lambda: np.zeros((1, 3)))
    """Corners of boxes around the hand's pieces in the tip frame, (n, 3)."""

    def lowest(self, rotations: Array, held: Held | None) -> Array:
        """Height of the lowest point of hand and held object over the tip (m,) [m], for tip rotations (m, 3, 3)."""
        hand = (self.hand_corners @ rotations[:, 2, :, None])[..., 0].min(axis=1)
        return np.asarray(hand if held is None else np.minimum(hand, held.lowest_of(rotations)))


@dataclass(frozen=True, slots=True)
class Door:
    """A leaf that turns about a vertical hinge: hinge and width [m], heading of the closed leaf from the hinge [rad].

    Which way it opens is not said by maps: it is taken to sweep both sides.
    """

    name: str
    x: float
    y: float
    width: float
    heading: float


class Surroundings(Protocol):
    """The believed world around the robot."""

    @property
    def arms(self) -> Sequence[ArmModel]:
        """All arms, in the robot's order."""

    def arms_of(self, device: Device) -> Sequence[ArmModel]:
        """Arms that a device designator may mean."""

    def bind(self, what: Object) -> str:
        """The body that an object designator means; raises ObjectUnresolvable."""

    def block(self, name: str) -> Block:
        """The believed shape of a body; for a held one where it was grasped."""

    def is_person(self, name: str) -> bool:
        """Whether the body is a person."""

    def is_room(self, name: str) -> bool:
        """Whether the body is a room: everything is in it."""

    def is_graspable(self, name: str) -> bool:
        """Whether the body can be taken into a hand."""

    def zone(self, name: str) -> ComfortZone:
        """Where the person takes things."""

    def held(self, arm: str) -> Held | None:
        """What the arm holds."""

    def grasped_at(self, name: str) -> Array:
        """The tip pose (4, 4) in the map at which a held body was grasped."""

    def base(self) -> Base:
        """Where the base is."""

    def revision(self) -> int:
        """Revision of the belief."""

    def posture(self) -> object:
        """Something that is equal as long as nothing of the robot has moved."""

    def floor(self) -> Floor:
        """What takes room from the base: with the robot's body, arms left out, as it is now."""

    def solids(self) -> Solids:
        """The pieces of all bodies that are not held."""

    def boxes_but(self, without: Sequence[str]) -> tuple[Boxes, tuple[str, ...]]:
        """Boxes around the pieces of all bodies that are not held, some left out; and whose they are."""

    def is_round(self, name: str) -> bool:
        """Whether a body is a cylinder."""

    def reachability(self, arm: ArmModel, grasp: GraspClass) -> ReachabilityMap:
        """The map of an arm and class of grasp."""

    def arm_check(
        self, arm: ArmModel, touches: str | None, *, opened: bool, near: tuple[Array, float] | None = None
    ) -> QuickCheck:
        """What rules out postures of an arm from any base, and poses of its hand wherever that stands.

        An arm would be in the room, or the robot in itself; a hand, with what it holds, in the room.

        ``touches`` and ``opened`` as in :meth:`contacts`; ``near``: middle (3,) and radius [m] of all that matters.
        """

    def stance_check(self, near: tuple[Array, float] | None = None) -> QuickCheck:
        """What rules out bases from which an arm, in its present posture, would stick into something."""

    def lifted(self, arm: ArmModel, torsos: Sequence[float]) -> tuple[float, ...]:
        """Positions of the torso at which the rest of the robot, in its present posture, does not touch itself."""

    def names(self) -> Sequence[str]:
        """All bodies."""

    def radius(self) -> float:
        """Of the base's outline [m]."""

    def front(self, name: str) -> float | None:
        """The heading [rad] of a body's front, None if it has none."""

    def doors(self, name: str) -> Sequence[Door]:
        """The doors that a body is or has."""

    def support(self, name: str) -> str | None:
        """What a body is believed to rest on."""

    def rests_at(self, name: str) -> float | None:
        """Height of the level top on which things can rest, of a room its floor [m]; None for what has none."""

    def is_solid(self, name: str) -> bool:
        """Whether a body can be touched: a marker cannot."""

    def pose(self, name: str) -> Pose:
        """Where a body is believed to be."""

    def size(self, name: str) -> tuple[float, float, float]:
        """Extents of a body's box along its axes [m]."""

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

    def stops_closing(self, base: Base, arm: ArmModel, q: Array, around: str) -> str | None:
        """The body that a finger of an arm at ``q`` would meet, closing from open, before it meets ``around``.

        Fingers on hinges go forward while they close: what is behind a thing may keep them from it.
        """

    def tip(self, arm: ArmModel) -> Array:
        """Pose (4, 4) of an arm's tip in the map."""

    def looked_in_vain(self, name: str) -> Sequence[Base]:
        """Places from where the body was looked for and not seen where it is believed to be."""

    def sighted(self) -> bool:
        """Whether the robot has a camera; one without handles things where the map has them."""

    def own_view(self) -> OwnView | None:
        """What the robot's own body, neck and camera, in its present posture, leave to be seen; None without camera."""

    def hidden(self, base: Base, name: str) -> str | None:
        """None if the camera could see the body from a base; else what hides it, "" if it is out of its limits."""

    def camera_range(self) -> tuple[float, float]:
        """Distances between which the camera recognises things [m]."""
