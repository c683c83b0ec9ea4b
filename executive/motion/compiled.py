"""Kinematics in C: functions generated for one chain, and ``kinematics.c`` around them, called through ctypes."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from executive.motion.native import library
from executive.motion.targets import IMPROPER, no_pose
from planlang.geometry import Array

if TYPE_CHECKING:  # backends chooses between this and the virtual machine
    from executive.motion.backends import ChainFacts
    from executive.motion.body_arrays import Bodies

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

    kind = "compiled"

    def __init__(self, facts: ChainFacts, code: ctypes.CDLL) -> None:
        self._facts, self._code = facts, code
        self._collision: _CollisionCode | None = None
        self._joints = sum(variable.index is not None for variable in facts.variables)
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

    def frames(self, q: Array) -> Array:
        """As ``Backend`` says."""
        q = np.ascontiguousarray(q)
        rows = np.empty((len(q), self._joints, 12))
        self._collisions().frames(q.ctypes.data, len(q), rows.ctypes.data)
        return np.concatenate([rows[..., :9].reshape(*rows.shape[:2], 3, 3), rows[..., 9:, None]], axis=3)

    def checker(self, bodies: Bodies) -> CompiledChecker:
        """As ``Backend`` says."""
        return CompiledChecker(self._collisions(), bodies)

    def _collisions(self) -> _CollisionCode:
        if self._collision is None:
            key = ("collision", self._facts.digest)
            code = library(key, lambda: _collision_source(self._facts))
            if code is None:
                raise RuntimeError("the compiler that made this chain's code is gone")
            self._collision = _CollisionCode(code)
        return self._collision


class CompiledSolver:
    """Inverse kinematics; implements ``Solver``."""

    def __init__(self, facts: ChainFacts, code: ctypes.CDLL, tolerance: tuple[float, float]) -> None:
        kinds = [_POINTER, _SIZE, _POINTER, _SIZE, _SIZE, _SIZE, _POINTER, _POINTER, _POINTER, _POINTER, _POINTER]
        self._solve_rows = _function(code, "solve_rows", kinds)
        self._solve_rows.restype = _SIZE
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
        refused = self._solve_rows(
            *(poses.ctypes.data, count, seeds.ctypes.data, tries, seeds.strides[0] // 8, seeds.strides[1] // 8),
            *(*self._fixed, q.ctypes.data, solved.ctypes.data),
        )
        if refused >= 0:
            raise no_pose(poses[refused], refused)
        return q, solved


class _Arrays(ctypes.Structure):
    """``struct bodies`` of collision.c."""

    _fields_ = (
        ("base", _POINTER),
        ("clusters", _SIZE),
        *((name, _POINTER) for name in ("cluster", "cluster_group", "frame_ball", "obstacle_frame", "obstacle_ball")),
        *((name, _POINTER) for name in ("group_part", "group_pair", "group_width", "part_ball", "part_sphere")),
        *((name, _POINTER) for name in ("spheres", "pair_piece", "limit", "sure", "piece_kind", "piece")),
        *((name, _POINTER) for name in ("part_faces", "piece_faces", "corner_first", "corners", "plane_first")),
        *((name, _POINTER) for name in ("planes", "beyond")),
    )


_POINTERS = tuple(field[0] for field in _Arrays._fields_ if field[0] != "clusters")


class _CollisionCode:
    """What ``collision.c`` offers."""

    def __init__(self, code: ctypes.CDLL) -> None:
        self.frames = _function(code, "frames_rows", [_POINTER, _SIZE, _POINTER])
        self.judge = _function(code, "judge_rows", [_POINTER, _SIZE, _POINTER, _POINTER])
        self.hits = _function(code, "hit_rows", [_POINTER, _POINTER, _SIZE, ctypes.c_double, _POINTER, _POINTER])
        self.frame_hits = _function(code, "frame_hit_rows", [ctypes.c_int, _POINTER, _SIZE, _POINTER, _POINTER])
        self.edge = _function(code, "edge_hit", [_POINTER, _POINTER, _SIZE, _POINTER, _SIZE, _POINTER])
        self.doubtful = _function(code, "doubtful_at", [_POINTER, _POINTER, _POINTER])
        self.edge.restype = self.doubtful.restype = ctypes.c_int
        self.gaps = _function(code, "gaps_at", [_POINTER, _POINTER, _POINTER])


class CompiledChecker:
    """Implements ``Checker``; the bodies' arrays are read where they are."""

    def __init__(self, code: _CollisionCode, bodies: Bodies) -> None:
        self._code, self._bodies = code, bodies
        pointers = {name: getattr(bodies, name).ctypes.data for name in _POINTERS}
        self._arrays = _Arrays(clusters=len(bodies.cluster), **pointers)
        self._all = ctypes.addressof(self._arrays)

    def judge(self, q: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        q = np.ascontiguousarray(q)
        found = np.empty(len(q), np.int32)
        self._code.judge(q.ctypes.data, len(q), self._all, found.ctypes.data)
        return found

    def hits(self, q: Array, bases: Array, deeper: float) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        q, bases = np.ascontiguousarray(q), np.ascontiguousarray(bases)
        found = np.empty(len(q), np.int32)
        self._code.hits(q.ctypes.data, bases.ctypes.data, len(q), deeper, self._all, found.ctypes.data)
        return found

    def frame_hits(self, frame: int, places: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        places, found = np.ascontiguousarray(places), np.empty(len(places), np.int32)
        self._code.frame_hits(frame, places.ctypes.data, len(places), self._all, found.ctypes.data)
        return found

    def edge_hit(self, start: Array, end: Array, pieces: int, order: NDArray[np.int32]) -> int:
        """As ``Checker`` says."""
        start, end = np.ascontiguousarray(start), np.ascontiguousarray(end)
        return int(
            self._code.edge(start.ctypes.data, end.ctypes.data, pieces, order.ctypes.data, len(order), self._all)
        )

    def doubtful(self, q: Array) -> NDArray[np.int32]:
        """As ``Checker`` says."""
        q, found = np.ascontiguousarray(q), np.empty(len(self._bodies.pair_piece), np.int32)
        return found[: int(self._code.doubtful(q.ctypes.data, self._all, found.ctypes.data))]

    def gaps(self, q: Array) -> Array:
        """As ``Checker`` says."""
        q, found = np.ascontiguousarray(q), np.empty(len(self._bodies.pair_piece))
        self._code.gaps(q.ctypes.data, self._all, found.ctypes.data)
        return found


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
        "IMPROPER": IMPROPER,
        "STEPS": STEPS,
        "STALLED": STALLED,
        "MOST_SLOW": MOST_SLOW,
    }
    return generated(functions, defined, "kinematics.c")


def _collision_source(facts: ChainFacts) -> str:
    """C of the frames of a chain and of collisions of what moves with them."""
    from executive.motion.collision import SPHERES
    from executive.motion.symbolic import frames_function, symbolic_chain

    chain = symbolic_chain(facts.joints, facts.variables, facts.dof)
    defined: dict[str, float] = {"JOINTS": facts.dof, "FRAMES": 2 + len(chain.frames), "SPHERES": SPHERES}
    return generated([frames_function(chain)], defined, "collision.c")


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
