"""Grips of the handle of a door or drawer: poses of a hand's tip, with the fingers opened only as far as needed.

Fingers close across a bar, at its middle or at the point that is easiest to reach, and around a knob from the front in
any roll. The hand approaches square to the leaf or at an angle: from above to a low handle, from below to a high one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.locations.hand_solutions import base_matrices
from executive.robots.arms import ArmModel
from executive.robots.openings import ROOM, TIGHT, Fingers
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, inverse, moved, product, rigid, rotated
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

APPROACH, PAST = 0.08, 0.01
"""Distance of the pre-grasp from the grasp along the approach, and least clearance of the fingertips there [m]."""
PITCHES, STEEPEST = (0.0, 0.4, 0.9, 1.3), 1.31
"""Angles of the approach up or down from square to the leaf, and their largest sum with sideways angles [rad]."""
YAWS, FINER = (0.0, 0.4, -0.4, 0.8, -0.8), (0.0, 0.3, -0.3, 0.45, -0.45, 0.6, -0.6, 0.75, -0.75, 0.9, -0.9)
"""Sideways angles of the approach [rad]; finer ones beside a wall, where the hand or its fingers may collide."""
ROLLS = (0.0, math.pi / 2, math.pi / 4, -math.pi / 4)
"""Rolls of the hand to grasp a knob from the front [rad]."""
LAGS = (0.0, 0.5, 1.0)
"""Shares of the leaf's rotation that the hand does not follow, turning about a bar that is parallel to the hinge."""
PARALLEL = 0.95
"""Cosine above which two directions count as parallel."""
LONG = 1.5
"""Ratio of the longest to the second extent above which a handle is a bar, across which fingers close."""
END = 0.02
"""Least distance of a grip from the end of a bar: half the width of a finger [m]."""
BELOW_SHOULDER = 0.2
"""Height below the shoulder at which an arm reaches farthest to the front [m]."""
HELD = 0.006
"""Least length of the fingers in contact with a handle [m]; they reach at least to its middle."""
CLEAR = 0.003
"""Clearance between the fingertips and the leaf behind a handle [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Grips:
    """Grips of one handle by one hand."""

    starts: Array
    """Poses of the tip in the map at the handle (g, 4, 4)."""
    points: Array
    """Gripped points of the handle in the map (g, 3)."""
    turns: NDArray[np.bool_]
    """Whether the hand may turn about the handle, a bar parallel to the hinge (g,)."""
    fingers: Fingers
    """Opening of the hand for the approach."""
    approach: Array
    """Approach direction in the tip frame (3,)."""
    back: float
    """Distance of the pre-grasp from the grasp along the approach [m]."""

    def __len__(self) -> int:
        return len(self.starts)

    def chosen(self, which: NDArray[np.bool_]) -> Grips:
        """Select grips by a mask (g,)."""
        return replace(self, starts=self.starts[which], points=self.points[which], turns=self.turns[which])

    @property
    def before(self) -> Array:
        """Pre-grasp poses of the tip, from which the hand moves straight to the handle (g, 4, 4)."""
        return self.short_by(self.back)

    def short_by(self, away: float) -> Array:
        """Compute the poses of the tip (g, 4, 4) at a distance back along the approach [m]."""
        poses = self.starts.copy()
        poses[:, :3, 3] -= away * (self.starts[:, :3, :3] @ self.approach)
        return poses

    def along(self, joint: Articulation, values: Array) -> Array:
        """Compute the poses of the tip with the joint at each of ``values`` (n,), the first as it is now.

        Returns one series for each grip and each of :data:`LAGS` (g, l, n, 4, 4).
        """
        first = joint.motion(float(values[0])).inverse().matrix()
        motions = np.stack([product(joint.motion(value).matrix(), first) for value in values.tolist()])
        poses = motions[None, None] @ self.starts[:, None, None]
        centres = moved(motions[None], self.points[:, None])[:, None]
        cross = cross_matrix(np.array(joint.axis))
        angles = -np.outer(LAGS, values - values[0])[..., None, None]
        turns = np.eye(3) + np.sin(angles) * cross + (1 - np.cos(angles)) * product(cross, cross)
        lagging = np.broadcast_to(poses, (len(self), len(LAGS), *poses.shape[2:])).copy()
        lagging[..., :3, :3] = turns @ poses[..., :3, :3]
        lagging[..., :3, 3] = centres + rotated(turns, poses[..., :3, 3] - centres)
        return lagging


@dataclass(frozen=True, slots=True, eq=False)
class _Hand:
    """Extent of a hand while it closes; the fingertips may move forward as they close."""

    points: Array
    """Points in the tip frame that span the hand from open to closed (n, 3)."""
    ahead: float
    """Distance by which the hand extends ahead of the tip when it holds the handle [m]."""

    @staticmethod
    def closing(scene: PlanningScene, arm: ArmModel, fingers: Fingers, width: float) -> _Hand:
        """Compute the extent of a hand whose fingers close from an opening onto a ``width`` [m]."""
        hands = [hand_with(scene, arm, one) for one in arm.openings.closing(fingers, width)]
        return _Hand(np.concatenate(hands), float((hands[0] @ np.array(arm.frame.approach)).max()))


def grips_of(scene: PlanningScene, arm: ArmModel, joint: Articulation, *, tight: bool = False) -> Grips:
    """Sample the grips of a leaf's handle at its current pose, the straightest approaches first.

    ``tight``: open the fingers less, and approach in more directions and from nearer.
    """
    assert joint.handle is not None
    pose, size = scene.bodies.pose(joint.handle), np.asarray(scene.bodies.size(joint.handle))
    outwards, middle = outwards_of(scene, joint), np.array(pose.position)
    order = np.argsort(size)
    is_bar = bool(size[order[2]] > LONG * size[order[1]])
    easiest = float(np.mean([arm.shoulder_low[2], arm.shoulder_high[2]])) - BELOW_SHOULDER
    lengthways = 0.5 * float(size[order[2]]) - END if is_bar else 0.0
    yaws = FINER if tight else YAWS
    directions = [
        (bar, approach, closing)
        for bar in _bars(pose.rotation[:, order[2]], outwards, is_bar=is_bar)
        for approach, closing in _directions(outwards, bar, yaws, down=middle[2] < easiest, is_bar=is_bar)
    ]
    widths = [float(np.abs(pose.rotation.T @ closing) @ size) for _, _, closing in directions]
    fingers = _opened(
        arm, max((one for one in widths if one <= arm.max_opening), default=0.0), TIGHT if tight else ROOM
    )
    hands = {one: _Hand.closing(scene, arm, fingers, one) for one in sorted(set(widths)) if one <= arm.max_opening}
    starts, points, turns = [], [], []
    for (bar, approach, closing), width in zip(directions, widths, strict=True):
        if width > arm.max_opening:
            continue
        turning = joint.kind is JointKind.HINGED and abs(float(bar @ np.array(joint.axis))) > PARALLEL
        for along in _along(bar, lengthways, easiest - middle[2]):
            for sign in (1.0, -1.0):
                rotation = arm.frame.rotation(approach, sign * closing)
                point = middle + along * bar
                short = _short_of(scene, joint, rotation @ hands[width].points.T, point, outwards, approach)
                depth = float(np.abs(pose.rotation.T @ approach) @ size) / 2
                if short <= hands[width].ahead + min(0.0, depth - HELD):
                    starts.append(rigid(rotation, point - short * approach))
                    points.append(point)
                    turns.append(turning)
    ahead = max((one.ahead for one in hands.values()), default=0.0)
    back = min(APPROACH, ahead + 0.5 * float(size[order[1]]) + PAST) if tight else APPROACH
    return Grips(
        np.array(starts).reshape(-1, 4, 4),
        np.array(points).reshape(-1, 3),
        np.array(turns, bool),
        fingers,
        np.array(arm.frame.approach),
        back,
    )


def _opened(arm: ArmModel, width: float, room: float) -> Fingers:
    """Find the opening for a width [m], with ``room`` beside it [m]."""
    if not arm.openings.fingers:
        return ()
    return arm.openings.fingers[int(arm.openings.around(np.array([[width, 0.0]]), room)[0])]


def hand_with(scene: PlanningScene, arm: ArmModel, fingers: Fingers = ()) -> Array:
    """Compute points (n, 3) in the tip frame that span a hand with ``fingers`` at given positions, by default as is."""
    world, tip = scene.world, arm.tip
    current = world.configuration()
    to_tip = inverse(world.link_pose(tip, Configuration(current.base, {**current.joints, **dict(fingers)})).matrix())
    points = world.robot.points(sorted(world.robot.hand_of(tip)))
    world.link_pose(tip)  # side effect: puts the robot's model back into its current configuration
    return np.asarray(moved(to_tip, np.concatenate(points)))


def outwards_of(scene: PlanningScene, joint: Articulation) -> Array:
    """Compute the outward normal (3,) of a leaf's free side in the map, at its current pose."""
    if joint.kind is JointKind.PRISMATIC and not joint.frame:
        return np.array(joint.axis)
    if joint.is_knob and joint.holder is not None:
        arrow = np.array(scene.bodies.pose(joint.leaf).position) - scene.bodies.pose(joint.holder).position
        return np.array(joint.axis) * math.copysign(1.0, float(arrow @ joint.axis))
    leaf, handle = scene.bodies.pose(joint.leaf), scene.bodies.pose(joint.handle or joint.leaf)
    normal = leaf.rotation[:, int(np.argmin(scene.bodies.size(joint.leaf)))]
    opens = float(np.cross(joint.axis, np.array(leaf.position) - np.array(joint.point)) @ normal)
    away = float((np.array(handle.position) - np.array(leaf.position)) @ normal)
    return np.asarray(normal * math.copysign(1.0, away if abs(away) > 1e-3 else opens))


def on_side_of_handle(scene: PlanningScene, joint: Articulation, bases: Array) -> NDArray[np.bool_]:
    """Mark the base poses (m, 3) that are on the side of a leaf where its handle is."""
    leaf = np.array(scene.bodies.pose(joint.leaf).position)
    return np.asarray((bases[:, :2] - leaf[:2]) @ outwards_of(scene, joint)[:2] > 0)


def within_reach(arm: ArmModel, bases: Array, tips: Array) -> tuple[NDArray[np.intp], Array]:
    """Count the leading positions of a tip (n, 3) that are within an arm's length from base poses (m, 3).

    Also returns the largest deviation of the distance from the comfortable 0.65 of the reach (m,).
    """
    shoulder = moved(base_matrices(bases), (arm.shoulder_low + arm.shoulder_high) / 2)
    low, high = arm.shoulder_low[2], arm.shoulder_high[2]
    gaps = shoulder[:, None] - tips[None]
    gaps[..., 2] = np.clip(tips[None, :, 2], low, high) - tips[None, :, 2]
    away = np.linalg.norm(gaps, axis=2) / arm.reach
    reached = np.logical_and.accumulate(away < 1.0, axis=1)
    strain = np.where(reached, np.abs(away - 0.65), 0.0).max(axis=1)
    return np.asarray(reached.sum(axis=1)), strain


def shut_out(scene: PlanningScene, joint: Articulation, home: Sequence[float], bases: Array) -> NDArray[np.bool_]:
    """Mark the bases (m, 3) that a shut door between rooms parts from a base pose."""
    shut = scene.world.scene.body(joint.leaf)
    normal = shut.pose.rotation[:2, int(np.argmin(shut.size))]
    sides = (np.vstack([home, bases])[:, :2] - shut.pose.position[:2]) @ normal > 0
    return np.asarray(sides[1:] != sides[0])


def _bars(longest: Array, outwards: Array, *, is_bar: bool) -> list[Array]:
    """List the unit vectors (3,) across which fingers close: the axis of a bar, or several rolls for a knob."""
    if is_bar:
        return [_square(longest, outwards)] if abs(float(longest @ outwards)) < PARALLEL else []
    up = _square(np.eye(3)[2] if abs(outwards[2]) < PARALLEL else np.eye(3)[0], outwards)
    across = np.cross(outwards, up)
    return [math.cos(roll) * up + math.sin(roll) * across for roll in ROLLS]


def _directions(
    outwards: Array, bar: Array, yaws: Sequence[float], *, down: bool, is_bar: bool
) -> Iterator[tuple[Array, Array]]:
    """Yield approach and closing directions (3,), square to the leaf first; ``down``: from above, else from below."""
    up = _square(np.eye(3)[2] if abs(outwards[2]) < PARALLEL else bar, outwards)
    side, sign = np.cross(up, outwards), 1.0 if down else -1.0
    pairs = [(p, y) for p in PITCHES for y in yaws if p + abs(y) < STEEPEST and (is_bar or p + abs(y) < 1.0)]
    for pitch, yaw in sorted(pairs, key=lambda pair: pair[0] + abs(pair[1])):
        level = math.cos(yaw) * outwards + math.sin(yaw) * side
        approach = -(math.cos(pitch) * level + sign * math.sin(pitch) * up)
        closing = np.cross(bar, approach)
        length = float(np.linalg.norm(closing))
        if length > 0.3:
            yield approach, closing / length


def _along(bar: Array, lengthways: float, higher: float) -> tuple[float, ...]:
    """Choose grip positions along a bar, from its middle [m]: the one nearest to the easiest height, and the middle."""
    if lengthways <= END:
        return (0.0,)
    if abs(float(bar[2])) < PARALLEL:
        return (0.0, lengthways, -lengthways)
    best = float(np.clip(higher * math.copysign(1.0, bar[2]), -lengthways, lengthways))
    return (best, 0.0) if abs(best) > END else (0.0,)


def _short_of(
    scene: PlanningScene, joint: Articulation, corners: Array, point: Array, outwards: Array, approach: Array
) -> float:
    """Compute how far the tip must stop before a point of the handle, so that fingers do not touch the leaf [m].

    ``corners``: points that span the hand, relative to its tip, in map directions (3, n).
    """
    leaf = scene.bodies.pose(joint.leaf)
    thick = float(np.abs(leaf.rotation.T @ outwards) @ np.asarray(scene.bodies.size(joint.leaf))) / 2
    behind = thick if joint.is_knob else float((point - np.array(leaf.position)) @ outwards) - thick
    if behind < 0:
        return 0.0
    lacking = max(0.0, -float((outwards @ corners).min()) - behind + CLEAR)
    return lacking / max(-float(approach @ outwards), 1e-3)


def _square(direction: Array, to: Array) -> Array:
    """Project a direction (3,) onto the plane perpendicular to another, and normalise it."""
    part = direction - float(direction @ to) * to
    return np.asarray(part / np.linalg.norm(part))
