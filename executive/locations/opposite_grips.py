"""Grips of a thing held by two hands: on opposite sides of its rim, or by opposite handles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.locations.grasp_candidates import HandPoses
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.hand_solutions import unblocked
from executive.locations.rejections import Rejections
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.records import dataclass
from planlang.relations.demands import Reach, ReachKind

OPPOSITE = 0.25
"""Greatest offset of the midpoint between two grips from the thing's centre, as a share of their distance."""
LEAST = 0.1
"""Smallest distance of two grips, with room for both hands [m]."""
SAME_PLACE = 0.02
"""Distance below which grips of one direction differ in depth only [m]."""
AT_PLACE, MOST_AT_PLACE = 0.05, 8
"""Distance below which grips of one hand share a place [m], and the number kept per place, most natural first."""


@dataclass(frozen=True, slots=True, eq=False)
class Grips:
    """Grips of one hand: poses (c, 4, 4, 4) in the map before the thing, at it, above it, and back."""

    arm: ArmModel
    plans: tuple[HandPoses, ...]
    poses: Array
    weights: Array


def grips_of(name: str, arm: ArmModel, scene: PlanningScene, log: Rejections) -> Grips:
    """Generate the collision-free grips of a thing by one hand; the others are counted."""
    weighted: list[tuple[float, HandPoses]] = []
    for hand in unblocked(arm, candidates_of(Reach(ReachKind.GRASP, name), arm, scene, log, Stage.ALL), scene, log):
        table = hand.candidates
        weighted += [(float(table.weights[k]), table.plan(k)) for k in range(len(table))]
    kept: list[tuple[float, HandPoses]] = []
    for weight, plan in sorted(weighted, key=lambda one: -round(one[0], 6)):
        neighbours = [other for _, other in kept if _apart(plan, other) < AT_PLACE]
        if len(neighbours) < MOST_AT_PLACE and not any(_alike(plan, other) for other in neighbours):
            kept.append((weight, plan))
    poses = np.array([plan.poses for _, plan in kept]).reshape(-1, 4, 4, 4)
    return Grips(arm, tuple(plan for _, plan in kept), poses, np.array([weight for weight, _ in kept]))


def _apart(one: HandPoses, other: HandPoses) -> float:
    return float(np.linalg.norm(one.poses[1, :3, 3] - other.poses[1, :3, 3]))


def _alike(one: HandPoses, other: HandPoses) -> bool:
    turned = np.abs(one.poses[1, :3, :3] - other.poses[1, :3, :3]).max()
    return bool(_apart(one, other) < SAME_PLACE and turned < SAME_PLACE)


def opposite(first: Grips, second: Grips, centre: Array) -> NDArray[np.bool_]:
    """Check which grips of two hands, (c, d), are opposite about the centre (3,) of a thing."""
    one, other = first.poses[:, None, 1, :2, 3], second.poses[None, :, 1, :2, 3]
    apart = np.linalg.norm(one - other, axis=2)
    aside = np.linalg.norm((one + other) / 2 - centre[:2], axis=2)
    return np.asarray((apart >= LEAST) & (aside <= OPPOSITE * apart))
