"""Grips of the handle of a door or drawer: poses of the tip of a hand, its fingers open only as far as needed.

A bar is taken across, at its middle or at the point that is easiest to reach; a knob from the front, in any roll. The
hand comes square to the leaf or at an angle: from above to a low handle, from below to a high one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.robots.arms import ArmModel
from executive.robots.openings import ROOM, TIGHT, Fingers
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import cross_matrix, inverse, moved, product, rigid, rotated
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

APPROACH, PAST = 0.08, 0.01
"""Distance of the pose before a handle back along the approach direction, and of fingertips from the handle there, at
least [m]."""
PITCHES, STEEPEST = (0.0, 0.4, 0.9, 1.3), 1.31
"""Angles of the approach from square to the leaf, up or down, and the largest sum with those sideways [rad]."""
YAWS, FINER = (0.0, 0.4, -0.4, 0.8, -0.8), (0.0, 0.3, -0.3, 0.45, -0.45, 0.6, -0.6, 0.75, -0.75, 0.9, -0.9)
"""Angles of the approach sideways, and those beside a wall, which is met by the hand or else by its fingers [rad]."""
ROLLS = (0.0, math.pi / 2, math.pi / 4, -math.pi / 4)
"""Rolls in which a hand takes a knob from the front [rad]."""
LAGS = (0.0, 0.5, 1.0)
"""By how much of the leaf's turning a hand turns less, about a bar that is parallel to the hinge."""
PARALLEL = 0.95
"""Cosine from which on two directions count as parallel."""
LONG = 1.5
"""A handle that is longer than this many times its second extent is a bar: fingers close across it."""
END = 0.02
"""Distance from the end of a bar at which it is taken, at least: half the width of a finger [m]."""
BELOW_SHOULDER = 0.2
"""Height below the shoulder at which an arm reaches farthest to the front [m]."""
HELD = 0.006
"""Length of the fingers that is at a handle, at least [m]; and they come as far as its middle."""
CLEAR = 0.003
"""Room between the fingertips and the leaf behind a handle [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Grips:
    """Grips of one handle by one hand."""

    starts: Array
    """Poses of the tip in the map at the handle (g, 4, 4)."""
    points: Array
    """Points of the handle that are gripped (g, 3)."""
    turns: NDArray[np.bool_]
    """Whether the hand may turn about the handle, which is parallel to the hinge (g,)."""
    fingers: Fingers
    """How far the hand opens for it."""
    approach: Array
    """Approach direction in the tip frame (3,)."""
    back: float
    """Distance of the pose before the handle back along it [m]."""

    def __len__(self) -> int:
        return len(self.starts)

    def chosen(self, which: NDArray[np.bool_]) -> Grips:
        """Return some of them (g,)."""
        return replace(self, starts=self.starts[which], points=self.points[which], turns=self.turns[which])

    def raised(self, rise: float) -> Grips:
        """Return the same of a handle that is higher [m]."""
        starts = self.starts.copy()
        starts[:, 2, 3] += rise
        return replace(self, starts=starts, points=self.points + np.array([0.0, 0.0, rise]))

    @property
    def before(self) -> Array:
        """The poses of the tip from which the hand goes straight to the handle (g, 4, 4)."""
        return self.short_by(self.back)

    def short_by(self, away: float) -> Array:
        """Return the poses of the tip at some distance back along the approach direction [m] (g, 4, 4)."""
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
        found = np.broadcast_to(poses, (len(self), len(LAGS), *poses.shape[2:])).copy()
        found[..., :3, :3] = turns @ poses[..., :3, :3]
        found[..., :3, 3] = centres + rotated(turns, poses[..., :3, 3] - centres)
        return found


@dataclass(frozen=True, slots=True, eq=False)
class _Hand:
    """A hand that takes something between its fingers, which may come farther forward as they close."""

    points: Array
    """Points in the tip frame that span it from open to closed (n, 3)."""
    ahead: float
    """How far it goes ahead of the tip when it has the thing [m]."""

    @staticmethod
    def closing(scene: PlanningScene, arm: ArmModel, fingers: Fingers, width: float) -> _Hand:
        """Return a hand whose fingers close from an opening on a thing of some width [m]."""
        hands = [hand_with(scene, arm, one) for one in arm.openings.closing(fingers, width)]
        return _Hand(np.concatenate(hands), float((hands[0] @ np.array(arm.frame.approach)).max()))


def grips_of(scene: PlanningScene, arm: ArmModel, joint: Articulation, *, tight: bool = False) -> Grips:
    """Work out how a hand may take the handle of a leaf where that is now, the straightest ways first.

    ``tight``: fingers are opened less, and come from more sides and from nearer.
    """
    assert joint.handle is not None
    pose, size = scene.bodies.pose(joint.handle), np.asarray(scene.bodies.size(joint.handle))
    outwards, middle = outwards_of(scene, joint), np.array(pose.position)
    order = np.argsort(size)
    is_bar = bool(size[order[2]] > LONG * size[order[1]])
    easiest = float(np.mean([arm.shoulder_low[2], arm.shoulder_high[2]])) - BELOW_SHOULDER
    lengthways = 0.5 * float(size[order[2]]) - END if is_bar else 0.0
    yaws = FINER if tight else YAWS
    ways = [
        (bar, approach, closing)
        for bar in _bars(pose.rotation[:, order[2]], outwards, is_bar=is_bar)
        for approach, closing in _directions(outwards, bar, yaws, down=middle[2] < easiest, is_bar=is_bar)
    ]
    widths = [float(np.abs(pose.rotation.T @ closing) @ size) for _, _, closing in ways]
    fingers = _opened(
        arm, max((one for one in widths if one <= arm.max_opening), default=0.0), TIGHT if tight else ROOM
    )
    hands = {one: _Hand.closing(scene, arm, fingers, one) for one in sorted(set(widths)) if one <= arm.max_opening}
    starts, points, turns = [], [], []
    for (bar, approach, closing), width in zip(ways, widths, strict=True):
        if width > arm.max_opening:
            continue
        turning = joint.kind is JointKind.HINGED and abs(float(bar @ np.array(joint.axis))) > PARALLEL
        for along in _along(bar, lengthways, easiest - middle[2]):
            for sign in (1.0, -1.0):
                rotation = arm.frame.rotation(approach, sign * closing)
                point = middle + along * bar
                short = _short_of(scene, joint, rotation @ hands[width].points.T, point, outwards, approach)
                if short <= hands[width].ahead + min(0.0, _depth(pose, size, approach) - HELD):
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


def _depth(pose: Pose, size: Array, approach: Array) -> float:
    """Return half the extent of a box along an approach direction [m]."""
    return float(np.abs(pose.rotation.T @ approach) @ size) / 2


def _opened(arm: ArmModel, width: float, room: float) -> Fingers:
    """Return fingers open for a width [m], with so much room beside it."""
    if not arm.openings.fingers:
        return ()
    return arm.openings.fingers[int(arm.openings.around(np.array([[width, 0.0]]), room)[0])]


def hand_with(scene: PlanningScene, arm: ArmModel, fingers: Fingers = ()) -> Array:
    """Return points (n, 3) in the tip frame that span a hand with its fingers somewhere, if not told where they are."""
    world, tip = scene.world, scene.robot.arm(arm.name).tip
    now = world.configuration()
    back = inverse(world.link_pose(tip, Configuration(now.base, {**now.joints, **dict(fingers)})).matrix())
    points = world.robot.points(sorted(world.robot.hand_of(tip)))
    world.link_pose(tip)  # it shows the robot as it is again
    return np.asarray(moved(back, np.concatenate(points)))


def outwards_of(scene: PlanningScene, joint: Articulation) -> Array:
    """Compute the direction (3,) in the map in which the free side of a leaf shows now."""
    if joint.kind is JointKind.PRISMATIC:
        return np.array(joint.axis)
    if joint.is_knob and joint.holder is not None:
        arrow = np.array(scene.bodies.pose(joint.leaf).position) - scene.bodies.pose(joint.holder).position
        return np.array(joint.axis) * math.copysign(1.0, float(arrow @ joint.axis))
    leaf, handle = scene.bodies.pose(joint.leaf), scene.bodies.pose(joint.handle or joint.leaf)
    normal = leaf.rotation[:, int(np.argmin(scene.bodies.size(joint.leaf)))]
    opens = float(np.cross(joint.axis, np.array(leaf.position) - np.array(joint.point)) @ normal)
    away = float((np.array(handle.position) - np.array(leaf.position)) @ normal)
    return np.asarray(normal * math.copysign(1.0, away if abs(away) > 1e-3 else opens))


def _bars(longest: Array, outwards: Array, *, is_bar: bool) -> list[Array]:
    """Return the unit vectors across which fingers close: that of a bar, several of a knob."""
    if is_bar:
        return [_square(longest, outwards)] if abs(float(longest @ outwards)) < PARALLEL else []
    up = _square(np.eye(3)[2] if abs(outwards[2]) < PARALLEL else np.eye(3)[0], outwards)
    across = np.cross(outwards, up)
    return [math.cos(roll) * up + math.sin(roll) * across for roll in ROLLS]


def _directions(
    outwards: Array, bar: Array, yaws: Sequence[float], *, down: bool, is_bar: bool
) -> Iterator[tuple[Array, Array]]:
    """Yield approach and closing directions, square to the leaf first; ``down``: from above, else from below."""
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
    """Return where along a bar it is taken [m]: where it is nearest to the height of ease, and at its middle."""
    if lengthways <= END:
        return (0.0,)
    if abs(float(bar[2])) < PARALLEL:
        return (0.0, lengthways, -lengthways)
    best = float(np.clip(higher * math.copysign(1.0, bar[2]), -lengthways, lengthways))
    return (best, 0.0) if abs(best) > END else (0.0,)


def _short_of(
    scene: PlanningScene, joint: Articulation, corners: Array, point: Array, outwards: Array, approach: Array
) -> float:
    """Compute how far short of a point of the handle the tip stops, so that fingers do not touch the leaf behind [m].

    ``corners``: points that span the hand, about its tip (3, n).
    """
    leaf = scene.bodies.pose(joint.leaf)
    thick = float(np.abs(leaf.rotation.T @ outwards) @ np.asarray(scene.bodies.size(joint.leaf))) / 2
    behind = thick if joint.is_knob else float((point - np.array(leaf.position)) @ outwards) - thick
    if behind < 0:
        return 0.0
    lacking = max(0.0, -float((outwards @ corners).min()) - behind + CLEAR)
    return lacking / max(-float(approach @ outwards), 1e-3)


def _square(direction: Array, to: Array) -> Array:
    """Return the part of a direction that is square to another, as unit vector."""
    part = direction - float(direction @ to) * to
    return np.asarray(part / np.linalg.norm(part))
