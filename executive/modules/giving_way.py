"""Driving where other robots drive: look for them before and on the way, and stop where one has come into the way."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from contextlib import suppress
from functools import partial

import numpy as np

from executive.modules.platform import Platform
from executive.motion import Boxes, clearance_at
from planlang.designators import Location
from planlang.failures import LookingGoalUnreachable
from planlang.geometry import Array, Pose
from planlang.kernel import now, sleep
from planlang.language.resources import using
from planlang.protocols import Trajectory

SECONDS_AHEAD = 3.0
"""Part of the way that has to be free of other robots [s]: they are looked for many times meanwhile."""
ROOM = 0.15
"""Distance that is kept from them while they move [m]; one that stands is planned around as closely as furniture."""
NEARER = 0.01
"""Change of a distance that counts [m]."""
PATIENCE = 1.0
"""Time to wait for a robot that closes the way before it is looked at again [s]."""
LEAST, LONGEST = 10.0, 120.0
"""Bounds of the time to wait for a robot that is in the way [s]."""
SOON, EYE_LEVEL = 1.5, 0.6
"""Point of the way to look at: how soon the base is there [s], and height [m]."""
NEAR_BY = 2.5
"""Distance of another robot up to which it is watched instead of the way [m]."""


class Lookout:
    """Looks out for the other robots of a map, and believes each where it was last seen."""

    def __init__(self, platform: Platform) -> None:
        self._platform = platform
        self._last: Mapping[str, Pose] = {}
        """Where the others were when the way was last found free."""
        self.closed_by: str | None = None
        """The robot for which the base has last stopped."""

    @property
    def others(self) -> frozenset[str]:
        """Names of the robots that move by themselves."""
        return frozenset(mover.body for mover in self._platform.scene.world.scene.movers)

    async def look(self) -> None:
        """Look where the others are believed to be, as far as that can be seen from here.

        One that is not there any more is believed to be nowhere until it is seen.
        """
        platform = self._platform
        async with using("head"):
            for name in sorted(self._poses()):
                if platform.scene.visibility.hidden(platform.base(), name) is None:
                    with suppress(LookingGoalUnreachable):
                        await platform.sensing.look_at(np.array(platform.scene.bodies.block(name).centre), name)
                    if not platform.sensing.shows_here(partial(_has, name)):
                        platform.belief.not_there(name)
        self._last = self._poses()

    def patience(self, names: Collection[str]) -> float:
        """Compute how long to wait for robots [s]: for the longest of their routes there and back, in bounds."""
        movers = [one for one in self._platform.scene.world.scene.movers if one.body in names]
        return min(max([LEAST, *(2 * one.length / one.speed for one in movers)]), LONGEST)

    async def wait(self) -> None:
        """Give a robot that closes the way the time to leave, and look again."""
        await sleep(PATIENCE)
        await self.look()

    async def wait_for(self, location: Location, seconds: float) -> None:
        """Wait until a location has a base pose, at most so long [s].

        Another robot that cannot be seen from here may have left: it is believed to be nowhere until it is seen.
        """
        platform, end = self._platform, now() + seconds
        tested: Mapping[str, Pose] | None = None
        while now() < end:
            for name in sorted(self._poses().keys() & platform.resolver.movers_beside(location)):
                if platform.scene.visibility.hidden(platform.base(), name) is not None:
                    platform.belief.not_there(name)
            if self._poses() != tested and platform.resolver.is_possible(location):
                return
            tested = self._poses()
            await self.wait()

    def closes(self, path: Trajectory) -> bool:
        """Take a picture, and check whether a robot has come so near to the rest of a path that the base has to stop.

        One that stands where it was when the path was planned does not close it. The camera turns to the nearest one,
        or, if none is near, to where the path leads.
        """
        platform, rest = self._platform, self._rest(path)
        platform.sensing.see()
        now = self._poses()
        self._watch(rest, now)
        if not now or now == self._last:
            return False
        silhouette, sizes = platform.scene.world.silhouette(), platform.scene.bodies.size
        for name, pose in now.items():
            rooms = clearance_at(rest[:, :2], Boxes.around([pose], np.array([sizes(name)])), silhouette)
            if rooms.min() < min(ROOM, rooms[0] - NEARER):
                self.closed_by = name
                return True
        self._last = now
        return False

    def _watch(self, rest: Array, others: Mapping[str, Pose]) -> None:
        """Turn the camera to the nearest robot, or, if none is near, to where the rest of a path (n, 3) leads."""
        x, y, _ = rest[0]
        away = {math.dist(pose.position[:2], (x, y)): pose.position for pose in others.values()}
        nearest = min(away, default=math.inf)
        soon = rest[min(int(SOON * self._platform.world.rate), len(rest) - 1)]
        point = away[nearest] if nearest <= NEAR_BY else (soon[0], soon[1], EYE_LEVEL)
        self._platform.sensing.turn_towards(np.array(point))

    def _rest(self, path: Trajectory) -> Array:
        """Select the poses (n, 3) of a path from where the base is, for the next seconds."""
        rows, (x, y, yaw) = path.positions, self._platform.base()
        away = np.hypot(rows[:, 0] - x, rows[:, 1] - y) + np.abs(np.sin((rows[:, 2] - yaw) / 2))
        here = int(away.argmin())
        return np.asarray(rows[here : here + int(SECONDS_AHEAD * self._platform.world.rate)])

    def _poses(self) -> Mapping[str, Pose]:
        belief = self._platform.belief
        return {name: belief.pose(name) for name in belief.names() if name in self.others}


def _has(name: str, seen: Collection[str]) -> bool:
    return name in seen
