"""A Levenberg-Marquardt step for inverse kinematics as one symbolic function, and its iteration over many seeds.

With e = (p* - p, w log(R* R^T)) and J weighted alike, a step is dq = J^T (J J^T + l I)^-1 e with the damping
l = |e|^2 / 2 + bias of Sugihara (Solvability-unconcerned inverse kinematics, IEEE T-RO 2011). Columns of joints that
stand at a limit and would leave it are taken out of J; the step is clipped, then the joints. The constants are not
critical: 3 to 5 steps a round, giving up at 0.5 to 0.9, steps of 0.5 to 1.5 cost the same within a tenth (0.04 ms a
target for an arm on a lift, 0.1 ms for one of seven joints alone).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.motion.symbolic import RowFunction, SymbolicChain
from planlang.protocols import Array

ROTATION_WEIGHT = 0.5
"""Metres per radian in the error."""
BIAS = 1e-6
"""Smallest damping: keeps steps finite where the Jacobian loses rank."""
LARGEST_STEP = 0.8
"""Largest move of a joint in one step [rad, m]."""
STEPS = 4
"""Steps between two looks at the error from outside."""
ROUNDS = 12
"""Looks after which a seed is given up."""
STALLED = 0.8
"""A seed is given up when a round leaves more than this share of its squared error."""


@dataclass(frozen=True, slots=True)
class StepFunctions:
    """``steps``: (q, target) -> q after STEPS steps; ``error``: (q, target) -> (squared position, squared angle).

    A target is a row of 12: the rotation row by row, the position. Arguments of ``steps`` and ``error`` alike.
    """

    steps: Any
    error: Any
    tolerance: tuple[float, float]
    """Squared position [m^2] and squared angle [rad^2] at which a solution is one."""


class Solver(Protocol):
    """Iterates steps from seeds until targets are met; the virtual machine is one, compiled code can be another."""

    def __call__(self, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Targets (m, 12), seeds (m, s, d), tried in order -> the first solution (m, d), and whether there is one.

        A row without solution holds the configuration of the smallest error found.
        """


def step_functions(
    chain: SymbolicChain, lower: Array, upper: Array, tolerance: tuple[float, float], free_axis: Array | None
) -> StepFunctions:
    """Build the functions for joint limits (d,), tolerances [m, rad] and an axis of the tip that may turn freely."""
    q, target = chain.q, casadi.SX.sym("target", 12)
    wanted, place = casadi.reshape(target[:9], 3, 3).T, target[9:]
    linear = place - chain.position
    if free_axis is None:
        angular = _log(wanted @ chain.rotation.T)
        turning = chain.jacobian[3:, :]
    else:
        axis = chain.rotation @ casadi.SX(casadi.DM(free_axis))
        angular = _turn_between(axis, wanted @ casadi.SX(casadi.DM(free_axis)))
        turning = chain.jacobian[3:, :] - axis @ (axis.T @ chain.jacobian[3:, :])
    squares = casadi.vertcat(casadi.dot(linear, linear), casadi.dot(angular, angular))
    limits = (tolerance[0] ** 2, tolerance[1] ** 2)

    error = casadi.vertcat(linear, ROTATION_WEIGHT * angular)
    jacobian = casadi.vertcat(chain.jacobian[:3, :], ROTATION_WEIGHT * turning)
    low, high = casadi.DM(lower), casadi.DM(upper)
    slope = jacobian.T @ error
    leaving = casadi.logic_or(
        casadi.logic_and(q <= low + 1e-9, slope < 0), casadi.logic_and(q >= high - 1e-9, slope > 0)
    )
    jacobian = jacobian @ casadi.diag(1 - leaving)
    damped = jacobian @ jacobian.T + (0.5 * casadi.dot(error, error) + BIAS) * casadi.SX.eye(6)
    move = jacobian.T @ casadi.ldl_solve(error, *casadi.ldl(damped))
    move = move * casadi.fmin(1, LARGEST_STEP / casadi.fmax(casadi.mmax(casadi.fabs(move)), 1e-12))
    met = casadi.logic_and(squares[0] <= limits[0], squares[1] <= limits[1])
    moved = casadi.fmin(casadi.fmax(q + casadi.if_else(met, 0, move), low), high)
    one = casadi.Function("ik_step", [q, target], [casadi.densify(moved)], {"cse": True})

    x, t = casadi.MX.sym("q", q.numel()), casadi.MX.sym("target", 12)
    state = x
    for _ in range(STEPS):
        state = one(state, t)
    steps = casadi.Function("ik_steps", [x, t], [state])
    return StepFunctions(
        steps, casadi.Function("ik_error", [q, target], [casadi.densify(squares)], {"cse": True}), limits
    )


class VirtualMachine:
    """Iterates the step functions on casadi's virtual machine, all targets at once, one seed of each at a time."""

    def __init__(self, functions: StepFunctions) -> None:
        self._steps = RowFunction(functions.steps)
        self._error = RowFunction(functions.error)
        self._tolerance = np.array(functions.tolerance)

    def __call__(self, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As :class:`Solver` says; a target's result does not depend on the other targets."""
        count, tries, _ = seeds.shape
        best, least = seeds[:, 0].copy(), np.full(count, np.inf)
        solved = np.zeros(count, dtype=np.bool_)
        # one lane per target that is still open
        lane, q = np.arange(count), seeds[:, 0].copy()
        seed, rounds, before = np.zeros(count, np.int64), np.zeros(count, np.int64), np.full(count, np.inf)
        while lane.size:
            (q,) = self._steps(q, targets[lane])
            (squares,) = self._error(q, targets[lane])
            rounds += 1
            error = squares[:, 0] + ROTATION_WEIGHT**2 * squares[:, 1]
            met = (squares <= self._tolerance).all(axis=1)
            better = met | (error < least[lane])
            best[lane[better]], least[lane[better]] = q[better], error[better]
            solved[lane[met]] = True
            given_up = ~met & ((error > STALLED * before) | (rounds >= ROUNDS))
            before = error
            seed[given_up] += 1
            again = given_up & (seed < tries)
            q[again] = seeds[lane[again], seed[again]]
            rounds[again], before[again] = 0, np.inf
            keep = ~met & (seed < tries)
            lane, q, seed, rounds, before = lane[keep], q[keep], seed[keep], rounds[keep], before[keep]
        return best, solved


def _log(rotation: Any) -> Any:
    """Rotation vector of a rotation matrix (3, 3), away from half turns."""
    twice = casadi.vertcat(
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    )
    sine = casadi.sqrt(casadi.dot(twice, twice) / 4 + 1e-20)
    return twice / 2 * (casadi.atan2(sine, (casadi.trace(rotation) - 1) / 2) / sine)


def _turn_between(axis: Any, wanted: Any) -> Any:
    """The shortest rotation vector that turns one unit vector onto another, away from opposite ones."""
    cross = casadi.cross(axis, wanted)
    sine = casadi.sqrt(casadi.dot(cross, cross) + 1e-20)
    return cross * (casadi.atan2(sine, casadi.dot(axis, wanted)) / sine)
