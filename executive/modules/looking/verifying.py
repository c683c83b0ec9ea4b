"""A look at where a hand has let go of a thing: is it there, in the hand of a person, or has it fallen?"""

from __future__ import annotations

from contextlib import suppress
from functools import partial

import numpy as np

from executive.modules.platform import Platform
from planlang.failures import LookingFailure, ObjectLost
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.protocols import GroupKind, MotionState

ELSEWHERE = 0.1
"""Distance from where a hand has let go of it from which on a thing is elsewhere [m]: who takes it moves it less."""
ASIDE = 0.3
"""Distance to the side up to which a thing that is seen lower has fallen [m]; farther off it may be another like it."""
POINTS = (-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6, 0.8)
"""Points along a thing at which a depth image may show that it is not there, as shares of half its length."""
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
    sensing, belief = platform.sensing, platform.belief
    if platform.robot.camera is None:
        return
    there = belief.pose(name)
    await _neck_at_rest(platform, _gaze(platform, there, platform.below(name)), name)
    is_seen, seen = name in sensing.see(), belief.pose(name)
    if is_seen and seen.distance(there) <= ELSEWHERE:
        return
    if (is_seen and _is_below(seen, there)) or sensing.seen_through(*_points(platform, name, there)) >= EMPTY:
        belief.lost(name, platform.below(name))
        support = platform.scene.bodies.support(name) if is_seen else None
        where = "" if support is None else f", but on {support}"
        raise ObjectLost(f"{name} is no longer held by {person}{where}", what=name)


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
