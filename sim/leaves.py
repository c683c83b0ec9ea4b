"""The leaves of a world: what its joints' values are, what moves with each, and which hand moves one."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from sim.bodies import Bodies
from sim.joints import Articulation
from sim.scene import Scene

SLIPPED = 0.03
"""A hand that is farther than this from the place of a leaf that it held holds it no more [m]."""


@dataclass(slots=True)
class Led:
    """A leaf that follows a hand: the hand goes where it goes, the leaf as far as its joint lets it."""

    link: str
    """The link of the robot whose origin is where the fingers are closed."""
    closed: Array
    """Where that place of the leaf is in the map when the leaf is shut, (3,)."""
    hand: frozenset[int]
    """Numbers of the hand's links; they may touch the leaf and its parts."""
    touched: frozenset[str]
    """Bodies that the leaf may touch: what it belongs to, and what it touched at the beginning."""
    carried: dict[str, Pose] = field(default_factory=dict)
    """Bodies inside of it, with their poses in its frame."""
    placed: int | None = None
    """The robot's ``moves`` when the leaf was put where the hand has it."""


class Leaves:
    """The joints of a scene in one world."""

    def __init__(self, scene: Scene, bodies: Bodies) -> None:
        self.joints: dict[str, Articulation] = {joint.leaf: joint for joint in scene.joints}
        self.values = dict.fromkeys(self.joints, 0.0)
        self.led: dict[str, Led] = {}
        self._bodies = bodies
        self.movable = [body.name for body in scene.bodies if body.movable]
        """What may lie inside of leaves."""

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
        led = self.led[leaf]
        self.put(leaf, self.joints[leaf].value_at(led.closed, np.array(hand.position)), led.carried)

    def strayed(self, leaf: str, hand: Pose) -> bool:
        """Return whether a hand has left the place of a leaf that it held."""
        there = moved(self.joints[leaf].motion(self.values[leaf]).matrix(), self.led[leaf].closed)
        return float(np.linalg.norm(there - np.array(hand.position))) > SLIPPED

    def held_place(self, leaf: str, hand: Pose) -> Array:
        """Return where the place of a leaf at which a hand is now would be if it were shut, (3,) in the map."""
        return moved(self.joints[leaf].motion(self.values[leaf]).inverse().matrix(), np.array(hand.position))

    def hands_on(self, body: str) -> frozenset[int]:
        """Return the numbers of the links that may touch a body because they lead the leaf that it belongs to."""
        return frozenset().union(*(led.hand for leaf, led in self.led.items() if body in self.joints[leaf].bodies))


def inside(pose: Pose, size: Sequence[float], points: Array) -> NDArray[np.bool_]:
    """Return which of points (n, 3) are inside a box, (n,)."""
    local = rotated(pose.rotation.T, points - np.array(pose.position))
    return np.asarray(np.all(np.abs(local) < np.asarray(size) / 2, axis=1))
