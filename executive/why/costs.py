"""How small a change is: less for a choice of the run than for a thing moved, more for furniture and another robot."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence

from executive.maps.supports import Standing
from planlang.advice import ABSENT, ATTEMPTS, BEFORE, POSITION, ROBOT, TRANSLATION, Change
from planlang.geometry.areas import HAIR
from sim import Scene

CHOICE, STEP, THING, DOOR, FURNITURE, OTHER_ROBOT = 1.0, 2.0, 3.0, 4.0, 5.0, 8.0
"""Of a choice of the run; of a step, attempt or recovery; of a thing moved; of a door that is open or shut; of
furniture moved, and of anything away; of another robot."""
PER_METRE = 10.0
"""What a metre adds to the cost of moving something."""
_OPTIONS = {ROBOT: OTHER_ROBOT, ATTEMPTS: STEP, BEFORE: STEP}


def cost_of(changes: Sequence[Change], scene: Scene) -> float:
    """Sum the costs of changes; what moves or goes along with something costs nothing."""
    return sum(_cost(group[0], scene) for group in groups_of(changes, scene))


def groups_of(changes: Sequence[Change], scene: Scene) -> list[list[Change]]:
    """Group changes: with the first of those that move alike, or with what it stands on or belongs to, if that goes."""
    standing = Standing(scene)
    leaves = {body: joint.leaf for joint in scene.joints for body in joint.bodies}
    bodies = {body.name for body in scene.bodies}
    groups: list[list[Change]] = []
    below = {one: _below(str(one.thing), standing, leaves, bodies) for one in changes if one.thing is not None}
    gone = {one.thing for one in changes if one.what == ABSENT}
    for change in sorted(changes, key=lambda one: one.what == ABSENT and bool(gone & below[one])):
        own = next((group for group in groups if _goes_along(change, group[0], below.get(change, set()), scene)), None)
        if own is None:
            groups.append([change])
        else:
            own.append(change)
    return groups


def _below(name: str, standing: Standing, leaves: Mapping[str, str], bodies: Container[str]) -> set[str]:
    """Names of what a body is a part of, or stands on, directly or not."""
    found: set[str] = set()
    left: list[str | None] = [name]
    while left:
        one = left.pop()
        if one is None or one in found:
            continue
        found.add(one)
        left += [leaves.get(one), standing.support(one) if one in bodies else None]
    return found - {name}


def _goes_along(change: Change, other: Change, below: set[str], scene: Scene) -> bool:
    if change.what != other.what or change.what not in (ABSENT, TRANSLATION):
        return False
    if change.what == ABSENT:
        return other.thing in below
    return math.dist(displacement(change, scene), displacement(other, scene)) <= HAIR


def displacement(change: Change, scene: Scene) -> Sequence[float]:
    """Compute how far, and where to, a change moves a thing (x, y, z) [m]."""
    assert isinstance(change.value, tuple)
    position = scene.body(str(change.thing)).pose.position
    return [float(to) - at for to, at in zip(change.value, position, strict=True)]


def _cost(change: Change, scene: Scene) -> float:
    if change.thing is None:
        return _OPTIONS.get(change.what, CHOICE)
    if change.what == POSITION:
        return DOOR
    if change.what == ABSENT or change.thing not in {body.name for body in scene.bodies}:
        return FURNITURE
    base = THING if scene.body(change.thing).movable else FURNITURE
    return base + PER_METRE * math.hypot(*displacement(change, scene))
