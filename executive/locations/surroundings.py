"""What resolving a location needs to know: the believed world, the robot's arms, exact collision and sight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from executive.locations.block import Block
from executive.locations.hand import ComfortZone, HandFrame, Held
from executive.motion import InverseKinematics
from planlang.designators import Device, Object
from planlang.protocols import Array, Contact

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

    def clearance(self, bases: Array) -> Array:
        """Room (m,) [m] around the robot's body, arms left out, at bases (m, 3); negative where there is none."""

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

    def looked_in_vain(self, name: str) -> Sequence[Base]:
        """Places from where the body was looked for and not seen where it is believed to be."""

    def sighted(self) -> bool:
        """Whether the robot has a camera; one without handles things where the map has them."""

    def sees(self, base: Base, name: str) -> bool:
        """Whether the camera could see the body from a base: within its limits, unoccluded."""
