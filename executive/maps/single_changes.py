"""Single changes of a map or of a run, as data: what messages advise and what ``planlang why`` tries are made here."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from planlang.advice import ABSENT, POSITION, START, TRANSLATION, Change
from planlang.geometry import Pose
from sim.joints import Articulation

DIGITS = 6
"""Decimal places of what a change states [m, rad]."""
BasePose = tuple[float, float, float]


def things_moved(poses: Mapping[str, Pose]) -> tuple[Change, ...]:
    """Return the changes by which things, and what moves along with them, are at poses, turned as they are."""
    places = {name: tuple(round(value, DIGITS) for value in pose.position) for name, pose in poses.items()}
    return tuple(Change(TRANSLATION, place, name) for name, place in places.items())


def things_away(names: Iterable[str]) -> tuple[Change, ...]:
    """Return the changes by which the map lacks things."""
    return tuple(Change(ABSENT, True, name) for name in names)


def leaf_moved(joint: Articulation, value: float) -> tuple[Change, ...]:
    """Return the change by which a leaf is open by a value [rad, m]."""
    return (Change(POSITION, round(joint.sign * value + 0.0, DIGITS), joint.leaf),)


def started_at(base: BasePose) -> tuple[Change, ...]:
    """Return the change by which the base starts at a pose."""
    return (Change(START, base),)


def option_set(name: str, value: str | int) -> tuple[Change, ...]:
    """Return the change by which an option of the run has a value."""
    return (Change(name, value),)
