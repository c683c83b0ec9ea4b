"""Look at a door, drawer, lid or device before its state is believed: what a map says of it may be wrong.

All modules that open, close, push or switch furniture call :func:`is_witnessed`.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.arm.hand_work import HandWork
from executive.modules.platform import Platform
from planlang.designators import a_location
from planlang.failures import LookingGoalUnreachable
from planlang.geometry import Array


async def is_seen_from_here(platform: Platform, name: str) -> bool:
    """Return whether the robot itself knows the state of a leaf or device, after a look from here if necessary.

    What it has seen or felt, and not moved since, is not looked at again.
    """
    return platform.belief.witnessed(name) or await _looked(platform, name)


async def is_witnessed(work: HandWork, name: str) -> bool:
    """Return the same as :func:`is_seen_from_here`, after a look from other base poses if necessary."""
    platform = work.platform
    if await is_seen_from_here(platform, name):
        return True
    if platform.robot.camera is None or platform.robot.base.fixed:
        return False
    seeing = a_location(visible_from=platform.scene.bodies.designator(name))

    async def drive(base: BasePose) -> None:
        await work.tuck()
        await work.drive(base)

    bases = (solution.base for solution in platform.resolver.bases(seeing))
    return await work.seen_from(lambda: bases, drive, partial(_looked, platform, name))


async def _looked(platform: Platform, name: str) -> bool:
    """Look at a leaf or device from here, wherever the leaf may be; return whether it was seen."""
    with suppress(LookingGoalUnreachable):
        return await platform.sensing.shows(_gazes(platform, name), name, lambda _: platform.belief.witnessed(name))
    return False


def _gazes(platform: Platform, name: str) -> Iterator[Array]:
    """Yield points (3,) of the map to look at: of a leaf where it is believed to be, then where it would be otherwise.

    Without any if it is believed to be out of sight.
    """
    scene, joint = platform.scene, platform.belief.joints.get(name)
    bodies = (name,) if joint is None else joint.bodies
    visible = [body for body in bodies if scene.visibility.hidden(scene.base(), body) is None]
    if not visible:
        return
    yield scene.bodies.block(visible[0]).centre
    if joint is not None:
        leaf = scene.world.scene.body(name)
        for value in (0.0, joint.upper / 2, joint.upper):
            yield np.array((joint.motion(value) @ leaf.pose).position)
