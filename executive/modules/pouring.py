"""Pouring: what flows out of a vessel that a hand holds upside down, for how long, and what is believed of it."""

from __future__ import annotations

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import numpy as np

from executive.modules.motion_grounding import GroundedMotion
from executive.modules.phases import Phase
from executive.modules.platform import Platform
from executive.motion.arm_group import ArmGroup
from executive.robots.arms import ArmModel
from planlang import now
from planlang.designators import Action, Object
from planlang.effects import effects_of
from planlang.geometry import Array, Pose
from planlang.language.performing import actions_around
from planlang.ontology import expand
from planlang.protocols import Trajectory
from planlang.records import dataclass


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """A vessel with something in it that a motion moves."""

    name: str
    arm: ArmModel
    offset: Pose
    """Its pose in the frame of the arm's tip."""
    turned: Array
    """Rows of the motion at which its axis points down, (m,)."""
    before: float
    """Amount that had flowed out of it when the motion was made before, and failed [ml]."""
    key: str
    """Key by which that is remembered."""

    def seconds(self, steps: float) -> float:
        """Return for how many steps of the world it flowed until so many had been made since the motion began."""
        rows = len(self.turned)
        return float(self.turned[: round(min(steps, rows))].sum()) + max(0.0, steps - rows) * bool(self.turned[-1])


class Pouring:
    """Pouring with the arms of one platform, in one recipe."""

    def __init__(self, platform: Platform, phase: Phase) -> None:
        self._platform, self._phase = platform, phase

    @asynccontextmanager
    async def during(
        self, action: Action, motion: GroundedMotion, group: ArmGroup, trajectory: Trajectory
    ) -> AsyncIterator[None]:
        """Hold vessels that a motion has turned over in the end until an amount has flowed; believe what has flowed.

        The amount is that of the action or of one around it [ml]; else all of a substance that is named ("the mix"),
        and out of a vessel that is named what its class or what is usual says. What flowed when the motion was made
        before, and failed, counts.
        """
        platform, flows = self._platform, list(self._flows(action, motion, group, trajectory.positions))
        began, rate = now(), platform.world.rate
        flow_rate = platform.scene.world.changes.rules.flow_rate
        try:
            yield
            for flow in flows:
                seconds = flow.seconds((now() - began) * rate) / rate
                if flow.turned[-1] and flow_rate > 0:
                    held = max(0.0, self._amount(action, flow) / flow_rate - seconds)
                    await platform.wait_holding([flow.arm.name], lambda: False, f"{flow.name} poured", timeout=held)
        except BaseException:  # a failure, or the end of the task: what has flowed has flowed
            for flow in flows:
                flowed = self._believe(flow, flow_rate * flow.seconds((now() - began) * rate) / rate)
                self._phase.poured[flow.key] = flow.before + flowed
            raise
        for flow in flows:
            self._believe(flow, flow_rate * flow.seconds((now() - began) * rate) / rate)
            self._phase.poured.pop(flow.key, None)

    def _flows(self, action: Action, motion: GroundedMotion, group: ArmGroup, rows: Array) -> Iterator[Flow]:
        """Yield the vessels among the tools of a motion (m, n) that something is in."""
        platform = self._platform
        changes, number = platform.scene.world.changes, {arm.name: k for k, arm in enumerate(motion.arms)}
        for name, grip in platform.belief.held.items():
            if grip.arm in number and changes.is_vessel(name) and changes.matter.total(name) > 0:
                arm, key = number[grip.arm], f"{action.type} {name}"
                turned = self._turned(group, rows, arm, grip.offset.matrix())
                yield Flow(name, motion.arms[arm], grip.offset, turned, self._phase.poured.get(key, 0.0), key)

    def _turned(self, group: ArmGroup, rows: Array, arm: int, offset: Array) -> Array:
        """Return at which rows (m, n) the axis of a vessel points down, (m,)."""
        axes = group.fk(rows, arm)[:, 2, :3] @ offset[:3, 2]  # the base stands level
        return np.asarray(axes < 0)

    def _amount(self, action: Action, flow: Flow) -> float:
        """Return how much is to flow yet [ml]; "pour the mix" is all of it, "pour from the bottle" some of it."""
        platform = self._platform
        actions = (action, *actions_around())
        for amount in (one.get("amount") for one in actions):
            if isinstance(amount, int | float):
                return float(amount) - flow.before
        if any(self._means_content(one.get("object_acted_on"), flow.name) for one in actions):
            return platform.scene.world.changes.matter.total(flow.name)
        ontology = platform.belief.map.ontology
        ancestors = [expand(cls) for cls in platform.ancestors(action.type)]
        for cls, above in ((action.type, ancestors), (POURING, None)):
            amount = effects_of(ontology, expand(cls), above).amount
            if amount is not None:
                return amount - flow.before
        return 0.0

    def _means_content(self, what: object, vessel: str) -> bool:
        """Return whether an action is about what is in a vessel, not the vessel."""
        belief, changes = self._platform.belief, self._platform.scene.world.changes
        if not isinstance(what, Object) or belief.means(what, vessel):
            return False
        content = changes.matter.contents.get(vessel, {})
        return any(changes.rules.is_a(type, what.type) for type in content)

    def _believe(self, flow: Flow, amount: float) -> float:
        """Let an amount [ml] flow in the believed world, onto or into what is below; return how much it was."""
        platform = self._platform
        platform.sync()
        world, tip = platform.scene.world, platform.world.link_pose(platform.robot.arm(flow.arm.name).tip)
        portions = world.changes.matter.take(flow.name, amount) if amount > 0 else []
        if not portions:
            return 0.0
        mouth = tip @ flow.offset @ Pose((0.0, 0.0, world.size(flow.name)[2] / 2))
        below = world.changes.drop(portions, mouth.position, flow.name)
        flowed = sum(one.amount for one in portions)
        platform.belief.poured(flow.name, below or "the floor", flowed)
        return flowed


POURING = "FluidFlow-Translation"
"""The class of actions that lets something flow."""
