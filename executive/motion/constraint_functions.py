"""The functions of motion constraints over the joints of arms, with their gradients, as expressions of casadi.

Every function is one of four of p (a tool feature's position), d (its direction) and constants c and n, by which
:class:`Bound` says where a world feature is: cosine and heading between directions, the offset of p along n, and the
distance of p from the line along n, or from c itself where n is 0. Directions are unit vectors.
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
from executive.motion.kinematics import ChainFunctions
from executive.motion.symbolic import RowFunction
from planlang.designators import Object
from planlang.geometry import Array
from planlang.geometry.matrices import inverse, moved, product, rotated
from planlang.motion_constraints import Feature, Measure, MotionConstraint
from planlang.records import dataclass

UNDEFINED = 1e-3
"""Vectors shorter than this have no heading."""
LENGTH_TOLERANCE, COSINE_TOLERANCE = 1e-3, 5e-3
"""Excess of a function over its limits up to which the constraint still holds [m], [no unit]."""


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """The things of constraints: tools in hands, the rest where it was at the start."""

    base: Array
    """Pose (4, 4) of the arms' base link in the map."""
    tools: Mapping[Object, tuple[int, Array]]
    """Tool -> the number of the arm that holds it, and its pose (4, 4) in the frame of the arm's tip."""
    things: Mapping[Object, Array]
    """Thing -> its pose (4, 4) in the map; features of the world are taken from here."""
    frames: Mapping[str, Array]
    """Reference frame -> its rotation (3, 3) in the map."""
    torso: Array
    """Rotation (3, 3) in the map of the frame that is meant where a constraint names none: x ahead, z up."""

    def pose_of(self, thing: Object) -> Array:
        """Return the pose of a thing in the map; raises :class:`MotionError` for one that is nowhere."""
        if thing not in self.things:
            raise MotionError(f"nothing says where {thing} is")
        return self.things[thing]

    def tool(self, thing: Object) -> tuple[int, Array]:
        """Return the arm and the pose in its tip of a tool; raises :class:`MotionError` for one that is in no hand."""
        if thing not in self.tools:
            raise MotionError(f"no hand that takes part in the motion holds {thing}")
        return self.tools[thing]

    def rotation(self, frame: str | None) -> Array:
        """Return the rotation of a reference frame in the map; raises :class:`MotionError` for an unknown one."""
        if frame is None:
            return self.torso
        named = frame.lstrip("/")
        if named not in self.frames:
            raise MotionError(f"there is no reference frame {frame}; there are {', '.join(self.frames) or 'none'}")
        return self.frames[named]


@dataclass(frozen=True, slots=True, eq=False)
class Bound:
    """A constraint as one of four functions, with the numbers that it takes."""

    constraint: MotionConstraint
    function: str
    arm: int
    parameters: Array
    """Position and direction of the tool feature in the frame of the arm's tip; c and n in the base, (12,)."""
    lower: float
    upper: float
    tolerance: float

    @staticmethod
    def of(constraint: MotionConstraint, where: Surroundings) -> Bound:
        """Return a constraint as things are; raises :class:`MotionError` for a feature that is not grounded."""
        arm, in_tip = where.tool(constraint.tool.of)
        tool = _placed(constraint.tool, in_tip)
        world = _placed(constraint.world, product(inverse(where.base), where.pose_of(constraint.world.of)))
        measure, normal = constraint.kind.value.measure, world[3:]
        if measure is Measure.OFFSET or (measure is Measure.HEIGHT and not normal.any()):
            axis = rotated(where.rotation(constraint.frame), np.array(constraint.kind.value.axis))
            normal = rotated(where.base[:3, :3].T, axis)
        tolerance = LENGTH_TOLERANCE if constraint.kind.value.unit else COSINE_TOLERANCE
        parameters = np.concatenate([tool, world[:3], normal])
        return Bound(constraint, _FUNCTION_OF[measure], arm, parameters, *constraint.limits, tolerance)


_FUNCTION_OF = {
    Measure.COSINE: "cosine",
    Measure.HEADING: "heading",
    Measure.HEIGHT: "offset",
    Measure.OFFSET: "offset",
    Measure.DISTANCE: "distance",
}


def _placed(feature: Feature, pose: Array) -> Array:
    """Return position and unit direction (6,) of a feature of a thing at a pose (4, 4); a point has the direction 0."""
    if feature.position is None:
        raise MotionError(f"{feature} is not grounded: no model has said where it is in {feature.of}")
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
    """Return the length of a vector, with a gradient at 0 as well."""
    return casadi.sqrt(casadi.dot(vector, vector) + 1e-18)


_FORMULAS: dict[str, Callable[[Any, Any, Any, Any], Any]] = {
    "cosine": _cosine,
    "heading": _heading,
    "offset": _offset,
    "distance": _distance,
}


class ConstraintFunctions:
    """Values and gradients of constraints over the joints of a group."""

    def __init__(self, group: ArmGroup, bounds: Sequence[Bound]) -> None:
        self.group, self.bounds = group, tuple(bounds)
        self.lower, self.upper, self.tolerance = (
            np.array([getattr(bound, name) for bound in bounds]) for name in ("lower", "upper", "tolerance")
        )
        kinds = [(bound.arm, bound.function) for bound in bounds]
        self._kinds = tuple(dict.fromkeys(kinds))
        self._of_kind = np.array([self._kinds.index(kind) for kind in kinds], np.intp)
        self._parameters = np.array([bound.parameters for bound in bounds]).reshape(-1, 12)

    def values(self, q: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Return values (r,) and gradients (r, n) of constraints, by number (r,), at configurations (r, n)."""
        found, gradients = np.zeros(len(which)), np.zeros((len(which), self.group.dof))
        for kind, (arm, _) in enumerate(self._kinds):
            rows = np.flatnonzero(self._of_kind[which] == kind)
            if not len(rows):
                continue
            columns = self.group.columns[arm]
            value, gradient = self._functions[kind](q[rows][:, columns].T, self._parameters[which[rows]].T)
            found[rows] = value[0]
            gradients[rows[:, None], columns] = gradient.T
        return found, gradients

    def all_values(self, q: Array) -> Array:
        """Return the values (m, k) of all k constraints at configurations (m, n)."""
        count = len(self.bounds)
        which = np.tile(np.arange(count), len(q))
        return self.values(np.repeat(q, count, axis=0), which)[0].reshape(len(q), count)

    def excess(self, values: Array) -> Array:
        """Return how far values (..., k) are outside of the limits, in tolerances: at most 1 where they hold."""
        return np.asarray(np.maximum(np.maximum(self.lower - values, values - self.upper), 0.0) / self.tolerance)

    @cached_property
    def _functions(self) -> list[RowFunction]:
        return [_function(self.group.chains[arm].functions, name) for arm, name in self._kinds]


@lru_cache(64)
def _function(functions: ChainFunctions, name: str) -> RowFunction:
    """Return (q of a chain, parameters) -> value, gradient; written down once for chains that move the same."""
    chain = functions.symbolic
    given = casadi.SX.sym("parameters", 12)
    position, direction = chain.position + chain.rotation @ given[:3], chain.rotation @ given[3:6]
    value = _FORMULAS[name](position, direction, given[6:9], given[9:])
    gradient = casadi.densify(casadi.gradient(value, chain.q))
    return RowFunction(casadi.Function(name, [chain.q, given], [casadi.densify(value), gradient], {"cse": True}))
