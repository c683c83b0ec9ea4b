"""Pouring: how long to hold a vessel tilted, and whether the amount has arrived where it was to go."""

from __future__ import annotations

import math
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

from executive.modules.flowing import Flow, within
from executive.modules.phases import Phase, Pour
from executive.modules.platform import Platform
from executive.modules.tools.motion_grounding import GroundedMotion
from planlang.designators import Action, Object
from planlang.effects import effects_of
from planlang.failures import AmountNotPoured, VesselEmpty
from planlang.language.performing import actions_around
from planlang.ontology import expand
from planlang.protocols import Trajectory
from planlang.state.matter import KG_PER_ML
from planlang.state.questions import is_vessel

SLOWER = 1.25
"""Largest ratio of the time to turn the vessel back to the time to turn it over that the reserve allows for."""


class Pouring:
    """Pouring by the arms of one platform, in one recipe."""

    def __init__(self, platform: Platform, phase: Phase) -> None:
        self._platform, self.phase = platform, phase
        self._flowing, self._flow_rate = platform.flowing, platform.flowing.flow_rate

    @asynccontextmanager
    async def during(self, action: Action, motion: GroundedMotion, trajectory: Trajectory) -> AsyncIterator[None]:
        """Pour around a motion (the body of the ``with``) that turns a vessel over or back.

        After turning it over, the vessel is held until a little less than the amount has flowed, with a reserve for
        turning it back. Before turning it back, when the duration of that motion is known, it is held for the rest.
        What flowed before a motion failed counts when the motion is repeated.

        The amount [ml] is stated by the action or an enclosing one; otherwise it is all of a named substance ("the
        mix"), or the usual amount for the class when a vessel is named. Raises VesselEmpty if the vessel is not known
        to contain anything, and AmountNotPoured: beforehand if the amount is impossible, afterwards if it was missed.
        """
        self._flowing.catch_up()
        flows = list(self._flows(motion, trajectory))
        for flow in flows:
            if flow.turned[-1] and (problem := self._begin(flow, action, motion)) is not None:
                raise problem
        for flow in flows:
            if flow.turned[0] and not flow.turned[-1]:
                step = self._flow_rate / self._platform.world.rate  # holding ends within a step: rather too much
                await self._hold(flow, self._foreseen(flow) - step)
        yield
        for flow in flows:
            if flow.turned[-1]:
                await self._hold(flow, SLOWER * self._foreseen(flow))
            else:
                self._end(flow)

    def too_slow(self, action: Action, motion: GroundedMotion, trajectory: Trajectory) -> AmountNotPoured | None:
        """Build the failure of a motion that turns a vessel over so slowly that too much flows; None if it does not.

        Raises VesselEmpty or AmountNotPoured if no motion can pour the amount.
        """
        flows = (flow for flow in self._flows(motion, trajectory) if flow.turned[-1])
        return next((problem for flow in flows if (problem := self._begin(flow, action, motion)) is not None), None)

    def _flows(self, motion: GroundedMotion, trajectory: Trajectory) -> Iterator[Flow]:
        """Yield the flows out of vessels that a motion turns over, or that are being poured from."""
        arms = {arm.name for arm in motion.arms}
        for flow in self._flowing.flows(trajectory):
            if flow.arm in arms and (flow.turned.any() or flow.name in self.phase.pours):
                yield flow

    def _begin(self, flow: Flow, action: Action, motion: GroundedMotion) -> AmountNotPoured | None:
        """Record the amount to pour; return the failure if more than that would flow during the motion.

        Raises VesselEmpty or AmountNotPoured if no motion can pour it.
        """
        pour = self.phase.pours.get(flow.name)
        if pour is None or (pour.by.type != action.type and action.get("amount") is not None):
            (asked, stated), into = self._amount(action, flow), self._target(action, motion)
            pour = Pour(action, asked, into, self._flowing.arrived(flow.name, into), self.phase.before)
            if not stated:
                pour.asked = min(asked, *self._bounds(flow, pour).values())
        poured = self._poured(flow.name, pour)
        rest = pour.asked - poured
        if rest <= 0 or self._flow_rate <= 0:
            return None
        if self._platform.belief.state.matter.total(flow.name) <= 0 and not poured:
            raise VesselEmpty(f"nothing is known to be in {flow.name}", arm=flow.arm, what=flow.name)
        for bound, most in self._bounds(flow, pour).items():
            if rest > most + within(pour.asked):
                raise self._refusal(flow, pour, f"{bound} {most:.0f} ml")
        least = 2 * self._foreseen(flow)
        if rest < least - within(pour.asked):
            return self._refusal(flow, pour, f"{least:.0f} ml flow while {flow.name} is turned over and back")
        self.phase.pours[flow.name] = pour
        return None

    def _bounds(self, flow: Flow, pour: Pour) -> dict[str, float]:
        """Compute the upper bounds of the amount [ml], keyed by the words that describe each bound in a message."""
        scene, matter = self._platform.scene, self._platform.belief.state.matter
        bounds = {f"{flow.name} holds": matter.total(flow.name)}
        if pour.into is not None and is_vessel(self._platform.belief.state, pour.into, scene.mirror.queries):
            room = scene.world.scene.body(pour.into).capacity - matter.total(pour.into)
            bounds[f"{pour.into} has room for"] = max(0.0, room)
            if (spare := scene.spare_payload(pour.into)) < math.inf:
                bounds[f"the payload of what holds {pour.into} allows"] = spare / KG_PER_ML
        return bounds

    def _refusal(self, flow: Flow, pour: Pour, reason: str) -> AmountNotPoured:
        poured = self._poured(flow.name, pour)
        message = f"{pour.asked:.0f} ml were asked for, {poured:.0f} ml were poured: {reason}"
        return AmountNotPoured(message, arm=flow.arm, what=flow.name, asked=pour.asked, poured=poured)

    def _poured(self, vessel: str, pour: Pour) -> float:
        """Compute how much of an amount has arrived [ml]."""
        return self._flowing.arrived(vessel, pour.into) - pour.before

    def is_done(self, action: Action) -> bool:
        """Check whether nothing is left to pour of what an action has begun to pour, and no vessel is turned over."""
        pours = {name: pour for name, pour in self.phase.pours.items() if pour.by.type == action.type}
        over = {flow.name for flow in self._flowing.flows() if flow.turned[-1]}
        return (
            bool(pours)
            and over.isdisjoint(pours)
            and all(pour.asked - self._poured(name, pour) <= within(pour.asked) for name, pour in pours.items())
        )

    def _end(self, flow: Flow) -> None:
        """Close the record of a pour. Raises AmountNotPoured, and keeps the record, if the amount was missed."""
        pour = self.phase.pours.get(flow.name)
        if pour is None:
            return
        if abs(self._poured(flow.name, pour) - pour.asked) > within(pour.asked):
            into = "" if pour.into is None else f" into {pour.into}"
            raise self._refusal(flow, pour, f"out of {flow.name}{into}")
        del self.phase.pours[flow.name]

    def _foreseen(self, flow: Flow) -> float:
        """Predict how much flows during a motion [ml], which is about as much as during its reverse."""
        return self._flow_rate * float(flow.turned.sum()) / self._platform.world.rate

    async def _hold(self, flow: Flow, reserve: float) -> None:
        """Hold a turned vessel until all of the amount but a reserve [ml] has flowed."""
        pour = self.phase.pours.get(flow.name)
        if pour is None or self._flow_rate <= 0:
            return
        rest = max(0.0, pour.asked - self._poured(flow.name, pour) - reserve) / self._flow_rate
        with self._flowing.during([flow.arm]):
            await self._platform.wait_holding([flow.arm], lambda: False, f"{flow.name} poured", timeout=rest)

    def _target(self, action: Action, motion: GroundedMotion) -> str | None:
        """Find the vessel among the world objects of a motion, else what the action pours onto, else the only one."""
        scene, state = self._platform.scene, self._platform.belief.state
        names = list(dict.fromkeys(scene.bodies.bind(one) for one in motion.things))
        vessel = next((name for name in names if is_vessel(state, name, scene.mirror.queries)), None)
        where = next((one for act in (action, *actions_around()) if (one := act.get("to_location")) is not None), None)
        stated = [scene.bodies.bind(where)] if isinstance(where, Object) else []
        onto = [name for name in names if name in stated] or names
        return vessel or (onto[0] if len(onto) == 1 else None)

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


POURING = "FluidFlow-Translation"
"""Class of pouring actions, whose usual amount is the default."""
