"""What a hand is and what it deals with: its frame, what it holds, where a person takes things."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from planlang.geometry import Array, Pose


@dataclass(frozen=True, slots=True)
class HandFrame:
    """How a tip frame is meant: unit vectors of the approach and of the closing direction in it."""

    approach: tuple[float, float, float]
    closing: tuple[float, float, float]

    def rotation(self, approach: Array, closing: Array) -> Array:
        """The rotation (3, 3) that turns the frame's approach and closing axes into the given map directions."""
        return np.asarray(_axes(approach, closing) @ _axes(self.approach, self.closing).T)


def _axes(first: Sequence[float] | Array, second: Sequence[float] | Array) -> Array:
    """Two orthogonal unit vectors and their cross product as columns (3, 3); numpy's own is slow for single vectors."""
    a, b, c = first
    d, e, f = second
    return np.array([[a, d, b * f - c * e], [b, e, c * d - a * f], [c, f, a * e - b * d]])


class HandTerm(NamedTuple):
    """One conjunct about a hand: relation, body, greatest and least distance if they are stated, whether negated."""

    name: str
    body: str
    within: float | None = None
    beyond: float | None = None
    negated: bool = False
    viewer: tuple[float, float] | None = None
    """Whose left and right is meant, where the body has no front of its own."""


@dataclass(frozen=True, slots=True)
class Held:
    """What a hand holds: name, pose in the tip frame, size of its box [m]."""

    name: str
    pose: Pose
    size: tuple[float, float, float]

    def lowest_of(self, rotations: Array) -> Array:
        """Height of the object's lowest point relative to the tip, for tip rotations (m, 3, 3), (m,) [m]."""
        turned = rotations @ self.pose.matrix()[:3, :3]
        return np.asarray(self.offsets(rotations)[:, 2] - np.abs(turned[:, 2]) @ (np.asarray(self.size) / 2))

    def offsets(self, rotations: Array) -> Array:
        """The object's centre relative to the tip, in the map, for tip rotations (m, 3, 3), (m, 3)."""
        return np.asarray(rotations @ np.asarray(self.pose.position))


@dataclass(frozen=True, slots=True)
class ComfortZone:
    """Where a person takes things: in front of their shoulders, within the length of their arms."""

    shoulders: tuple[tuple[float, float, float], ...]
    facing: float
    """Heading of the person [rad]."""
    arm_length: float
    contains: Callable[[Array], bool]
    """Whether a map point (3,) is one at which the person would take something."""

    def points(self) -> Array:
        """Points of the zone, most comfortable first, (n, 3); sparse."""
        turns = (0.0, 0.35, -0.35, 0.7, -0.7, 0.95, -0.95)
        found: dict[tuple[float, float, float], None] = {}
        for share in (0.7, 0.55, 0.85):
            for rise in (0.0, -0.12, 0.12):
                for turn in turns:
                    for x, y, z in self.shoulders:
                        step, heading = share * self.arm_length, self.facing + turn
                        point = (x + step * math.cos(heading), y + step * math.sin(heading), z + rise)
                        if self.contains(np.array(point)):
                            found[point] = None
        return np.array(list(found)).reshape(-1, 3)

    def margins(self, points: Array) -> Array:
        """How far inside the zone points (n, 3) are, (n,): shares of the arm, or of the cosine, to its nearest border.

        The person may sit a little otherwise than believed: what is at the border may not be taken.
        """
        offsets = points[:, None] - np.array(self.shoulders)
        away = np.linalg.norm(offsets, axis=2)
        ahead = offsets[..., 0] * math.cos(self.facing) + offsets[..., 1] * math.sin(self.facing)
        share, cosine = away / self.arm_length, ahead / np.maximum(away, 1e-9)
        return np.asarray(np.minimum(np.minimum(1.0 - share, share - 0.25), cosine - 0.5).max(axis=1))
