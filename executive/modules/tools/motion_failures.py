"""Says of a motion that is out of reach how near the arm gets to what it is about, and what would do."""

from __future__ import annotations

import math
from collections.abc import Callable

from executive.locations import Rejections
from executive.locations.changes import Changes
from executive.locations.explanations import called
from executive.modules.platform import Platform
from executive.modules.tools.motion_grounding import GroundedMotion


def out_of_reach(platform: Platform, motion: GroundedMotion, does: Callable[[], bool]) -> str:
    """Return how near a shoulder gets to the first movable thing of a motion, and where that would have to stand.

    ``does`` tells whether there is a base pose from which the motion ends, as the scene is supposed to be. "" for a
    motion that is about nothing of the kind.
    """
    bodies, arm = platform.scene.bodies, motion.arms[0]
    loose = ((bodies.bind(one), pose[:2, 3]) for one, pose in motion.things.items())
    found = next((one for one in loose if bodies.is_movable(one[0]) and bodies.support(one[0]) is not None), None)
    if found is None:
        return ""
    name, at = found
    away = platform.base_poses().distances([at[None]], motion.arms)[0]
    said = f"the shoulder of {called(arm.name)} gets no nearer to {name} than {away:.2f} m"
    if not math.isfinite(away):
        said = f"the base has no room to stand near {name}"
    changes = Changes(name, platform.scene, Rejections(), lambda _: does())
    return "; ".join(filter(None, (said, changes.nearer() or changes.in_vain())))
