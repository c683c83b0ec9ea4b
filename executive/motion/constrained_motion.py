"""Constrained arm motions, phase by phase: the path to the end of each, and its timing.

Constraints hold at the end of a phase. Those that held at its start and were required with the same limits by the phase
before hold throughout: so a cup stays upright, and a spatula stays on the pan while it is pushed. Paths are optimised
from the straight one, or from one that :mod:`executive.motion.arm_path` finds around obstacles. Every row of the timed
motion is checked: constraints, joint limits, and, exactly, collisions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from executive.motion.arm_path import JointSpace, plan_path
from executive.motion.constrained_ends import CORRECTIONS, Ends, Hits, MotionProblem
from executive.motion.constraint_functions import ConstraintFunctions
from executive.motion.constraint_optimisation import Optimiser, Rows
from executive.motion.errors import MotionError, NoConstrainedPath, OutOfEffort, OutsideLimits, StartInCollision
from executive.motion.trajectories import time_curve, time_path
from planlang.geometry import Array
from planlang.geometry.matrices import moved
from planlang.motion_constraints import MotionConstraint, Speed
from planlang.protocols import Trajectory
from planlang.records import dataclass

FAR = 0.12
"""Largest move of a joint between two waypoints [rad, m]."""
FEWEST, MOST = 3, 16
"""Numbers of waypoints between the ends of a phase; doubled once if constraints are violated in between."""
KEPT = 0.01
"""Clearance of a path where its ends allow it [m]."""
MOST_ENDS = 4
"""Number of ends to which paths are planned."""
SEARCHED = 300
"""Iterations of a search for a path around obstacles."""
AROUND = 10_000
"""Cost of such a search, which has its own budget, in variables of quadratic programs."""
TURN_STEP, SLIDE_STEP = 0.08, 0.02
"""Resolution of its checks [rad], [m]."""
HASTE = 1.002
"""Extra slowdown where a tool is too fast: rows come at whole fractions of a second."""
UNMOVED = 1e-9
"""Joint moves up to this count as none [rad, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PhaseMotion:
    """Motion of one phase."""

    trajectory: Trajectory
    """Starts where the phase before ended; a single row if nothing moves."""
    kept: tuple[MotionConstraint, ...]
    """Constraints that hold throughout, not only at the end."""
    given_up: tuple[MotionConstraint, ...]
    """Constraints that heavier ones exclude."""


def solve_motion(
    problem: MotionProblem,
    start: Array,
    phases: Sequence[Sequence[MotionConstraint]],
    before: Sequence[MotionConstraint] = (),
    *,
    wishes: Mapping[MotionConstraint, MotionConstraint] = MappingProxyType({}),
    explains: bool = True,
) -> list[PhaseMotion]:
    """Plan the motion of each phase from joint values (n,); ``before`` are the constraints before the first.

    ``wishes``: soft constraints of the last phase -> the same with the limits that must hold. Without ``explains``
    nothing is given up, and all constraints are named if they cannot all hold.

    Raises :class:`StartInCollision`, :class:`OutsideLimits`, :class:`ConstraintsContradict` with a minimal set of
    conflicting constraints of equal weight, :class:`NoConstrainedPath`, :class:`OutOfEffort` if the budget is spent
    before anything was found out, and :class:`MotionError` for unknown features, tools or frames.
    """
    begin = np.array(start, float)
    group, problem = problem.group, problem.afresh()
    if begin.shape != (group.dof,) or not np.isfinite(begin).all():
        raise ValueError(f"expected finite values of {group.names}, got shape {begin.shape}")
    if not group.within(begin, 1e-3).all():
        raise OutsideLimits("the start", begin.tolist(), *(limits.tolist() for limits in group.bounds))
    if pairs := problem.touching(begin.copy()):
        raise StartInCollision(begin.tolist(), pairs)
    active = [tuple(one for one in phase if one.is_active) for phase in phases]
    if wishes:
        active[-1] = (*active[-1], *wishes)
    ends = Ends.of(problem, begin, active, wishes)
    ends.explains = explains
    failures: list[NoConstrainedPath] = []
    try:
        for end_of in ends.found():
            try:
                return list(_phase_motions(ends, end_of, active, tuple(one for one in before if one.is_active)))
            except NoConstrainedPath as failure:
                failures.append(failure)
                if len(failures) == MOST_ENDS:
                    break
    except OutOfEffort as end:
        raise (failures[0] if failures else end) from None
    raise failures[0]


def _phase_motions(
    ends: Ends,
    end_of: dict[int, Array],
    phases: Sequence[tuple[MotionConstraint, ...]],
    before: tuple[MotionConstraint, ...],
) -> Iterator[PhaseMotion]:
    """Yield the motions of all phases, given their ends."""
    here = ends.start
    for phase, constraints in enumerate(phases):
        end = end_of.get(phase, here)
        numbers = ends.phases.get(phase, ())
        excess = ends.functions.excess(ends.functions.all_values(here[None])[0])
        kept = [
            number
            for number, one in zip(numbers, constraints, strict=True)
            if excess[number] <= 1.0 and any(one.asks_the_same(other) for other in before)
        ]
        way = Way(ends.problem, ends.functions, here, end, kept, numbers, phase)
        given_up = ends.given_up.get(phase, set()) - ends.wished.keys()
        of = [bound.constraint for bound in ends.functions.bounds]
        yield PhaseMotion(way.timed(), tuple(of[k] for k in kept), tuple(of[k] for k in numbers if k in given_up))
        here, before = end, constraints


@dataclass(slots=True)
class Way:
    """Path of one phase from a configuration (n,) to another."""

    problem: MotionProblem
    functions: ConstraintFunctions
    start: Array
    end: Array
    kept: Sequence[int]
    """Constraints that hold throughout, by number."""
    active: Sequence[int]
    phase: int

    def timed(self) -> Trajectory:
        """Plan the timed motion; raises :class:`NoConstrainedPath`."""
        problem, group = self.problem, self.problem.group
        if np.abs(self.end - self.start).max() <= UNMOVED:
            return Trajectory(group.names, self.start[None])
        if problem.obstacles is not None:
            problem.obstacles.keep(KEPT, (self.start, self.end))
        objection: Sequence[tuple[str, str]] = ()
        for waypoints in self._guesses():
            trajectory, objection = self._optimised(waypoints)
            if trajectory is not None:
                return trajectory
        if problem.obstacles is not None:
            around = self._around()
            if around is not None:
                trajectory, objection = self._optimised(_spread(around, MOST))
                if trajectory is None and not self.kept:
                    trajectory = self._checked(around, time_path)[0]
                if trajectory is not None:
                    return trajectory
        raise NoConstrainedPath(self.phase, self._of(self.kept), objection)

    def through(self, rows: Array) -> Trajectory:
        """Time the motion through configurations (m, n), both ends included, on a curve or straight: the quicker one.

        Raises NoConstrainedPath.
        """
        objection: Sequence[tuple[str, str]] = ()
        timed = [self._in_time(rows, timing) for timing in (time_curve, time_path)]
        for one in sorted(timed, key=lambda one: len(one.positions)):
            hits = self._hits(one)
            if hits is not None and not hits:
                return one
            objection = hits[0][1] if hits else objection
        raise NoConstrainedPath(self.phase, self._of(self.kept), objection)

    def _of(self, numbers: Sequence[int]) -> list[MotionConstraint]:
        return [self.functions.bounds[number].constraint for number in numbers]

    def _guesses(self) -> Iterator[Array]:
        """Yield waypoints (m, n) between the ends, on the straight line: some, then twice as many."""
        count = int(np.clip(np.ceil(np.abs(self.end - self.start).max() / FAR), FEWEST, MOST))
        straight = np.stack([self.start, self.end])
        yield _spread(straight, count)
        if self.kept:
            yield _spread(straight, 2 * count)

    def _around(self) -> Array | None:
        """Plan a path (m, n) around bodies, without constraints."""
        problem, group = self.problem, self.problem.group
        assert problem.obstacles is not None
        resolution = np.where(group.prismatic, SLIDE_STEP, TURN_STEP)
        space = JointSpace.of(group.lower, group.upper, continuous=group.continuous, resolution=resolution)
        rng = np.random.default_rng(problem.seed)
        problem.effort.spend(AROUND)
        try:
            path = plan_path(
                self.start,
                self.end,
                space,
                problem.obstacles,
                lambda q, _: problem.touching(q),
                rng,
                iterations=SEARCHED,
            )
        except MotionError:
            return None
        problem.obstacles.keep(KEPT, (self.start, self.end))
        whole_turns = np.abs(path[-1] - self.end).max() > UNMOVED
        return None if whole_turns else np.vstack([self.start, path[1:-1], self.end])

    def _optimised(self, waypoints: Array) -> tuple[Trajectory | None, Sequence[tuple[str, str]]]:
        """Optimise and time waypoints (m, n): the motion, or None and what touches."""
        problem = self.problem
        objection: Sequence[tuple[str, str]] = ()
        pairs = [(k, one) for k in range(len(waypoints)) for one in self.kept]
        optimiser = Optimiser(
            self.functions,
            Rows.of(pairs),
            self.start,
            self.end,
            problem.rates.prices(),
            np.ones(len(pairs)),
            problem.effort,
            None if problem.obstacles is None else problem.clearances,
        )
        for times in range(CORRECTIONS):
            optimum = optimiser.found_from(waypoints)
            if not optimum.holds:
                return None, objection
            waypoints = optimum.q
            whole = np.vstack([self.start, waypoints, self.end])
            for timing in (time_curve, time_path):  # a curve is faster, but swings out
                timed, hits = self._checked(whole, timing)
                if timed is not None:
                    return timed, ()
            if not hits:  # functions leave their limits between waypoints
                return None, objection
            objection = hits[0][1]
            problem.learn(hits, times)
        return None, objection

    def _checked(self, waypoints: Array, timing: Callable[..., Trajectory]) -> tuple[Trajectory | None, Hits]:
        """Time waypoints (m, n), ends included, and check the motion: None, and what touches, if it is invalid."""
        timed = self._in_time(waypoints, timing)
        hits = self._hits(timed)
        return (timed if hits is not None and not hits else None), hits or []

    def _hits(self, timed: Trajectory) -> Hits | None:
        """Find exact collisions of a timed motion; None if it leaves joint limits or constraints."""
        return self.problem.hits(timed.positions[1:-1]) if self._keeps(timed.positions) else None

    def _keeps(self, rows: Array) -> bool:
        """Check that rows (m, n) respect joint limits and the constraints that hold throughout."""
        if not self.problem.group.within(rows, 1e-3).all():
            return False
        if not self.kept:
            return True
        excess = self.functions.excess(self.functions.all_values(rows))
        return bool(excess[:, list(self.kept)].max() <= 1.0)

    # Timing

    def _in_time(self, waypoints: Array, timing: Callable[..., Trajectory]) -> Trajectory:
        """Time waypoints (m, n) such that no tool is faster than its constraints allow."""
        problem = self.problem
        rates, velocity = problem.rates, problem.rates.velocity
        while True:
            timed = timing(
                problem.group.names,
                waypoints,
                velocity=velocity,
                acceleration=rates.acceleration,
                jerk=rates.jerk,
                rate=rates.rate,
            )
            hurry = self._hurry(timed.positions)
            if hurry <= 1.0:
                return timed
            velocity = velocity / (HASTE * hurry)

    def _hurry(self, rows: Array) -> float:
        """Compute the greatest ratio of a tool feature's speed to the allowed one in rows (m, n)."""
        ratio = 0.0
        for arm in sorted({self.functions.bounds[k].arm for k in self.active}):
            poses = self.problem.group.fk(rows, arm)
            turned = _angles(poses) * self.problem.rates.rate
            for bound in (self.functions.bounds[k] for k in self.active):
                if bound.arm != arm:
                    continue
                pace = (bound.constraint.speed or Speed.MEDIUM).value
                points = moved(poses, bound.parameters[:3])
                speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) * self.problem.rates.rate
                ratio = max(ratio, float(speeds.max(initial=0.0)) / pace.linear, turned / pace.angular)
        return ratio


def _angles(poses: Array) -> float:
    """Largest angle between consecutive poses (m, 4, 4) [rad]."""
    turns = np.einsum("mij,mik->mjk", poses[:-1, :3, :3], poses[1:, :3, :3]) - np.eye(3)
    # for a turn by t, |R - 1| = 2 sqrt(2) sin(t / 2); the trace would lose small angles to rounding
    half_sines = np.sqrt((turns * turns).sum(axis=(1, 2)) / 8)
    return float(2 * np.arcsin(np.minimum(half_sines, 1.0)).max(initial=0.0))


def _spread(waypoints: Array, count: int) -> Array:
    """Interpolate configurations (count, n) evenly between the first and the last of waypoints (m, n)."""
    lengths = np.abs(np.diff(waypoints, axis=0)).max(axis=1)
    marks = np.append(0.0, np.cumsum(lengths))
    at = np.linspace(0.0, marks[-1], count + 2)[1:-1]
    return np.stack([np.interp(at, marks, column) for column in waypoints.T], axis=1)
