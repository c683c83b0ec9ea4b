"""The leaves of a world: joint values, what moves with each leaf, and which hand moves it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.records import dataclass
from sim.bodies import Bodies
from sim.joints import HALFWAY, Articulation, Control
from sim.scene import Scene

SLIPPED = 0.03
"""Distance between a hand and the handle that it holds beyond which the grip is lost [m]."""


@dataclass(slots=True)
class LeafGrasp:
    """Grasp on the handle of a leaf: the leaf follows the hand as far as its joint allows."""

    link: str
    """Link of the robot that holds the handle."""
    handle: str | None
    """The handle that it holds."""
    grip: Array
    """Centre of the handle in the link's frame, (3,): the hand may turn about it."""
    closed: Array
    """Centre of the handle in the map when the leaf is closed, (3,)."""
    hand: frozenset[int]
    """Numbers of the hand's links, which may touch the handle."""
    touched: frozenset[str]
    """Bodies that the leaf may touch: its holder or frame, and those near it when it was grasped."""
    carried: dict[str, Pose] = field(default_factory=dict)
    """Bodies inside the leaf, with their poses in its frame."""
    placed: int | None = None
    """Value of the robot's ``moves`` when the leaf was last placed."""
    turn: Pose | None = None
    """For a knob, whose centre stays in place: its displacement in the link's frame."""


class Leaves:
    """Joint values of a scene's leaves in one world."""

    def __init__(self, scene: Scene, bodies: Bodies) -> None:
        self.joints: dict[str, Articulation] = {joint.leaf: joint for joint in scene.joints}
        self.values = dict.fromkeys(self.joints, 0.0)
        self.led: dict[str, LeafGrasp] = {}
        self._bodies = bodies
        self.movable = [body.name for body in scene.bodies if body.movable]
        for joint in scene.joints:
            if joint.first:
                self.put(joint.leaf, joint.first, self.inside(joint.leaf))

    def put(self, leaf: str, value: float, carried: Mapping[str, Pose]) -> None:
        """Move a leaf, with its parts and contents, to a joint value."""
        self.values[leaf] = value
        closed = {name: self._bodies.bodies[name].pose for name in self.joints[leaf].bodies}
        for name, pose in self.joints[leaf].poses(value, closed, carried).items():
            self._bodies.place(name, pose)

    def inside(self, leaf: str, but: Collection[str] = ()) -> dict[str, Pose]:
        """Find the movable bodies inside a leaf, with their poses in its frame."""
        removed, poses = self._bodies.removed, self._bodies.poses
        movable = {name: poses[name] for name in self.movable if name not in but and name not in removed}
        return contents(poses[leaf], self._bodies.bodies[leaf].size, movable)

    def follow(self, leaf: str, hand: Pose) -> None:
        """Move a grasped leaf to match the pose of its hand."""
        led, joint = self.led[leaf], self.joints[leaf]
        at = moved(hand.matrix(), led.grip)
        value = joint.value_at(led.closed, at) if led.turn is None else joint.value_of(IDENTITY, hand @ led.turn)
        self.put(leaf, value, led.carried)

    def strayed(self, leaf: str, hand: Pose) -> bool:
        """Check whether a hand has left the handle that it held."""
        led = self.led[leaf]
        there = moved(self.joints[leaf].motion(self.values[leaf]).matrix(), led.closed)
        return float(np.linalg.norm(there - moved(hand.matrix(), led.grip))) > SLIPPED

    def leaf_of(self, body: str) -> str | None:
        """Find the leaf to which a body belongs, as itself or as a part."""
        whole = (leaf for leaf, joint in self.joints.items() if body in joint.bodies)
        return body if body in self.joints else next(whole, None)

    def is_turned(self, knob: Control) -> bool:
        """Check whether a knob is turned far enough to switch its device."""
        return self.values[knob.body] >= HALFWAY * self.joints[knob.body].upper

    def handle(self, leaf: str, hand: Pose) -> str | None:
        """Find the handle of a leaf that is nearest to a hand; None for a leaf without any."""
        handles = self.joints[leaf].handles
        return min(handles, key=lambda name: self._bodies.poses[name].distance(hand), default=None)

    def closed(self, leaf: str, part: str | None) -> Array:
        """Locate the centre of a leaf's part, or of the leaf itself, (3,) in the map when the leaf is closed."""
        return np.array(self._bodies.bodies[part or leaf].pose.position)

    def leader(self, body: str) -> str | None:
        """Find the link of the robot that moves a leaf, one of its parts or its contents, if any."""
        moving = ((one.link, (*self.joints[leaf].bodies, *one.carried)) for leaf, one in self.led.items())
        return next((link for link, bodies in moving if body in bodies), None)

    def hands_on(self, body: str) -> frozenset[int]:
        """List the numbers of the links that may touch a handle because they hold it."""
        return frozenset().union(*(led.hand for led in self.led.values() if body == led.handle))


def contents(leaf: Pose, size: Sequence[float], poses: Mapping[str, Pose]) -> dict[str, Pose]:
    """Find which things at poses are inside a leaf, with their poses in its frame."""
    points = np.array([pose.position for pose in poses.values()]).reshape(-1, 3)
    back = leaf.inverse()
    is_inside = inside(leaf, size, points).tolist()
    return {name: back @ pose for (name, pose), within in zip(poses.items(), is_inside, strict=True) if within}


def inside(pose: Pose, size: Sequence[float], points: Array) -> NDArray[np.bool_]:
    """Check which of points (n, 3) are inside a box, (n,)."""
    local = rotated(pose.rotation.T, points - np.array(pose.position))
    return np.asarray(np.all(np.abs(local) < np.asarray(size) / 2, axis=1))
