"""Openings of a hand: so wide that what it takes fits, and no wider, so that fingers pass between close neighbours.

Measured on the shapes of the fingers at a few openings from closed to opened, at sections across the approach.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from executive.robots.robot import Arm, Gripper
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved
from planlang.geometry.shapes import ConvexSolid
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim import PlanningWorld

ROOM = 0.02
"""Room that is left beside a thing between the fingers, on both sides together [m]."""
TIGHT = 0.008
"""The same where there is no way for wider fingers [m]."""
STEPS = 21
"""Openings that are measured, from closed to opened."""
SECTIONS = np.linspace(-0.1, 0.1, 21)
"""Places along the approach, from the grip point on, at which fingers are measured [m]."""
_TURNS = np.arange(16) * (np.pi / 8)
AROUND = np.stack([np.cos(_TURNS), np.sin(_TURNS)])
"""Directions in which an outline has its corners (2, 16)."""

Fingers = tuple[tuple[str, float], ...]
"""Joints of fingers and their values; none means: as they are."""


@dataclass(frozen=True, slots=True, eq=False)
class Openings:
    """The openings of a hand, the narrowest first; none for a hand without fingers that move."""

    fingers: tuple[Fingers, ...] = ()
    gaps: Array = field(default_factory=lambda: np.zeros((0, len(SECTIONS))))
    """Gap between the fingers at each opening and section [m], infinite where there are no fingers (n, s)."""
    ends: Array = field(default_factory=lambda: np.zeros(0))
    """How far the fingers reach beyond the grip point at each opening (n,) [m]: those that turn differ."""

    @property
    def joints(self) -> tuple[str, ...]:
        """Return the names of the fingers' joints."""
        return tuple(name for name, _ in self.widest)

    @property
    def widest(self) -> Fingers:
        """Return the fingers opened as far as they go."""
        return self.fingers[-1] if self.fingers else ()

    @property
    def gap(self) -> float:
        """Gap between the fingers at the grip point, opened as far as they go [m]; infinite without any."""
        return float(self.gaps[-1, len(SECTIONS) // 2]) if self.fingers else math.inf

    def around(self, spans: Array, room: float = ROOM) -> NDArray[np.intp]:
        """Return the number of the narrowest opening for things (m,), the widest one where none has room enough.

        ``spans``: how wide they are across, and how far they come behind the grip point [m] (m, 2); ``room``: what is
        left beside them [m].
        """
        between = -spans[:, 1:] - 1e-9 <= SECTIONS
        fits = ~between[:, None] | (self.gaps >= spans[:, None, :1] + room)
        good: NDArray[np.bool_] = np.asarray(fits.all(axis=2))
        good[:, -1] = True
        return np.asarray(good.argmax(axis=1), np.intp)

    def closing(self, fingers: Fingers, width: float) -> tuple[Fingers, ...]:
        """Return the openings through which fingers go as they close on a thing of some width [m], narrowest first."""
        if not self.fingers:
            return (fingers,)
        last = self.fingers.index(fingers)
        first = int(self.around(np.array([[width, 0.0]]), 0.0)[0])
        return self.fingers[min(first, last) : last + 1]

    def advance(self, width: float) -> float:
        """Return how far fingers reach out beyond where they are when wide open, as they close on a thing [m]."""
        if not self.fingers:
            return 0.0
        narrow, wide = (int(self.around(np.array([[width, 0.0]]), room)[0]) for room in (0.0, ROOM))
        last = max(0, narrow - 1)  # they meet the thing between two of the openings that were measured
        return max(0.0, float(self.ends[last : wide + 1].max() - self.ends[-1]))

    def lets_in(self, width: float) -> bool:
        """Return whether something so wide [m] goes between the tips of the fingers though they are closed."""
        tips = self.gaps[0][np.isfinite(self.gaps[0])][-1:] if self.fingers else ()
        return any(width < gap for gap in tips)

    def beyond(self, joints: Mapping[str, float]) -> Fingers:
        """Return the narrowest opening in which fingers have let go of what they hold with their joints at values."""
        if not self.fingers:
            return ()
        middle = len(SECTIONS) // 2
        widths = self.gaps[:, middle]
        shares = np.linspace(0.0, 1.0, len(self.fingers))
        now = self.share(joints)
        return self.fingers[int(self.around(np.array([[np.interp(now, shares, widths), 0.0]]))[0])]

    def share(self, joints: Mapping[str, float]) -> float:
        """Return how far the fingers are open, 0 closed and 1 opened, with their joints at values."""
        closed, opened = (np.array([value for _, value in self.fingers[end]]) for end in (0, -1))
        now = np.array([joints[name] for name in self.joints])
        return float(np.clip(((now - closed) / (opened - closed)).max(), 0.0, 1.0))


def openings_of(arm: Arm, world: PlanningWorld) -> Openings:
    """Return the openings of an arm's hand; fingers without shapes are taken to need the widest."""
    if arm.gripper is None:
        return Openings()
    gripper = arm.gripper
    fingers = tuple(_between(gripper, share) for share in np.linspace(0.0, 1.0, STEPS).tolist())
    measured = [_measured(arm, gripper, dict(one), world) for one in fingers]
    world.link_pose(arm.tip)  # it shows the robot as it is again
    gaps, ends = np.stack([gaps for gaps, _ in measured]), np.array([end for _, end in measured])
    return Openings(fingers, gaps if np.isfinite(gaps).any() else np.zeros_like(gaps), ends)


def _between(gripper: Gripper, share: float) -> Fingers:
    return tuple((name, (1.0 - share) * gripper.closed[name] + share * gripper.opened[name]) for name in gripper.joints)


def _measured(arm: Arm, gripper: Gripper, joints: Mapping[str, float], world: PlanningWorld) -> tuple[Array, float]:
    """Return twice the least distance of any finger from the middle plane of the hand at each section [m] (s,).

    And how far fingers reach beyond the grip point [m].
    """
    there = Configuration((0.0, 0.0, 0.0), joints)
    back = inverse(world.link_pose(arm.tip, there).matrix())
    numbers = {name: number for number, name in enumerate(world.robot.solid_names)}
    axes = np.stack([arm.approach, arm.closing], axis=1)
    least, end = np.full(len(SECTIONS), np.inf), 0.0
    for link in gripper.finger_links:
        if link not in numbers:
            continue
        frame = back @ world.link_pose(link, there).matrix()
        outlines = [_outline(frame @ hull.pose.matrix(), hull, axes) for hull in world.robot.hulls(numbers[link])]
        side = float(np.sign(np.concatenate(outlines)[:, 1].mean()))
        for outline in outlines:
            least = np.minimum(least, _sections(outline * [1.0, side]))
            end = max(end, float(outline[:, 0].max()))
    return np.asarray(2 * np.maximum(least, 0.0)), end


def _outline(at: Array, hull: ConvexSolid, axes: Array) -> Array:
    """Return points (n, 2) that span a convex solid at a pose (4, 4), seen along two axes (3, 2)."""
    points = moved(at, hull.points) @ axes
    extreme = points[sorted({*(points @ AROUND).argmax(axis=0).tolist()})]
    thick = hull.radius + hull.beyond
    return np.asarray((extreme[:, None] + thick * AROUND.T).reshape(-1, 2) if thick > 0 else extreme)


def _sections(outline: Array) -> Array:
    """Return the least second coordinate of a convex outline (n, 2) at sections of the first, infinite beside it."""
    first, second = outline[:, None], outline[None]
    low, high = np.minimum(first[..., 0], second[..., 0]), np.maximum(first[..., 0], second[..., 0])
    run = np.where(high - low < 1e-9, 1.0, second[..., 0] - first[..., 0])
    shares = (SECTIONS[:, None, None] - first[..., 0]) / run
    values = first[..., 1] + shares * (second[..., 1] - first[..., 1])
    crossed = (low <= SECTIONS[:, None, None]) & (SECTIONS[:, None, None] <= high) & (high - low >= 1e-9)
    return np.asarray(np.where(crossed, values, np.inf).min(axis=(1, 2)))
