"""Optimisation of a few consecutive configurations: short joint moves under bounds on constraints and clearances.

The cost is the sum of squared moves between configurations, plus squared violations of bounds, in tolerances. It is
minimised by sequential quadratic programming: functions are linearised by casadi, the convex programs are solved by
casadi's interface to DAQP (D. Arnström, A. Bemporad, D. Axehill, A dual active-set solver for embedded quadratic
programming, IEEE TAC 2022), and steps are kept within a trust region (J. Nocedal, S. Wright, Numerical Optimization,
chapter 18). Clearances are linearised as in J. Schulman et al., Motion planning with sequential convex optimization and
convex collision checking (IJRR 2014).

With squared penalties a joint move of 1 rad violates a bound by less than a hundredth of its tolerance. Conflicting
bounds share the violation among themselves, and with no others.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from functools import lru_cache
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.motion.constraint_functions import ConstraintFunctions
from executive.motion.errors import Effort
from planlang.geometry import Array
from planlang.records import dataclass

STEPS = 40
"""Quadratic programs after which the best result so far is returned."""
RADIUS, LARGEST_RADIUS, LEAST_RADIUS = 0.5, 1.5, 1e-5
"""Largest joint change per step (trust region): at first, ever, and when the search ends [rad, m]."""
HOLDS = 0.5
"""Share of its tolerance by which a function may exceed its limits: the rest is reserved for between waypoints."""
ENOUGH, FLAT, STALLED = 0.2, 0.02, 1e-3
"""The search ends once all bounds hold to the first share and a step improves the cost by less than the second; or, in
any case, by less than the third."""
CLEARANCE_TOLERANCE = 5e-3
"""Missing clearance that weighs as much as a function that exceeds its limits by its tolerance [m]."""
UNBOUNDED = 1e20
PROBE = 1e-4
"""Joint change for finite differences of clearances [rad, m]."""

Index = NDArray[np.intp]
Clearances = Callable[[Array, Index | None], tuple[Index, Index, Array]]
"""Configurations (m, n) -> number and configuration (k,) of each near pair of bodies, and its room beyond what is
required (k,) [m]; for the given pairs, or for all."""


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """r bounds: the configuration and constraint of each."""

    configurations: Index
    constraints: Index

    @staticmethod
    def of(pairs: Sequence[tuple[int, int]]) -> Rows:
        """Create bounds from pairs (configuration, constraint)."""
        rows = np.array(pairs, np.intp).reshape(-1, 2)
        return Rows(rows[:, 0], rows[:, 1])


@dataclass(frozen=True, slots=True, eq=False)
class Optimum:
    """Result of an optimisation."""

    q: Array
    """Configurations (m, n)."""
    excess: Array
    """Violation of each row, in tolerances (r,)."""
    blocked: float
    """Greatest missing clearance [m]; 0 without collision."""
    needed: NDArray[np.bool_]
    """Mask of the rows that must hold (r,)."""

    @property
    def holds(self) -> bool:
        """Whether all rows that must hold do, without collision."""
        beyond = float(self.excess[self.needed].max(initial=0.0))
        return beyond <= HOLDS and self.blocked <= HOLDS * CLEARANCE_TOLERANCE


@dataclass(slots=True)
class Optimiser:
    """A sequence of configurations (m, n) that starts at a fixed one and may end at one."""

    functions: ConstraintFunctions
    rows: Rows
    start: Array
    """Configuration before the first (n,)."""
    end: Array | None
    """Configuration after the last (n,), if fixed."""
    weights: Array
    """Price of squared moves of each joint (n,)."""
    penalties: Array
    """Price of the squared excess of each row (r,): 1 for those that must hold."""
    effort: Effort
    """Budget in variables of quadratic programs."""
    clearances: Clearances | None = None
    lower: Array = field(init=False)
    upper: Array = field(init=False)
    tolerance: Array = field(init=False)

    def __post_init__(self) -> None:
        which, functions = self.rows.constraints, self.functions
        self.tolerance = functions.tolerance[which]
        # tighten bounds by a part of the tolerance where possible: functions deviate between waypoints
        room = np.minimum((functions.upper[which] - functions.lower[which]) / 2, HOLDS * self.tolerance)
        lower, upper = functions.lower[which] + room, functions.upper[which] - room
        self.lower, self.upper = np.minimum(lower, upper), np.maximum(lower, upper)  # rounding may swap them

    def found_from(self, q: Array) -> Optimum:
        """Optimise from configurations (m, n)."""
        low, high = self.functions.group.bounds
        q = np.clip(q, low, high)
        here = self._at(q)
        radius, steps = RADIUS, 0
        straight = np.abs(self._slope(q)).max(initial=0.0) < LEAST_RADIUS
        if straight and here.price <= self._moves(q):  # all bounds hold, and no path is shorter
            steps = STEPS
        while steps < STEPS:
            steps += 1
            move, predicted = self._step(here, radius)
            length = float(np.abs(move).max(initial=0.0))
            there = self._at(np.clip(here.q + move, low, high))
            gained, promised = here.price - there.price, here.price - predicted
            before = here.price
            if gained > 0:
                here = there
            if gained > 0.75 * promised:
                radius = min(max(radius, 2 * length), LARGEST_RADIUS)
            elif gained < 0.25 * promised:
                radius = 0.35 * length
            least_gain = FLAT if here.excess.max(initial=0.0) <= ENOUGH else STALLED
            if radius < LEAST_RADIUS or (gained > 0 and gained < least_gain * before):
                break
        values = self.functions.values(here.q[self.rows.configurations], self.rows.constraints)[0]
        which = self.rows.constraints
        beyond = np.maximum(self.functions.lower[which] - values, values - self.functions.upper[which])
        blocked = float(-here.room.min(initial=0.0))
        return Optimum(here.q, np.maximum(beyond, 0.0) / self.tolerance, blocked, self.penalties >= 1.0)

    def _at(self, q: Array) -> _Here:
        """Evaluate functions, gradients and the cost at configurations."""
        values, gradients = self.functions.values(q[self.rows.configurations], self.rows.constraints)
        excess = np.maximum(np.maximum(self.lower - values, values - self.upper), 0.0) / self.tolerance
        pairs, of, room = (_NONE, _NONE, np.zeros(0)) if self.clearances is None else self.clearances(q, None)
        missing = np.maximum(-room, 0.0) / CLEARANCE_TOLERANCE
        price = self._moves(q) + (self.penalties @ (excess * excess) + missing @ missing) / 2
        return _Here(q, values, gradients, excess, pairs, of, room, float(price))

    def _moves(self, q: Array) -> float:
        """Cost of the moves."""
        return float((np.diff(self._whole(q), axis=0) ** 2 @ self.weights).sum() / 2)

    def _whole(self, q: Array) -> Array:
        return np.vstack([self.start, q] if self.end is None else [self.start, q, self.end])

    def _slopes(self, here: _Here) -> Array:
        """Compute the gradients (k, n) of the room of near pairs by finite differences."""
        n = here.q.shape[1]
        slopes = np.zeros((len(here.pairs), n))
        if self.clearances is None or not len(here.pairs):
            return slopes
        # vary each joint in turn, at configurations with something near
        near, place = np.unique(here.of, return_inverse=True)
        moved = (here.q[near][:, None] + PROBE * np.eye(n)).reshape(-1, n)
        pairs, rows, room = self.clearances(moved, np.unique(here.pairs))
        known = dict(zip(zip(pairs.tolist(), rows.tolist(), strict=True), room.tolist(), strict=True))
        for k, (pair, row) in enumerate(zip(here.pairs.tolist(), place.tolist(), strict=True)):
            for joint in range(n):
                slopes[k, joint] = (known.get((pair, row * n + joint), here.room[k]) - here.room[k]) / PROBE
        return slopes

    def _step(self, here: _Here, radius: float) -> tuple[Array, float]:
        """Solve the quadratic program for the move (m, n), and predict the cost."""
        m, n = here.q.shape
        count, near = len(self.rows.constraints), len(here.room)
        slack, size = count + near, m * n
        self.effort.spend(size + slack)
        hessian = np.zeros((size + slack, size + slack))
        hessian[:size, :size] = np.kron(self._coupling(m), np.diag(self.weights))
        penalties = np.append(self.penalties, np.ones(near))
        hessian[range(size, size + slack), range(size, size + slack)] = penalties
        jacobian = np.zeros((slack, m, n))
        jacobian[np.arange(count), self.rows.configurations] = here.gradients / self.tolerance[:, None]
        jacobian[count + np.arange(near), here.of] = self._slopes(here) / CLEARANCE_TOLERANCE
        least = np.append((self.lower - here.values) / self.tolerance, -here.room / CLEARANCE_TOLERANCE)
        most = np.append((self.upper - here.values) / self.tolerance, np.full(near, UNBOUNDED))
        low, high = self.functions.group.bounds
        free = np.full(slack, UNBOUNDED)
        solution = _program(size + slack, slack)(
            h=hessian,
            g=np.append((self._slope(here.q) * self.weights).ravel(), np.zeros(slack)),
            a=np.hstack([jacobian.reshape(slack, size), np.eye(slack)]),
            lba=np.maximum(least, -UNBOUNDED),
            uba=np.minimum(most, UNBOUNDED),
            lbx=np.append(np.maximum(low - here.q, -radius).ravel(), -free),
            ubx=np.append(np.minimum(high - here.q, radius).ravel(), free),
        )
        x = np.asarray(solution["x"].full()).ravel()
        move, beyond = x[:size].reshape(m, n), x[size:]
        return move, self._moves(here.q + move) + float(penalties @ (beyond * beyond)) / 2

    def _slope(self, q: Array) -> Array:
        """Gradient of the moves (m, n), for joints of weight 1."""
        moves = np.diff(self._whole(q), axis=0)
        after = moves[1:] if self.end is not None else np.vstack([moves[1:], np.zeros(q.shape[1])])
        return np.asarray(moves[: len(q)] - after)

    def _coupling(self, m: int) -> Array:
        """Second derivative of the moves of one joint of weight 1 (m, m)."""
        matrix = 2 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)
        if self.end is None:
            matrix[-1, -1] = 1.0
        return np.asarray(matrix)


@dataclass(frozen=True, slots=True, eq=False)
class _Here:
    """Values at the current configurations."""

    q: Array
    values: Array
    gradients: Array
    excess: Array
    pairs: Index
    """Near pairs of bodies (k,)."""
    of: Index
    """Configuration of each (k,)."""
    room: Array
    """Clearance of each beyond what is required (k,) [m]."""
    price: float


_NONE = np.zeros(0, np.intp)


@lru_cache(64)
def _program(size: int, rows: int) -> Any:
    """Create the solver of dense programs with ``size`` variables and ``rows`` constraints."""
    shape = {"h": casadi.Sparsity.dense(size, size), "a": casadi.Sparsity.dense(rows, size)}
    return casadi.conic("program", "daqp", shape, {"error_on_fail": False})
