"""Straight lines through a physics client: what they hit first."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from planlang.geometry import Array
from sim.bodies import Bodies
from sim.engine import bullet
from sim.robot import Robot

BATCH = 16_000
"""Rays per call of PyBullet: beyond 16,383 it silently answers fewer."""

_EVERYTHING, _NOT_ROBOT = -1, ~64
_ROBOT_GROUP = 64


class Rays:
    """Casts rays; the robot's links are in a collision group of their own, so that rays can pass through them."""

    def __init__(self, client: int, bodies: Bodies, robot: Robot | None) -> None:
        self.client, self.bodies, self.robot = client, bodies, robot
        if robot is not None:
            for index in robot.links.values():
                bullet.setCollisionFilterGroupMask(robot.uid, index, _ROBOT_GROUP, -1, physicsClientId=client)

    def _hits(self, starts: Array, ends: Array, mask: int) -> list[Any]:
        hits: list[Any] = []
        for first in range(0, len(starts), BATCH):
            hits += bullet.rayTestBatch(
                starts[first : first + BATCH].tolist(),
                ends[first : first + BATCH].tolist(),
                collisionFilterMask=mask,
                physicsClientId=self.client,
            )
        return hits

    def _name(self, hit: Any) -> str | None:
        if self.robot is not None and hit[0] == self.robot.uid:
            return self.robot.link_names[hit[1]]
        return self.bodies.name_of(hit[0])

    def cast(self, starts: Array, ends: Array) -> tuple[str | None, ...]:
        """(n, 3) starts and ends -> names of bodies or links that are hit first."""
        return tuple(self._name(hit) for hit in self._hits(starts, ends, _EVERYTHING))

    def seeing_through_the_robot(self, starts: Array, ends: Array) -> tuple[str | None, ...]:
        """Cast rays as :meth:`cast`, as if there were no robot."""
        return tuple(self._name(hit) for hit in self._hits(starts, ends, _NOT_ROBOT))

    def down(self, starts: Array, ends: Array) -> tuple[tuple[str | None, ...], Array]:
        """Return the names of bodies below, the robot left out, and the heights of the hits (0 where there is none)."""
        hits = self._hits(starts, ends, _NOT_ROBOT)
        return tuple(self._name(hit) for hit in hits), np.array([float(hit[3][2]) for hit in hits])

    @contextlib.contextmanager
    def without(self, name: str) -> Iterator[None]:
        """Cast as if a body were not there."""
        pieces = self.bodies.of[name]
        self.bodies.hide(pieces)
        try:
            yield
        finally:
            self.bodies.show(pieces)
