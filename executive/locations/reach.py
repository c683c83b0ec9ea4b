"""Whether, from places of the base, an arm can do what a relation asks of the hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from executive.belief.free_floor import BasePose
from executive.belief.planning_scene import PlanningScene
from executive.locations.candidates import blocks
from executive.locations.inverse_map import InverseMaps
from executive.locations.rejections import COLLISION, OUT_OF_REACH, Reason, Rejections, first_body
from executive.locations.solving import base_matrices, solve
from executive.locations.ways import CLASSES, HandPlan, Ways
from executive.motion import QuickCheck, cartesian_path
from executive.robots.arms import ArmModel
from planlang.geometry import Array

CHUNK = 48
"""Ways whose inverse kinematics is solved in one call."""


class HandTerm(NamedTuple):
    """One conjunct about a hand: relation, body, greatest and least distance if they are stated, whether negated."""

    name: str
    body: str
    within: float | None = None
    beyond: float | None = None
    negated: bool = False
    viewer: tuple[float, float] | None = None
    """Whose left and right is meant, where the body has no front of its own."""


@dataclass(frozen=True, slots=True)
class Reach:
    """What a hand has to be able to do: "grasp", "retreat", "above", "offer" or "place", about one body."""

    kind: str
    body: str
    grasp: str | None = None
    """The class of grasp that is asked for."""
    arms: tuple[str, ...] | None = None
    """Names of the arms that may do it; None: all."""
    heights: tuple[float, float] = (0.02, 0.15)
    """Of the lowest point over the body's top, for "above" [m]."""
    inside: bool = False
    """For "place": in the body, not on it."""
    also: tuple[HandTerm, ...] = ()
    """What else holds of the hand."""
    before: bool = False
    """For "grasp" and "retreat": where the hand stands before the thing, not at it, is where that holds."""


@dataclass(frozen=True, slots=True)
class ReachSolution:
    """A hand plan with collision-free joint values (k, d) for each of its poses."""

    reach: Reach
    arm: ArmModel
    plan: HandPlan
    joints: Array


def is_among(known: ReachSolution, ways: Ways) -> bool:
    """Whether a way's poses are those of one of some ways."""
    poses = ways.poses(np.arange(len(ways)))
    if poses.shape[1:] != known.plan.poses.shape:
        return False
    return bool((np.abs(poses - known.plan.poses).max(axis=(1, 2, 3)) < 1e-6).any())


def stopped_by(
    solution: ReachSolution, base: BasePose, scene: PlanningScene, check: QuickCheck | None = None
) -> Reason | None:
    """Why an arm cannot do what a solution says, judged exactly; None if it can.

    ``check``, of the arm: where it is sure that nothing is hit nothing is looked at.
    """
    body = touched_at(solution.joints, solution, base, scene, check)
    return _in_collision(body) or stopped_on_the_way(solution, base, scene, check)


def stopped_on_the_way(
    solution: ReachSolution, base: BasePose, scene: PlanningScene, check: QuickCheck | None = None
) -> Reason | None:
    """Why an arm cannot go from pose to pose of a solution, or the fingers not close on a thing; None if they can."""
    line = straight(solution, base)
    if line is None:
        return OUT_OF_REACH
    body = touched_at(line, solution, base, scene, check)
    if body is None and solution.reach.kind == "grasp":
        body = scene.collisions.stops_closing(base, solution.arm, solution.joints[1], solution.reach.body)
    return _in_collision(body)


def straight(solution: ReachSolution, base: BasePose) -> Array | None:
    """Joint values (n, d) with the tip on the straight lines from pose to pose, as it will move; None if it cannot.

    Without those at the first pose, where the lines begin.
    """
    poses = np.linalg.inv(base_matrices(np.array([base]))[0]) @ solution.plan.poses
    q, rows = solution.joints[0], [solution.joints[:0]]
    for one, other in pairwise(poses):
        line = cartesian_path(solution.arm.solver, q, one, other, lambda _: True)
        if line.waypoints is None:
            return None
        rows.append(line.waypoints[1:])
        q = line.waypoints[-1]
    return np.concatenate(rows)


def touched_at(
    rows: Array, solution: ReachSolution, base: BasePose, scene: PlanningScene, check: QuickCheck | None = None
) -> str | None:
    """The body that is in the way at some joint values (m, d) of a solution; None if all are free."""
    plan = solution.plan
    for q in rows if check is None else _unsure(rows, base, check):
        if contacts := scene.collisions.contacts(base, solution.arm, q, plan.touches, plan.opened):
            return first_body(contacts)
    return None


def _unsure(rows: Array, base: BasePose, check: QuickCheck) -> Array:
    """Those of some joint values (m, d) at which something may be hit, as far as a check of the arm tells."""
    return rows[~check.clear(np.repeat(base_matrices(np.array([base])), len(rows), axis=0), rows)]


def hand_is_stopped(solution: ReachSolution, base: BasePose, scene: PlanningScene, check: QuickCheck) -> bool:
    """Whether the hand itself is in something on the way of a solution, or when it closes: wherever the base stands.

    ``check``, of the arm: where it is sure that nothing is hit nothing is looked at.
    """
    plan, hand, bodies = solution.plan, solution.arm.hand_links, scene.bodies.names()
    line = straight(solution, base)
    for q in _unsure(solution.joints if line is None else np.concatenate([solution.joints, line]), base, check):
        contacts = scene.collisions.contacts(base, solution.arm, q, plan.touches, plan.opened)
        if any(contact.part in hand and contact.body in bodies for contact in contacts):
            return True
    if solution.reach.kind != "grasp":
        return False
    return scene.collisions.stops_closing(base, solution.arm, solution.joints[1], solution.reach.body) is not None


def _in_collision(body: str | None) -> Reason | None:
    return None if body is None else Reason(COLLISION, body)


def from_base(
    reach: Reach,
    base: BasePose,
    arm: ArmModel,
    ways: Ways,
    scene: PlanningScene,
    inverse: InverseMaps,
    rejections: Rejections,
    *,
    seed: Array | None = None,
    generous: bool = False,
) -> Iterator[ReachSolution]:
    """Ways that have a collision-free solution from one base, lazily, best first; others are counted, each once.

    Where the maps have postures these are the seeds; if ``generous``, ways beyond them are tried from the arm's own
    postures at last. ``seed`` (d,) is tried before: with it, solutions near it are preferred.
    """
    there = np.array(base)
    placed = base_matrices(there[None])[0]
    check = scene.collisions.arm_check(arm, ways.touches, opened=ways.opened)
    index, scores, seeds = _looked_up(ways, there, arm, inverse)
    order = np.argsort(-(scores * ways.weights[index]).round(6), kind="stable")
    index, seeds = index[order], seeds[order]
    _, first = np.unique(index, return_index=True)
    first = np.sort(first)  # of each way the best posture, then the others
    later = np.setdiff1d(np.arange(len(index)), first, assume_unique=True)
    passes = [(index[rows], seeds[rows][:, None]) for rows in (first, later) if len(rows)]
    if seed is not None and passes:
        chosen, known = passes[0]
        present = np.broadcast_to(seed, (len(chosen), 1, len(seed)))
        passes[0] = chosen, np.concatenate([present, known], axis=1)
    if generous:
        rest = np.setdiff1d(np.argsort(-ways.weights.round(6), kind="stable"), index, assume_unique=True)
        own_seeds = arm.seeds if seed is None else np.vstack([seed, arm.seeds])
        rest = rest[within_reach(ways, rest, placed, arm)]
        passes.append((rest, np.broadcast_to(own_seeds, (len(rest), *own_seeds.shape))))
    tried = np.concatenate([chosen for chosen, _ in passes]) if passes else np.zeros(0, np.intp)
    rejections.add(OUT_OF_REACH.text, len(ways) - len(np.unique(tried)))
    done, counted = set[int](), set[int]()
    for chosen, begun in passes:
        for part in blocks(len(chosen), CHUNK):
            rows = [row for row in range(part.start, part.stop) if int(chosen[row]) not in done]
            mine = chosen[rows]
            solved = solve(ways, mine, np.repeat(there[None], len(mine), 0), arm, begun[rows], check)
            for number, joints, reason in zip(mine.tolist(), solved.joints, solved.reasons, strict=True):
                if number in done:
                    continue
                if reason is None:
                    solution = ReachSolution(reach, arm, ways.plan(number), joints)
                    reason = stopped_by(solution, base, scene, check)
                    if reason is None:
                        done.add(number)
                        yield solution
                        continue
                if number not in counted:
                    counted.add(number)
                    rejections.count([reason])


def _looked_up(ways: Ways, base: Array, arm: ArmModel, inverse: InverseMaps) -> tuple[NDArray[np.intp], Array, Array]:
    """For one base the ways that the maps know a posture for, one entry for each torso position: way, score, seed."""
    c, s = math.cos(base[2]), math.sin(base[2])
    local = ways.points - np.array([base[0], base[1], 0.0])
    local = np.stack([c * local[:, 0] + s * local[:, 1], c * local[:, 1] - s * local[:, 0], local[:, 2]], axis=1)
    headings = ways.headings - base[2]
    index, scores, seeds = [], [], [np.zeros((0, len(arm.joints)))]
    for number in sorted(set(ways.grasps.tolist())):
        forward = inverse(arm, CLASSES[number]).forward
        mine = np.flatnonzero(ways.grasps == number)
        for z in np.unique(ways.points[mine, 2].round(6)):
            level = mine[ways.points[mine, 2].round(6) == z]
            for torso in forward.heights(float(z)):
                rows = forward.find(local[level], headings[level], ways.rolls[level], torso)
                known = rows >= 0
                index.append(level[known])
                scores.append(forward.rows["score"][rows[known]].astype(float))
                seeds.append(forward.seeds(rows[known], torso))
    if not index:
        return np.zeros(0, np.intp), np.zeros(0), seeds[0]
    return np.concatenate(index), np.concatenate(scores), np.concatenate(seeds)


def within_reach(ways: Ways, index: NDArray[np.intp], placed: Array, arm: ArmModel) -> NDArray[np.bool_]:
    """A quick necessary condition from a base at ``placed`` (4, 4): no key pose is farther than the arm is long."""
    points = (ways.points[index] - placed[:3, 3]) @ placed[:3, :3]
    shoulders = np.repeat(((arm.shoulder_low + arm.shoulder_high) / 2)[None], len(points), 0)
    shoulders[:, 2] = np.clip(points[:, 2], arm.shoulder_low[2], arm.shoulder_high[2])
    return np.asarray(np.linalg.norm(points - shoulders, axis=1) <= arm.reach)
