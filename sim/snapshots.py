"""What came into being in a world as JSON, and back. Numbers come back exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from planlang.geometry import Pose
from sim.bodies import Bodies
from sim.scene import Body

FARTHEST = 1e4
"""Greatest coordinate [m], angle [rad] or speed [m/s] that is believed: ten kilometres, farther than any map goes."""
UNIT = 1e-3
"""Largest error of a quaternion's length: a pose that was written comes back to the last digit."""


def created(all_: Bodies) -> list[Any]:
    """Return the bodies that were not in the scene at the beginning, where they came into being."""
    bodies = [all_.bodies[name] for name in all_.created]
    return [[one.name, one.type, str(one.shape), list(one.size), pose_json(one.pose)] for one in bodies]


def created_of(state: Any, all_: Bodies) -> Iterator[Body]:
    """Yield the inverse of :func:`created`; raises ValueError for a damaged one."""
    for name, type, shape, size, pose in state:
        if not isinstance(name, str) or name in all_.bodies:
            raise ValueError(f"{name!r} cannot come into being")
        x, y, z = _numbers(size, 3)
        yield Body(name, pose_of(pose), (x, y, z), shape, type=str(type), movable=True)


def pose_json(pose: Pose) -> list[float]:
    """Return the position and quaternion, seven numbers."""
    return [*pose.position, *pose.orientation]


def pose_of(state: object) -> Pose:
    """Return the inverse of :func:`pose_json`; raises ValueError."""
    x, y, z, a, b, c, d = _numbers(state, 7)
    if abs(math.hypot(a, b, c, d) - 1.0) > UNIT:
        raise ValueError(f"a unit quaternion is expected, not {[a, b, c, d]!r}")
    return Pose((x, y, z), (a, b, c, d))


def _numbers(state: object, count: int) -> list[float]:
    if not isinstance(state, list) or len(state) != count:
        raise ValueError(f"{count} numbers are expected, not {state!r}")
    if not all(type(value) in (int, float) and math.isfinite(value) for value in state):
        raise ValueError(f"finite numbers are expected, not {state!r}")
    if any(abs(value) > FARTHEST for value in state):
        raise ValueError(f"numbers up to {FARTHEST:g} are expected, not {state!r}")
    return state
