"""Check that an object has been turned over: look, and compare with its pose before."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from executive.modules.platform import Platform
from planlang.designators import action
from planlang.failures import LookingFailure, ObjectNotTurned, PerceptionFailure
from planlang.geometry import Array, Pose
from planlang.kernel import sleep
from planlang.language.performing import perform
from sim.bodies import axes_of
from sim.falling import falling_time

if TYPE_CHECKING:
    from executive.modules.phases import Phase
    from executive.modules.tools.motion_grounding import GroundedMotion
    from executive.motion.arm_group import ArmGroup

TURNED = -0.5
"""Largest cosine between an object's up axis before and after turning it over: at least 120 degrees."""


async def check_turned(platform: Platform, name: str, before: Pose) -> None:
    """Look at an object; raise ObjectNotTurned if it is seen to lie as before. An object that is not seen passes."""
    heights = (platform.scene.world.pose(tool).position[2] for tool in platform.belief.held)
    await sleep(falling_time(max(heights, default=0.0) - before.position[2]))  # it may still fall off the highest tool
    what = platform.scene.bodies.designator(name)
    with suppress(PerceptionFailure, LookingFailure):
        await perform(action("LookingForSomething", object_acted_on=what))
        if float(platform.belief.pose(name).rotation[:, 2] @ before.rotation[:, 2]) > TURNED:
            raise ObjectNotTurned(what=name)


async def check_flip(
    platform: Platform, motion: GroundedMotion, group: ArmGroup, rows: Array, phase: Phase, names: Sequence[str]
) -> None:
    """Check the thin objects among ``names`` whose pose before is known, if a motion (m, n) has turned a blade over."""
    thin = [name for name in names if platform.scene.world.scene.body(name).thin and name in phase.things]
    if thin and _turns_a_blade(platform, motion, group, rows):
        for name in thin:
            await check_turned(platform, name, phase.things[name])


def _turns_a_blade(platform: Platform, motion: GroundedMotion, group: ArmGroup, rows: Array) -> bool:
    """Check whether a motion (m, n) turns the blade of a held tool upside down."""
    number = {arm.name: k for k, arm in enumerate(motion.arms)}
    for name, grip in platform.belief.held.items():
        body = platform.scene.world.scene.body(name)
        if body.blade and grip.arm in number:
            normal = grip.offset.rotation[:, axes_of(body.size)[2]]
            first, last = group.fk(rows[[0, -1]], number[grip.arm])[:, 2, :3] @ np.asarray(normal)
            if first * last < 0:
                return True
    return False
