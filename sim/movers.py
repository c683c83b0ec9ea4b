"""Bodies that move by themselves, such as another robot: each drives to and fro on its route, and waits for others."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise

from planlang.geometry import Pose
from planlang.records import dataclass

AHEAD = 0.5
"""Distance in front of a mover that has to be free, or it waits [m]: more than a base needs to come to a stop."""
SAMPLES = 4
"""Poses that are checked on this distance: with a mover's own length, nothing is between them."""

FINE, FACING = 0.01, 0.1
"""Spacing of places on a route that are compared with a pose [m], and what a turn counts beside a distance [m/rad]."""


@dataclass(frozen=True, slots=True)
class Mover:
    """A body that moves on its own along a route on the floor, to its end and back again."""

    body: str
    route: tuple[tuple[float, float], ...]
    """At least two points (x, y) of the map [m], the first of which is the place of its body in the scene."""
    speed: float
    """In metres per second."""
    first: float = 0.0
    """Distance that it has gone on its route in the beginning [m]."""

    def __post_init__(self) -> None:
        if len(self.route) < 2 or not self.length > 0 or not self.speed > 0:
            raise ValueError(f"{self.body} needs a route of two different points and a speed, got {self.route}")

    @property
    def length(self) -> float:
        """Length of its route, one way [m]."""
        return sum(math.dist(one, other) for one, other in zip(self.route, self.route[1:], strict=False))

    def pose_at(self, gone: float, height: float) -> Pose:
        """Compute the pose after a distance gone [m], at a height of the body's centre [m]; x is ahead."""
        left = gone % (2 * self.length)
        points = self.route
        if left >= self.length:
            left, points = left - self.length, self.route[::-1]
        for start, end in pairwise(points):
            far = math.dist(start, end)
            if (left <= far and far > 0) or end is points[-1]:
                break
            left -= far
        share = min(1.0, left / far)
        x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
        return Pose.planar(x, y, math.atan2(end[1] - start[1], end[0] - start[0]), height)

    def gone_at(self, pose: Pose) -> float:
        """Find the distance gone at which it is nearest to a pose [m], on its way there or back, as the pose faces."""

        def away(gone: float) -> float:
            there = self.pose_at(gone, pose.position[2])
            return there.distance(pose) + FACING * there.turn(pose)

        count = math.ceil(2 * self.length / FINE)
        return min((2 * self.length * number / count for number in range(count)), key=away)


class Movers:
    """Advances the movers of one world."""

    def __init__(
        self, movers: Iterable[Mover], poses: Mapping[str, Pose], place: Callable[[str, Pose], None], rate: int
    ) -> None:
        """``poses`` are those of all bodies as they are now, ``place`` changes one."""
        self._movers, self._poses, self._place, self._rate = tuple(movers), poses, place, rate
        self.gone = {one.body: one.first for one in self._movers}
        """Mover -> distance gone [m]."""
        for one in self._movers:
            place(one.body, self._pose(one, 0.0))

    def step(self, is_free: Callable[[str], bool]) -> None:
        """Advance each by one step, in turn, unless something is in its way.

        ``is_free`` checks whether nothing that moves touches a body where that is now.
        """
        for one in self._movers:
            here, step = self._poses[one.body], one.speed / self._rate
            if here != self._pose(one, 0.0):  # somebody has put it elsewhere
                self.gone[one.body] = one.gone_at(here)
            for far in (*(AHEAD * k / SAMPLES for k in range(1, SAMPLES + 1)), step):
                self._place(one.body, self._pose(one, far))
                if not is_free(one.body):
                    self._place(one.body, here)
                    break
            else:
                self.gone[one.body] += step

    def _pose(self, mover: Mover, ahead: float) -> Pose:
        return mover.pose_at(self.gone[mover.body] + ahead, self._poses[mover.body].position[2])
