"""Ends of the phases of a constrained motion: configurations at which each phase's constraints hold.

All phases are optimised together, so that consecutive ends are close, from several initial guesses, since the
optimisation is local. If that fails, each phase is treated by itself: of constraints that cannot all hold a minimal
conflicting set is found by deletion (J. Chinneck, E. Dravnieks, Locating minimal infeasible constraint sets in linear
programs, ORSA J. Computing 1991). Its lightest constraints are given up; if all weigh the same, the problem is
infeasible.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from itertools import islice
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from executive.motion.arm_group import ArmGroup
from executive.motion.arm_path import Quick, bisection
from executive.motion.constraint_functions import Bound, ConstraintFunctions, Surroundings
from executive.motion.constraint_optimisation import Index, Optimiser, Optimum, Rows
from executive.motion.errors import ConstraintsContradict, Effort, OutOfEffort
from planlang.geometry import Array
from planlang.motion_constraints import MotionConstraint
from planlang.records import dataclass

BEGINNINGS = 16
"""Initial guesses per search: of 180 random problems one needed 8, all others at most 3."""
ROUNDS = 4
"""Optimisations of a closed stroke: more made four spoons in a pot no quicker."""
NUDGE = 0.1
"""Standard deviation of the random offset of the second guess [rad, m]: gradients may vanish at the start."""
NEAR = 0.05
"""Room up to which the optimisation considers bodies [m]."""
FARTHER = 0.002
"""Distance added between bodies that turned out to touch, doubled each time in a row [m]."""
MOST_HITS = 3
"""Exact hits after which checking stops: learning from them changes the motion."""
CORRECTIONS = 6
"""Rounds of exact hits after which an end, or a path, is given up."""
GIVEN_UP = 1e-4
"""Price of the excess of a constraint that heavier ones exclude, relative to 1."""
WISHED = 0.1
"""Price of a soft constraint's excess, divided by its greatest possible excess [tolerances]: more than the price of
longer joint moves, too little to push hard constraints beyond their limits."""
MOST_UNEQUAL = 50.0
"""Largest ratio of the price of a joint's moves to the median in a phase."""


MOST = 200_000
"""Budget of a search in variables of quadratic programs; an exact check counts as :data:`EXACT` of them."""
EXACT = 20

Hits = list[tuple[Array, Sequence[tuple[str, str]]]]
"""Configurations (n,), each with the bodies that touch there."""

OTHER = 0.05
"""Smallest difference of a joint between distinct ends [rad, m]."""


class Obstacles(Quick, Protocol):
    """Bodies that must not be touched: :class:`executive.motion.collision.QuickCheck` of a group of arms."""

    @property
    def names(self) -> tuple[tuple[str, str], ...]:
        """The two bodies of each pair."""

    def sure(self, q: Array) -> NDArray[np.bool_]:
        """Check which configurations (m, n) are surely free."""

    def room(self, q: Array, within: float, among: Index | None = None) -> tuple[Index, Index, Array]:
        """Find pairs and configurations (k,) whose room is at most ``within`` [m], and that room (k,)."""

    def learn(self, q: Array, pairs: Sequence[tuple[str, str]], by: float = ...) -> None:
        """Learn which pairs touch at a configuration (n,): keep them farther apart [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class JointRates:
    """Limits of moving joints (n,), and the rows per second of trajectories."""

    velocity: Array
    acceleration: Array
    jerk: Array
    rate: int
    most_unequal: float = MOST_UNEQUAL
    """Largest ratio of the price of a joint's moves to the median."""

    def prices(self) -> Array:
        """Compute the prices of squared moves (n,): slow joints are expensive."""
        slowness = self.velocity**-2.0
        return np.clip(slowness / np.median(slowness), 1 / self.most_unequal, self.most_unequal)


@dataclass(frozen=True, slots=True, eq=False)
class MotionProblem:
    """Arms and their surroundings."""

    group: ArmGroup
    where: Surroundings
    rates: JointRates
    obstacles: Obstacles | None = None
    touching: Callable[[Array], Sequence[tuple[str, str]]] = lambda q: ()
    """Exact check of a configuration (n,): which pairs of bodies collide."""
    seed: int = 0
    """Seed of the random initial guesses."""
    effort: Effort = field(default_factory=lambda: Effort(MOST, "variables of quadratic programs"))
    """Computing budget."""

    def hits(self, q: Array) -> Hits:
        """Find configurations (m, n) in exact collision, with the pairs; all of them, or the first :data:`MOST_HITS`.

        They are checked in bisection order, the middle of unchecked parts first.
        """
        rows = q if self.obstacles is None else q[~self.obstacles.sure(q)]
        candidates = ((row, self.touches(row)) for row in rows[bisection(len(rows) + 1) - 1])
        return list(islice((hit for hit in candidates if hit[1]), MOST_HITS))

    def touches(self, q: Array) -> Sequence[tuple[str, str]]:
        """Find the pairs in exact collision at a configuration (n,)."""
        self.effort.spend(EXACT)
        return self.touching(q.copy())

    def afresh(self) -> MotionProblem:
        """Copy the problem with an unspent budget."""
        return replace(self, effort=replace(self.effort, spent=0))

    def learn(self, hits: Hits, times: int) -> None:
        """Keep touching bodies farther apart from now on; ``times`` counts repetitions in a row."""
        for row, pairs in hits:
            if self.obstacles is not None:
                self.obstacles.learn(row, pairs, FARTHER * 2**times)

    def clearances(self, q: Array, among: Index | None) -> tuple[Index, Index, Array]:
        """Find near pairs of bodies, configurations, and their room [m]: :data:`Clearances`."""
        assert self.obstacles is not None
        return self.obstacles.room(q, NEAR, among)


@dataclass(slots=True)
class Ends:
    """Search for the ends of phases; each phase is a set of constraints, by number."""

    problem: MotionProblem
    start: Array
    functions: ConstraintFunctions
    phases: Mapping[int, Sequence[int]]
    """Number of a phase with constraints -> its constraints."""
    given_up: dict[int, set[int]] = field(default_factory=dict)
    """Phase -> constraints that need not hold: heavier ones exclude them, or they are soft."""
    wished: Mapping[int, float] = field(default_factory=dict)
    """Soft constraints of the last phase, which hold as far as they can, with the prices of their excess."""
    explains: bool = True
    """True to find out which constraints conflict: that takes longer than all the rest."""

    @staticmethod
    def of(
        problem: MotionProblem,
        start: Array,
        asked: Sequence[Sequence[MotionConstraint]],
        wishes: Mapping[MotionConstraint, MotionConstraint] = MappingProxyType({}),
    ) -> Ends:
        """Set up the search for phases of active constraints from a configuration (n,).

        ``wishes``: soft constraints of the last phase -> the same with the limits that must hold.
        """
        every = list(dict.fromkeys(one for phase in asked for one in phase))
        functions = ConstraintFunctions(problem.group, [Bound.of(one, problem.where) for one in every])
        number = {one: k for k, one in enumerate(every)}
        phases = {k: [number[one] for one in phase] for k, phase in enumerate(asked) if phase}
        wished = {
            number[one]: WISHED / max(1.0, float(functions.excess(_limits(wide)[:, None])[:, number[one]].max()))
            for one, wide in wishes.items()
        }
        return Ends(problem, start, functions, phases, {len(asked) - 1: set(wished)}, wished)

    def found(self) -> Iterator[dict[int, Array]]:
        """Yield ends (n,) of phases, by their numbers, better ones first.

        Raises :class:`ConstraintsContradict` if there are none.
        """
        distinct: list[Array] = []
        needed = [(phase, [one for one in asked if one not in self.wished]) for phase, asked in self.phases.items()]
        for beginning in self._beginnings(len(self.phases)):
            optimum = self._optimum(beginning, needed)
            if optimum.holds and all(np.abs(optimum.q - q).max(initial=0.0) > OTHER for q in distinct):
                distinct.append(optimum.q)
                better = (self._optimum(q, list(self.phases.items())) for q in (optimum.q, beginning) if self.wished)
                yield from (self._by_phase(one.q) for one in islice((one for one in better if one.holds), 1))
                yield self._by_phase(optimum.q)
            if not self.phases:
                return
        if not distinct and not self.explains:
            raise ConstraintsContradict(0, [one.constraint for one in self.functions.bounds])
        if not distinct:
            alone = np.array([self._alone(phase) for phase in self.phases])
            optimum = self._optimum(alone, list(self.phases.items()))
            yield self._by_phase(optimum.q if optimum.holds else alone)

    def along(self, most: int = BEGINNINGS) -> Iterator[dict[int, Array]]:
        """Yield ends (n,) of phases, by number, each optimised from the one before: consecutive ends are close."""
        every = list(self.phases.items())
        for beginning in self._beginnings(1, most):
            rows = beginning
            for one in every:
                optimum = self._optimum(rows[-1:], [one])
                if not optimum.holds:
                    break
                rows = np.vstack([rows, optimum.q])
            else:
                whole = self._optimum(rows[1:], every)
                yield self._by_phase(whole.q if whole.holds else rows[1:])

    def near(self, q: Array) -> Iterator[dict[int, Array]]:
        """Yield ends (n,) of phases, by number, optimised from guesses (m, n), one for each; nothing if they fail."""
        optimum = self._optimum(q, list(self.phases.items()))
        if optimum.holds:
            yield self._by_phase(optimum.q)

    def rounded(self, q: Array) -> Array:
        """Optimise ends (m, n) of a closed sequence of phases for less time between them.

        All but one are optimised together, then all but the opposite one. Moves cost time: a torso far slower than the
        joints of an arm keeps still if it can.
        """
        asked, slowness, q = list(self.phases.values()), self.problem.rates.velocity**-2.0, q.copy()
        for turn in range(ROUNDS):
            first = turn % 2 * (len(q) // 2)
            others = [*range(first + 1, len(q)), *range(first)]
            pairs = [(k, one) for k, other in enumerate(others) for one in asked[other]]
            optimiser = self._optimiser(pairs, [1.0] * len(pairs), blocked=self.problem.obstacles is not None)
            optimiser.start = optimiser.end = q[first]
            optimiser.weights = slowness / np.median(slowness)
            optimum = optimiser.found_from(q[others])
            if not optimum.holds:
                break
            q[others] = optimum.q
        return q

    def reached(self, tries: int) -> Iterator[Array]:
        """Yield configurations (n,) at which the last phase ends, from ``tries`` guesses, ignoring obstacles.

        Stops early when the problem's budget is spent.
        """
        every = list(self.phases.items())
        with suppress(OutOfEffort):
            for beginning in islice(self._beginnings(len(every), tries), tries):
                optimum = self._optimum(beginning, every, blocked=False)
                if optimum.holds:
                    yield np.asarray(optimum.q[-1])

    def _by_phase(self, q: Array) -> dict[int, Array]:
        return dict(zip(self.phases, q, strict=True))

    def _beginnings(self, count: int, most: int = BEGINNINGS) -> Iterator[Array]:
        """Yield guesses (count, n), equal for all phases: the start, nudged, with rolled hands, random."""
        rng, group = np.random.default_rng(self.problem.seed), self.problem.group
        yield np.repeat(self.start[None], count, axis=0)
        yield np.repeat(self.start[None] + rng.normal(0.0, NUDGE, group.dof), count, axis=0)
        rolled = [self._rolled(hands) for hands in range(1, 2 ** len(group.chains))]
        for one in rolled:
            yield np.repeat(one[None], count, axis=0)
        for _ in range(most - 2 - len(rolled)):
            anywhere = group.near(rng.uniform(group.lower, group.upper), self.start)
            yield np.repeat(anywhere[None], count, axis=0)

    def _rolled(self, hands: int) -> Array:
        """Turn the last joints of some chains, a bit each, by half a turn from the start (n,)."""
        group, q = self.problem.group, self.start.copy()
        for k, columns in enumerate(group.columns):
            if hands >> k & 1:
                last = columns[-1]
                q[last] += np.pi if group.continuous[last] or q[last] + np.pi <= group.upper[last] else -np.pi
        return np.clip(q, *group.bounds)

    def _optimum(self, q: Array, phases: Sequence[tuple[int, Collection[int]]], *, blocked: bool = True) -> Optimum:
        """Optimise phases from configurations (m, n); an optimum in exact collision does not hold."""
        problem = self.problem
        pairs = [(k, one) for k, (_, asked) in enumerate(phases) for one in asked]
        prices = [self._price(phase, one) for phase, asked in phases for one in asked]
        optimum = self._optimiser(pairs, prices, blocked=False).found_from(q)
        if problem.obstacles is None or not blocked or not optimum.holds:
            return optimum
        problem.obstacles.keep(0.0, (self.start,))
        optimiser = self._optimiser(pairs, prices, blocked=True)
        for times in range(CORRECTIONS):
            if not problem.obstacles.free(optimum.q).all():
                optimum = optimiser.found_from(optimum.q)
            hits = problem.hits(optimum.q) if optimum.holds else []
            if not hits:
                return optimum
            problem.learn(hits, times)
        return replace(optimum, blocked=np.inf)

    def _price(self, phase: int, one: int) -> float:
        if one not in self.given_up.get(phase, ()):
            return 1.0
        return self.wished.get(one, GIVEN_UP)

    def _optimiser(self, pairs: Sequence[tuple[int, int]], prices: Sequence[float], *, blocked: bool) -> Optimiser:
        return Optimiser(
            self.functions,
            Rows.of(pairs),
            self.start,
            None,
            self.problem.rates.prices(),
            np.array(prices, float),
            self.problem.effort,
            self.problem.clearances if blocked else None,
        )

    # Conflicts

    def _alone(self, phase: int) -> Array:
        """Find an end (n,) of a single phase, giving up what heavier constraints exclude."""
        given_up = self.given_up.setdefault(phase, set())
        while True:
            q = self._holding(phase, self.phases[phase])
            if q is not None:
                return q
            hard = [one for one in self.phases[phase] if one not in given_up]
            conflict, pairs = self._conflict(phase, hard)
            weights = {one: self._constraint(one).weight for one in conflict}
            lightest = min(weights.values())
            if lightest == max(weights.values()):
                raise ConstraintsContradict(phase, [self._constraint(one) for one in conflict], pairs)
            given_up.update(one for one, weight in weights.items() if weight == lightest)

    def _holding(self, phase: int, asked: Collection[int], *, blocked: bool = True) -> Array | None:
        """Find a configuration (n,) at which constraints of a phase hold, if possible."""
        for beginning in self._beginnings(1):
            optimum = self._optimum(beginning, [(phase, asked)], blocked=blocked)
            if optimum.holds:
                return np.asarray(optimum.q[0])
        return None

    def _conflict(self, phase: int, hard: Sequence[int]) -> tuple[list[int], Sequence[tuple[str, str]]]:
        """Find a minimal set of constraints that cannot all hold, and the bodies in their way."""
        free = self._holding(phase, hard, blocked=False)
        conflict = list(hard)
        for one in sorted(hard, key=lambda k: self._constraint(k).weight):
            rest = [k for k in conflict if k != one]
            if self._holding(phase, rest, blocked=free is not None) is None:
                conflict = rest
        return conflict, () if free is None else self._in_the_way(phase, conflict)

    def _in_the_way(self, phase: int, conflict: Sequence[int]) -> Sequence[tuple[str, str]]:
        """Find the bodies that would collide where constraints hold."""
        problem, q = self.problem, self._holding(phase, conflict, blocked=False)
        assert problem.obstacles is not None
        assert q is not None
        exact = problem.touching(q)
        if exact:
            return exact
        pairs, _, room = problem.obstacles.room(q[None], 0.0)
        return [problem.obstacles.names[pair] for pair in pairs[np.argsort(room, kind="stable")].tolist()]

    def _constraint(self, number: int) -> MotionConstraint:
        return self.functions.bounds[number].constraint


def _limits(constraint: MotionConstraint) -> Array:
    """List the finite limits of a constraint (1 or 2,)."""
    limits = np.array(constraint.limits)
    return np.asarray(limits[np.isfinite(limits)])
