"""The leaves of a world: what its joints' values are, what moves with each, and which hand moves one."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.records import dataclass
from sim.bodies import Bodies
from sim.joints import Articulation
from sim.scene import Scene

SLIPPED = 0.03
"""A hand that is farther than this from the place of a leaf that it held holds it no more [m]."""


@dataclass(slots=True)
class Led:
    """A leaf that follows a hand: the hand goes where it goes, the leaf as far as its joint lets it."""

    link: str
    """The link of the robot that holds its handle."""
    grip: Array
    """The middle of the handle in the link's frame, (3,): the hand may turn about it."""
    closed: Array
    """The same in the map when the leaf is shut, (3,)."""
    hand: frozenset[int]
    """Numbers of the hand's links; they may touch the handle."""
    touched: frozenset[str]
    """Bodies that the leaf may touch: what it belongs to, and what it touched at the beginning."""
    carried: dict[str, Pose] = field(default_factory=dict)
    """Bodies inside of it, with their poses in its frame."""
    placed: int | None = None
    """The robot's ``moves`` when the leaf was put where the hand has it."""
    turn: Pose | None = None
    """Of a knob, the middle of which stays where it is: how it has moved, in the link's frame."""


_HERE = Pose((0.0, 0.0, 0.0))


class Leaves:
    """The joints of a scene in one world."""

    def __init__(self, scene: Scene, bodies: Bodies) -> None:
        self.joints: dict[str, Articulation] = {joint.leaf: joint for joint in scene.joints}
        self.values = dict.fromkeys(self.joints, 0.0)
        self.led: dict[str, Led] = {}
        self._bodies = bodies
        self.movable = [body.name for body in scene.bodies if body.movable]
        """The spaces inside of leaves in which things may lie."""
        for joint in scene.joints:
            if joint.first:
                self.put(joint.leaf, joint.first, self.inside(joint.leaf))

    def put(self, leaf: str, value: float, carried: Mapping[str, Pose]) -> None:
        """Move a leaf, with its parts and what lies inside of it, to a value of its joint."""
        joint, motion = self.joints[leaf], self.joints[leaf].motion(value)
        self.values[leaf] = value
        for name in joint.bodies:
            closed = self._bodies.bodies[name].pose
            self._bodies.place(name, motion @ closed if value else closed)
        for name, offset in carried.items():
            self._bodies.place(name, self._bodies.poses[leaf] @ offset)

    def inside(self, leaf: str, but: Collection[str] = ()) -> dict[str, Pose]:
        """Return the movable bodies inside a leaf, with their poses in its frame."""
        size = self._bodies.bodies[leaf].size
        pose, poses = self._bodies.poses[leaf], self._bodies.poses
        movable = [name for name in self.movable if name not in but and name not in self._bodies.removed]
        found = inside(pose, size, np.array([poses[name].position for name in movable]).reshape(-1, 3))
        return {movable[index]: pose.inverse() @ poses[movable[index]] for index in np.flatnonzero(found).tolist()}

    def follow(self, leaf: str, hand: Pose) -> None:
        """Move a leaf that is led to where its hand is."""
        led, joint = self.led[leaf], self.joints[leaf]
        at = moved(hand.matrix(), led.grip)
        value = joint.value_at(led.closed, at) if led.turn is None else joint.value_of(_HERE, hand @ led.turn)
        self.put(leaf, value, led.carried)

    def strayed(self, leaf: str, hand: Pose) -> bool:
        """Return whether a hand has left the handle that it held."""
        led = self.led[leaf]
        there = moved(self.joints[leaf].motion(self.values[leaf]).matrix(), led.closed)
        return float(np.linalg.norm(there - moved(hand.matrix(), led.grip))) > SLIPPED

    def leaf_of(self, body: str) -> str | None:
        """Return the leaf that a body is, or is a part of."""
        whole = (leaf for leaf, joint in self.joints.items() if body in joint.bodies)
        return body if body in self.joints else next(whole, None)

    def handle(self, leaf: str) -> Array:
        """Return the middle of a leaf's handle, of the leaf itself if it has none, (3,) in the map when it is shut."""
        return np.array(self._bodies.bodies[self.joints[leaf].handle or leaf].pose.position)

    def leader(self, body: str) -> str | None:
        """Return the link of the robot that moves a leaf, a part of one, or what lies inside of one; None without."""
        moving = ((one.link, (*self.joints[leaf].bodies, *one.carried)) for leaf, one in self.led.items())
        return next((link for link, bodies in moving if body in bodies), None)

    def hands_on(self, body: str) -> frozenset[int]:
        """Return the numbers of the links that may touch a handle because they are closed on it."""
        return frozenset().union(*(led.hand for leaf, led in self.led.items() if body == self.joints[leaf].handle))


def inside(pose: Pose, size: Sequence[float], points: Array) -> NDArray[np.bool_]:
    """Return which of points (n, 3) are inside a box, (n,)."""
    local = rotated(pose.rotation.T, points - np.array(pose.position))
    return np.asarray(np.all(np.abs(local) < np.asarray(size) / 2, axis=1))
