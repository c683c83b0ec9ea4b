"""A planning world that mirrors states: it is brought to the one that is asked about, when it is asked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from planlang.geometry import Pose
from planlang.state import Grip, WorldState
from sim.planning_world import PlanningWorld

T = TypeVar("T")


def state_of(world: PlanningWorld, robot: str) -> WorldState:
    """Take over the state of a world as it is; ``robot`` names the robot in it. Nothing is in its hands yet."""
    joints = {joint.leaf: world.joint(joint.leaf) for joint in world.scene.joints}
    return WorldState({robot: world.configuration()}, dict(world.poses()), joints, matter=world.changes.matter)


class WorldMirror:
    """Planning world that answers for any state of its scene."""

    def __init__(self, world: PlanningWorld, robot: str) -> None:
        """``robot``: name in the states of the robot that is in the world."""
        self._world, self._robot = world, robot
        self._shown: WorldState | None = None
        self._known = dict.fromkeys(world.names())
        """Bodies of all states so far: others were made in the world itself, and no state knows of them yet."""

    def at(self, state: WorldState) -> PlanningWorld:
        """Return the world as it is in a state. What it answers holds until another state is asked for."""
        if state is not self._shown:
            before, self._shown = self._shown, None  # if this is interrupted, the world is in no state
            self._become(state, before)
            self._shown = state
        return self._world

    def after(self, state: WorldState, happening: Callable[[PlanningWorld], T]) -> tuple[WorldState, T]:
        """Let something happen to things in a state; return the state after it, and what ``happening`` returned.

        Destroyed bodies have no pose then. Created ones are in the world, but not in the state: they get a pose there
        when it is said what they are.
        """
        world, carried = self.at(state), state.carried()
        self._shown = None
        result = happening(world)
        there, poses = world.poses(), dict[str, Pose]()
        for name, pose in state.poses.items():
            if name in state.away or (name in carried and name in there):
                poses[name] = pose
            elif name in there:
                poses[name] = pose if pose == there[name] else there[name]
        held = {name: grip for name, grip in state.held.items() if name in poses}
        self._shown = replace(state, poses=poses, held=held, matter=world.changes.matter)
        return self._shown, result

    def _become(self, state: WorldState, before: WorldState | None) -> None:
        """Bring the world to a state: what hands hold, the robot, joints, then all other poses."""
        world, carried = self._world, state.carried()
        riders = carried - state.held.keys()
        for name in [name for name in world.attached() if name not in riders]:
            hands = state.held[name].hands if name in state.held else ()
            if name in world.attached() and world.holders(name) != tuple(hand.link for hand in hands):
                world.release(name)
        for leaf, link in world.led().items():
            if state.led.get(leaf) != link:
                world.let_go(leaf)
        there = state.robots[self._robot]
        if before is None or before.robots[self._robot] != there:
            world.set_configuration(there)
        for leaf, value in state.joints.items():
            if world.joint(leaf) != value:
                world.set_joint(leaf, value)
            if leaf in state.led and leaf not in world.led():
                world.lead(state.led[leaf], leaf)
        self._place(state, carried)
        for name, grip in state.held.items():
            if name not in world.attached():
                _put_into_hands(world, name, grip, state)
        world.recall_touched(state.touched)
        world.changes.matter = state.matter

    def _place(self, state: WorldState, carried: frozenset[str]) -> None:
        """Bring all bodies that no hand carries to their poses, and take those out that are not in the room."""
        world = self._world
        there = world.poses()
        present = {name: pose for name, pose in state.poses.items() if name not in state.away}
        for name in self._known:
            if name in there and name not in present:
                world.remove(name)
        for name, pose in present.items():
            if name not in there:
                world.restore(name)
            at = there[name] if name in there else world.pose(name)
            if name not in carried and at is not pose and at != pose:
                world.set_pose(name, pose)
        self._known |= dict.fromkeys(state.poses)


def _put_into_hands(world: PlanningWorld, name: str, grip: Grip, state: WorldState) -> None:
    """Move an object, with all that stands on it, into the hands, and attach it."""
    motion = world.link_pose(grip.link) @ grip.offset @ state.poses[name].inverse()
    for one in (name, *grip.riders):
        world.set_pose(one, motion @ state.poses[one])
    for hand in grip.hands:
        world.attach(hand.link, name)
