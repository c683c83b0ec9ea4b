"""Where things are, as far as pictures of a camera that errs tell: repeated looks average (Kalman, 1960).

What a camera tells of a pose it tells with a standard deviation, equal along all axes. A thing at rest has the estimate
that is most likely by all pictures since it was last moved; one that is seen where it cannot have been has been moved,
and its estimate begins anew.
"""

from __future__ import annotations

import math

import numpy as np

from planlang.geometry import Pose
from planlang.protocols import Detection
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

GATE = 4.0
"""Standard deviations within which what is seen may be what is believed: one of 900 pictures is beyond in space."""
ALIKE = 1.0
"""Share of its standard deviation by which an estimate may change before the believed pose follows."""
NEAR_AXIS = 0.05
"""Distance from the axis of a hinge below which the position of a part does not tell how far it is turned [m]."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A pose with the standard deviations of its position [m] and of its rotation [rad] along and about each axis."""

    pose: Pose
    deviation: float = 0.0
    angle_deviation: float = 0.0

    @staticmethod
    def of(detection: Detection) -> Estimate:
        """Take what one picture tells."""
        return Estimate(detection.pose, detection.deviation, detection.angle_deviation)

    @property
    def is_exact(self) -> bool:
        """True if there is no doubt about the pose."""
        return not (self.deviation or self.angle_deviation)

    def slack(self, other: Estimate | None = None) -> float:
        """Compute how far apart both may seem to be if they are at the same place [m]; None is exact."""
        return GATE * math.hypot(self.deviation, 0.0 if other is None else other.deviation)

    def angle_slack(self, other: Estimate | None = None) -> float:
        """Compute how far both may seem to be turned from each other if they are not [rad]; None is exact."""
        return GATE * math.hypot(self.angle_deviation, 0.0 if other is None else other.angle_deviation)

    def agrees(self, other: Estimate) -> bool:
        """Check whether both may be of a thing that was not moved."""
        near, turned = self.slack(other), self.angle_slack(other)
        return self.pose.distance(other.pose) <= near and self.pose.turn(other.pose) <= turned

    def fused(self, other: Estimate) -> Estimate:
        """Combine both, each by the inverse of its variance: the update of a Kalman filter for what does not move."""
        gain, deviation = _combined(self.deviation, other.deviation)
        turning, angle_deviation = _combined(self.angle_deviation, other.angle_deviation)
        x, y, z = (one + gain * (two - one) for one, two in zip(self.pose.position, other.pose.position, strict=True))
        return Estimate(Pose((x, y, z), _between(self.pose, other.pose, turning)), deviation, angle_deviation)

    def is_like(self, pose: Pose, moved: float, turned: float) -> bool:
        """Check whether a believed pose does as well; one within ``moved`` [m] and ``turned`` [rad] always does."""
        near, alike = max(moved, ALIKE * self.deviation), max(turned, ALIKE * self.angle_deviation)
        return self.pose.distance(pose) <= near and self.pose.turn(pose) <= alike


def _combined(deviation: float, other: float) -> tuple[float, float]:
    """Compute the weight of the second of two independent measurements, and the standard deviation of their mean."""
    total = deviation**2 + other**2
    if total == 0.0:
        return 0.0, 0.0
    return deviation**2 / total, deviation * other / math.sqrt(total)


def _between(one: Pose, other: Pose, share: float) -> tuple[float, float, float, float]:
    """Interpolate orientations along the shortest turn (Shoemake, 1985), nearly equal ones along the chord."""
    dot = sum(a * b for a, b in zip(one.orientation, other.orientation, strict=True))
    angle, sign = math.acos(min(1.0, abs(dot))), math.copysign(1.0, dot)
    first, second = (1 - share, share)
    if angle > 1e-6:
        first, second = (math.sin(part * angle) / math.sin(angle) for part in (first, second))
    mixed = [first * a + sign * second * b for a, b in zip(one.orientation, other.orientation, strict=True)]
    length = math.hypot(*mixed)
    x, y, z, w = (part / length for part in mixed)
    return x, y, z, w


def _from_axis(joint: Articulation, closed: Pose) -> float:
    """Compute the distance of a part of a leaf from the axis about which that turns [m]."""
    return float(np.linalg.norm(np.cross(np.array(closed.position) - np.array(joint.point), np.array(joint.axis))))


def leaf_value(joint: Articulation, closed: Pose, known: float, seen: Estimate) -> float:
    """Estimate how far a door, drawer, lid or knob is open by a picture of one of its parts [rad, m].

    ``closed`` is the pose of the part when all is shut, ``known`` the value that is believed. That stays as long as the
    picture agrees with it; what may be shut then is.
    """
    if joint.kind is JointKind.PRISMATIC:
        value, deviation = joint.value_of(closed, seen.pose), seen.deviation
    else:
        arm = _from_axis(joint, closed)
        by_place = seen.deviation / arm if arm > NEAR_AXIS else math.inf
        by_turn = seen.angle_deviation
        value, deviation = joint.value_of(closed, seen.pose), by_turn
        if by_place < math.inf:
            at = joint.value_at(np.array(closed.position), np.array(seen.pose.position))
            gain, deviation = _combined(by_turn, by_place)
            value += gain * (at - value)
    return next((one for one in (known, 0.0) if abs(value - one) <= GATE * deviation), value)
