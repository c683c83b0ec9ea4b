"""Base poses from which a closed hand pushes a button: inverse kinematics for many of them at once, best first."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import base_matrices
from executive.locations.standing import Standing
from executive.modules.furniture.leaf_grips import within_reach
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product, rigid
from planlang.records import dataclass

LEANS = (0.0, 0.4, -0.4, 0.75, -0.75)
"""Angles by which the hand leans up, down, or sideways from the button's normal [rad]."""
ROLLS = 8
"""Number of rolls of the hand about its approach."""
FARTHEST = 0.5
"""Largest step of an arm joint between two waypoints of a push [rad, m]."""
BLOCK, MOST = 16, 800
"""Base poses per batch, and base poses to try."""
MOST_CHECKED = 16
"""Pushes of a batch that are checked exactly."""
SEEDS = 4
"""Postures of the arm from which to solve."""
FARTHER, TURNING = 0.1, 0.05
"""Cost of driving one metre, and of turning by one radian, in shares of the arm's reach off a comfortable distance."""
APART = 0.15
"""Least distance between the base poses that are yielded [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Push:
    """A way to push a button: base pose, and joint values (n, d) along the stroke."""

    base: BasePose
    joints: Array


def pushes(
    standing: Standing, arm: ArmModel, line: Array, *, touches: str, free: int, is_free: Callable[[Push], bool]
) -> Iterator[Push]:
    """Yield pushes of a button by an arm, in batches of base poses at a comfortable distance, the present one first.

    ``line``: tip points of the stroke in the map (n, 3), the first before the button, the last at it; at the first
    ``free`` of them the hand does not touch anything yet, the button ``touches`` included. ``is_free`` checks a push
    exactly.
    """
    scene, points = standing.scene, line
    normal = (points[0] - points[-1]) / np.linalg.norm(points[0] - points[-1])
    rotations = _hands(arm, normal)
    bases, coarse = standing.lattice(arm, points[-1:])
    reached, strain = within_reach(arm, bases, points[-1:])
    # a base behind the button is of no use
    ahead = (bases[:, :2] - points[-1, :2]) @ normal[:2] > 0
    kept = (reached > 0) & (ahead | (abs(normal[2]) > 0.5))
    kept[kept] = standing.poses.free(bases[kept])
    bases, strain, coarse = bases[kept], strain[kept], coarse[kept]
    away = bases - np.array(scene.base())
    turned = np.abs(np.remainder(away[:, 2] + math.pi, 2 * math.pi) - math.pi)
    cost = (strain + FARTHER * np.hypot(away[:, 0], away[:, 1]) + TURNING * turned).round(6)
    here = (away == 0.0).all(axis=1)
    bases = bases[np.lexsort((cost, ~coarse, ~here))][:MOST]
    check = scene.collisions.arm_check(arm, touches, ())
    yielded: list[BasePose] = []
    for number in range(0, len(bases), BLOCK):
        checked = 0
        for base, joints in _solved(arm, bases[number : number + BLOCK], rotations, points):
            if checked == MOST_CHECKED or any(math.dist(base[:2], other[:2]) < APART for other in yielded):
                continue
            placed = np.repeat(base_matrices(np.array([base])), free, axis=0)
            if any(hit is not None for hit in check.hit(placed, joints[:free])):
                continue
            checked += 1
            if standing.poses.has_room(base) and is_free(push := Push(base, joints)):
                yielded.append(base)
                yield push


def _hands(arm: ArmModel, normal: Array) -> Array:
    """List rotations (h, 3, 3) of the tip with the approach against a normal (3,), or leaning from that."""
    up = np.eye(3)[2] if abs(normal[2]) < 0.7 else np.eye(3)[0]
    side = np.cross(up, normal)
    side /= np.linalg.norm(side)
    up = np.cross(normal, side)
    found = []
    for tilt, turn in itertools.product(LEANS, LEANS):
        if tilt and turn:
            continue
        across = math.sin(tilt) * up + math.sin(turn) * side
        approach = across - math.cos(tilt or turn) * normal
        for roll in np.arange(ROLLS) * (2 * math.pi / ROLLS):
            first = np.cross(approach, side if abs(float(approach @ side)) < 0.9 else up)
            first /= np.linalg.norm(first)
            closing = math.cos(roll) * first + math.sin(roll) * np.cross(approach, first)
            found.append(arm.frame.rotation(approach, closing))
    return np.array(found)


def _solved(arm: ArmModel, bases: Array, rotations: Array, points: Array) -> Iterator[tuple[BasePose, Array]]:
    """Yield base poses with joint values (n, d) that follow the points (n, 3) backwards from the last, one branch."""
    there = inverse(base_matrices(bases))
    rows, hands = (grid.ravel() for grid in np.indices((len(bases), len(rotations))))
    seeds = np.broadcast_to(arm.seeds[:SEEDS], (len(rows), *arm.seeds[:SEEDS].shape))
    joints = np.zeros((len(points), len(rows), len(arm.joints)))
    active = np.arange(len(rows))
    for step in reversed(range(len(points))):
        tips = rigid(rotations[hands[active]], np.repeat(points[step][None], len(active), axis=0))
        before = None if step == len(points) - 1 else joints[step + 1, active]
        q, good = arm.chain.solve(product(there[rows[active]], tips), seeds if before is None else before[:, None])
        if before is not None:
            good &= np.abs(q - before).max(axis=1) < FARTHEST
        joints[step, active] = q
        active = active[good]
        if not len(active):
            return
    for row in active.tolist():
        x, y, yaw = bases[rows[row]].tolist()
        yield (x, y, yaw), joints[:, row]
