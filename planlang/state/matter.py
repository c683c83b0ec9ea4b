"""Substances, contents, heat and device states: what actions change besides poses, and rules of what becomes of them.

Amounts are in millilitres, times in seconds of the world.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field, replace
from typing import Any, TypeVar

from planlang.geometry.shapes import Size
from planlang.records import dataclass

T = TypeVar("T")

MOST = 1e6
"""Greatest plausible amount [ml]: a cubic metre."""
ON = "DeviceStateOn"
"""State of a device that is on."""
OFF = "DeviceStateOff"
"""State of a device that is off."""
KG_PER_ML = 0.001
"""Density of all substances, that of water [kg/ml]."""
LEAST = 1e-9
"""Amounts up to this count as none [ml]."""


@dataclass(frozen=True, slots=True)
class Portion:
    """Amount [ml] of a class of substances, with the names of everything that went into it."""

    type: str
    amount: float
    origins: tuple[str, ...] = ()

    def with_(self, other: Portion) -> Portion:
        """Combine with more of the same substance."""
        return Portion(self.type, self.amount + other.amount, merged(self.origins, other.origins))


@dataclass(frozen=True, slots=True)
class Matter:
    """State of all things besides their poses; unmentioned things are as their class is.

    Immutable, its mappings too: each change makes another value that shares what stays equal.
    """

    contents: Mapping[str, Mapping[str, Portion]] = field(default_factory=dict)
    """Thing -> class of a substance -> its amount in the thing; for food itself, its own amount."""
    heated: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Thing -> time for which its lower side, along its own z axis, and its upper side were heated [s]."""
    states: Mapping[str, str] = field(default_factory=dict)
    """Device, or thing that was mixed or cleaned -> state."""
    types: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Thing -> classes that heat has given it, newest first, then its original class."""
    origins: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Created thing -> names of everything that went into it."""
    gone: Mapping[str, None] = field(default_factory=dict)
    """Destroyed things, in order."""

    # Questions

    def total(self, name: str) -> float:
        """Total volume in a thing [ml]."""
        return sum(portion.amount for portion in self.contents.get(name, {}).values())

    def gives_way(self, name: str) -> bool:
        """Check whether a thing is poured substance that no heat has made firm."""
        return name in self.origins and name in self.contents and name not in self.types

    def is_on(self, name: str) -> bool:
        """Check whether a device is on."""
        return self.states.get(name) == ON

    def went_into(self, name: str) -> tuple[str, ...]:
        """Name everything that went into a thing or its contents."""
        content = self.contents.get(name, {}).values()
        return merged(self.origins.get(name, ()), *(portion.origins for portion in content))

    # Changes

    def holding(self, name: str, content: Mapping[str, Portion]) -> Matter:
        """Give a thing other contents; none if ``content`` is empty."""
        contents = {**self.contents, name: content} if content else without(self.contents, name)
        return replace(self, contents=contents)

    def put(self, name: str, portion: Portion) -> Matter:
        """Add a portion to a thing's contents."""
        return self.holding(name, _with(self.contents.get(name, {}), portion))

    def take(self, name: str, amount: float) -> tuple[Matter, list[Portion]]:
        """Take an amount [ml], or all there is, out of a thing: the same share of each substance."""
        content, volume = self.contents.get(name, {}), self.total(name)
        if volume <= LEAST or amount <= 0:
            return self, []
        share = min(1.0, amount / volume)
        taken = [Portion(one.type, one.amount * share, one.origins) for one in content.values()]
        left = [Portion(one.type, one.amount * (1 - share), one.origins) for one in content.values() if share < 1]
        return self.holding(name, {one.type: one for one in left if one.amount > LEAST}), taken

    def switched(self, name: str, state: str) -> Matter:
        """Give a device or thing a state."""
        return replace(self, states={**self.states, name: state})

    def warmed(self, name: str, lower: float, upper: float) -> Matter:
        """Set for how long the sides of a thing were heated [s]."""
        return replace(self, heated={**self.heated, name: (lower, upper)})

    def cooled(self, name: str) -> Matter:
        """Forget that a thing was heated."""
        return replace(self, heated=without(self.heated, name))

    def became(self, name: str, type: str, before: str) -> Matter:
        """Change the class of a thing and of what it consists of."""
        changed = replace(self, types={**self.types, name: (type, *self.types.get(name, (before,)))})
        content = changed.contents.get(name, {}).values()
        changed = changed.holding(name, {})
        for portion in content:
            changed = changed.put(name, Portion(type, portion.amount, portion.origins))
        return changed

    def turned_into(self, name: str, type: str, output: str) -> Matter:
        """Change the class of a substance in a thing."""
        content = self.contents[name]
        return self.holding(name, _with(without(content, type), replace(content[type], type=output)))

    def created(self, name: str, origins: Iterable[str]) -> Matter:
        """Add a thing that was made of others."""
        return replace(self, origins={**self.origins, name: tuple(origins)}, gone=without(self.gone, name))

    def destroyed(self, name: str) -> Matter:
        """Destroy a thing and its contents."""
        contents, states = without(self.contents, name), without(self.states, name)
        return replace(self, gone={**self.gone, name: None}, contents=contents, states=states)

    # Snapshots

    def snapshot(self) -> dict[str, Any]:
        """Serialise as JSON."""
        return {
            "contents": {
                name: [[one.type, one.amount, list(one.origins)] for one in content.values()]
                for name, content in self.contents.items()
            },
            "heated": {name: list(seconds) for name, seconds in self.heated.items()},
            "states": dict(self.states),
            "types": {name: list(types) for name, types in self.types.items()},
            "origins": {name: list(origins) for name, origins in self.origins.items()},
            "gone": list(self.gone),
        }

    @staticmethod
    def of(snapshot: Mapping[str, Any], known: Iterable[str]) -> Matter:
        """Read a :meth:`snapshot`; raises ValueError if it is damaged or mentions unknown things."""
        names = set(known)
        for table in snapshot.values():
            if not names.issuperset(table):
                raise ValueError(f"there is no body {', '.join(sorted(set(map(str, table)) - names))}")
        contents = {name: [_portion(*one) for one in content] for name, content in snapshot["contents"].items()}
        return Matter(
            {name: {one.type: one for one in content} for name, content in contents.items()},
            {name: (_number(low), _number(high)) for name, (low, high) in snapshot["heated"].items()},
            {name: str(value) for name, value in snapshot["states"].items()},
            {name: tuple(map(str, types)) for name, types in snapshot["types"].items()},
            {name: tuple(map(str, origins)) for name, origins in snapshot["origins"].items()},
            dict.fromkeys(map(str, snapshot["gone"])),
        )


def without(table: Mapping[str, T], name: str) -> Mapping[str, T]:
    """Leave a name out of a table; the table itself if it does not have it."""
    if name not in table:
        return table
    left = dict(table)
    del left[name]
    return left


def _with(content: Mapping[str, Portion], portion: Portion) -> Mapping[str, Portion]:
    known = content.get(portion.type)
    return {**content, portion.type: portion if known is None else known.with_(portion)}


def merged(*several: Iterable[str]) -> tuple[str, ...]:
    """Sort all names, without duplicates."""
    return tuple(sorted({name for names in several for name in names}))


def _portion(type: Any, amount: Any, origins: Any) -> Portion:
    return Portion(str(type), _number(amount), tuple(map(str, origins)))


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not (math.isfinite(value) and 0 <= value <= MOST):
        raise ValueError(f"expected a number from 0 to {MOST:g}, got {value!r}")
    return float(value)


# What becomes of things


@dataclass(frozen=True, slots=True)
class Heating:
    """Rule: a thing of one of ``inputs`` becomes ``output`` after ``seconds`` of one side over one of ``sources``."""

    inputs: tuple[str, ...]
    output: str
    sources: tuple[str, ...]
    seconds: float


PUDDLE = (0.14, 0.14, 0.008)
"""Size of a puddle if its class states none [m]."""
ROUNDING = 1e-6
"""Error of a sum over many steps [s]."""


def _unknown(cls: str) -> Size | None:
    return None


@dataclass(frozen=True, slots=True)
class Rules:
    """Behaviour of classes of things; the defaults know neither subclasses nor heat."""

    heating: tuple[Heating, ...] = ()
    is_a: Callable[[str, str], bool] = field(default=operator.eq, compare=False)
    """Whether a class is equal to, or a subclass of, another."""
    size: Callable[[str], Size | None] = field(default=_unknown, compare=False)
    """Size [m] of a created thing of a class; None if the class states none."""
    flow_rate: float = 20.0
    """Outflow of a vessel that is turned over [ml/s]."""
    _heatable: dict[str, bool] = field(default_factory=dict, init=False, repr=False, compare=False)

    def result(self, type: str, source: str) -> Heating | None:
        """Find the rule for heating a thing by a source, given their classes; the most specific output wins."""
        fitting = [
            one
            for one in self.heating
            if any(self.is_a(type, cls) for cls in one.inputs) and any(self.is_a(source, cls) for cls in one.sources)
        ]
        return next(
            (
                one
                for one in fitting
                if not any(one is not other and self.is_a(other.output, one.output) for other in fitting)
            ),
            None,
        )

    def can_heat(self, type: str) -> bool:
        """Check whether heat changes things of a class, or has changed them; asked of all things in every step."""
        if type not in self._heatable:
            self._heatable[type] = any(
                self.is_a(type, cls) for one in self.heating for cls in (*one.inputs, one.output)
            )
        return self._heatable[type]
