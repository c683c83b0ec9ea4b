"""Angles by which things leaned from upright while the robot had them, in the simulator's truth."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator

from sim import PyBulletWorld


class Tilts:
    """Watches a true world: of what stood upright when grasped, and is to stay so, the largest tilt [rad].

    ``leaning`` are the things that a step means to lean, as long as they do: they are not watched meanwhile.
    """

    def __init__(self, leaning: Collection[str] = ()) -> None:
        self._leaning = leaning
        self.largest: dict[str, float] = {}
        self.limits: dict[str, float] = {}
        self._held: dict[str, bool] = {}
        """The things that are held, and whether each stood upright when it was grasped."""

    def __call__(self, world: PyBulletWorld) -> None:
        """Take note of the world after a step."""
        before, self._held = self._held, {}
        for name in world.attached():
            limit = world.scene.body(name).largest_tilt
            if limit is not None:
                x, y, _, _ = world.pose(name).orientation
                tilt = math.acos(max(-1.0, 1.0 - 2.0 * (x * x + y * y)))
                self._held[name] = before.get(name, tilt <= limit)
                if self._held[name] and name not in self._leaning:
                    self.largest[name], self.limits[name] = max(tilt, self.largest.get(name, 0.0)), limit

    def degrees(self) -> dict[str, float]:
        """Return the largest tilt of each thing, to a tenth of a degree."""
        return {name: round(math.degrees(tilt), 1) for name, tilt in self.largest.items()}

    def lines(self) -> Iterator[str]:
        """Yield a line for each thing, to print."""
        for name, tilt in self.degrees().items():
            limit = math.degrees(self.limits[name])
            beyond = f"; {limit:g} are allowed" if tilt > limit else ""
            yield f"{name}: leaned by at most {tilt:g} degrees while it was held{beyond}"
