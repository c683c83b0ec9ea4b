"""One step of inverse kinematics as a symbolic function: Levenberg-Marquardt with joint limits.

With e = (p* - p, w log(R* R^T)) and J weighted alike, a step is dq = J^T (J J^T + l I)^-1 e with the damping
l = |e|^2 / 2 + bias of Sugihara (Solvability-unconcerned inverse kinematics, IEEE T-RO 2011). Columns of joints that
stand at a limit and would leave it are taken out of J; the step is clipped, then the joints.
"""

from __future__ import annotations

from typing import Any

import casadi

from executive.motion.symbolic import SymbolicChain
from planlang.geometry import Array

ROTATION_WEIGHT = 0.5
"""Metres per radian in the error."""
BIAS = 1e-6
"""Smallest damping: keeps steps finite where the Jacobian loses rank."""
LARGEST_STEP = 0.8
"""Largest move of a joint in one step [rad, m]."""
HALF_TURN = 1e-6
"""Nearer to half a turn than this what tells the axis of other turns all but vanishes [rad]."""


def step_function(chain: SymbolicChain, lower: Array, upper: Array, free_axis: Array | None) -> Any:
    """(q, target) -> (q after one step, squared errors [m^2, rad^2] at q) within joint limits (d,), infinite or not.

    A target is a row of 12: the rotation row by row, the position. ``free_axis`` (3,) is one of the tip about which it
    may turn freely.
    """
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
    moved = casadi.fmin(casadi.fmax(q + move, low), high)
    outputs = [casadi.densify(moved), casadi.densify(squares)]
    return casadi.Function("ik_step", [q, target], outputs, {"cse": True})


def _log(rotation: Any) -> Any:
    """Rotation vector of a rotation matrix (3, 3); of half a turn one of the two."""
    twice = casadi.vertcat(
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    )
    sine = casadi.sqrt(casadi.dot(twice, twice) / 4 + 1e-20)
    cosine = (casadi.trace(rotation) - 1) / 2
    angle = casadi.atan2(sine, cosine)
    column = _longest(rotation + casadi.SX.eye(3))  # of half a turn about n: 2 n n^T
    return casadi.if_else(
        casadi.logic_and(sine < HALF_TURN, cosine < 0),
        column * (angle / casadi.norm_2(column)),
        twice / 2 * (angle / sine),
    )


def _turn_between(axis: Any, wanted: Any) -> Any:
    """The shortest rotation vector that turns one unit vector onto another; of opposite ones one of many."""
    cross = casadi.cross(axis, wanted)
    sine = casadi.sqrt(casadi.dot(cross, cross) + 1e-20)
    cosine = casadi.dot(axis, wanted)
    angle = casadi.atan2(sine, cosine)
    across = _longest(casadi.SX.eye(3) - axis @ axis.T)
    return casadi.if_else(
        casadi.logic_and(sine < HALF_TURN, cosine < 0), across * (angle / casadi.norm_2(across)), cross * (angle / sine)
    )


def _longest(matrix: Any) -> Any:
    """The column of the greatest diagonal element of a matrix (3, 3)."""
    first, second, third = (matrix[i, i] for i in range(3))
    rest = casadi.if_else(second >= third, matrix[:, 1], matrix[:, 2])
    return casadi.if_else(casadi.logic_and(first >= second, first >= third), matrix[:, 0], rest)
