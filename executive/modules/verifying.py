"""A look at where a hand has let go of a thing: is it where it was put, in the hand of a person, or elsewhere?"""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial

import numpy as np

from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.failures import GripperGoalNotReached, LookingFailure, ObjectLost
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated, upright
from planlang.protocols import GroupKind, MotionState
from sim.tolerances import TILT

ELSEWHERE = 0.1
"""Distance from where a hand has let go of it from which on a thing is elsewhere [m]: who takes it moves it less."""
ASIDE = 0.3
"""Distance to the side up to which a thing that is seen lower has fallen [m]; farther off it may be another like it."""
POINTS = (-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8)
"""Points along a thing at which a depth image may show that it is not there, as shares of half its length."""
SUNK = 0.04
"""Depth below where a thing was put from which on it has slid off what it was put on [m]: more than noise makes."""
LOWER = 0.25
"""How far below the place of a thing to look at most, for each metre from the camera: the place stays in the image."""
EMPTY = 0.5
"""Share of the points in sight at which nothing is, from which on it is gone: the hand may be behind the others."""
WELL_INSIDE = 0.8
"""Share of half the least extent of a thing: lines of sight farther out may graze past it."""


def begin_to_watch(platform: Platform, name: str) -> None:
    """Begin to turn the neck to what may become of a thing in a hand, and do not wait for its end."""
    platform.observe()
    gaze = _gaze(platform, platform.scene.world.pose(name), platform.below(name))
    if not platform.sensing.frames(gaze):
        platform.sensing.turn_towards(gaze)


async def check_is_in_hand(platform: Platform, name: str, person: str) -> None:
    """Look once whether a thing is still where a person has taken it; raise ObjectLost if it is not.

    It is not if it is seen to have fallen, or if the camera sees through where it was. Without a camera, or if neither
    thing nor place is in sight, nothing is known, and it is believed to be there.
    """
    if platform.robot.camera is None:
        return
    there = platform.belief.pose(name)
    seen = await _seen(platform, name, there)
    if seen is not None and seen.distance(there) <= ELSEWHERE:
        return
    if (seen is not None and _is_below(seen, there)) or _is_empty(platform, name, there):
        where = "" if seen is None else _but_on(platform, name)
        raise _lost(platform, name, f"{name} is no longer held by {person}{where}")


async def check_is_where_put(platform: Platform, name: str) -> None:
    """Look once whether a thing that was let go stands where it was put; raise ObjectLost if it does not.

    It does not if it is seen to have moved, sunk or fallen over, or if the camera sees through where it was put. What
    the hand hides is not known: it is believed to be there. So it is without a camera.
    """
    if platform.robot.camera is None:
        return
    there, put_on = upright(platform.belief.pose(name)), platform.scene.bodies.support(name)
    seen = await _seen(platform, name, there)
    told = _has_left(platform, name, there, put_on, seen)
    if told is not None and ((seen is not None and seen.distance(there) <= ASIDE) or _is_empty(platform, name, there)):
        raise _lost(platform, name, told)


async def check_is_felt(platform: Platform, arm: ArmModel, name: str, opened: Fingers) -> None:
    """Close the fingers on a thing that they have let go, and open them again; raise ObjectLost if they feel nothing.

    So a robot without a camera checks whether it stands where it was put. ``opened`` is the opening around it.
    """
    hands, base = platform.hands, platform.base()
    motion = None
    with suppress(GripperGoalNotReached):  # fingers that do not close tell nothing
        motion = await hands.move(arm, closed=True)
    await hands.move(arm, closed=False, fingers=opened)
    if motion is not None and motion.touch is None and motion.state is MotionState.DONE:
        failure = _lost(platform, name, f"{_not_there(name, platform.scene.bodies.support(name))}: no finger feels it")
        platform.belief.missed(name, arm.name, base)
        raise failure


def _not_there(name: str, put_on: str | None) -> str:
    return f"{name} is not where it was put{'' if put_on is None else f', on {put_on}'}"


def _has_left(platform: Platform, name: str, there: Pose, put_on: str | None, seen: Pose | None) -> str | None:
    """Say what has become of a thing that was put down at a pose, and is seen at another one; None if it is there."""
    if seen is None:
        return _not_there(name, put_on)
    if _lean(seen, there) > TILT:
        return f"{name} has fallen over{_on(platform, name)}"
    if there.position[2] - seen.position[2] > SUNK:
        return f"{_not_there(name, put_on)}{_but_on(platform, name)}"
    if seen.distance(there) > ELSEWHERE:
        return f"{_not_there(name, put_on)}, but {seen.distance(there):.2f} m away"
    return None


def _lean(pose: Pose, other: Pose) -> float:
    """Compute the angle between what points up in two poses of a thing [rad]; turns about the vertical do not count."""
    return math.acos(float(np.clip(pose.rotation[2] @ other.rotation[2], -1.0, 1.0)))


async def _seen(platform: Platform, name: str, there: Pose) -> Pose | None:
    """Take a picture of where a thing should be once the neck is at rest; return where it is seen, if it is."""
    await _neck_at_rest(platform, _gaze(platform, there, platform.below(name)), name)
    return platform.belief.pose(name) if name in platform.sensing.see() else None


def _is_empty(platform: Platform, name: str, there: Pose) -> bool:
    return platform.sensing.seen_through(*_points(platform, name, there)) >= EMPTY


def _lost(platform: Platform, name: str, told: str) -> ObjectLost:
    """Believe that a thing is lost, below where it is seen, or was."""
    platform.belief.lost(name, platform.below(name))
    return ObjectLost(told, what=name)


def _on(platform: Platform, name: str) -> str:
    support = platform.scene.bodies.support(name)
    return "" if support is None else f" on {support}"


def _but_on(platform: Platform, name: str) -> str:
    on = _on(platform, name)
    return on and f", but{on}"


def _gaze(platform: Platform, there: Pose, fallen: Pose) -> Array:
    """Choose the map point (3,) to look at, for a thing that is at one pose, or has fallen to another: below the first.

    So both are in the image, if they are no farther apart than that shows.
    """
    camera, point = platform.robot.camera, np.array(there.position)
    if camera is not None:
        away = float(np.linalg.norm(point - platform.world.link_pose(camera.link).position))
        point[2] -= min(LOWER * away, (there.position[2] - fallen.position[2]) / 2)
    return point


async def _neck_at_rest(platform: Platform, gaze: Array, name: str) -> None:
    """Wait until the neck, which began to turn to a map point (3,), is at rest; turn it again if it has not arrived."""
    motion = partial(platform.world.motion, GroupKind.HEAD)
    await platform.wait_holding((), lambda: motion().state is not MotionState.MOVING, "head at rest")
    if motion().state is MotionState.FAILED and not platform.sensing.frames(gaze):
        with suppress(LookingFailure):
            await platform.sensing.look_at(gaze, name)


def _is_below(seen: Pose, there: Pose) -> bool:
    x, y, down = np.array(there.position) - np.array(seen.position)
    return bool(down > ELSEWHERE and np.hypot(x, y) <= ASIDE)


def _points(platform: Platform, name: str, pose: Pose) -> tuple[Array, float]:
    """List map points (n, 3) along a thing at a pose, and how far from them lines of sight surely meet it [m]."""
    half = np.array(platform.scene.world.scene.body(name).size) / 2
    axis = np.eye(3)[int(half.argmax())] * half.max()
    return np.array(pose.position) + np.outer(POINTS, rotated(pose.rotation, axis)), WELL_INSIDE * float(half.min())
