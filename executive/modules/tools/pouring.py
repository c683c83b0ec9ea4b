"""Pouring: how long to hold a vessel tilted, and how much is believed to have flowed out of it.

The robot does not measure the flow. The amount is the time for which the vessel pointed down, multiplied by the flow
rate of the ontology.
"""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import numpy as np

from executive.modules.phases import Phase, Pour
from executive.modules.platform import Platform
from executive.modules.tools.motion_grounding import GroundedMotion
from executive.motion.arm_group import ArmGroup
from executive.robots.arms import ArmModel
from planlang.changes import Poured
from planlang.designators import Action, Object
from planlang.effects import effects_of
from planlang.failures import AmountNotPoured, VesselEmpty
from planlang.geometry import Array, Pose
from planlang.kernel import now
from planlang.language.performing import actions_around
from planlang.ontology import expand
from planlang.protocols import Trajectory
from planlang.records import dataclass
from planlang.state import flow as state_after_flow
from planlang.state.matter import KG_PER_ML
from planlang.state.questions import is_vessel

WITHIN, WITHIN_SHARE = 5.0, 0.05
"""Tolerance of a poured amount: the larger of the two [ml, share]."""
SLOWER = 1.25
"""Largest ratio of the time to turn the vessel back to the time to turn it over that the reserve allows for."""


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Flow out of a held vessel during a motion."""

    name: str
    """Vessel."""
    arm: ArmModel
    offset: Pose
    """Pose of the vessel in the frame of the arm's tip."""
    turned: Array
    """Mask of the motion's rows at which the vessel's axis points down, (m,)."""

    def steps(self, made: float) -> float:
        """Count the steps with flow among the first ``made`` world steps since the motion began."""
        rows = len(self.turned)
        return float(self.turned[: round(min(made, rows))].sum()) + max(0.0, made - rows) * bool(self.turned[-1])


class Pouring:
    """Pouring by the arms of one platform, in one recipe."""

    def __init__(self, platform: Platform, phase: Phase) -> None:
        self._platform, self._phase = platform, phase
        self._flow_rate = platform.scene.mirror.queries.rules.flow_rate

    @asynccontextmanager
    async def during(
        self, action: Action, motion: GroundedMotion, group: ArmGroup, trajectory: Trajectory
    ) -> AsyncIterator[None]:
        """Pour around a motion (the body of the ``with``) that turns a vessel over or back.

        After turning it over, the vessel is held until a little less than the amount has flowed, with a reserve for
        turning it back. Before turning it back, when the duration of that motion is known, it is held for the rest.
        What flowed before a motion failed counts when the motion is repeated.

        The amount [ml] is stated by the action or an enclosing one; otherwise it is all of a named substance ("the
        mix"), or the usual amount for the class when a vessel is named. Raises VesselEmpty if the vessel is not known
        to contain anything, and AmountNotPoured: beforehand if the amount is impossible, afterwards if it was missed.
        """
        rate = self._platform.world.rate
        flows = list(self._flows(motion, group, trajectory.positions))
        for flow in flows:
            if flow.turned[-1] and (problem := self._begin(flow, action, motion)) is not None:
                raise problem
        for flow in flows:
            if flow.turned[0] and flow.name in self._phase.pours:
                self._flowed(flow, now() - self._phase.pours[flow.name].until)
                if not flow.turned[-1]:
                    step = self._flow_rate / rate  # holding ends within a step: err towards a little too much
                    await self._hold(flow, self._foreseen(flow) - step)
        began = now()
        try:
            yield
        finally:  # also after a failure, because the liquid has flowed
            for flow in flows:
                self._flowed(flow, flow.steps((now() - began) * rate) / rate)
        for flow in flows:
            if flow.turned[-1]:
                await self._hold(flow, SLOWER * self._foreseen(flow))
            else:
                self._end(flow)

    def too_slow(
        self, action: Action, motion: GroundedMotion, group: ArmGroup, trajectory: Trajectory
    ) -> AmountNotPoured | None:
        """Build the failure of a motion that turns a vessel over so slowly that too much flows; None if it does not.

        Raises VesselEmpty or AmountNotPoured if no motion can pour the amount.
        """
        flows = (flow for flow in self._flows(motion, group, trajectory.positions) if flow.turned[-1])
        return next((problem for flow in flows if (problem := self._begin(flow, action, motion)) is not None), None)

    def _flows(self, motion: GroundedMotion, group: ArmGroup, rows: Array) -> Iterator[Flow]:
        """Yield the vessels in the arms of a motion (m, n) that it turns over, or that are being poured from."""
        platform = self._platform
        number = {arm.name: k for k, arm in enumerate(motion.arms)}
        for name, grip in platform.belief.held.items():
            if grip.arm in number and is_vessel(platform.belief.state, name, platform.scene.mirror.queries):
                arm = number[grip.arm]
                # z of the vessel's axis in the base's frame, which is level: the axis points down if negative
                vertical = group.fk(rows, arm)[:, 2, :3] @ grip.offset.matrix()[:3, 2]
                turned: Array = np.asarray(vertical < 0)
                if turned.any() or name in self._phase.pours:
                    yield Flow(name, motion.arms[arm], grip.offset, turned)

    def _begin(self, flow: Flow, action: Action, motion: GroundedMotion) -> AmountNotPoured | None:
        """Record the amount to pour; return the failure if more than that would flow during the motion.

        Raises VesselEmpty or AmountNotPoured if no motion can pour it.
        """
        pour = self._phase.pours.get(flow.name)
        if pour is not None and pour.by == action.type:
            pour.until = now()
        else:
            asked, stated = self._amount(action, flow)
            pour = Pour(action.type, asked, self._target(motion), until=now())
            if not stated:
                pour.asked = min(asked, *self._bounds(flow, pour).values())
        rest = pour.asked - pour.flowed
        if rest <= 0 or self._flow_rate <= 0:
            return None
        if self._platform.belief.state.matter.total(flow.name) <= 0 and not pour.flowed:
            raise VesselEmpty(f"nothing is known to be in {flow.name}", arm=flow.arm.name, what=flow.name)
        for bound, most in self._bounds(flow, pour).items():
            if rest > most + _within(pour.asked):
                raise self._refusal(flow, pour, f"{bound} {most:.0f} ml")
        least = 2 * self._foreseen(flow)
        if rest < least - _within(pour.asked):
            return self._refusal(flow, pour, f"{least:.0f} ml flow while {flow.name} is turned over and back")
        self._phase.pours[flow.name] = pour
        return None

    def _bounds(self, flow: Flow, pour: Pour) -> dict[str, float]:
        """Compute the upper bounds of the amount [ml], keyed by the words that describe each bound in a message."""
        scene, matter = self._platform.scene, self._platform.belief.state.matter
        bounds = {f"{flow.name} holds": matter.total(flow.name)}
        if pour.into is not None:
            room = scene.world.scene.body(pour.into).capacity - matter.total(pour.into)
            bounds[f"{pour.into} has room for"] = max(0.0, room)
            if (spare := scene.spare_payload(pour.into)) < math.inf:
                bounds[f"the payload of what holds {pour.into} allows"] = spare / KG_PER_ML
        return bounds

    def _refusal(self, flow: Flow, pour: Pour, reason: str) -> AmountNotPoured:
        message = f"{pour.asked:.0f} ml were asked for, {pour.flowed:.0f} ml were poured: {reason}"
        return AmountNotPoured(message, arm=flow.arm.name, what=flow.name, asked=pour.asked, poured=pour.flowed)

    def _end(self, flow: Flow) -> None:
        """Close the record of a pour. Raises AmountNotPoured, and keeps the record, if the amount was missed."""
        pour = self._phase.pours.get(flow.name)
        if pour is None:
            return
        if abs(pour.flowed - pour.asked) > _within(pour.asked):
            into = "" if pour.into is None else f" into {pour.into}"
            raise self._refusal(flow, pour, f"out of {flow.name}{into}")
        del self._phase.pours[flow.name]

    def _foreseen(self, flow: Flow) -> float:
        """Predict how much flows during a motion [ml], which is about as much as during its reverse."""
        return self._flow_rate * float(flow.turned.sum()) / self._platform.world.rate

    async def _hold(self, flow: Flow, reserve: float) -> None:
        """Hold a turned vessel until all of the amount but a reserve [ml] has flowed."""
        pour = self._phase.pours.get(flow.name)
        if pour is None or self._flow_rate <= 0:
            return
        rest = max(0.0, pour.asked - pour.flowed - reserve) / self._flow_rate
        began = now()
        try:
            await self._platform.wait_holding([flow.arm.name], lambda: False, f"{flow.name} poured", timeout=rest)
        finally:
            self._flowed(flow, now() - began)

    def _target(self, motion: GroundedMotion) -> str | None:
        """Find the vessel among the world objects of a motion; None when pouring onto a surface."""
        scene, state = self._platform.scene, self._platform.belief.state
        names = [scene.bodies.bind(one) for one in motion.things]
        return next((name for name in names if is_vessel(state, name, scene.mirror.queries)), None)

    def _amount(self, action: Action, flow: Flow) -> tuple[float, bool]:
        """Determine the amount to pour [ml], and whether the plan states it; "pour the mix" states all of it."""
        platform = self._platform
        actions = (action, *actions_around())
        for amount in (one.get("amount") for one in actions):
            if isinstance(amount, int | float):
                return float(amount), True
        if any(self._means_content(one.get("object_acted_on"), flow.name) for one in actions):
            return platform.belief.state.matter.total(flow.name), True
        ontology = platform.belief.map.ontology
        ancestors = [expand(cls) for cls in platform.ancestors(action.type)]
        for cls, above in ((action.type, ancestors), (POURING, None)):
            amount = effects_of(ontology, expand(cls), above).amount
            if amount is not None:
                return amount, False
        return 0.0, False

    def _means_content(self, what: object, vessel: str) -> bool:
        """Check whether a designator describes the content of a vessel rather than the vessel itself."""
        belief, is_a = self._platform.belief, self._platform.scene.mirror.queries.rules.is_a
        if not isinstance(what, Object) or belief.means(what, vessel):
            return False
        return any(is_a(type, what.type) for type in belief.state.matter.contents.get(vessel, {}))

    def _flowed(self, flow: Flow, seconds: float) -> None:
        """Update belief and record: the vessel has flowed for some time [s] into, or onto, what is below."""
        platform, pour = self._platform, self._phase.pours.get(flow.name)
        belief, tip = platform.belief, platform.world.link_pose(flow.arm.tip)
        mouth = tip @ flow.offset @ Pose((0.0, 0.0, platform.scene.world.size(flow.name)[2] / 2))
        before = belief.state.matter
        amount, queries = self._flow_rate * seconds, platform.scene.mirror.queries
        state, flowed, below = state_after_flow(belief.state, flow.name, amount, mouth.position, queries)
        belief.happened(state, Poured(flow.name, below or "the floor", flowed) if flowed else None)
        if pour is not None:
            into = pour.into
            pour.flowed += flowed if into is None else state.matter.total(into) - before.total(into)
            pour.until = now()


def _within(asked: float) -> float:
    return max(WITHIN, WITHIN_SHARE * asked)


POURING = "FluidFlow-Translation"
"""Class of pouring actions, whose usual amount is the default."""
