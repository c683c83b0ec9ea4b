"""Substances, contents, heat and device states: what actions change besides poses.

Amounts are in millilitres, times in seconds of the world.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any

from planlang.records import dataclass

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
class Heating:
    """Rule: a thing of one of ``inputs`` becomes ``output`` after ``seconds`` of one side over one of ``sources``."""

    inputs: tuple[str, ...]
    output: str
    sources: tuple[str, ...]
    seconds: float


Size = tuple[float, float, float]


def _same(cls: str, above: str) -> bool:
    return cls == above


PUDDLE = (0.14, 0.14, 0.008)
"""Size of a puddle if its class states none [m]."""


def _unknown(cls: str) -> Size | None:
    return None


@dataclass(frozen=True, slots=True)
class Rules:
    """Behaviour of classes of things; the defaults know neither subclasses nor heat."""

    heating: tuple[Heating, ...] = ()
    is_a: Callable[[str, str], bool] = field(default=_same, compare=False)
    """Whether a class is equal to, or a subclass of, another."""
    size: Callable[[str], Size | None] = field(default=_unknown, compare=False)
    """Size [m] of a created thing of a class; None if the class states none."""
    flow_rate: float = 20.0
    """Outflow of a vessel that is turned over [ml/s]."""

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
        """Check whether heat changes things of a class, or has changed them."""
        return any(self.is_a(type, cls) for one in self.heating for cls in (*one.inputs, one.output))


class Matter:
    """State of all things of a world, or of a belief about one; unmentioned things are as their class is."""

    def __init__(self) -> None:
        self.contents: dict[str, dict[str, Portion]] = {}
        """Thing -> class of a substance -> its amount in the thing; for food itself, its own amount."""
        self.heated: dict[str, tuple[float, float]] = {}
        """Thing -> time for which its lower side, along its own z axis, and its upper side were heated [s]."""
        self.states: dict[str, str] = {}
        """Device, or thing that was mixed or cleaned -> state."""
        self.types: dict[str, tuple[str, ...]] = {}
        """Thing -> classes that heat has given it, newest first, then its original class."""
        self.origins: dict[str, tuple[str, ...]] = {}
        """Created thing -> names of everything that went into it."""
        self.gone: dict[str, None] = {}
        """Destroyed things, in order."""
        self.count = 0
        """Number of changes made by actions; those that time brings are not counted."""

    def put(self, name: str, portion: Portion) -> None:
        """Add a portion to a thing's contents."""
        content = self.contents.setdefault(name, {})
        content[portion.type] = content[portion.type].with_(portion) if portion.type in content else portion

    def take(self, name: str, amount: float) -> list[Portion]:
        """Take an amount [ml], or all there is, out of a thing: the same share of each substance."""
        content = self.contents.get(name, {})
        volume = sum(portion.amount for portion in content.values())
        if volume <= LEAST or amount <= 0:
            return []
        share = min(1.0, amount / volume)
        taken = [Portion(one.type, one.amount * share, one.origins) for one in content.values()]
        left = [Portion(one.type, one.amount * (1 - share), one.origins) for one in content.values() if share < 1]
        self.contents[name] = {one.type: one for one in left if one.amount > LEAST}
        if not self.contents[name]:
            del self.contents[name]
        return taken

    def total(self, name: str) -> float:
        """Total volume in a thing [ml]."""
        return sum(portion.amount for portion in self.contents.get(name, {}).values())

    def gives_way(self, name: str) -> bool:
        """Check whether a thing is poured substance that no heat has made firm."""
        return name in self.origins and name in self.contents and name not in self.types

    def is_on(self, name: str) -> bool:
        """Check whether a device is on."""
        return self.states.get(name) == ON

    def became(self, name: str, type: str, before: str) -> None:
        """Change the class of a thing and of what it consists of."""
        self.types[name] = (type, *self.types.get(name, (before,)))
        content = self.contents.pop(name, None)
        for portion in (content or {}).values():
            self.put(name, Portion(type, portion.amount, portion.origins))

    def state(self) -> tuple[object, ...]:
        """Summarise the state as a hashable value."""
        contents = tuple((name, tuple(content.values())) for name, content in self.contents.items())
        tables = (self.heated, self.states, self.types, self.origins, self.gone)
        return (contents, *(tuple(table.items()) for table in tables))

    def snapshot(self) -> dict[str, Any]:
        """Serialise the state as JSON."""
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

    def restore(self, state: Mapping[str, Any], known: Iterable[str]) -> None:
        """Restore a :meth:`snapshot`; raises ValueError if it is damaged or mentions unknown things."""
        names = set(known)
        for table in state.values():
            if not names.issuperset(table):
                raise ValueError(f"there is no body {', '.join(sorted(set(map(str, table)) - names))}")
        contents = {name: [_portion(*one) for one in content] for name, content in state["contents"].items()}
        self.contents = {name: {one.type: one for one in content} for name, content in contents.items()}
        self.heated = {name: (_number(low), _number(high)) for name, (low, high) in state["heated"].items()}
        self.states = {name: str(value) for name, value in state["states"].items()}
        self.types = {name: tuple(map(str, types)) for name, types in state["types"].items()}
        self.origins = {name: tuple(map(str, origins)) for name, origins in state["origins"].items()}
        self.gone = dict.fromkeys(map(str, state["gone"]))


def merged(*several: Iterable[str]) -> tuple[str, ...]:
    """Sort all names, without duplicates."""
    return tuple(sorted({name for names in several for name in names}))


def _portion(type: Any, amount: Any, origins: Any) -> Portion:
    return Portion(str(type), _number(amount), tuple(map(str, origins)))


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not (math.isfinite(value) and 0 <= value <= MOST):
        raise ValueError(f"expected a number from 0 to {MOST:g}, got {value!r}")
    return float(value)
