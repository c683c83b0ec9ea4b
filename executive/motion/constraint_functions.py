"""Functions of motion constraints over the joints of arms, with gradients, as casadi expressions.

Every function is one of four in p (position of a tool feature), d (its direction) and constants c and n, with which
:class:`Bound` describes the world feature: cosine and heading between directions, the offset of p along n, and the
distance of p from the line along n, or from c itself if n is 0. Directions are unit vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.motion.arm_group import ArmGroup
from executive.motion.errors import MotionError
from executive.motion.symbolic import ChainFunctions, RowFunction
from planlang.designators import Object
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product, rotated
from planlang.motion_constraints import Feature, Measure, MotionConstraint
from planlang.records import dataclass

UNDEFINED = 1e-3
"""Length below which a vector has no heading."""
LENGTH_TOLERANCE, COSINE_TOLERANCE = 1e-3, 5e-3
"""Excess over its limits up to which a constraint still holds [m], [no unit]."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """Objects of constraints: tools in hands, all others where they were at the start."""

    base: Array
    """Pose (4, 4) of the arms' base link in the map."""
    tools: Mapping[Object, tuple[int, Array]]
    """Tool -> number of the arm that holds it, and its pose (4, 4) in the frame of the arm's tip."""
    things: Mapping[Object, Array]
    """Thing with features of the world -> its pose (4, 4) in the map."""
    frames: Mapping[str, Array]
    """Reference frame -> its rotation (3, 3) in the map."""
    torso: Array
    """Rotation (3, 3) in the map of the default reference frame: x ahead, z up."""

    def pose_of(self, thing: Object) -> Array:
        """Pose of a thing in the map; raises :class:`MotionError` if it is unknown."""
        if thing not in self.things:
            raise MotionError(f"the pose of {thing} is unknown")
        return self.things[thing]

    def tool(self, thing: Object) -> tuple[int, Array]:
        """Arm that holds a tool, and the tool's pose in its tip; raises :class:`MotionError` if no hand holds it."""
        if thing not in self.tools:
            raise MotionError(f"no hand of this motion holds {thing}")
        return self.tools[thing]

    def rotation(self, frame: str | None) -> Array:
        """Rotation of a reference frame in the map; raises :class:`MotionError` for an unknown one."""
        if frame is None:
            return self.torso
        named = frame.lstrip("/")
        if named not in self.frames:
            raise MotionError(f"unknown reference frame {frame}; known are {', '.join(self.frames) or 'none'}")
        return self.frames[named]


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """Constraint as one of four functions, with its parameters."""

    constraint: MotionConstraint
    measure: Measure
    arm: int
    parameters: Array
    """Position and direction of the tool feature in the frame of the arm's tip; c and n in the base, (12,)."""
    lower: float
    upper: float
    tolerance: float

    @staticmethod
    def of(constraint: MotionConstraint, where: Surroundings) -> Bound:
        """Bind a constraint to its surroundings; raises :class:`MotionError` for a feature that is not grounded."""
        arm, in_tip = where.tool(constraint.tool.of)
        tool = _placed(constraint.tool, in_tip)
        world = _placed(constraint.world, product(inverse(where.base), where.pose_of(constraint.world.of)))
        measure, normal = constraint.kind.value.measure, world[3:]
        if measure is Measure.OFFSET or (measure is Measure.HEIGHT and not normal.any()):
            axis = rotated(where.rotation(constraint.frame), np.array(constraint.kind.value.axis))
            normal = rotated(where.base[:3, :3].T, axis)
        tolerance = LENGTH_TOLERANCE if constraint.kind.value.unit else COSINE_TOLERANCE
        parameters = np.concatenate([tool, world[:3], normal])
        return Bound(constraint, measure, arm, parameters, *constraint.limits, tolerance)


def _placed(feature: Feature, pose: Array) -> Array:
    """Position and unit direction (6,) of a feature of a thing at a pose (4, 4); the direction of a point is 0."""
    if feature.position is None:
        raise MotionError(f"{feature} is not grounded: no model states where it is on {feature.of}")
    position = moved(pose, np.array(feature.position))
    direction = np.zeros(3)
    if feature.direction is not None:
        direction = rotated(pose[:3, :3], np.array(feature.direction)) / np.linalg.norm(feature.direction)
    return np.concatenate([position, direction])


def _cosine(p: Any, d: Any, c: Any, n: Any) -> Any:
    return casadi.dot(d, n)


def _heading(p: Any, d: Any, c: Any, n: Any) -> Any:
    a, b = casadi.cross(n, p - c), d - casadi.dot(n, d) * n
    long, wide = _length(a), _length(b)
    known = casadi.logic_and(long >= UNDEFINED, wide >= UNDEFINED)
    return casadi.if_else(known, casadi.dot(a, b) / (long * wide), 0)


def _offset(p: Any, d: Any, c: Any, n: Any) -> Any:
    return casadi.dot(n, p - c)


def _distance(p: Any, d: Any, c: Any, n: Any) -> Any:
    v = p - c
    return _length(v - casadi.dot(n, v) * n)


def _length(vector: Any) -> Any:
    """Length of a vector, differentiable at 0."""
    return casadi.sqrt(casadi.dot(vector, vector) + 1e-18)


_FORMULAS: dict[Measure, Callable[[Any, Any, Any, Any], Any]] = {
    Measure.COSINE: _cosine,
    Measure.HEADING: _heading,
    Measure.HEIGHT: _offset,
    Measure.OFFSET: _offset,
    Measure.DISTANCE: _distance,
}


class ConstraintFunctions:
    """Values and gradients of constraints over the joints of a group."""

    def __init__(self, group: ArmGroup, bounds: Sequence[Bound]) -> None:
        self.group, self.bounds = group, tuple(bounds)
        self.lower, self.upper, self.tolerance = (
            np.array([getattr(bound, name) for bound in bounds]) for name in ("lower", "upper", "tolerance")
        )
        kinds = [(bound.arm, bound.measure) for bound in bounds]
        self._kinds = tuple(dict.fromkeys(kinds))
        self._of_kind = np.array([self._kinds.index(kind) for kind in kinds], np.intp)
        self._parameters = np.array([bound.parameters for bound in bounds]).reshape(-1, 12)

    def values(self, q: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Compute values (r,) and gradients (r, n) of constraints, by number (r,), at configurations (r, n)."""
        values, gradients = np.zeros(len(which)), np.zeros((len(which), self.group.dof))
        for kind, (arm, _) in enumerate(self._kinds):
            rows = np.flatnonzero(self._of_kind[which] == kind)
            if not len(rows):
                continue
            columns = self.group.columns[arm]
            value, gradient = self._functions[kind](q[rows][:, columns].T, self._parameters[which[rows]].T)
            values[rows] = value[0]
            gradients[rows[:, None], columns] = gradient.T
        return values, gradients

    def all_values(self, q: Array) -> Array:
        """Compute the values (m, k) of all k constraints at configurations (m, n)."""
        count = len(self.bounds)
        which = np.tile(np.arange(count), len(q))
        return self.values(np.repeat(q, count, axis=0), which)[0].reshape(len(q), count)

    def excess(self, values: Array) -> Array:
        """Compute how far values (..., k) exceed the limits, in tolerances: up to 1 they hold."""
        return np.asarray(np.maximum(np.maximum(self.lower - values, values - self.upper), 0.0) / self.tolerance)

    @cached_property
    def _functions(self) -> list[RowFunction]:
        return [_function(self.group.chains[arm].functions, measure) for arm, measure in self._kinds]


@lru_cache(64)
def _function(chain: ChainFunctions, measure: Measure) -> RowFunction:
    """Build (q of a chain, parameters) -> value, gradient; cached for chains with equal kinematics."""
    parameters = casadi.SX.sym("parameters", 12)
    position = chain.position + chain.rotation @ parameters[:3]
    direction = chain.rotation @ parameters[3:6]
    value = _FORMULAS[measure](position, direction, parameters[6:9], parameters[9:])
    gradient = casadi.densify(casadi.gradient(value, chain.q))
    return RowFunction(
        casadi.Function(measure.name, [chain.q, parameters], [casadi.densify(value), gradient], {"cse": True})
    )
