"""Pouring: what flows out of a vessel that a hand holds upside down, for how long, and what is believed of it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from executive.modules.motion_grounding import GroundedMotion
from executive.modules.platform import Platform
from executive.motion.arm_group import ArmGroup
from planlang.designators import Action, Object
from planlang.geometry import Array, Pose
from planlang.language.performing import actions_around
from planlang.ontology import expand
from planlang.recipe.effects import effects_of


class Pouring:
    """Pouring with the arms of one platform."""

    def __init__(self, platform: Platform) -> None:
        self._platform = platform

    async def pour(self, action: Action, motion: GroundedMotion, group: ArmGroup, rows: Array) -> None:
        """Hold vessels that a motion (m, n) has turned over until an amount has flowed, and believe that it has.

        The amount is that of the action or of one around it [ml]; else all of a substance that is named ("the mix"),
        and out of a vessel that is named what its class or what is usual says.
        """
        platform = self._platform
        for name, arm, offset in self._vessels(motion):
            turned = self._turned(motion, group, rows, arm, offset)
            seconds = float(turned.sum()) / platform.world.rate
            rate = platform.scene.world.changes.rules.flow_rate
            if turned[-1] and rate > 0:
                held = max(0.0, self._amount(action, name) / rate - seconds)
                arms = [motion.arms[arm].name]
                await platform.wait_holding(arms, lambda: False, f"{name} poured", timeout=held)
                seconds += held
            if seconds > 0:
                self._believe(name, rate * seconds)

    def _vessels(self, motion: GroundedMotion) -> Iterator[tuple[str, int, Array]]:
        """Yield the vessels among tools that something is in: name, number of the arm, pose (4, 4) in its tip."""
        platform = self._platform
        changes, number = platform.scene.world.changes, {arm.name: k for k, arm in enumerate(motion.arms)}
        for name, grip in platform.belief.held.items():
            if grip.arm in number and changes.is_vessel(name) and changes.matter.total(name) > 0:
                yield name, number[grip.arm], grip.offset.matrix()

    def _turned(self, motion: GroundedMotion, group: ArmGroup, rows: Array, arm: int, offset: Array) -> Array:
        """Return at which rows (m, n) the axis of a vessel points down, (m,)."""
        axes = group.fk(rows, arm)[:, 2, :3] @ offset[:3, 2]  # the base stands level
        return np.asarray(axes < 0)

    def _amount(self, action: Action, vessel: str) -> float:
        """Return how much is to flow [ml]; "pour the mix" is all of it, "pour from the bottle" some of it."""
        platform = self._platform
        actions = (action, *actions_around())
        for amount in (one.get("amount") for one in actions):
            if isinstance(amount, int | float):
                return float(amount)
        if any(self._means_content(one.get("object_acted_on"), vessel) for one in actions):
            return platform.scene.world.changes.matter.total(vessel)
        ontology = platform.belief.map.ontology
        ancestors = [expand(cls) for cls in platform.ancestors(action.type)]
        for cls, above in ((action.type, ancestors), (POURING, None)):
            amount = effects_of(ontology, expand(cls), above).amount
            if amount is not None:
                return amount
        return 0.0

    def _means_content(self, what: object, vessel: str) -> bool:
        """Return whether an action is about what is in a vessel, not the vessel."""
        belief, changes = self._platform.belief, self._platform.scene.world.changes
        if not isinstance(what, Object) or belief.means(what, vessel):
            return False
        content = changes.matter.contents.get(vessel, {})
        return any(changes.rules.is_a(type, what.type) for type in content)

    def _believe(self, name: str, amount: float) -> None:
        """Let an amount [ml] flow in the believed world, onto or into what is below."""
        platform = self._platform
        platform.sync()
        world = platform.scene.world
        portions = world.changes.matter.take(name, amount)
        mouth = world.pose(name) @ Pose((0.0, 0.0, world.size(name)[2] / 2))
        world.changes.drop(portions, mouth.position, name)
        below = world.support(name)
        flowed = sum(one.amount for one in portions)
        platform.belief.poured(name, below or "the floor", flowed)


POURING = "FluidFlow-Translation"
"""The class of actions that lets something flow."""
