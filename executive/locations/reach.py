"""Whether, from one place of the base, an arm can do what a relation asks of the hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np

from executive.locations.hand import HandPlan, above_plans, grasp_plans, offer_plans, retreat_plans
from executive.locations.rejections import Rejections, first_body
from executive.locations.surroundings import ArmModel, Base, Surroundings
from planlang.protocols import Array

CHUNK = 18
"""Plans whose inverse kinematics is solved in one call."""


@dataclass(frozen=True, slots=True)
class Reach:
    """What a hand has to be able to do: "grasp", "retreat", "above" or "offer", about one body."""

    kind: str
    body: str


@dataclass(frozen=True, slots=True)
class ReachSolution:
    """A hand plan with collision-free joint values (k, d) for each of its poses."""

    reach: Reach
    arm: ArmModel
    plan: HandPlan
    joints: Array


def base_matrix(base: Base) -> Array:
    """Pose (4, 4) of the base frame in the map."""
    c, s = math.cos(base[2]), math.sin(base[2])
    return np.array([[c, -s, 0.0, base[0]], [s, c, 0.0, base[1]], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


def hand_plans(reach: Reach, base: Base, arm: ArmModel, around: Surroundings) -> Iterator[HandPlan]:
    """Ways to satisfy a reach with an arm from a base, most natural first."""
    shoulder = base_matrix(base) @ np.append((arm.shoulder_low + arm.shoulder_high) / 2, 1.0)
    eye, block = shoulder[:3], around.block(reach.body)
    held = around.held(arm.name)
    match reach.kind:
        case "grasp":
            yield from grasp_plans(reach.body, block, eye, arm.frame, arm.max_opening)
        case "retreat":
            yield from retreat_plans(reach.body, around.grasped_at(reach.body), arm.frame)
        case "above":
            yield from above_plans(reach.body, block, eye, arm.frame, held, arm.hand_radius)
        case "offer":
            yield from offer_plans(reach.body, around.zone(reach.body), eye, arm.frame, held)


def reach_solutions(
    reach: Reach,
    base: Base,
    arm: ArmModel,
    around: Surroundings,
    rejections: Rejections,
    *,
    most_plans: int = 2 * CHUNK,
    seed: Array | None = None,
) -> Iterator[ReachSolution]:
    """Plans whose poses all have a collision-free solution from ``base``, lazily; without any, one reason is counted.

    ``seed`` (d,) is tried first by inverse kinematics, so that solutions near it are preferred.
    """
    plans = islice(hand_plans(reach, base, arm, around), most_plans)
    to_base: Array = np.linalg.inv(base_matrix(base)).astype(np.float64)
    seeds = arm.seeds if seed is None else np.vstack([seed, arm.seeds])
    found = possible = False
    touched: dict[str, int] = {}
    while chunk := list(islice(plans, CHUNK)):
        possible = True
        near = [plan for plan in chunk if within_reach(to_base, plan.poses, arm)]
        if not near:
            continue
        key = min(1, len(near[0].poses) - 1)
        targets = np.stack([to_base @ plan.poses[key] for plan in near])
        q_key, solved = arm.solver.solve(targets, np.broadcast_to(seeds, (len(near), *seeds.shape)))
        for plan, q, ok in zip(near, q_key, solved, strict=True):
            joints = _complete(plan, key, q, to_base, arm) if ok else None
            if joints is None:
                continue
            contacts = next(
                (
                    hit
                    for q_i in _between(joints)
                    if (hit := around.contacts(base, arm, q_i, plan.touches, plan.opened))
                ),
                (),
            )
            if contacts:
                touched[first_body(contacts)] = touched.get(first_body(contacts), 0) + 1
                continue
            found = True
            yield ReachSolution(reach, arm, plan, joints)
    if touched and not found:
        rejections.collision(max(touched, key=lambda body: touched[body]))
    elif not found:
        rejections.add("out of reach" if possible or reach.kind != "grasp" else "too wide for the gripper")


def within_reach(to_base: Array, poses: Array, arm: ArmModel) -> bool:
    """A quick necessary condition: no pose is farther from the shoulder than the arm is long."""
    points = (to_base @ poses[:, :, 3, None])[:, :3, 0]
    heights = np.clip(points[:, 2], arm.shoulder_low[2], arm.shoulder_high[2])
    shoulders = np.repeat(((arm.shoulder_low + arm.shoulder_high) / 2)[None], len(points), 0)
    shoulders[:, 2] = heights
    return bool((np.linalg.norm(points - shoulders, axis=1) <= arm.reach).all())


def _between(joints: Array) -> Iterator[Array]:
    """The rows (k, d) themselves, then points on the lines between neighbours."""
    yield from joints
    for first, second in pairwise(joints):
        for share in (0.5, 0.25, 0.75):
            yield first + share * (second - first)


def _complete(plan: HandPlan, key: int, q: Array, to_base: Array, arm: ArmModel) -> Array | None:
    """Joint values of all poses of a plan, warm-started from those of pose ``key``; None if one has no solution."""
    others = [index for index in range(len(plan.poses)) if index != key]
    joints = np.repeat(q[None], len(plan.poses), 0)
    if others:
        targets = np.stack([to_base @ plan.poses[index] for index in others])
        solution, ok = arm.solver.solve(targets, np.broadcast_to(q, (len(others), 1, len(q))))
        if not ok.all() or np.abs(solution - q).max() > 1.2:
            return None
        joints[others] = solution
    return joints
