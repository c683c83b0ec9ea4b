"""Hand poses that relations ask for: grasps, poses above things, poses that offer something to a person.

All poses are of an arm's tip frame in the map, (k, 4, 4), to be taken one after another.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from executive.locations.block import Block
from planlang.protocols import Array, Pose

APPROACH = 0.08
"""How far back along the approach direction the pre-grasp is [m] (rules of `in_front_of`)."""
LIFTS = (0.05, 0.08, 0.03)
"""How far up the hand goes with what it has grasped, then back [m]; places are judged by the first."""
CLEARANCES = (0.04, 0.07, 0.11)
"""Heights of the lowest point above a surface for `above` [m]; the relation allows 0.02 to 0.15."""
YAW_OFFSETS = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9, 1.25, -1.25)
"""Approach directions relative to the line from the robot to the target [rad]."""
PITCHES = (0.0, 0.4, 0.8, math.pi / 2)
"""How far the approach direction points down [rad]: from the side, tilted, from the top."""


@dataclass(frozen=True, slots=True)
class HandFrame:
    """How a tip frame is meant: unit vectors of the approach and of the closing direction in it."""

    approach: tuple[float, float, float]
    closing: tuple[float, float, float]

    def rotation(self, approach: Array, closing: Array) -> Array:
        """The rotation (3, 3) that turns the frame's approach and closing axes into the given map directions."""
        return np.asarray(_axes(approach, closing) @ _axes(self.approach, self.closing).T)


def _axes(first: Sequence[float] | Array, second: Sequence[float] | Array) -> Array:
    """Two orthogonal unit vectors and their cross product as columns (3, 3); numpy's own is slow for single vectors."""
    a, b, c = first
    d, e, f = second
    return np.array([[a, d, b * f - c * e], [b, e, c * d - a * f], [c, f, a * e - b * d]])


@dataclass(frozen=True, slots=True)
class HandPlan:
    """One way to satisfy a reach: tip poses in order, a label for people, and which body the hand may touch."""

    label: str
    poses: Array
    touches: str | None = None
    opened: bool = False
    """Whether the fingers are open meanwhile."""


def transform(rotation: Array, position: Array) -> Array:
    """Homogeneous matrix (4, 4)."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = position
    return matrix


def shifted(pose: Array, offset: Array) -> Array:
    """The pose (4, 4) moved by a map vector (3,)."""
    moved = pose.copy()
    moved[:3, 3] += offset
    return moved


def grasp_plans(
    name: str, block: Block, eye: Array, frame: HandFrame, max_opening: float, *, pitches: Sequence[float] = PITCHES
) -> Iterator[HandPlan]:
    """Pre-grasp, grasp, lift and retreat for a body, from the side that faces ``eye`` (2,) first.

    The fingers close horizontally, across an extent that fits into ``max_opening`` [m].
    """
    bearing = math.atan2(block.y - eye[1], block.x - eye[0])
    for pitch in pitches:
        for offset in YAW_OFFSETS:
            yaw = bearing + offset
            closing = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
            if extent(block, closing) > max_opening:
                continue
            approach = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)])
            for roll in (1.0, -1.0):
                grasp = transform(frame.rotation(approach, roll * closing), block.centre)
                lift = shifted(grasp, np.array([0.0, 0.0, LIFTS[0]]))
                poses = np.stack(
                    [shifted(grasp, -APPROACH * approach), grasp, lift, shifted(lift, -APPROACH * approach)]
                )
                yield HandPlan(f"grasp {name} at yaw {yaw:.2f} pitch {pitch:.2f}", poses, name, opened=True)


def extent(block: Block, direction: Array) -> float:
    """Width of the block across a horizontal direction [m]."""
    if block.round:
        return 2 * max(block.half_x, block.half_y)
    c, s = math.cos(block.yaw), math.sin(block.yaw)
    x, y = map(float, direction[:2])
    return 2 * (abs(x * c + y * s) * block.half_x + abs(y * c - x * s) * block.half_y)


def upright_rotations(bearing: float, frame: HandFrame, held: Pose | None) -> Iterator[tuple[float, Array]]:
    """Level hands, or hands that keep what they hold upright, turned about the vertical; bearing first.

    ``held`` is the pose of the held object in the tip frame. Yields (yaw, rotation (3, 3)).
    """
    if held is None:
        bases = []
        for roll in (1.0, -1.0):
            bases.append(frame.rotation(np.array([1.0, 0.0, 0.0]), np.array([0.0, roll, 0.0])))
    else:
        bases = [held.matrix()[:3, :3].T]
    for offset in YAW_OFFSETS:
        for base in bases:
            approach = base @ np.asarray(frame.approach)
            turn = bearing + offset - math.atan2(approach[1], approach[0])
            c, s = math.cos(turn), math.sin(turn)
            yield bearing + offset, np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ base


@dataclass(frozen=True, slots=True)
class Held:
    """What a hand holds: name, pose in the tip frame, size of its box [m]."""

    name: str
    pose: Pose
    size: tuple[float, float, float]

    def lowest(self, rotation: Array) -> float:
        """Height of the object's lowest point relative to the tip, for a tip rotation (3, 3) [m]."""
        matrix = self.pose.matrix()
        turned = rotation @ matrix[:3, :3]
        centre: Array = rotation @ matrix[:3, 3]
        half_height = np.abs(turned[2]) @ (np.asarray(self.size) / 2)
        return float(centre[2] - half_height)

    def offset(self, rotation: Array) -> Array:
        """The object's centre relative to the tip, in the map (3,)."""
        return np.asarray(rotation @ np.asarray(self.pose.position))


def above_plans(
    name: str, block: Block, eye: Array, frame: HandFrame, held: Held | None, hand_radius: float, *, most: int = 6
) -> Iterator[HandPlan]:
    """Hand level over the block's top, so that what it holds would come down whole on it; nearest to ``eye`` first."""
    inset = (max(held.size[:2]) / 2 if held else hand_radius) + 0.03
    points = block.grid(0.08, inset)
    nearest = block.nearest(eye[None, :2], inset)
    points = np.concatenate([nearest, points])
    order = np.argsort(np.hypot(points[:, 0] - eye[0], points[:, 1] - eye[1]), kind="stable")
    for point in points[order[:most]]:
        bearing = math.atan2(point[1] - eye[1], point[0] - eye[0])
        for clearance in CLEARANCES:
            for yaw, rotation in upright_rotations(bearing, frame, held.pose if held else None):
                lowest = held.lowest(rotation) if held else -hand_radius
                offset = held.offset(rotation) if held else np.zeros(3)
                tip = np.array([point[0] - offset[0], point[1] - offset[1], block.high + clearance - lowest])
                label = f"above {name} by {clearance:.2f} at yaw {yaw:.2f}"
                yield HandPlan(label, transform(rotation, tip)[None])


@dataclass(frozen=True, slots=True)
class ComfortZone:
    """Where a person takes things: in front of their shoulders, within the length of their arms."""

    shoulders: tuple[tuple[float, float, float], ...]
    facing: float
    """Heading of the person [rad]."""
    arm_length: float
    contains: Callable[[Array], bool]
    """Whether a map point (3,) is one at which the person would take something."""

    def points(self) -> Array:
        """Points of the zone, most comfortable first, (n, 3); sparse."""
        turns = (0.0, 0.35, -0.35, 0.7, -0.7, 0.95, -0.95)
        found: dict[tuple[float, float, float], None] = {}
        for share in (0.7, 0.55, 0.85):
            for rise in (0.0, -0.12, 0.12):
                for turn in turns:
                    for x, y, z in self.shoulders:
                        step, heading = share * self.arm_length, self.facing + turn
                        point = (x + step * math.cos(heading), y + step * math.sin(heading), z + rise)
                        if self.contains(np.array(point)):
                            found[point] = None
        return np.array(list(found)).reshape(-1, 3)


def offer_plans(
    name: str, zone: ComfortZone, eye: Array, frame: HandFrame, held: Held | None, *, most: int = 8
) -> Iterator[HandPlan]:
    """Hand level, what it holds inside the person's comfort zone; nearest to ``eye`` first."""
    points = zone.points()
    order = np.argsort(np.hypot(points[:, 0] - eye[0], points[:, 1] - eye[1]).round(2), kind="stable")
    for point in points[order[:most]]:
        bearing = math.atan2(point[1] - eye[1], point[0] - eye[0])
        for yaw, rotation in upright_rotations(bearing, frame, held.pose if held else None):
            offset = held.offset(rotation) if held else np.zeros(3)
            yield HandPlan(f"offer to {name} at yaw {yaw:.2f}", transform(rotation, point - offset)[None])


def retreat_plans(name: str, grasp: Array, frame: HandFrame) -> Iterator[HandPlan]:
    """Back to where the hand came from with what it holds: along the approach, raised so that it clears its support.

    ``grasp`` (4, 4) is the tip pose at which the object was grasped.
    """
    approach = grasp[:3, :3] @ np.asarray(frame.approach)
    up = np.array([0.0, 0.0, 1.0])
    for rise in LIFTS:
        lift = shifted(grasp, rise * up)
        yield HandPlan(f"lift {name} by {rise:.2f}", np.stack([lift, shifted(lift, -APPROACH * approach)]), name)
