"""Kinematics in C: functions generated for one chain, and ``kinematics.c`` around them, called through ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from executive.motion.native import library
from planlang.protocols import Array

if TYPE_CHECKING:  # backends chooses between this and the virtual machine
    from executive.motion.backends import ChainFacts

STEPS = 40
"""Steps of inverse kinematics after which a seed is given up."""
STALLED, MOST_SLOW = 0.9, 3
"""A seed is given up when so many steps in a row leave more than this share of its squared error.

Between 0.8 and 0.98, and 3 and 6 steps, the time for a reachable target changes by 5 %; more patience solves one more
target of 4,000 and makes unreachable ones dearer by half.
"""
_POINTER, _SIZE = ctypes.c_void_p, ctypes.c_ssize_t


class CompiledChain:
    """Forward kinematics and Jacobian; implements ``Backend``."""

    def __init__(self, facts: ChainFacts, code: ctypes.CDLL) -> None:
        self._facts, self._code = facts, code
        self._position_rows = _function(code, "position_rows", [_POINTER, _SIZE, _POINTER, _POINTER])
        self._pose_rows = _function(code, "pose_rows", [_POINTER, _SIZE, _POINTER, _POINTER, _POINTER])

    @staticmethod
    def of(facts: ChainFacts) -> CompiledChain | None:
        """None without a compiler."""
        code = library(("chain", facts.digest, _numbers()), lambda: _source(facts, None, whole=True))
        return CompiledChain(facts, code) if code is not None else None

    def position(self, q: Array) -> tuple[Array, Array]:
        """As ``Backend`` says."""
        q = np.ascontiguousarray(q)
        rotation, position = np.empty((len(q), 9)), np.empty((len(q), 3))
        self._position_rows(q.ctypes.data, len(q), rotation.ctypes.data, position.ctypes.data)
        return rotation, position

    def pose(self, q: Array) -> tuple[Array, Array, Array]:
        """As ``Backend`` says."""
        q = np.ascontiguousarray(q)
        rotation, position = np.empty((len(q), 9)), np.empty((len(q), 3))
        jacobian = np.empty((len(q), 6 * self._facts.dof))
        self._pose_rows(q.ctypes.data, len(q), rotation.ctypes.data, position.ctypes.data, jacobian.ctypes.data)
        return rotation, position, jacobian

    def solver(self, free_axis: Array | None, tolerance: tuple[float, float]) -> CompiledSolver:
        """As ``Backend`` says."""
        code: ctypes.CDLL | None = self._code
        if free_axis is not None:
            key = ("free axis", self._facts.digest, free_axis.tolist(), _numbers())
            code = library(key, lambda: _source(self._facts, free_axis, whole=False))
            if code is None:
                raise RuntimeError("the compiler that made this chain's code is gone")
        assert code is not None
        return CompiledSolver(self._facts, code, tolerance)


class CompiledSolver:
    """Inverse kinematics; implements ``Solver``."""

    def __init__(self, facts: ChainFacts, code: ctypes.CDLL, tolerance: tuple[float, float]) -> None:
        kinds = [_POINTER, _SIZE, _POINTER, _SIZE, _SIZE, _SIZE, _POINTER, _POINTER, _POINTER, _POINTER, _POINTER]
        self._solve_rows = _function(code, "solve_rows", kinds)
        self._limits = np.concatenate([facts.lowest, facts.highest])
        self._turning = facts.continuous.astype(np.uint8)
        self._tolerance = np.square(tolerance)
        self._fixed = (self._limits.ctypes.data, self._turning.ctypes.data, self._tolerance.ctypes.data)

    def __call__(self, poses: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """As ``Solver`` says."""
        count, tries, dof = seeds.shape
        poses = np.ascontiguousarray(poses)
        if seeds.strides[2] != 8 or seeds.strides[0] % 8 or seeds.strides[1] % 8:
            seeds = np.ascontiguousarray(seeds)
        q, solved = np.empty((count, dof)), np.empty(count, np.bool_)
        self._solve_rows(
            *(poses.ctypes.data, count, seeds.ctypes.data, tries, seeds.strides[0] // 8, seeds.strides[1] // 8),
            *(*self._fixed, q.ctypes.data, solved.ctypes.data),
        )
        return q, solved


def _numbers() -> tuple[float, ...]:
    return STEPS, STALLED, MOST_SLOW


def _source(facts: ChainFacts, free_axis: Array | None, *, whole: bool) -> str:
    """C of the chain; not ``whole``: of inverse kinematics alone."""
    from executive.motion.levenberg_marquardt import ROTATION_WEIGHT, step_function
    from executive.motion.symbolic import pose_function, position_function, symbolic_chain

    chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
    functions = [step_function(chain, facts.lowest, facts.highest, free_axis)]
    if whole:
        functions += [position_function(chain), pose_function(chain)]
    defined = {
        "JOINTS": facts.dof,
        "ROTATION_WEIGHT": ROTATION_WEIGHT,
        "STEPS": STEPS,
        "STALLED": STALLED,
        "MOST_SLOW": MOST_SLOW,
    }
    return generated(functions, defined, "kinematics.c")


def generated(functions: Sequence[Any], defined: dict[str, float], loops: str) -> str:
    """C of symbolic functions and of a file of this package that calls them, with constants defined for it."""
    import casadi

    generator = casadi.CodeGenerator("generated", {"with_header": False})
    for function in functions:
        generator.add(function)
        sizes = {"ARG": function.sz_arg(), "RES": function.sz_res(), "IW": function.sz_iw(), "W": function.sz_w()}
        defined |= {f"{function.name()}_SZ_{name}": size for name, size in sizes.items()}
    lines = [f"#define {name} {value!r}" for name, value in defined.items()]
    loops_text = (Path(__file__).parent / loops).read_text(encoding="utf-8")
    return "\n".join([generator.dump(), *lines, loops_text])


def _function(code: ctypes.CDLL, name: str, arguments: list[Any]) -> Any:
    function = getattr(code, name)
    function.argtypes, function.restype = arguments, None
    return function
