"""Worlds that are brought to states: a planning world mirrors the one that is asked about, when it is asked."""

from __future__ import annotations

from planlang.state import Grip, WorldState
from sim.kinematic import KinematicScene
from sim.planning_world import PlanningWorld


class WorldMirror:
    """Planning world that answers for any state of its scene."""

    def __init__(self, world: PlanningWorld, robot: str) -> None:
        """``robot``: name in the states of the robot that is in the world."""
        self._world, self._robot = world, robot
        self._shown: WorldState | None = None
        self.queries = world.queries(self.at)
        """Answers for changes of any state."""

    def at(self, state: WorldState) -> PlanningWorld:
        """Return the world as it is in a state. What it answers holds until another state is asked for."""
        if state is not self._shown:
            before, self._shown = self._shown, None  # if this is interrupted, the world is in no state
            become(self._world, self._robot, state, before)
            self._shown = state
        return self._world


def become(world: KinematicScene, robot: str, state: WorldState, before: WorldState | None = None) -> None:
    """Bring a world to a state: what hands hold, the robot, joints, then all other poses.

    ``robot`` names the robot of the world in the state; ``before`` is the state that the world is in, if it is known.
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
    there = state.robots[robot]
    if before is None or before.robots[robot] != there:
        world.set_configuration(there)
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
    """Move an object, with all that stands on it, into the hands, and attach it."""
    motion = world.link_pose(grip.link) @ grip.offset @ state.poses[name].inverse()
    for one in (name, *grip.riders):
        world.set_pose(one, motion @ state.poses[one])
    for hand in grip.hands:
        world.attach(hand.link, name)
