"""Worlds that are brought to states: a planning world mirrors the one that is asked about, when it is asked."""

from __future__ import annotations

from planlang.state import Grip, WorldState
from sim.kinematic import KinematicScene
from sim.planning_world import PlanningWorld
from sim.queries import EngineQueries


class WorldMirror:
    """Planning world that answers for any state of its scene."""

    def __init__(self, world: PlanningWorld, robot: str) -> None:
        """``robot``: name in the states of the robot that is in the world."""
        self._world, self._robot = world, robot
        self._shown: WorldState | None = None
        self.queries = EngineQueries(self.at, world.scene.rules, world.gravity.bodies.bodies.values())
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
