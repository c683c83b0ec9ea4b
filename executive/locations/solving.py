"""Joint values for ways of a hand from many bases at once: inverse kinematics, and spheres that rule out collisions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from executive.locations.rejections import COLLISION, NO_ROOM, OUT_OF_REACH, Reason, Rejections
from executive.locations.ways import Ways
from executive.motion import QuickCheck
from executive.robots.arms import ArmModel
from planlang.geometry import Array

FARTHEST = 1.2
"""Largest move of a joint between neighbouring poses of a way [rad, m]."""
BETWEEN = 1
"""Places on the straight line from one pose of a way to the next at which the hand is looked at."""
ON_LATTICE, OFF_LATTICE = 0.004, 0.039
"""How much deeper inside something than elsewhere spheres of the arm must be to count, for a posture of a map whose
height is that of the target, or is not [m].
"""


@dataclass(frozen=True, slots=True, eq=False)
class Solved:
    """Joint values (m, k, d) of m ways from m bases, and why others than those with None are impossible."""

    joints: Array
    reasons: list[Reason | None]


def base_matrices(bases: Array) -> Array:
    """Poses (m, 4, 4) of the base frame in the map for bases (m, 3)."""
    matrices = np.zeros((len(bases), 4, 4))
    matrices[:, 0, 0] = matrices[:, 1, 1] = np.cos(bases[:, 2])
    matrices[:, 1, 0] = np.sin(bases[:, 2])
    matrices[:, 0, 1] = -matrices[:, 1, 0]
    matrices[:, 0, 3], matrices[:, 1, 3] = bases[:, 0], bases[:, 1]
    matrices[:, 2, 2] = matrices[:, 3, 3] = 1.0
    return matrices


def unblocked(ways: Ways, check: QuickCheck, rejections: Rejections) -> Ways:
    """Ways in which the hand itself, wherever the base stands, would be inside nothing; others are counted.

    It goes straight from pose to pose, so that what is in between counts as well.
    """
    if not len(ways):
        return ways
    poses = _with_between(ways.poses(np.arange(len(ways))))
    bodies = _met(check.hand_hit(poses.reshape(-1, 4, 4)), len(ways))
    rejections.count(_in_the_way(bodies))
    return ways.chosen([body is None for body in bodies])


def _with_between(poses: Array) -> Array:
    """Series of poses (n, k, 4, 4) of one rotation, then those :data:`BETWEEN` each and the next."""
    shares = np.linspace(0.0, 1.0, BETWEEN + 2)[1:-1].tolist()
    between = [(1.0 - share) * poses[:, :-1] + share * poses[:, 1:] for share in shares]
    return np.concatenate([poses, *between], axis=1)


def arms_have_room(bases: Array, check: QuickCheck, rejections: Rejections) -> NDArray[np.bool_]:
    """At which bases (n, 3) no arm, in its present posture, is inside something as far as spheres tell.

    Others are counted.
    """
    bodies = check.hit(base_matrices(bases))
    rejections.count(None if body is None else Reason(NO_ROOM, body) for body in bodies)
    return np.array([body is None for body in bodies], bool)


def solve(
    ways: Ways,
    index: NDArray[np.intp],
    bases: Array,
    arm: ArmModel,
    seeds: Array,
    check: QuickCheck,
    *,
    slack: float | None = None,
) -> Solved:
    """Joint values of ways (m,) from bases (m, 3), begun at seeds (m, s, d); spheres inside something rule out.

    With ``slack`` the first seeds are within so many metres of solutions: where they are so much deeper in something
    than solutions may be, nothing is solved.
    """
    count, steps = len(index), ways.offsets.shape[1]
    joints = np.zeros((count, steps, seeds.shape[2]))
    reasons: list[Reason | None] = [None] * count

    def left(rows: NDArray[np.intp], found: Iterable[Reason | None]) -> NDArray[np.intp]:
        """Those of some rows for which there is no reason."""
        for row, reason in zip(rows.tolist(), found, strict=True):
            reasons[row] = reason
        return rows[[reasons[row] is None for row in rows.tolist()]]

    to_base = np.linalg.inv(base_matrices(bases))
    targets = to_base[:, None] @ ways.poses(index)
    alive = np.arange(count)
    if slack is not None:
        alive = left(alive, _in_the_way(_blocked(seeds[:, :1], bases, check, slack)))
    q, solved = arm.solver.solve(targets[alive, ways.key], seeds[alive])
    joints[alive, ways.key] = q
    alive = left(alive, (None if good else OUT_OF_REACH for good in solved.tolist()))
    others = [step for step in range(steps) if step != ways.key]
    if others and len(alive):
        goals = targets[alive][:, others].reshape(-1, 4, 4)
        starts = np.repeat(joints[alive, ways.key], len(others), axis=0)
        found, good = arm.solver.solve(goals, starts[:, None])
        good &= np.abs(found - starts).max(axis=1) <= FARTHEST
        joints[alive[:, None], others] = found.reshape(len(alive), len(others), -1)
        whole = good.reshape(len(alive), len(others)).all(axis=1)
        alive = left(alive, (None if good else OUT_OF_REACH for good in np.asarray(whole).tolist()))
    postures = joints[alive][:, [ways.key, *others]]
    left(alive, _in_the_way(_blocked(postures, bases[alive], check)))
    return Solved(joints, reasons)


def _blocked(q: Array, bases: Array, check: QuickCheck, deeper: float = 0.0) -> list[str | None]:
    """For each base (n, 3) what a sphere of the arm is inside of, by so much more, at some of q (n, s, d)."""
    count, steps, size = q.shape
    return _met(check.hit(np.repeat(base_matrices(bases), steps, axis=0), q.reshape(-1, size), deeper=deeper), count)


def _met(bodies: Sequence[str | None], count: int) -> list[str | None]:
    """For each of ``count`` places the first body that is met in one of its postures, None where none is."""
    steps = len(bodies) // max(count, 1)
    return [next(filter(None, bodies[k * steps : (k + 1) * steps]), None) for k in range(count)]


def _in_the_way(bodies: Iterable[str | None]) -> list[Reason | None]:
    return [None if body is None else Reason(COLLISION, body) for body in bodies]
