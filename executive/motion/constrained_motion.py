"""Motions of arms under constraints, phase by phase: the way to the end of each, and its timing.

Constraints hold at the end of a phase, and those throughout it that held at its beginning and were asked for, with the
same limits, in the phase before: so a cup is carried upright, and a spatula stays on the pan while it is pushed. Ways
are optimised from the straight one, or from one that :mod:`executive.motion.arm_path` finds around what is in the way,
and every row of the timed motion is checked: functions, joint limits, and what touches, exactly.
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
"""Numbers of waypoints between the ends of a phase; they are doubled once where functions leave limits in between."""
KEPT = 0.01
"""Distance that a way keeps from everything where its ends allow it [m]."""
MOST_ENDS = 4
"""Ends to which ways are looked for."""
SEARCHED = 300
"""Branches of a search for a way around what is in the way."""
AROUND = 10_000
"""Variables of quadratic programs that such a search, which has a bound of its own, counts as."""
TURN_STEP, SLIDE_STEP = 0.08, 0.02
"""Steps in which such a way is checked [rad], [m]."""
HASTE = 1.002
"""By how much more than needed joints are slowed down where a tool is too fast: rows are whole parts of a second."""
UNMOVED = 1e-9
"""Joint moves up to this are none [rad, m]."""


@dataclass(frozen=True, slots=True, eq=False)
class PhaseMotion:
    """The motion of one phase."""

    trajectory: Trajectory
    """Begins where the phase before ended; a single row where nothing moves."""
    kept: tuple[MotionConstraint, ...]
    """The constraints that hold throughout, beside at the end."""
    given_up: tuple[MotionConstraint, ...]
    """The constraints that heavier ones exclude."""


def solve_motion(
    problem: MotionProblem,
    start: Array,
    phases: Sequence[Sequence[MotionConstraint]],
    before: Sequence[MotionConstraint] = (),
    *,
    wishes: Mapping[MotionConstraint, MotionConstraint] = MappingProxyType({}),
    explains: bool = True,
) -> list[PhaseMotion]:
    """Return how each phase is moved, from joint values (n,); ``before`` was asked for before the first.

    ``wishes``: constraints of the last phase, with narrower limits -> these; they hold at its end as far as all else
    allows. Unless it ``explains``, nothing is given up, and all constraints are named where they cannot all hold.

    Raises :class:`StartInCollision`, :class:`OutsideLimits`, :class:`ConstraintsContradict` with a smallest set of
    constraints of equal weight that cannot all hold, :class:`NoConstrainedPath`, :class:`OutOfEffort` where nothing was
    found out before as much was computed as may be, and :class:`MotionError` for features, tools or frames of which
    nothing is known.
    """
    begin = np.array(start, float)
    group, problem = problem.group, problem.afresh()
    if begin.shape != (group.dof,) or not np.isfinite(begin).all():
        raise ValueError(f"expected finite values of {group.names}, got shape {begin.shape}")
    if not group.within(begin, 1e-3).all():
        raise OutsideLimits("the start", begin.tolist(), *(limits.tolist() for limits in group.bounds))
    if pairs := problem.touching(begin.copy()):
        raise StartInCollision(begin.tolist(), pairs)
    asked = [tuple(one for one in phase if one.is_active) for phase in phases]
    if wishes:
        asked[-1] = (*asked[-1], *wishes)
    ends = Ends.of(problem, begin, asked, wishes)
    ends.explains = explains
    tried: list[NoConstrainedPath] = []
    try:
        for found in ends.found():
            try:
                return list(_moved(ends, found, asked, tuple(one for one in before if one.is_active)))
            except NoConstrainedPath as failure:
                tried.append(failure)
                if len(tried) == MOST_ENDS:
                    break
    except OutOfEffort as end:
        raise (tried[0] if tried else end) from None
    raise tried[0]


def _moved(
    ends: Ends,
    found: dict[int, Array],
    asked: Sequence[tuple[MotionConstraint, ...]],
    before: tuple[MotionConstraint, ...],
) -> Iterator[PhaseMotion]:
    """Yield the motions of all phases, whose ends are known."""
    here = ends.start
    for phase, constraints in enumerate(asked):
        end = found.get(phase, here)
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
    """The way of one phase from a configuration (n,) to another."""

    problem: MotionProblem
    functions: ConstraintFunctions
    start: Array
    end: Array
    kept: Sequence[int]
    """Constraints that hold throughout, by number."""
    active: Sequence[int]
    phase: int

    def timed(self) -> Trajectory:
        """Return the motion; raises :class:`NoConstrainedPath`."""
        problem, group = self.problem, self.problem.group
        if np.abs(self.end - self.start).max() <= UNMOVED:
            return Trajectory(group.names, self.start[None])
        if problem.obstacles is not None:
            problem.obstacles.keep(KEPT, (self.start, self.end))
        objection: Sequence[tuple[str, str]] = ()
        for waypoints in self._guesses():
            found, objection = self._optimised(waypoints)
            if found is not None:
                return found
        if problem.obstacles is not None:
            around = self._around()
            if around is not None:
                found, objection = self._optimised(_spread(around, MOST))
                if found is None and not self.kept:
                    found = self._checked(around, time_path)[0]
                if found is not None:
                    return found
        raise NoConstrainedPath(self.phase, self._of(self.kept), objection)

    def through(self, rows: Array) -> Trajectory:
        """Return the quicker motion through configurations (m, n), of which the ends are two: on a curve or straight.

        Raises NoConstrainedPath.
        """
        tried = [self._checked(rows, timing) for timing in (time_curve, time_path)]
        if found := [timed for timed, _ in tried if timed is not None]:
            return min(found, key=lambda timed: len(timed.positions))
        objection = next((hits[0][1] for _, hits in reversed(tried) if hits), ())
        raise NoConstrainedPath(self.phase, self._of(self.kept), objection)

    def _of(self, numbers: Sequence[int]) -> list[MotionConstraint]:
        return [self.functions.bounds[number].constraint for number in numbers]

    def _guesses(self) -> Iterator[Array]:
        """Yield waypoints (m, n) between the ends, on the straight way: some, and twice as many."""
        count = int(np.clip(np.ceil(np.abs(self.end - self.start).max() / FAR), FEWEST, MOST))
        straight = np.stack([self.start, self.end])
        yield _spread(straight, count)
        if self.kept:
            yield _spread(straight, 2 * count)

    def _around(self) -> Array | None:
        """Return a way (m, n) around bodies, without constraints."""
        problem, group = self.problem, self.problem.group
        assert problem.obstacles is not None
        resolution = np.where(group.prismatic, SLIDE_STEP, TURN_STEP)
        space = JointSpace.of(group.lower, group.upper, continuous=group.continuous, resolution=resolution)
        rng = np.random.default_rng(problem.seed)
        problem.effort.spend(AROUND)
        try:
            found = plan_path(
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
        whole_turns = np.abs(found[-1] - self.end).max() > UNMOVED
        return None if whole_turns else np.vstack([self.start, found[1:-1], self.end])

    def _optimised(self, waypoints: Array) -> tuple[Trajectory | None, Sequence[tuple[str, str]]]:
        """Return the motion through optimised waypoints (m, n), or None and what touches."""
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
        """Return waypoints (m, n), ends too, with times; None, and what touches, if it may not be moved like that."""
        timed = self._in_time(waypoints, timing)
        if not self._keeps(timed.positions):
            return None, []
        hits = self.problem.hits(timed.positions[1:-1])
        return (None if hits else timed), hits

    def _keeps(self, rows: Array) -> bool:
        """Return True if rows (m, n) are within joint limits, and constraints hold throughout."""
        if not self.problem.group.within(rows, 1e-3).all():
            return False
        if not self.kept:
            return True
        excess = self.functions.excess(self.functions.all_values(rows))
        return bool(excess[:, list(self.kept)].max() <= 1.0)

    # Timing

    def _in_time(self, waypoints: Array, timing: Callable[..., Trajectory]) -> Trajectory:
        """Return waypoints (m, n) with times, such that no tool is faster than its constraints allow."""
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
        """Return how many times as fast as allowed the features of tools move or turn at most in rows (m, n)."""
        most = 0.0
        for arm in sorted({self.functions.bounds[k].arm for k in self.active}):
            poses = self.problem.group.fk(rows, arm)
            turned = _angles(poses) * self.problem.rates.rate
            for bound in (self.functions.bounds[k] for k in self.active):
                if bound.arm != arm:
                    continue
                pace = (bound.constraint.speed or Speed.MEDIUM).value
                points = moved(poses, bound.parameters[:3])
                speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) * self.problem.rates.rate
                most = max(most, float(speeds.max(initial=0.0)) / pace.linear, turned / pace.angular)
        return most


def _angles(poses: Array) -> float:
    """Return the largest angle between one of poses (m, 4, 4) and the next [rad]."""
    turns = np.einsum("mij,mik->mjk", poses[:-1, :3, :3], poses[1:, :3, :3]) - np.eye(3)
    # of a turn by t: |R - 1| = 2 sqrt(2) sin(t / 2); its trace would lose small ones to rounding
    half_sines = np.sqrt((turns * turns).sum(axis=(1, 2)) / 8)
    return float(2 * np.arcsin(np.minimum(half_sines, 1.0)).max(initial=0.0))


def _spread(waypoints: Array, count: int) -> Array:
    """Return so many configurations (count, n) evenly between the first and the last of some waypoints (m, n)."""
    lengths = np.abs(np.diff(waypoints, axis=0)).max(axis=1)
    marks = np.append(0.0, np.cumsum(lengths))
    at = np.linspace(0.0, marks[-1], count + 2)[1:-1]
    return np.stack([np.interp(at, marks, column) for column in waypoints.T], axis=1)
