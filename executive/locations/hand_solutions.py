"""Joint values for grasp candidates: inverse kinematics for many bases at once, and exact checks of single ones.

Collision spheres rule out most before anything is checked exactly in the planning scene.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.base_candidates import blocks
from executive.locations.grasp_candidates import CLASSES, GraspCandidates, Hand, HandPoses, upright
from executive.locations.grasps_from_above import is_low
from executive.locations.inverse_maps import InverseMaps
from executive.locations.questions import once
from executive.locations.rejections import COLLISION, NO_HOLD, OUT_OF_REACH, Reason, Rejections, first_body
from executive.motion import QuickCheck, cartesian_path
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, product, rigid, rotated
from planlang.protocols import Contact
from planlang.records import dataclass
from planlang.relations.demands import Reach, ReachKind

FARTHEST = 1.2
"""Largest move of a joint between consecutive poses of a candidate [rad, m]."""
ON_LATTICE, OFF_LATTICE = 0.004, 0.039
"""Extra penetration of spheres that counts as collision, for map postures at the height of the target, or not [m]."""


def base_matrices(bases: Array) -> Array:
    """Poses (m, 4, 4) of the base frame in the map for bases (m, 3)."""
    return rigid(upright(bases[:, 2]), np.column_stack([bases[:, :2], np.zeros(len(bases))]))


def unblocked(
    arm: ArmModel,
    tables: Sequence[GraspCandidates],
    scene: PlanningScene,
    rejections: Rejections,
    near: tuple[Array, float] | None = None,
    *,
    varied: bool = True,
    hits: HandHits | None = None,
) -> list[Hand]:
    """Select the candidates in which the hand itself is collision-free, wherever the base stands; count the others.

    The hand moves straight from pose to pose, so poses in between are tested as well. If it collides, variants of the
    grasp are tried if ``varied``. ``hits`` shares results between arms with equal ``near``.
    """
    hits = hits or HandHits()
    hands: list[Hand] = []
    for table in tables:
        blocked, reasons = np.arange(len(table)), dict[int, str | None]()
        free: dict[Fingers, list[GraspCandidates]] = {}
        for variant in table.variants(arm.openings) if varied else (table,):
            check = scene.collisions.arm_check(arm, variant.touches, variant.fingers, near)
            remaining = variant.chosen(blocked)
            if variant is table:
                reasons = dict(zip(blocked.tolist(), _hand_collisions(remaining, check, hits), strict=True))
                good = np.array([body is None for body in reasons.values()], bool)
            else:
                good = _is_free(remaining, check, hits)
            free.setdefault(variant.fingers, []).append(remaining.chosen(good))
            blocked = blocked[~good]
            if not len(blocked):
                break
        rejections.count(_in_the_way(reasons[row] for row in blocked.tolist()))
        rejections.show_hands(COLLISION, table.points[blocked])
        for fingers, parts in free.items():
            check = scene.collisions.arm_check(arm, table.touches, fingers, near)
            if len(joined := GraspCandidates.joined(parts)):
                hands.append(Hand(arm, joined, check))
    return hands


class HandHits:
    """Collisions of hands with their tips at given poses, shared by all arms with the same hand."""

    def __init__(self) -> None:
        self._known: dict[QuickCheck, dict[bytes, str | None]] = {}

    def __call__(self, check: QuickCheck, tips: Array) -> list[str | None]:
        """Find what the hand of a check collides with at tip poses (..., 4, 4), or None."""
        if check not in self._known:
            same = (known for other, known in self._known.items() if other.has_same_hand(check))
            self._known[check] = next(same, {})
        return once(self._known[check], tips.reshape(-1, 16), lambda new: check.hand_hit(new.reshape(-1, 4, 4)))


def _hand_collisions(candidates: GraspCandidates, check: QuickCheck, hits: HandHits) -> list[str | None]:
    """Find for each candidate what its hand collides with, or None."""
    poses = candidates.poses(np.arange(len(candidates)))
    halfway = 0.5 * poses[:, :-1] + 0.5 * poses[:, 1:]  # the hand goes straight, with one rotation
    return _hits(hits(check, np.concatenate([poses, halfway], axis=1)), len(candidates))


def _is_free(candidates: GraspCandidates, check: QuickCheck, hits: HandHits) -> NDArray[np.bool_]:
    """Check in which candidates the hand is collision-free (n,); first at the key pose, where it mostly collides."""
    key = candidates.poses(np.arange(len(candidates)))[:, candidates.key]
    free = np.array([body is None for body in hits(check, key)], bool)
    free[free] = [body is None for body in _hand_collisions(candidates.chosen(free), check, hits)]
    return free


def solve(
    candidates: GraspCandidates,
    index: NDArray[np.intp],
    bases: Array,
    arm: ArmModel,
    seeds: Array,
    check: QuickCheck,
    *,
    slack: float | None = None,
) -> tuple[Array, list[Reason | None]]:
    """Solve candidates (m,) from bases (m, 3), with seeds (m, s, d), and rule out collisions by spheres.

    Returns joint values (m, k, d), and why those of each candidate are not possible; None if they are.

    With ``slack``, the first seeds are within that distance [m] of solutions: if they penetrate something by that much
    more than solutions may, the candidate is not solved. A slow torso then moves as the arm does: that is a search for
    base poses, which asks whether there is a posture at all.
    """
    solver = arm if slack is None else arm.chain
    count, steps = len(index), candidates.offsets.shape[1]
    joints = np.zeros((count, steps, seeds.shape[2]))
    reasons: list[Reason | None] = [None] * count

    def without_reason(rows: NDArray[np.intp], verdicts: Iterable[Reason | None]) -> NDArray[np.intp]:
        """Record reasons for rows, and return the rows without any."""
        for row, reason in zip(rows.tolist(), verdicts, strict=True):
            reasons[row] = reason
        return rows[[reasons[row] is None for row in rows.tolist()]]

    targets = product(inverse(base_matrices(bases))[:, None], candidates.poses(index))
    alive = np.arange(count)
    if slack is not None:
        alive = without_reason(alive, _in_the_way(_blocked(seeds[:, :1], bases, check, slack)))
    q, solved = solver.solve(targets[alive, candidates.key], seeds[alive])
    joints[alive, candidates.key] = q
    alive = without_reason(alive, (None if good else OUT_OF_REACH for good in solved.tolist()))
    others = [step for step in range(steps) if step != candidates.key]
    if others and len(alive):
        goals = targets[alive][:, others].reshape(-1, 4, 4)
        starts = np.repeat(joints[alive, candidates.key], len(others), axis=0)
        other_joints, good = solver.solve(goals, starts[:, None])
        good &= np.abs(other_joints - starts).max(axis=1) <= FARTHEST
        joints[alive[:, None], others] = other_joints.reshape(len(alive), len(others), -1)
        whole = good.reshape(len(alive), len(others)).all(axis=1)
        alive = without_reason(alive, (None if good else OUT_OF_REACH for good in np.asarray(whole).tolist()))
    postures = joints[alive][:, [candidates.key, *others]]
    without_reason(alive, _in_the_way(_blocked(postures, bases[alive], check)))
    return joints, reasons


def _blocked(q: Array, bases: Array, check: QuickCheck, deeper: float = 0.0) -> list[str | None]:
    """Find what the arm's spheres hit from each base (n, 3), ``deeper`` [m] than usual, at any of q (n, s, d)."""
    count, steps, size = q.shape
    return _hits(check.hit(np.repeat(base_matrices(bases), steps, axis=0), q.reshape(-1, size), deeper=deeper), count)


def _hits(bodies: Sequence[str | None], count: int) -> list[str | None]:
    """Find for each of ``count`` places the first body hit in any of its postures, or None."""
    steps = len(bodies) // max(count, 1)
    return [next(filter(None, bodies[k * steps : (k + 1) * steps]), None) for k in range(count)]


def _in_the_way(bodies: Iterable[str | None]) -> list[Reason | None]:
    return [_in_collision(body) for body in bodies]


CHUNK = 48
"""Candidates per call of inverse kinematics."""


@dataclass(frozen=True, slots=True)
class HandSolution:
    """Grasp candidate with collision-free joint values (k, d) for each of its poses."""

    reach: Reach
    arm: ArmModel
    plan: HandPoses
    joints: Array

    def among(self, candidates: GraspCandidates) -> Iterator[GraspCandidates]:
        """Yield those of candidates that have its poses, themselves or in a variant for tight places."""
        for variant in candidates.variants(self.arm.openings):
            poses = variant.poses(np.arange(len(variant)))
            if poses.shape[1:] == self.plan.poses.shape:
                equal = np.abs(poses - self.plan.poses).max(axis=(1, 2, 3)) < 1e-6
                if equal.any():
                    yield variant.chosen(equal)


def with_torso_still(solution: HandSolution, now: Array, base: BasePose) -> HandSolution | None:
    """Solve the poses of a solution again for an arm with a slow torso, which stays as in joint values ``now`` (d,).

    None for other arms, or if the arm alone does not get to all poses.
    """
    arm = solution.arm
    if arm.standing is None or arm.lift is None:
        return None
    seeds = np.stack([solution.joints, np.broadcast_to(now, solution.joints.shape)], axis=1)
    seeds[:, :, arm.lift.column] = now[arm.lift.column]
    targets = product(inverse(base_matrices(np.array([base]))[0]), solution.plan.poses[-len(solution.joints) :])
    q, reached = arm.solve(targets, seeds)
    is_even = not len(q) or np.abs(np.diff(q, axis=0)).max(initial=0.0) <= FARTHEST
    stands = np.ptp(q[:, arm.lift.column], axis=0) == 0.0
    return replace(solution, joints=q) if reached.all() and is_even and stands else None


@dataclass(frozen=True, slots=True)
class Trial:
    """Exact check of a solution in the planning scene, with the base at a pose.

    Postures that ``check``, of the arm, proves free are not checked again.
    """

    solution: HandSolution
    base: BasePose
    scene: PlanningScene
    check: QuickCheck | None = None

    def stopped(self) -> Reason | None:
        """Explain why the arm cannot perform the solution; None if it can."""
        return _in_collision(self.touched(self.solution.joints)) or self.stopped_on_the_way()

    def fails_to_grip(self) -> Reason | None:
        """Explain why the fingers cannot grip the thing where the hand is; None if they can."""
        return self._slips() or _in_collision(self._stops_closing())

    def stopped_on_the_way(self) -> Reason | None:
        """Explain why the arm cannot move from pose to pose, or the fingers cannot grip; None if they can."""
        if (slips := self._slips()) is not None:
            return slips
        line = self._straight()
        if line is None:
            return OUT_OF_REACH
        return _in_collision(self.touched(line) or self._stops_closing() or self._stops_opening())

    def hand_is_stopped(self) -> bool:
        """Check whether the hand itself collides on its path, or when it closes: then from any base."""
        if self._hand_meets(self.solution.joints) or self._stops_closing() is not None or self._slips() is not None:
            return True
        line = self._straight()
        return line is not None and self._hand_meets(line)

    def _hand_meets(self, rows: Array) -> bool:
        """Check whether the hand itself collides at some joint values (m, d)."""
        hand, bodies = self.solution.arm.hand_links, self.scene.bodies.names()
        met = (contact for contacts in self._contacts(rows) for contact in contacts)
        return any(one.part in hand and one.body in bodies for one in met)

    def touched(self, rows: Array) -> str | None:
        """Find the body that the robot collides with at some joint values (m, d); None if all are free."""
        return next(map(first_body, self._contacts(rows)), None)

    def _contacts(self, rows: Array) -> Iterator[Sequence[Contact]]:
        """Yield the contacts at joint values (m, d), where there are any."""
        plan, arm = self.solution.plan, self.solution.arm
        if self.check is not None:
            placed = base_matrices(np.array([self.base]))
            rows = rows[~self.check.clear(np.repeat(placed, len(rows), axis=0), rows)]
        for q in rows:
            if contacts := self.scene.collisions.contacts(self.base, arm, q, plan.touches, plan.fingers):
                yield contacts

    def _stops_closing(self) -> str | None:
        """Find what keeps the fingers from closing on the thing."""
        one = self.solution
        if one.reach.kind is not ReachKind.GRASP:
            return None
        return self.scene.collisions.stops_closing(self.base, one.arm, one.joints[1], one.reach.body, one.plan.fingers)

    def _stops_opening(self) -> str | None:
        """Find what keeps the fingers from opening around a thing put down, or the hand from retreating from it."""
        one = self.solution
        held = self.scene.arms.held(one.arm.name) if one.reach.kind is ReachKind.PLACE else None
        if held is None:
            return None
        fingers = one.arm.openings.beyond(self.scene.world.configuration().joints)
        each = (self.scene.collisions.contacts(self.base, one.arm, q, held.name, fingers) for q in one.joints[1:])
        return next((contact.body for contacts in each for contact in contacts if contact.part != held.name), None)

    def _slips(self) -> Reason | None:
        """Explain why the closing fingers would not grip the thing; None if they would."""
        one = self.solution
        if one.reach.kind is not ReachKind.GRASP:
            return None
        collisions, q, fingers = self.scene.collisions, one.joints[1], one.plan.fingers
        if collisions.contacts(self.base, one.arm, q, fingers=fingers):
            return NO_HOLD  # an open finger would penetrate the thing
        block, *handles = self.scene.bodies.grips(one.reach.body)
        if not handles and not is_low(block) and block.wall == 0:
            return None  # the opening was chosen for its width
        held = collisions.closed_on(self.base, one.arm, q, one.reach.body, fingers)
        return NO_HOLD if held is None else None

    def _straight(self) -> Array | None:
        """Compute joint values (n, d) with the tip on the lines from pose to pose; None if impossible.

        Without those at the first pose, where the lines begin.
        """
        one = self.solution
        poses = product(inverse(base_matrices(np.array([self.base]))[0]), one.plan.poses)
        q, rows = one.joints[0], [one.joints[:0]]
        for begin, end in pairwise(poses):
            line = cartesian_path(one.arm.chain, q, begin, end, lambda _: True, solve=one.arm.solve)
            if line.waypoints is None:
                return None
            rows.append(line.waypoints[1:])
            q = line.waypoints[-1]
        return np.concatenate(rows)


def _in_collision(body: str | None) -> Reason | None:
    return None if body is None else Reason(COLLISION, body)


def from_base(
    reach: Reach,
    base: BasePose,
    arm: ArmModel,
    tables: Sequence[GraspCandidates],
    scene: PlanningScene,
    inverse: InverseMaps,
    rejections: Rejections,
    *,
    seed: Array | None = None,
    beyond: Array | None = None,
) -> Iterator[HandSolution]:
    """Yield collision-free solutions from one base, lazily, best first; the others are counted, each once.

    Map postures serve as seeds; candidates outside the maps are tried last, from the seeds ``beyond`` (n, d), if any.
    ``seed`` (d,) is tried first, so that solutions near it are preferred.
    """
    base_row = np.array(base)
    points = np.concatenate([np.array([[*base[:2], 0.0]]), *(table.points for table in tables)])
    for _, candidates, check in unblocked(arm, tables, scene, rejections, scene.collisions.near(arm, points)):
        passes = _passes(base_row, arm, candidates, inverse, seed, beyond)
        tried = {number for chosen, _ in passes for number in chosen.tolist()}
        rejections.add(OUT_OF_REACH.text, len(candidates) - len(tried))
        parts = [(chosen[part], seeds[part]) for chosen, seeds in passes for part in blocks(len(chosen), CHUNK)]
        done, counted = set[int](), set[int]()
        for part, seeds in parts:
            left = np.array([number not in done for number in part.tolist()], bool)
            mine, bases = part[left], np.repeat(base_row[None], left.sum(), 0)
            solved = solve(candidates, mine, bases, arm, seeds[left], check)
            for number, joints, reason in zip(mine.tolist(), *solved, strict=True):
                if number in done:
                    continue
                if reason is None:
                    solution = HandSolution(reach, arm, candidates.plan(number), joints)
                    reason = Trial(solution, base, scene, check).stopped()
                    if reason is None:
                        done.add(number)
                        yield solution
                        continue
                if number not in counted:
                    counted.add(number)
                    rejections.count([reason])


def _passes(
    base: Array,
    arm: ArmModel,
    candidates: GraspCandidates,
    inverse: InverseMaps,
    seed: Array | None,
    beyond: Array | None,
) -> list[tuple[NDArray[np.intp], Array]]:
    """List passes of candidates (k,) with seeds (k, n, joints), in the order in which they are tried."""
    placed = base_matrices(base[None])[0]
    index, scores, seeds = _looked_up(candidates, base, arm, inverse)
    order = np.argsort(-(scores * candidates.weights[index]).round(6), kind="stable")
    index, seeds = index[order], seeds[order]
    _, first = np.unique(index, return_index=True)
    first = np.sort(first)  # the best posture of each candidate, then the others
    later = np.setdiff1d(np.arange(len(index)), first, assume_unique=True)
    passes = [(index[rows], seeds[rows][:, None]) for rows in (first, later) if len(rows)]
    if seed is not None and passes:
        chosen, known = passes[0]
        present = np.broadcast_to(seed, (len(chosen), 1, len(seed)))
        passes[0] = chosen, np.concatenate([present, known], axis=1)
    if beyond is not None:
        rest = np.setdiff1d(np.argsort(-candidates.weights.round(6), kind="stable"), index, assume_unique=True)
        own_seeds = beyond if seed is None else np.vstack([seed, beyond])
        rest = rest[within_reach(candidates, rest, placed, arm)]
        passes.append((rest, np.broadcast_to(own_seeds, (len(rest), *own_seeds.shape))))
    return passes


def _looked_up(
    candidates: GraspCandidates, base: Array, arm: ArmModel, inverse: InverseMaps
) -> tuple[NDArray[np.intp], Array, Array]:
    """Look up candidates with map postures from one base, by torso position: index, score, seed."""
    c, s = math.cos(base[2]), math.sin(base[2])
    local = candidates.points - np.array([base[0], base[1], 0.0])
    local = np.stack([c * local[:, 0] + s * local[:, 1], c * local[:, 1] - s * local[:, 0], local[:, 2]], axis=1)
    headings = candidates.headings - base[2]
    index, scores, seeds = [], [], [np.zeros((0, len(arm.joints)))]
    for number in sorted(set(candidates.grasps.tolist())):
        forward = inverse(arm, CLASSES[number]).forward
        mine = np.flatnonzero(candidates.grasps == number)
        for z in np.unique(candidates.points[mine, 2].round(6)):
            level = mine[candidates.points[mine, 2].round(6) == z]
            for torso in forward.heights(float(z)):
                rows = forward.find(local[level], headings[level], candidates.rolls[level], torso)
                known = rows >= 0
                index.append(level[known])
                scores.append(forward.rows["score"][rows[known]].astype(float))
                seeds.append(forward.seeds(rows[known], torso))
    if not index:
        return np.zeros(0, np.intp), np.zeros(0), seeds[0]
    return np.concatenate(index), np.concatenate(scores), np.concatenate(seeds)


def within_reach(
    candidates: GraspCandidates, index: NDArray[np.intp], placed: Array, arm: ArmModel
) -> NDArray[np.bool_]:
    """Check quickly whether key poses are within the arm's length from a base at ``placed`` (4, 4)."""
    points = rotated(placed[:3, :3].T, candidates.points[index] - placed[:3, 3])
    shoulders = np.repeat(((arm.shoulder_low + arm.shoulder_high) / 2)[None], len(points), 0)
    shoulders[:, 2] = np.clip(points[:, 2], arm.shoulder_low[2], arm.shoulder_high[2])
    return np.asarray(np.linalg.norm(points - shoulders, axis=1) <= arm.reach)
