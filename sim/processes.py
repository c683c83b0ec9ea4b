"""Processes without an actor: tilted vessels run dry, heat bakes, blades carry things and turn them over.

A thin thing over a rising blade moves along, slides off when the blade turns over, and lands upside down. Time advances
in steps; nothing here is random.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from planlang.changes import Simulated
from planlang.geometry import Pose
from planlang.geometry.matrices import turned_up
from planlang.records import dataclass
from planlang.state import Matter, Queries, WorldState, flow, warm
from planlang.state.questions import POURS
from sim.bodies import BLADE, axes_of
from sim.contact import HeldObject
from sim.falling import Falling

NEAR_BLADE = 0.03
"""Distance of a thing's centre from a blade up to which the blade carries it [m]."""
RISEN = 1e-6
"""Rise of a blade within a step above which it counts as rising [m]."""


@dataclass(frozen=True, slots=True)
class Riding:
    """Thing on a blade: the tool, the thing's pose in the tool's frame, and the side of the blade."""

    tool: str
    offset: Pose
    side: float


class Enacted(Protocol):
    """The world in which processes go on."""

    matter: Matter
    simulated: Simulated
    held: dict[str, HeldObject]
    gravity: Falling

    def world_state(self) -> WorldState:
        """The present state."""

    def enact(self, state: WorldState) -> object:
        """Bring things to a state to which flow or heat has led."""


class Processes:
    """Advances the processes of one world."""

    def __init__(self, world: Enacted, queries: Queries) -> None:
        self._world, self._queries, self._bodies = world, queries, world.gravity.bodies
        self.riding: dict[str, Riding] = {}
        self.heights: dict[str, float] = {}
        """Tool -> height of its blade one step earlier [m]."""

    def step(self, seconds: float) -> None:
        """Advance by some seconds: flow, blades, heat."""
        self.flow(seconds)
        self.carry()
        if any(map(self._world.matter.is_on, self._world.matter.states)):
            self._world.enact(warm(self._world.world_state(), seconds, self._queries))

    def flow(self, seconds: float) -> None:
        """Empty held vessels whose axis points down."""
        for name in tuple(self._world.held):
            body, pose = self._bodies.bodies[name], self._bodies.poses[name]
            if name in self._world.matter.contents and body.capacity > 0 and pose.rotation[2, 2] < POURS:
                mouth = pose @ Pose((0.0, 0.0, body.size[2] / 2))
                amount = self._queries.rules.flow_rate * seconds
                state, flowed, _ = flow(self._world.world_state(), name, amount, mouth.position, self._queries)
                so_far = self._world.simulated
                flows = {**so_far.flowed, name: so_far.flowed.get(name, 0.0) + flowed}
                self._world.simulated = replace(so_far, flowed=flows)
                self._world.enact(state)

    def carry(self) -> None:
        """Move thin things with the blades under them; drop those whose blade turns over."""
        tools = [name for name in self._world.held if self._bodies.bodies[name].blade]
        for thing, ride in list(self.riding.items()):
            if thing in self._world.held or thing in self._bodies.removed:
                del self.riding[thing]
            elif ride.tool not in tools:
                self._leave(thing, ride.tool)
            else:
                self._ride(thing, ride)
        if tools or self.heights:
            for tool in tools:
                self._take_along(tool)
            self.heights = {tool: self._blade(tool).position[2] for tool in tools}

    def _ride(self, thing: str, ride: Riding) -> None:
        blade = self._blade(ride.tool)
        self._bodies.place(thing, self._bodies.poses[ride.tool] @ ride.offset)
        sinks = blade.position[2] < self.heights.get(ride.tool, blade.position[2]) - RISEN
        turned = ride.side * blade.rotation[2, 2] < 0
        if turned:
            up = ride.side * float(np.sign(blade.rotation[:, 2] @ self._bodies.poses[thing].rotation[:, 2]))
            self._bodies.place(thing, turned_up(self._bodies.poses[thing], 2, -up))
        if turned or (sinks and self._world.gravity.under(thing, [ride.tool]) is not None):
            self._leave(thing, ride.tool)

    def _leave(self, thing: str, tool: str) -> None:
        del self.riding[thing]
        with self._world.gravity.rays.without(tool):
            self._world.gravity.begin(thing)

    def _take_along(self, tool: str) -> None:
        blade = self._blade(tool)
        if blade.position[2] <= self.heights.get(tool, np.inf) + RISEN:
            return
        body, held = self._bodies.bodies[tool], self._world.held
        # half the extents of the blade along its own axes [m]; its thickness is zero
        half = np.array([body.blade, body.size[axes_of(body.size)[1]], 0.0]) / 2
        for thing, other in self._bodies.bodies.items():
            excluded = thing in self.riding or thing in held or thing in self._bodies.removed
            if not other.thin or other.blade or excluded or thing in self._world.gravity.on_the_way:
                continue
            place = self._bodies.poses[thing]
            if self.heights[tool] > place.position[2] + other.size[2] / 2:
                continue
            local = np.array((blade.inverse() @ place).position)
            if np.linalg.norm(local - np.clip(local, -half, half)) <= NEAR_BLADE:
                side = 1.0 if blade.rotation[2, 2] > 0 else -1.0
                self.riding[thing] = Riding(tool, self._bodies.poses[tool].inverse() @ place, side)
                so_far = self._world.simulated
                carried = {**so_far.carried, thing: so_far.carried.get(thing, 0) + 1}
                self._world.simulated = replace(so_far, carried=carried)
                self._world.gravity.stop(thing)

    def _blade(self, tool: str) -> Pose:
        """Pose of a blade's centre: x along the tool's longest axis, z the normal."""
        body = self._bodies.bodies[tool]
        along, _, normal = axes_of(body.size)
        centre, columns = np.array(body.centre), np.zeros((3, 3))
        centre[along] += (body.size[along] - body.blade) / 2
        centre[normal] -= max(0.0, body.size[normal] - BLADE) / 2
        columns[along, 0], columns[normal, 2] = 1.0, 1.0
        columns[:, 1] = np.cross(columns[:, 2], columns[:, 0])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = columns, centre
        return self._bodies.poses[tool] @ Pose.from_matrix(matrix)
