"""Changes in words: the clause after "the goal is reached if"."""

from __future__ import annotations

import math
from collections.abc import Sequence

from executive.why.candidates import CLOSING, OPENING
from executive.why.costs import displacement, groups_of
from planlang.advice import ABSENT, ARM, ATTEMPTS, BEFORE, GRASP, POSITION, ROBOT, SCHEDULE, START, Change
from planlang.geometry.areas import HAIR
from planlang.recoveries import ASIDE
from sim import Scene
from sim.joints import Articulation, JointKind

FROM = {"side": "from the side", "tilted": "at a slant", "top": "from above"}
"""Class of grasps -> whence the hand comes."""


def clause_of(changes: Sequence[Change], scene: Scene) -> str:
    """Say changes as a condition: ``bottle1 is moved 0.10 m, to x = 1.20, y = 0.50, z = 0.79``."""
    return ", and ".join(_clause(group, scene) for group in groups_of(changes, scene))


def _clause(group: list[Change], scene: Scene) -> str:
    change, along = group[0], [str(one.thing) for one in group[1:]]
    name, value = str(change.thing), change.value
    if change.thing is None:
        return _option(change)
    if change.what == ABSENT:
        return f"{name} is not there" + (f", nor {_listed(along)}" if along else "")
    if change.what == POSITION:
        assert isinstance(value, float)
        joint = next((one for one in scene.joints if one.leaf == name), None)
        return f"{name} is {_opening(joint, value)} from the start"
    x, y, z = displacement(change, scene)
    way = "" if math.hypot(x, y) > HAIR else " up" if z > 0 else " down"
    assert isinstance(value, tuple)
    place = ", ".join(f"{axis} = {number:.2f}" for axis, number in zip("xyz", map(float, value), strict=True))
    return f"{name} is moved {math.hypot(x, y, z):.2f} m{way}, to {place}" + (
        f", and {_listed(along)} with it" if along else ""
    )


def _option(change: Change) -> str:
    value = change.value
    match change.what:
        case _ if change.what == START and isinstance(value, tuple):
            x, y, yaw = map(float, value)
            return f"the robot starts at x = {x:.2f}, y = {y:.2f}, yaw = {yaw:.2f}"
        case _ if change.what == ARM:
            return f"the robot grasps with its {value} arm first"
        case _ if change.what == GRASP:
            return f"the robot grasps things {FROM.get(str(value), value)} first"
        case _ if change.what == SCHEDULE:
            return f"steps whose order is open run in the order of schedule {value}"
        case _ if change.what == ATTEMPTS:
            return f"each recovery may try {'once' if value == 1 else f'{value} times'} more"
        case _ if change.what == BEFORE:
            return _before(str(value))
        case _ if change.what == ROBOT:
            return f"the robot is {value}"
    return f"{change.what} is {value}"


def _before(value: str) -> str:
    """Say an action that comes before the plan, or before a step of it."""
    what, _, step = value.partition("@")
    act, _, name = what.partition(" ")
    if act == ASIDE:
        return f"the robot puts {name} down before {step}"
    acts = {OPENING: "opens", CLOSING: "closes"}.get(act, f"performs {act} on")
    return f"the robot first {acts} {name}"


def _opening(joint: Articulation | None, value: float) -> str:
    if joint is None or joint.is_shut(joint.sign * value):
        return "closed"
    slides = joint.kind is JointKind.PRISMATIC
    return f"open by {100 * abs(value):.0f} cm" if slides else f"open by {math.degrees(abs(value)):.0f} degrees"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
