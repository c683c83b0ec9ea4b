"""A chain of joints as symbolic expressions of casadi."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix
from planlang.geometry.urdf import Joint, displacement


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
    frames: tuple[tuple[Any, Any], ...]
    """Rotation and position of the child of each moving joint, base first."""


def symbolic_chain(joints: Sequence[Joint], variables: Sequence[Variable], size: int) -> SymbolicChain:
    """Forward kinematics and geometric Jacobian of joints from base to tip as functions of q (size,)."""
    q = casadi.SX.sym("q", size)
    rotation, position = casadi.SX.eye(3), casadi.SX.zeros(3)
    moving: list[tuple[Joint, Variable, Any, Any]] = []
    frames: list[tuple[Any, Any]] = []
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
            cross = cross_matrix(joint.axis)
            turn = _constant(cross) * casadi.sin(value) + _constant(cross @ cross) * (1 - casadi.cos(value))
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
    return SymbolicChain(q, rotation, position, casadi.horzcat(*columns), tuple(frames))


def position_function(chain: SymbolicChain) -> Any:
    """q -> (rotation row by row (9), position (3))."""
    outputs = [_row_major(chain.rotation), casadi.densify(chain.position)]
    return casadi.Function("chain_position", [chain.q], outputs, {"cse": True})


def pose_function(chain: SymbolicChain) -> Any:
    """q -> (rotation row by row (9), position (3), Jacobian row by row (6 d))."""
    outputs = [_row_major(chain.rotation), casadi.densify(chain.position), _row_major(chain.jacobian)]
    return casadi.Function("chain_pose", [chain.q], outputs, {"cse": True})


def frames_function(chain: SymbolicChain) -> Any:
    """q -> for each moving joint the rotation of its child row by row (9), then its position (3), in one row."""
    rows = [part for rotation, position in chain.frames for part in (_row_major(rotation), casadi.densify(position))]
    return casadi.Function("chain_frames", [chain.q], [casadi.vertcat(*rows)], {"cse": True})


def _constant(matrix: Array) -> Any:
    """As a sparse constant: what is within rounding of 0 or 1 is it, so that the expressions stay small."""
    whole = np.round(matrix)
    return casadi.SX(casadi.sparsify(casadi.DM(np.where(np.abs(matrix - whole) < 1e-12, whole, matrix))))


def _row_major(matrix: Any) -> Any:
    return casadi.densify(casadi.vec(matrix.T))
