"""What came to be and what things hold, to JSON and back, for traces; numbers survive exactly."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from typing import Any

from planlang.geometry import Pose
from planlang.state.matter import Matter
from planlang.state.world import Made, WorldState

FARTHEST = 1e4
"""Largest plausible coordinate [m]: ten kilometres, farther than any map."""
UNIT = 1e-3
"""Largest error of a quaternion's norm: poses written by planlang come back to the last digit."""


def saved(state: WorldState) -> dict[str, Any]:
    """Serialise what a state's poses do not tell: the things that came to be, and what things hold and how they are."""
    made = [
        [name, one.type, "cylinder" if one.is_round else "box", list(one.size), [*one.at.position, *one.at.orientation]]
        for name, one in state.made.items()
    ]
    return {"created": made, "matter": state.matter.snapshot()}


def restored(state: WorldState, left: Mapping[str, Any], known: Collection[str]) -> WorldState:
    """Make a state in which things are as :func:`saved` in ``left``; ``known`` are the things of the start.

    Things that came to be have no pose yet. Raises ValueError if ``left`` is damaged or belongs to another scene.
    """
    try:
        made = dict(_made_of(left["created"], known))
        matter = Matter.of(left["matter"], (*known, *made))
    except (KeyError, TypeError, AttributeError) as problem:
        raise ValueError(f"the state of the world is damaged: {problem!r}") from None
    poses = {name: pose for name, pose in state.poses.items() if name not in matter.gone}
    held = {name: grip for name, grip in state.held.items() if name in poses}
    return replace(state, poses=poses, held=held, made=made, matter=matter)


def _made_of(left: Any, known: Collection[str]) -> Iterator[tuple[str, Made]]:
    for name, type, _, size, pose in left:
        if not isinstance(name, str) or name in known:
            raise ValueError(f"{name!r} is no name for a created body, or is already in use")
        x, y, z = _numbers(size, 3)
        if min(x, y, z) <= 0:
            raise ValueError(f"expected a size, got {size!r}")
        yield name, Made(str(type), (x, y, z), _pose(pose))


def _pose(left: object) -> Pose:
    x, y, z, a, b, c, d = _numbers(left, 7)
    if abs(math.hypot(a, b, c, d) - 1.0) > UNIT:
        raise ValueError(f"expected a unit quaternion, got {[a, b, c, d]!r}")
    return Pose((x, y, z), (a, b, c, d))


def _numbers(left: object, count: int) -> list[float]:
    if not isinstance(left, list) or len(left) != count:
        raise ValueError(f"expected {count} numbers, got {left!r}")
    if not all(type(value) in (int, float) and math.isfinite(value) for value in left):
        raise ValueError(f"expected finite numbers, got {left!r}")
    if any(abs(value) > FARTHEST for value in left):
        raise ValueError(f"expected numbers up to {FARTHEST:g}, got {left!r}")
    return left
