"""Constraints on the motion of a tool relative to the world, as plain data.

A constraint bounds a function of two features, one of a tool and one of the world. The table of these functions is
``ConstraintKind``; an executive implements each :class:`Measure`. In the formulas p and d are the position and the
direction of a feature, index t for the tool and o for the world, v = p_t - p_o and n = d_o / |d_o|.

Source: G. Bartels, I. Kresse, M. Beetz, Constraint-based movement representation grounded in geometric features
(Humanoids 2013). The classes are those of KnowRob's motion-constraints.owl.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import field, replace
from enum import Enum
from inspect import signature
from typing import ClassVar, TypeVar

from planlang.advice import Change
from planlang.designators import Device, Filler, Object, local_name
from planlang.failures import ManipulationFailure
from planlang.misuse import Usage, WrongValue, amount, is_iterable
from planlang.records import dataclass

Vector = tuple[float, float, float]

_FEATURE = Usage(
    "a_feature",
    {"kind": '"PLANE"', "of=": "pan"},
    {
        "position": "(0.0, 0.0, 0.02)",
        "direction": "(0.0, 0.0, 1.0)",
        "path": '("SpatulaBlade", "FrontSide")',
        "held_by": "LEFT_ARM",
        "name": '"rim"',
    },
)
_CONSTRAINT = Usage(
    "a_constraint",
    {"kind": '"HEIGHT"', "tool": "blade", "world": "pan"},
    {
        "lower": "0.1",
        "upper": "0.15",
        "weight": "1.0",
        "speed": '"SLOW"',
        "frame": '"map"',
        "name": '"HeightBladePan"',
    },
)


class _Named(Enum):
    """An Enum whose repr shows the names of members, not their values."""

    def __repr__(self) -> str:
        return f"{type(self).__name__}.{self.name}"


class FeatureKind(_Named):
    """The kinds of features."""

    POINT = "point"
    """A position alone."""
    LINE = "line"
    """A position, and the direction of the line through it."""
    PLANE = "plane"
    """A position, and the normal of the plane through it."""


class Measure(_Named):
    """A function of a tool feature and a world feature."""

    COSINE = "cosine"
    HEIGHT = "height"
    DISTANCE = "distance"
    HEADING = "heading"
    OFFSET = "offset"


@dataclass(frozen=True, slots=True)
class ConstraintType:
    """One row of the table."""

    owl: str
    """The class: a local name of KnowRob's motion-constraints.owl."""
    measure: Measure
    formula: str
    unit: str
    """"m", or "" for sines and cosines."""
    range: tuple[float, float] = (-math.inf, math.inf)
    """Range of the function; limits outside of it have no effect."""
    tool_direction: bool = False
    """True if the tool feature needs a direction, so that a point is not enough."""
    world_direction: bool = False
    """True if the world feature needs a direction."""
    axis: Vector = (0.0, 0.0, 0.0)
    """Axis in the reference frame along which an offset, or a height over a point, is measured."""


class ConstraintKind(_Named):
    """The table of constraints."""

    PERPENDICULARITY = ConstraintType(
        "PerpendicularityConstraint",
        Measure.COSINE,
        "cosine of the angle between d_t and d_o: 1 parallel, 0 perpendicular, -1 opposite",
        "",
        (-1.0, 1.0),
        tool_direction=True,
        world_direction=True,
    )
    HEIGHT = ConstraintType(
        "HeightConstraint",
        Measure.HEIGHT,
        "n . v; without d_o the z of v in the reference frame",
        "m",
        axis=(0.0, 0.0, 1.0),
    )
    DISTANCE = ConstraintType(
        "DistanceConstraint", Measure.DISTANCE, "|v - (n . v) n|; without d_o |v|", "m", (0.0, math.inf)
    )
    POINTING_AT = ConstraintType(
        "PointingAtConstraint",
        Measure.HEADING,
        "(a . b) / (|a| |b|) with a = d_o x v and b = d_t - (n . d_t) n; 0 where |a| or |b| < 0.001",
        "",
        (-1.0, 1.0),
        tool_direction=True,
        world_direction=True,
    )
    ABOVE_OF = ConstraintType("AboveOfConstraint", Measure.OFFSET, "z of v", "m", axis=(0.0, 0.0, 1.0))
    BELOW_OF = ConstraintType("BelowOfConstraint", Measure.OFFSET, "-z of v", "m", axis=(0.0, 0.0, -1.0))
    LEFT_OF = ConstraintType("LeftOfConstraint", Measure.OFFSET, "y of v", "m", axis=(0.0, 1.0, 0.0))
    RIGHT_OF = ConstraintType("RightOfConstraint", Measure.OFFSET, "-y of v", "m", axis=(0.0, -1.0, 0.0))
    BEHIND = ConstraintType("BehindConstraint", Measure.OFFSET, "x of v", "m", axis=(1.0, 0.0, 0.0))
    IN_FRONT_OF = ConstraintType("InFrontOfConstraint", Measure.OFFSET, "-x of v", "m", axis=(-1.0, 0.0, 0.0))

    @staticmethod
    def of_owl_class(owl: str) -> ConstraintKind | None:
        """Look up a kind by the IRI or local name of its OWL class; None if there is none."""
        return next((kind for kind in ConstraintKind if kind.value.owl == local_name(owl)), None)


@dataclass(frozen=True, slots=True)
class Pace:
    """Maximum speeds of a tool feature: linear [m/s] and angular [rad/s]."""

    owl: str
    linear: float
    angular: float


class Speed(_Named):
    """Classes of speed."""

    SLOW = Pace("SlowMotionConstraint", 0.05, 0.25)
    MEDIUM = Pace("MediumVelMotionConstraint", 0.15, 0.75)
    FAST = Pace("FastMotionConstraint", 0.3, 1.5)

    @staticmethod
    def of_owl_class(owl: str) -> Speed | None:
        """Look up a speed by the IRI or local name of its OWL class; None if there is none."""
        return next((speed for speed in Speed if speed.value.owl == local_name(owl)), None)


@dataclass(frozen=True, slots=True, repr=False)
class Feature(Filler):
    """A point, line or plane on an object or a tool.

    ``position`` [m] and ``direction`` (any nonzero length) are in the frame of the object ``of``. With ``kind`` None
    the feature is looked up in the object's model once the object is known: ``path`` names the classes of nested
    parts, outermost first. ``held_by`` selects the object by the hand that holds it, if several match.
    """

    kind: FeatureKind | None
    of: Object
    position: Vector | None = None
    direction: Vector | None = None
    path: tuple[str, ...] = ()
    held_by: Device | None = None
    name: str | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        _FEATURE.instance("of", self.of, Object, "an object or a device")
        if self.held_by is not None:
            _FEATURE.instance("held_by", self.held_by, Device, "a device")
        if self.name is not None:
            _FEATURE.text("name", self.name)
        if not isinstance(self.path, tuple) or not all(isinstance(one, str) and one for one in self.path):
            raise _FEATURE.wrong("path", self.path, "a tuple of classes")
        if self.kind is None:
            if self.position is not None or self.direction is not None:
                raise _FEATURE.wrong("kind", None, f"one of {_names(FeatureKind)} beside a position", WrongValue)
            return
        _FEATURE.instance("kind", self.kind, FeatureKind, f"one of {_names(FeatureKind)}")
        _check_vector("position", self.position)
        if self.kind is FeatureKind.POINT:
            if self.direction is not None:
                raise _FEATURE.wrong("direction", self.direction, "left out for a point", WrongValue)
        else:
            _check_vector("direction", self.direction)
            if math.hypot(*self.direction or ()) < LEAST_LENGTH:
                raise _FEATURE.wrong("direction", self.direction, "a vector with a length", WrongValue)

    @property
    def is_grounded(self) -> bool:
        """True if its position on the object is known."""
        return self.kind is not None

    def __str__(self) -> str:
        return self.name or ".".join((str(self.of), *self.path))

    def __repr__(self) -> str:
        return _call(a_feature, self, () if self.kind is None else (self.kind.name,))


@dataclass(eq=False, repr=False)
class ConstraintsUnsatisfied(ManipulationFailure):
    """Constraints of a motion cannot be satisfied, or were violated at its end; ``constraints`` has their names."""

    constraints: tuple[str, ...] = field(default=(), kw_only=True)
    changes: tuple[Change, ...] = field(default=(), kw_only=True)
    """What the message advises to change in the map, as data."""

    text: ClassVar[str] = "constraints of the motion do not hold"


STANDING_FOR = {"ObjectActedOn": "objectActedOn", "TargetOfMotion": "toLocation", "DeviceUsed": "deviceUsed"}
"""Placeholder classes in constraints -> the property of the motion that fills them."""
LEAST_LENGTH = 1e-6
"""Length below which a direction counts as zero."""


@dataclass(frozen=True, slots=True, repr=False)
class MotionConstraint(Filler):
    """Bounds on a function of two features: lower <= f <= upper [m, or no unit]; None is no limit.

    ``frame`` names the reference frame, by default the robot's torso with z up. If not all constraints can hold, those
    of higher weight prevail; ``weight`` 0 disables a constraint. ``name`` is its name in the recipe.
    """

    kind: ConstraintKind
    tool: Feature
    world: Feature
    lower: float | None = None
    upper: float | None = None
    weight: float = 1.0
    speed: Speed | None = None
    frame: str | None = None
    name: str | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        _CONSTRAINT.instance("kind", self.kind, ConstraintKind, f"one of {_names(ConstraintKind)}")
        for role, feature, needed in (
            ("tool", self.tool, self.kind.value.tool_direction),
            ("world", self.world, self.kind.value.world_direction),
        ):
            _CONSTRAINT.instance(role, feature, Feature, "a feature")
            if needed and feature.kind is FeatureKind.POINT:
                raise _CONSTRAINT.wrong(role, feature, "a line or a plane: a point has no direction", WrongValue)
        for bound, value in (("lower", self.lower), ("upper", self.upper)):
            if value is not None and not _is_finite(value):
                raise _CONSTRAINT.wrong(bound, value, "a finite number", WrongValue)
        if self.lower is not None and self.upper is not None and self.lower > self.upper:
            raise _CONSTRAINT.wrong("lower", self.lower, f"at most the upper limit, {self.upper}", WrongValue)
        if amount(self.weight) is None:
            raise _CONSTRAINT.wrong("weight", self.weight, "a finite number >= 0", WrongValue)
        if self.speed is not None:
            _CONSTRAINT.instance("speed", self.speed, Speed, f"one of {_names(Speed)}")
        for parameter, text in (("frame", self.frame), ("name", self.name)):
            if text is not None:
                _CONSTRAINT.text(parameter, text)

    @property
    def is_active(self) -> bool:
        """False if its weight is 0: it is then neither solved nor checked."""
        return self.weight > 0

    @property
    def limits(self) -> tuple[float, float]:
        """Effective limits: infinite without a limit, and for a limit outside the range (a distance >= -0.1)."""
        least, most = self.kind.value.range
        lower = -math.inf if self.lower is None or self.lower <= least else self.lower
        upper = math.inf if self.upper is None or self.upper >= most else self.upper
        return lower, upper

    def within(
        self,
        lower: float | None,
        upper: float | None,
        *,
        weight: float = 1.0,
        speed: Speed | str | None = None,
        name: str | None = None,
    ) -> MotionConstraint:
        """Copy the constraint with other limits, weight and speed; it keeps its name unless one is given."""
        pace = None if speed is None else _member(_CONSTRAINT, "speed", Speed, speed)
        return replace(self, lower=lower, upper=upper, weight=weight, speed=pace, name=name or self.name)

    def asks_the_same(self, other: MotionConstraint) -> bool:
        """Check whether both bound the same function by the same limits."""
        mine, others = (replace(one, weight=1.0, speed=None) for one in (self, other))
        return mine == others

    def __str__(self) -> str:
        bounds = " to ".join("any" if limit is None else f"{limit:g}" for limit in (self.lower, self.upper))
        unit = f" {self.kind.value.unit}" if self.kind.value.unit else ""
        name = self.name or self.kind.name.lower()
        return f"{name} of {self.tool} and {self.world} {bounds}{unit}"

    def __repr__(self) -> str:
        return _call(a_constraint, self, (self.kind.name, self.tool, self.world))


def a_feature(
    kind: FeatureKind | str | None = None,
    *,
    of: Object,
    position: Sequence[float] | None = None,
    direction: Sequence[float] | None = None,
    path: Sequence[str] = (),
    held_by: Device | None = None,
    name: str | None = None,
) -> Feature:
    """Describe a point, line or plane of a thing: ``a_feature("LINE", of=cup, position=(0, 0, 0), direction=...)``.

    Without ``kind`` it is looked up by classes of parts: ``a_feature(of=spatula, path=("Blade", "FrontSide"))``.
    """
    known = None if kind is None else _member(_FEATURE, "kind", FeatureKind, kind)
    _FEATURE.iterable("path", path, "a tuple of classes")
    vectors = (_vector("position", position), _vector("direction", direction))
    return Feature(known, of, *vectors, tuple(path), held_by, name)


def a_constraint(
    kind: ConstraintKind | str,
    tool: Feature,
    world: Feature,
    *,
    lower: float | None = None,
    upper: float | None = None,
    weight: float = 1.0,
    speed: Speed | str | None = None,
    frame: str | None = None,
    name: str | None = None,
) -> MotionConstraint:
    """Describe a constraint on a motion: ``a_constraint("HEIGHT", blade, pan, lower=0.1, upper=0.15)``."""
    known = _member(_CONSTRAINT, "kind", ConstraintKind, kind)
    pace = None if speed is None else _member(_CONSTRAINT, "speed", Speed, speed)
    return MotionConstraint(known, tool, world, lower, upper, weight, pace, frame, name)


def _call(maker: Callable[..., object], value: Feature | MotionConstraint, positional: Sequence[object]) -> str:
    """Format the call of ``maker`` that makes an equal value, without arguments that have their defaults."""
    parts = [repr(one) for one in positional]
    for parameter in signature(maker).parameters.values():
        given = getattr(value, parameter.name)
        if parameter.kind is parameter.KEYWORD_ONLY and given != parameter.default:
            parts.append(f"{parameter.name}={(given.name if isinstance(given, Enum) else given)!r}")
    return f"{maker.__name__}({', '.join(parts)})"


_E = TypeVar("_E", bound=Enum)


def _member(usage: Usage, parameter: str, kind: type[_E], value: _E | str) -> _E:
    """Convert a member of an Enum, or its name, to the member."""
    if isinstance(value, str) and value in kind.__members__:
        return kind[value]
    if not isinstance(value, kind):
        raise usage.wrong(parameter, value, f"one of {_names(kind)}", WrongValue)
    return value


def _names(kind: type[Enum]) -> str:
    return ", ".join(kind.__members__)


def _vector(parameter: str, value: Sequence[float] | None) -> Vector | None:
    if value is None:
        return None
    numbers = tuple(value) if hasattr(value, "__len__") and is_iterable(value) and not isinstance(value, str) else value
    _check_vector(parameter, numbers)
    x, y, z = map(float, numbers)
    return x, y, z


def _check_vector(parameter: str, value: object) -> None:
    if not isinstance(value, tuple) or len(value) != 3 or not all(map(_is_finite, value)):
        raise _FEATURE.wrong(parameter, value, "three finite numbers in the frame of the thing", WrongValue)


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
