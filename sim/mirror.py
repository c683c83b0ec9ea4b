"""Worlds that are brought to states: a planning world mirrors the one that is asked about, when it is asked.

What changes of a state ask, too, is answered by a world that shows it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from planlang.geometry import Pose
from planlang.state import Grip, WorldState
from planlang.state.questions import Point, thing_of
from sim.kinematic import KinematicScene
from sim.leaves import inside
from sim.planning_world import PlanningWorld
from sim.scene import Body


class WorldMirror:
    """Planning world that answers for any state of its scene."""

    def __init__(self, world: PlanningWorld, robot: str) -> None:
        """``robot``: name in the states of the robot that is in the world."""
        self._world, self._robot = world, robot
        self._shown: WorldState | None = None
        self.queries = EngineQueries(world, self.at)
        """Answers for changes of any state."""

    def at(self, state: WorldState) -> PlanningWorld:
        """Return the world as it is in a state. What it answers holds until another state is asked for."""
        if state is not self._shown:
            self._shown = None  # if this is interrupted, the world is in no state
            become(self._world, self._robot, state)
            self._shown = state
        return self._world


def become(world: KinematicScene, robot: str, state: WorldState) -> None:
    """Bring a world to a state: what hands hold, the robot, joints, then all other poses.

    ``robot`` names the robot of the world in the state. Nothing moves yet: a body in the air of a true world falls once
    a hand releases it.
    """
    carried = state.carried()
    riders = carried - state.held.keys()
    for name in [name for name in world.attached() if name not in riders]:
        hands = state.held[name].hands if name in state.held else ()
        if name in world.attached() and world.holders(name) != tuple(hand.link for hand in hands):
            world.release(name)
    for leaf, link in world.led().items():
        if state.led.get(leaf) != link:
            world.let_go(leaf)
    if world.configuration() != state.robots[robot]:
        world.set_configuration(state.robots[robot])
    for leaf, value in state.joints.items():
        if world.joint(leaf) != value:
            world.set_joint(leaf, value)
        if leaf in state.led and leaf not in world.led():
            world.lead(state.led[leaf], leaf)
    world.arrange(state)
    for name, grip in state.held.items():
        if name not in world.attached():
            _put_into_hands(world, name, grip, state)
    world.recall_touched(state.touched)


def _put_into_hands(world: KinematicScene, name: str, grip: Grip, state: WorldState) -> None:
    """Attach an object to the hands that hold it, after it was moved there with all that stands on it.

    At a start with things in hand, their poses are those in the hand already.
    """
    in_hand = world.link_pose(grip.link) @ grip.offset
    poses = {one: state.poses[one] for one in (name, *grip.riders)}
    if poses[name] != in_hand:
        motion = in_hand @ poses[name].inverse()
        poses = {one: motion @ pose for one, pose in poses.items()}
    for one, pose in poses.items():
        world.set_pose(one, pose)
    for hand in grip.hands:
        world.attach(hand.link, name)


class EngineQueries:
    """Implements :class:`planlang.state.Queries` by the rays and bodies of an engine."""

    def __init__(self, world: KinematicScene, at: Callable[[WorldState], KinematicScene]) -> None:
        """``at`` shows a state in the world, in which nothing has come to be yet."""
        self._at, self.rules, self._things = at, world.scene.rules, dict(world.gravity.bodies.bodies)
        self._heats: dict[str, tuple[str, bool] | None] = {}
        """Results of :meth:`heated_by`, valid until something moves or a device is switched."""
        self._heats_at: object = None

    def thing(self, name: str) -> Body | None:
        """Look up a thing of the start; None for a name that had no thing then."""
        return self._things.get(name)

    def pose(self, state: WorldState, name: str) -> Pose:
        """Locate a thing in the map; one that is held is in the hand."""
        return self._at(state).pose(name)

    def under(self, state: WorldState, name: str) -> str | None:
        """Find what a thing lies on."""
        return self._at(state).gravity.under(name)

    def below(self, state: WorldState, point: Point, but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the thing ``but`` counts as absent."""
        return self._at(state).gravity.below(point, but)

    def rest(self, state: WorldState, name: str) -> Pose | None:
        """Find where a thing would come to rest if released; None if nothing is below."""
        rest, support = self._at(state).gravity.rest(name)
        return None if support is None else rest

    def heated_by(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        """Find the device that heats a thing, and whether the thing is inside it.

        A thing is heated by a device below it, also through other things in between, or by one that it is inside of.
        """
        bodies = self._at(state).gravity.bodies
        now = bodies.moves, bodies.carries, tuple(state.matter.states.items())
        if now != self._heats_at:
            self._heats, self._heats_at = {}, now
        if name not in self._heats:
            self._heats[name] = self._heat_of(state, name)
        return self._heats[name]

    def _heat_of(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        below, seen = self.under(state, name), {name}
        while below is not None and below not in seen:
            if state.matter.is_on(below):
                return below, False
            seen.add(below)
            below = self.under(state, below)
        place = np.array([self.pose(state, name).position])
        for device in filter(state.matter.is_on, state.matter.states):
            size = thing_of(state, device, self).size
            if device != name and inside(self.pose(state, device), size, place)[0]:
                return device, True
        return None
