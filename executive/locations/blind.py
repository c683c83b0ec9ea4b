"""From where the robot's own body hides what it has to see: learnt from places where it did."""

from __future__ import annotations

import math
from collections.abc import Sequence

from planlang.geometry import Array


class Blind:
    """From where the robot's own body hides a thing: told by where the thing is for the robot.

    What hides it at some distance hides what is nearer in that direction; if ``strict`` only places nearly like that
    are taken as seen through.
    """

    def __init__(self, what: Array, *, strict: bool) -> None:
        self._what, self._strict = what, strict
        self._known: list[tuple[float, float]] = []

    def _seen(self, base: Sequence[float] | Array) -> tuple[float, float]:
        x, y = float(self._what[0] - base[0]), float(self._what[1] - base[1])
        return math.hypot(x, y), math.remainder(math.atan2(y, x) - float(base[2]), 2 * math.pi)

    def add(self, base: Sequence[float]) -> None:
        """The robot hides it from there."""
        self._known.append(self._seen(base))

    def covers(self, base: Array) -> bool:
        """Whether it is probably hidden from a place as well."""
        away, bearing = self._seen(base)
        if self._strict:
            return any(abs(away - d) < 0.03 and abs(bearing - b) < 0.1 for d, b in self._known)
        return any(away < d + 0.03 and abs(bearing - b) < 0.25 for d, b in self._known)
