"""Chains of joints as casadi expressions: forward kinematics, Jacobian, one step of inverse kinematics.

The step is Levenberg-Marquardt with joint limits. With e = (p* - p, w log(R* R^T)) and J weighted likewise, it is dq =
J^T (J J^T + l I)^-1 e with the damping l = |e|^2 / 2 + bias of Sugihara (Solvability-unconcerned inverse kinematics by
the Levenberg-Marquardt method, IEEE T-RO 2011). Columns of joints that are at a limit and would leave it are removed
from J; the step is clipped, then the joints are clamped.

A function is applied to many rows at once on casadi's virtual machine (:class:`RowFunction`), without compilation. An
instruction takes about 8 ns on numbers, and about 80 ns plus 1 ns per row on vectors. For many rows the same
instructions are therefore rewritten for vectors: a step of inverse kinematics of an arm of 8 joints (1,238
instructions) then takes 1.2 us per row instead of 10 us, little more than compiled C (docs/reference/benchmarks.md).
Both forms apply the same operations in the same order to each row, so that its result does not depend on the number of
rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import casadi
import numpy as np

from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, product
from planlang.geometry.urdf import Joint, displacement
from planlang.records import dataclass

BLOCKS = ((256, 97), (32, 7), (1, 0))
"""Rows of a block, and the number of remaining rows from which on that size is the cheapest."""


WORTH = 500
"""Rows after which a function is rewritten for vectors: that costs as much as these rows one by one."""


class RowFunction:
    """Function of vectors, applied to each column of its arguments (rows of a batch lie along the last axis).

    The work arrays belong to the object: one thread at a time.
    """

    def __init__(self, function: Any) -> None:
        """Wrap a casadi function of scalar expressions (SX) with dense vectors as arguments and results."""
        self._function = function
        self._rows = 0
        self._blocks: dict[int, tuple[list[Array], list[Array], Any, Any]] = {}

    def __call__(self, *arguments: Array) -> list[Array]:
        """Apply it to arguments (width, n); results have shape (width, n)."""
        count, parts = arguments[0].shape[1], list[list[Array]]()
        first = 0
        self._rows += count
        while first < count or not parts:
            size = next(size for size, least in BLOCKS if count - first >= least) if self._rows > WORTH else 1
            inputs, outputs, evaluate, _ = self._blocks.get(size) or self._block(size)
            last = min(first + size, count)
            for held, given in zip(inputs, arguments, strict=True):
                held[:, : last - first] = given[:, first:last]
            evaluate()
            parts.append([held[:, : last - first].copy() for held in outputs])
            first = last
        return (
            parts[0] if len(parts) == 1 else [np.concatenate(several, axis=1) for several in zip(*parts, strict=True)]
        )

    def _block(self, size: int) -> tuple[list[Array], list[Array], Any, Any]:
        one = self._function
        function = one if size == 1 else _on_vectors(one, size)
        inputs = [np.zeros((one.numel_in(i), size)) for i in range(one.n_in())]
        outputs = [np.zeros((one.numel_out(i), size)) for i in range(one.n_out())]
        buffer, evaluate = function.buffer()
        for i, array in enumerate(inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array.data)
        self._blocks[size] = (inputs, outputs, evaluate, buffer)
        return self._blocks[size]


def _on_vectors(function: Any, size: int) -> Any:
    """Rewrite a function with each number replaced by a vector of ``size`` rows.

    Rounding must stay the same, so casadi's simplification is off: it would replace a - (a + b) by -b.
    """
    simplifies = casadi.GlobalOptions.getSimplificationOnTheFly()
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        return _instructions_on_vectors(function, size)
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(simplifies)


def _instructions_on_vectors(function: Any, size: int) -> Any:
    arguments = [casadi.MX.sym(f"argument{i}", size, function.numel_in(i)) for i in range(function.n_in())]
    columns = [casadi.horzsplit(argument) for argument in arguments]
    results: list[list[Any]] = [[None] * function.numel_out(i) for i in range(function.n_out())]
    known: dict[int, Any] = {}
    for number in range(function.n_instructions()):
        operation = function.instruction_id(number)
        sources, targets = function.instruction_input(number), function.instruction_output(number)
        if operation == casadi.OP_CONST:
            known[targets[0]] = casadi.MX(function.instruction_constant(number))
        elif operation == casadi.OP_INPUT:
            known[targets[0]] = columns[sources[0]][sources[1]]
        elif operation == casadi.OP_OUTPUT:
            value = known[sources[0]]
            results[targets[0]][targets[1]] = value if value.numel() == size else casadi.repmat(value, size, 1)
        elif len(sources) == 1:
            known[targets[0]] = casadi.MX.unary(operation, known[sources[0]])
        else:
            known[targets[0]] = casadi.MX.binary(operation, known[sources[0]], known[sources[1]])
    return casadi.Function(function.name(), arguments, [casadi.horzcat(*columns) for columns in results])


ROTATION_WEIGHT = 0.5
"""Metres per radian in the error: about the length of a forearm, so that both parts change at the same rate."""
BIAS = 1e-6
"""Smallest damping: keeps steps finite at singularities, and convergence quadratic elsewhere."""
LARGEST_STEP = 0.8
"""Largest joint change per step [rad, m]: beyond it the linearised rotation is meaningless."""
HALF_TURN = 1e-6
"""Distance from half a turn [rad] within which the antisymmetric part of a rotation vanishes and gives no axis."""


@dataclass(frozen=True, slots=True)
class Variable:
    """Position of a joint: ``multiplier * q[index] + offset``; a constant if index is None."""

    index: int | None
    multiplier: float = 1.0
    offset: float = 0.0


class ChainFunctions:
    """Functions of a chain in its base frame, each built on first use; positions and rotations are expressions in q."""

    def __init__(self, joints: Sequence[Joint], variables: Sequence[Variable], lower: Array, upper: Array) -> None:
        """Derive forward kinematics and geometric Jacobian of joints from base to tip.

        ``lower`` and ``upper`` (d,) are infinite for continuous joints.
        """
        self._lower, self._upper, size = lower, upper, len(lower)
        q = casadi.SX.sym("q", size)
        rotation, position = casadi.SX.eye(3), casadi.SX.zeros(3)
        moving: list[tuple[Joint, Variable, Any, Any]] = []
        frames: list[tuple[Any, Any]] = []
        fixed = np.eye(4)
        for joint, variable in zip(joints, variables, strict=True):
            fixed = product(fixed, joint.origin)
            if variable.index is None:
                fixed = product(fixed, displacement(joint, variable.offset))
                continue
            position = position + rotation @ _constant(fixed[:3, 3])
            rotation = rotation @ _constant(fixed[:3, :3])
            fixed = np.eye(4)
            axis = rotation @ _constant(joint.axis)
            value = variable.multiplier * q[variable.index] + variable.offset
            if joint.kind == "prismatic":
                position = position + axis * value
            else:  # Rodrigues' formula
                cross = cross_matrix(joint.axis)
                turn = _constant(cross) * casadi.sin(value) + _constant(product(cross, cross)) * (1 - casadi.cos(value))
                rotation = rotation @ (casadi.SX.eye(3) + turn)
            moving.append((joint, variable, axis, position))
            frames.append((rotation, position))
        position = position + rotation @ _constant(fixed[:3, 3])
        rotation = rotation @ _constant(fixed[:3, :3])
        columns = [casadi.SX.zeros(6) for _ in range(size)]
        for joint, variable, axis, point in moving:
            linear = axis if joint.kind == "prismatic" else casadi.cross(axis, position - point)
            angular = casadi.SX.zeros(3) if joint.kind == "prismatic" else axis
            assert variable.index is not None
            columns[variable.index] = columns[variable.index] + variable.multiplier * casadi.vertcat(linear, angular)
        self.q, self.rotation, self.position = q, rotation, position
        self._columns, self._frames = casadi.horzcat(*columns), frames

    @cached_property
    def tip(self) -> RowFunction:
        """q -> rotation of the tip with its position as fourth column, row by row (12)."""
        return self._function("tip", _row_major(casadi.horzcat(self.rotation, self.position)))

    @cached_property
    def jacobian(self) -> RowFunction:
        """q -> Jacobian of the tip, linear above angular, row by row (6 d)."""
        return self._function("jacobian", _row_major(self._columns))

    @cached_property
    def frames(self) -> RowFunction:
        """q -> the same as for the tip for the children of j moving joints (12 j)."""
        return self._function("frames", casadi.vertcat(*(_row_major(casadi.horzcat(*frame)) for frame in self._frames)))

    def _function(self, name: str, output: Any) -> RowFunction:
        return RowFunction(casadi.Function(name, [self.q], [output], {"cse": True}))

    @cached_property
    def step(self) -> RowFunction:
        """One step of inverse kinematics."""
        return RowFunction(self.step_function())

    def step_function(self) -> Any:
        """(q, target) -> (q after one step, squared errors [m^2, rad^2] at q).

        A target has 12 rows: the rotation row by row, then the position.
        """
        q, target = self.q, casadi.SX.sym("target", 12)
        goal_rotation, goal_position = casadi.reshape(target[:9], 3, 3).T, target[9:]
        linear = goal_position - self.position
        angular = _log(goal_rotation @ self.rotation.T)
        squares = casadi.vertcat(casadi.dot(linear, linear), casadi.dot(angular, angular))

        error = casadi.vertcat(linear, ROTATION_WEIGHT * angular)
        jacobian = casadi.vertcat(self._columns[:3, :], ROTATION_WEIGHT * self._columns[3:, :])
        low, high = casadi.DM(self._lower), casadi.DM(self._upper)
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

    def within(self, q: Array) -> Array:
        """Clamp configurations (d, n) to the limits."""
        return np.minimum(np.maximum(q, self._lower[:, None]), self._upper[:, None])


def _log(rotation: Any) -> Any:
    """Rotation vector of a rotation matrix (3, 3); for half a turn one of the two."""
    twice = casadi.vertcat(
        rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]
    )
    sine = casadi.sqrt(casadi.dot(twice, twice) / 4 + 1e-20)
    cosine = (casadi.trace(rotation) - 1) / 2
    angle = casadi.atan2(sine, cosine)
    column = _longest(rotation + casadi.SX.eye(3))  # 2 n n^T for half a turn about n
    return casadi.if_else(
        casadi.logic_and(sine < HALF_TURN, cosine < 0),
        column * (angle / casadi.norm_2(column)),
        twice / 2 * (angle / sine),
    )


def _longest(matrix: Any) -> Any:
    """Column of the greatest diagonal element of a matrix (3, 3)."""
    first, second, third = (matrix[i, i] for i in range(3))
    rest = casadi.if_else(second >= third, matrix[:, 1], matrix[:, 2])
    return casadi.if_else(casadi.logic_and(first >= second, first >= third), matrix[:, 0], rest)


def _constant(matrix: Array) -> Any:
    """Sparse constant, with values close to 0 or 1 rounded, so that expressions stay small."""
    whole = np.round(matrix)
    return casadi.SX(casadi.sparsify(casadi.DM(np.where(np.abs(matrix - whole) < 1e-12, whole, matrix))))


def _row_major(matrix: Any) -> Any:
    return casadi.densify(casadi.vec(matrix.T))
