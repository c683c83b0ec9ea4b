"""The state of things in the simulator's truth when a run has ended, in words."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from planlang.designators import local_name
from sim import PyBulletWorld
from sim.joints import Articulation, JointKind
from sim.world import at_rest_on, held_by


def state_lines(truth: PyBulletWorld, names: Iterable[str]) -> Iterator[str]:
    """Yield a line for each thing of the plan: where it is, whether it is open or on, and what is in it."""
    scene = truth.scene
    for name in dict.fromkeys(names):
        if scene.body(name).graspable:
            holder, support = held_by(truth, name), at_rest_on(truth, name)
            if holder is not None:
                yield f"{name}: held by {holder}"
            else:
                yield f"{name}: at rest on {support}" if support is not None else f"{name}: not at rest"
        for joint in scene.joints:
            if not joint.is_knob and name in (joint.leaf, joint.holder):
                yield f"{joint.leaf}: {_opening(truth.joint(joint.leaf), joint)}"
        is_on = truth.changes.matter.is_on(name)
        if is_on or scene.body(name).is_on:  # that a refrigerator without a switch is not on says nothing
            yield f"{name}: {'on' if is_on else 'off'}"
        content = truth.changes.matter.contents.get(name, {}).values()
        if content:
            yield f"{name}: holds {', '.join(f'{one.amount:.0f} ml of {local_name(one.type)}' for one in content)}"


def _opening(value: float, joint: Articulation) -> str:
    if joint.is_shut(value):
        return "closed"
    slides = joint.kind is JointKind.PRISMATIC
    return f"open by {100 * value:.0f} cm" if slides else f"open by {math.degrees(value):.0f} degrees"
