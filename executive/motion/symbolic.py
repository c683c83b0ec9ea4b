"""The narrow door to casadi: a chain as symbolic expressions, and functions evaluated on rows of numpy arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from executive.motion.urdf import Joint
from planlang.protocols import Array

BLOCKS = (256, 32, 4, 1)
"""Rows per call of casadi's virtual machine; a call costs about 3 us beside the work of its rows."""


class RowFunction:
    """A symbolic function applied to every row of its arguments on casadi's virtual machine.

    Every row is computed on its own, in the same order of operations whatever the other rows are. The work arrays
    belong to the object: one thread at a time.
    """

    def __init__(self, function: Any) -> None:
        self.widths = tuple(int(function.numel_out(i)) for i in range(function.n_out()))
        """Length of a row of each result."""
        self._function = function
        self._blocks: dict[int, tuple[list[Array], list[Array], Any, Any]] = {}

    def __call__(self, *arguments: Array) -> tuple[Array, ...]:
        """Arguments (n, width of the argument) -> one (n, width) array per result."""
        rows = len(arguments[0])
        results = tuple(np.empty((rows, width)) for width in self.widths)
        first = 0
        while first < rows:
            size = next(block for block in BLOCKS if block <= rows - first)
            inputs, outputs, _, evaluate = self._blocks.get(size) or self._block(size)
            for held, given in zip(inputs, arguments, strict=True):
                held[:] = given[first : first + size]
            evaluate()
            for given, held in zip(results, outputs, strict=True):
                given[first : first + size] = held
            first += size
        return results

    def _block(self, size: int) -> tuple[list[Array], list[Array], Any, Any]:
        mapped = self._function if size == 1 else self._function.map(size)
        inputs = [np.zeros((size, self._function.numel_in(i))) for i in range(self._function.n_in())]
        outputs = [np.zeros((size, width)) for width in self.widths]
        buffer, evaluate = mapped.buffer()
        for i, array in enumerate(inputs):
            buffer.set_arg(i, array.data)
        for i, array in enumerate(outputs):
            buffer.set_res(i, array.data)
        self._blocks[size] = (inputs, outputs, buffer, evaluate)
        return self._blocks[size]


@dataclass(frozen=True, slots=True)
class Variable:
    """How a joint of a chain gets its position: ``multiplier * q[index] + offset``; index None is a fixed position."""

    index: int | None
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class SymbolicChain:
    """Expressions of a chain in its base frame, the tip's ``jacobian`` (6, d): linear above angular velocity."""

    q: Any
    rotation: Any
    position: Any
    jacobian: Any


def symbolic_chain(joints: Sequence[Joint], variables: Sequence[Variable], size: int) -> SymbolicChain:
    """Forward kinematics and geometric Jacobian of joints from base to tip as functions of q (size,)."""
    q = casadi.SX.sym("q", size)
    rotation, position = casadi.SX.eye(3), casadi.SX.zeros(3)
    moving: list[tuple[Joint, Variable, Any, Any]] = []
    fixed = np.eye(4)
    for joint, variable in zip(joints, variables, strict=True):
        fixed = fixed @ joint.origin
        if variable.index is None:
            fixed = fixed @ displacement(joint, variable.offset)
            continue
        position = position + rotation @ _constant(fixed[:3, 3])
        rotation = rotation @ _constant(fixed[:3, :3])
        fixed = np.eye(4)
        axis = rotation @ _constant(joint.axis)
        value = variable.multiplier * q[variable.index] + variable.offset
        if joint.kind == "prismatic":
            position = position + axis * value
        else:
            cross = _cross_matrix(joint.axis)
            turn = _constant(cross) * casadi.sin(value) + _constant(cross @ cross) * (1 - casadi.cos(value))
            rotation = rotation @ (casadi.SX.eye(3) + turn)
        moving.append((joint, variable, axis, position))
    position = position + rotation @ _constant(fixed[:3, 3])
    rotation = rotation @ _constant(fixed[:3, :3])
    columns = [casadi.SX.zeros(6) for _ in range(size)]
    for joint, variable, axis, point in moving:
        linear = axis if joint.kind == "prismatic" else casadi.cross(axis, position - point)
        angular = casadi.SX.zeros(3) if joint.kind == "prismatic" else axis
        assert variable.index is not None
        columns[variable.index] = columns[variable.index] + variable.multiplier * casadi.vertcat(linear, angular)
    return SymbolicChain(q, rotation, position, casadi.horzcat(*columns))


def pose_function(chain: SymbolicChain) -> RowFunction:
    """q -> (rotation row by row (9), position (3), Jacobian row by row (6 d))."""
    return RowFunction(
        casadi.Function(
            "chain_pose",
            [chain.q],
            [_row_major(chain.rotation), casadi.densify(chain.position), _row_major(chain.jacobian)],
            {"cse": True},
        )
    )


def position_function(chain: SymbolicChain) -> RowFunction:
    """q -> (rotation row by row (9), position (3))."""
    outputs = [_row_major(chain.rotation), casadi.densify(chain.position)]
    return RowFunction(casadi.Function("chain_position", [chain.q], outputs, {"cse": True}))


def displacement(joint: Joint, value: float) -> Array:
    """The motion (4, 4) of a joint's child at a position, in the child's frame at zero."""
    moved = np.eye(4)
    if joint.kind == "prismatic":
        moved[:3, 3] = joint.axis * value
    elif joint.kind != "fixed":
        cross = _cross_matrix(joint.axis)
        moved[:3, :3] += cross * np.sin(value) + cross @ cross * (1 - np.cos(value))
    return moved


def _cross_matrix(axis: Array) -> Array:
    x, y, z = axis
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _constant(matrix: Array) -> Any:
    """As a sparse constant: what is within rounding of 0 or 1 is it, so that the expressions stay small."""
    whole = np.round(matrix)
    return casadi.SX(casadi.sparsify(casadi.DM(np.where(np.abs(matrix - whole) < 1e-12, whole, matrix))))


def _row_major(matrix: Any) -> Any:
    return casadi.densify(casadi.vec(matrix.T))
