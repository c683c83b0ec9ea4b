"""Bodies created during a run, to JSON and back; numbers survive exactly."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from planlang.geometry import Pose
from sim.bodies import Bodies
from sim.scene import Body

FARTHEST = 1e4
"""Largest plausible coordinate [m], angle [rad] or speed [m/s]: ten kilometres, farther than any map."""
UNIT = 1e-3
"""Largest error of a quaternion's norm: poses written by planlang come back to the last digit."""


def created(all_: Bodies) -> list[Any]:
    """Serialise the bodies that were not in the initial scene, at the poses where they were created."""
    bodies = [all_.bodies[name] for name in all_.created]
    return [[one.name, one.type, str(one.shape), list(one.size), pose_json(one.pose)] for one in bodies]


def created_of(state: Any, all_: Bodies) -> Iterator[Body]:
    """Deserialise the result of :func:`created`; raises ValueError if it is damaged."""
    for name, type, shape, size, pose in state:
        if not isinstance(name, str) or name in all_.bodies:
            raise ValueError(f"{name!r} is no name for a created body, or is already in use")
        x, y, z = _numbers(size, 3)
        yield Body(name, pose_of(pose), (x, y, z), shape, type=str(type), movable=True)


def pose_json(pose: Pose) -> list[float]:
    """List the position and quaternion of a pose: seven numbers."""
    return [*pose.position, *pose.orientation]


def pose_of(state: object) -> Pose:
    """Parse the result of :func:`pose_json`; raises ValueError."""
    x, y, z, a, b, c, d = _numbers(state, 7)
    if abs(math.hypot(a, b, c, d) - 1.0) > UNIT:
        raise ValueError(f"expected a unit quaternion, got {[a, b, c, d]!r}")
    return Pose((x, y, z), (a, b, c, d))


def _numbers(state: object, count: int) -> list[float]:
    if not isinstance(state, list) or len(state) != count:
        raise ValueError(f"expected {count} numbers, got {state!r}")
    if not all(type(value) in (int, float) and math.isfinite(value) for value in state):
        raise ValueError(f"expected finite numbers, got {state!r}")
    if any(abs(value) > FARTHEST for value in state):
        raise ValueError(f"expected numbers up to {FARTHEST:g}, got {state!r}")
    return state
