"""What flows out of held vessels, as it is believed, whatever turns them over: pouring, or a hand that carries them.

The robot does not measure the flow. The amount is the time for which the vessel's axis points down, multiplied by the
flow rate of the ontology; it lands on what is believed to be straight below the mouth.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from itertools import groupby

import numpy as np

from executive.belief import Belief
from executive.belief.planning_scene import PlanningScene
from planlang.changes import Poured, Simulated
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, product
from planlang.kernel import now
from planlang.protocols import Trajectory
from planlang.records import dataclass
from planlang.state import WorldState
from planlang.state import flow as state_after_flow
from planlang.state.questions import POURS, is_vessel

PART = 15
"""World steps of a motion for which the mouth is taken to be in one place."""
WITHIN, WITHIN_SHARE = 5.0, 0.05
"""Tolerance of a poured amount: the larger of the two [ml, share]."""


def within(asked: float) -> float:
    """Compute the deviation that a poured amount may have [ml]."""
    return max(WITHIN, WITHIN_SHARE * asked)


@dataclass(frozen=True, slots=True, eq=False)
class Flow:
    """Flow out of a held vessel during a motion."""

    name: str
    """Vessel."""
    arm: str
    """Arm that holds it."""
    turned: Array
    """Mask of the motion's rows at which the vessel's axis points down, (m,)."""
    mouths: Array
    """Middle of its mouth at these rows, in the frame of the robot's base, (m, 3) [m]."""

    def steps(self, made: float) -> float:
        """Count the steps with flow among the first ``made`` world steps since the motion began."""
        return sum(steps for steps, _ in self.parts(made))

    def parts(self, made: float) -> Iterator[tuple[float, int]]:
        """Yield the parts of the motion with flow: the number of steps with flow, and the row where the mouth was."""
        rows = len(self.turned)
        flowing = self.turned.astype(float)
        flowing[round(min(made, rows)) :] = 0.0
        flowing[-1] += max(0.0, made - rows) * bool(self.turned[-1])
        for first in range(0, rows, PART):
            part = flowing[first : first + PART]
            if part.any():
                yield float(part.sum()), first + int(np.flatnonzero(part)[-1])


class Flowing:
    """Believed flow out of the vessels in the hands of one robot."""

    def __init__(self, belief: Belief, scene: PlanningScene, rate: int) -> None:
        """``rate``: world steps per second."""
        self._belief, self._scene, self._rate = belief, scene, rate
        self._until: dict[str, float] = {}
        """Held vessel -> plan time up to which its flow is counted [s]."""
        self._moving: set[str] = set()
        """Vessels whose flow a running motion counts."""
        self._arrived: dict[tuple[str, str | None], float] = {}
        """Vessel, and thing or None -> amount that has flowed there, or at all [ml]."""

    @property
    def flow_rate(self) -> float:
        """Flow out of a vessel that points down [ml/s]."""
        return self._scene.mirror.queries.rules.flow_rate

    def arrived(self, vessel: str, there: str | None) -> float:
        """Look up how much has flowed out of a vessel onto or into a thing, or at all if that is None, so far [ml]."""
        return self._arrived.get((vessel, there), 0.0)

    @property
    def simulated(self) -> Simulated:
        """What has flowed so far, by which declared effects of pouring are measured."""
        return Simulated({vessel: amount for (vessel, there), amount in self._arrived.items() if there is None})

    def flows(self, trajectory: Trajectory | None = None) -> Iterator[Flow]:
        """Yield the flows out of all held vessels during a motion from here; without one, nothing moves."""
        belief, scene = self._belief, self._scene
        arms = {arm.name: arm for arm in scene.arms.all}
        for name, grip in belief.held.items():
            if not is_vessel(belief.state, name, scene.mirror.queries):
                continue
            chain = arms[grip.arm].chain
            joints = belief.state.robots[belief.robot].joints
            rows = np.array([[joints[joint] for joint in chain.names]])
            if trajectory is not None and (columns := [one for one in chain.names if one in trajectory.names]):
                rows = np.repeat(rows, len(trajectory.positions), axis=0)
                for joint in columns:
                    column = trajectory.names.index(joint)
                    rows[:, chain.names.index(joint)] = trajectory.positions[:, column]
            poses = product(chain.fk(rows), grip.offset.matrix())
            mouths = poses[:, :3, 3] + scene.world.size(name)[2] / 2 * poses[:, :3, 2]
            yield Flow(name, grip.arm, np.asarray(poses[:, 2, 2] < POURS), mouths)  # the base is level

    def catch_up(self) -> None:
        """Count what has flowed since the last motion out of the vessels that no running motion counts."""
        resting = [flow for flow in self._full() if flow.name not in self._moving]
        for flow in resting:
            self._flowed(flow, self._until.get(flow.name, now()))
        self._until = {flow.name: now() for flow in resting}

    @contextmanager
    def during(self, arms: Collection[str], trajectory: Trajectory | None = None) -> Iterator[None]:
        """Count what flows out of the vessels in some arms during the body of the ``with``, which moves them, or waits.

        What has flowed counts also if the body fails, because the vessel slipped out of the hand, for instance.
        """
        self.catch_up()
        flows, began = [flow for flow in self._full(trajectory) if flow.arm in arms], now()
        self._moving.update(flow.name for flow in flows)
        try:
            yield
        finally:
            for flow in flows:
                self._flowed(flow, began)
                self._moving.discard(flow.name)
                self._until[flow.name] = now()

    def _full(self, trajectory: Trajectory | None = None) -> Collection[Flow]:
        """List the flows out of the held vessels that contain something."""
        contents = self._belief.state.matter.contents
        if not any(map(contents.get, self._belief.held)):
            return ()
        return [flow for flow in self.flows(trajectory) if contents.get(flow.name)]

    def _flowed(self, flow: Flow, since: float) -> None:
        """Update the belief: a vessel has flowed since a plan time [s] onto, or into, what was below its mouth."""
        belief, queries = self._belief, self._scene.mirror.queries
        base = Pose.planar(*belief.state.robots[belief.robot].base).matrix()
        parts = [(steps, moved(base, flow.mouths[row])) for steps, row in flow.parts((now() - since) * self._rate)]
        first = belief.state
        places = [(steps, _point(mouth)) for steps, mouth in parts]
        onto = groupby(places, lambda place: queries.below(first, place[1], flow.name)[0])
        for group in [list(one) for _, one in onto]:
            before, steps = belief.state, sum(steps for steps, _ in group)
            amount, point = self.flow_rate * steps / self._rate, group[-1][1]
            state, flowed, below = state_after_flow(before, flow.name, amount, point, queries)
            self._count(flow.name, before, state, flowed, below)
            belief.happened(state, Poured(flow.name, below or "the floor", flowed) if flowed else None)

    def _count(self, vessel: str, before: WorldState, after: WorldState, flowed: float, below: str | None) -> None:
        """Add an amount [ml] to what has arrived: a vessel below counts what it had room for."""
        queries, landed, under = self._scene.mirror.queries, flowed, below
        if below is not None and is_vessel(before, below, queries):
            landed = after.matter.total(below) - before.matter.total(below)
        on: list[str] = []
        while under is not None and under not in on:
            on.append(under)
            under = queries.under(before, under)
        for there, amount in ((None, flowed), *((one, landed) for one in on)):
            self._arrived[vessel, there] = self.arrived(vessel, there) + amount


def _point(position: Array) -> tuple[float, float, float]:
    x, y, z = position.tolist()
    return x, y, z
