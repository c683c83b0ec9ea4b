"""Substances, contents, heat and devices that are on: the state that actions change.

Amounts are in millilitres, times in seconds of the world.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Any

from planlang.records import dataclass

MOST = 1e6
"""Greatest amount [ml] that a state is believed to have: a cubic metre."""
ON = "DeviceStateOn"
"""The state of a device that is on."""
OFF = "DeviceStateOff"
"""The state of a device that is off."""
LEAST = 1e-9
"""Less than this is nothing [ml]."""


@dataclass(frozen=True, slots=True)
class Portion:
    """An amount [ml] of a class of substances, and the names of all that went into it."""

    type: str
    amount: float
    origins: tuple[str, ...] = ()

    def with_(self, other: Portion) -> Portion:
        """Return this with more of the same."""
        return Portion(self.type, self.amount + other.amount, merged(self.origins, other.origins))


@dataclass(frozen=True, slots=True)
class Heating:
    """A thing of one of ``inputs`` becomes ``output``, once a side of it was ``seconds`` over one of ``sources``."""

    inputs: tuple[str, ...]
    output: str
    sources: tuple[str, ...]
    seconds: float


Size = tuple[float, float, float]


def _same(cls: str, above: str) -> bool:
    return cls == above


PUDDLE = (0.14, 0.14, 0.008)
"""Size of what was poured out, if nothing says which size its class has [m]."""


def _unknown(cls: str) -> Size | None:
    return None


@dataclass(frozen=True, slots=True)
class Rules:
    """The behaviour of classes of things; the default knows of no classes above others, and of no heat."""

    heating: tuple[Heating, ...] = ()
    is_a: Callable[[str, str], bool] = field(default=_same, compare=False)
    """Return True if a class is another one, or below it."""
    size: Callable[[str], Size | None] = field(default=_unknown, compare=False)
    """The size [m] of a thing of a class that comes into being; None if the class has none."""
    flow_rate: float = 20.0
    """So fast does a vessel run dry that is turned over [ml/s]."""

    def result(self, type: str, source: str) -> Heating | None:
        """Return what heat of a source does to a thing, by their classes; the narrowest output counts."""
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
        """Return whether heat changes things of a class, or has changed them."""
        return any(self.is_a(type, cls) for one in self.heating for cls in (*one.inputs, one.output))


class Matter:
    """The state of all things of a world, or of a belief about one; what is not mentioned is as its class is."""

    def __init__(self) -> None:
        self.contents: dict[str, dict[str, Portion]] = {}
        """Thing -> class of a substance -> how much of it is in the thing; of food itself, how much it is."""
        self.heated: dict[str, tuple[float, float]] = {}
        """Thing -> how long its lower side, along its own z axis, and its upper side were over heat [s]."""
        self.states: dict[str, str] = {}
        """Device, or what was mixed or cleaned -> state."""
        self.types: dict[str, tuple[str, ...]] = {}
        """Thing -> the classes that heat has given it, the last one first, then what it was before."""
        self.origins: dict[str, tuple[str, ...]] = {}
        """Thing that came into being -> the names of all that went into it."""
        self.gone: dict[str, None] = {}
        """The destroyed things, in order."""
        self.count = 0
        """Number of changes that somebody made; those by time are not counted."""

    def put(self, name: str, portion: Portion) -> None:
        """Add to the contents of a thing."""
        content = self.contents.setdefault(name, {})
        content[portion.type] = content[portion.type].with_(portion) if portion.type in content else portion

    def take(self, name: str, amount: float) -> list[Portion]:
        """Take an amount [ml] out of a thing, or all there is: of everything in it the same share."""
        content = self.contents.get(name, {})
        whole = sum(portion.amount for portion in content.values())
        if whole <= LEAST or amount <= 0:
            return []
        share = min(1.0, amount / whole)
        taken = [Portion(one.type, one.amount * share, one.origins) for one in content.values()]
        left = [Portion(one.type, one.amount * (1 - share), one.origins) for one in content.values() if share < 1]
        self.contents[name] = {one.type: one for one in left if one.amount > LEAST}
        if not self.contents[name]:
            del self.contents[name]
        return taken

    def total(self, name: str) -> float:
        """Return how much is in a thing [ml]."""
        return sum(portion.amount for portion in self.contents.get(name, {}).values())

    def gives_way(self, name: str) -> bool:
        """Return whether a thing is what was poured, and no heat has made it firm."""
        return name in self.origins and name in self.contents and name not in self.types

    def is_on(self, name: str) -> bool:
        """Return whether a device is on."""
        return self.states.get(name) == ON

    def became(self, name: str, type: str, before: str) -> None:
        """Give a thing another class; what it consists of is of that class, too."""
        self.types[name] = (type, *self.types.get(name, (before,)))
        content = self.contents.pop(name, None)
        for portion in (content or {}).values():
            self.put(name, Portion(type, portion.amount, portion.origins))

    def state(self) -> tuple[object, ...]:
        """Return something hashable that is equal for equal states."""
        contents = tuple((name, tuple(content.values())) for name, content in self.contents.items())
        tables = (self.heated, self.states, self.types, self.origins, self.gone)
        return (contents, *(tuple(table.items()) for table in tables))

    def snapshot(self) -> dict[str, Any]:
        """Return the state as JSON."""
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
        """Go on from a :meth:`snapshot`; raises ValueError for one that is about things not known, or is damaged."""
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
    """Return all names, sorted, each once."""
    return tuple(sorted({name for names in several for name in names}))


def _portion(type: Any, amount: Any, origins: Any) -> Portion:
    return Portion(str(type), _number(amount), tuple(map(str, origins)))


def _number(value: Any) -> float:
    if type(value) not in (int, float) or not (math.isfinite(value) and 0 <= value <= MOST):
        raise ValueError(f"a number from 0 to {MOST:g} is expected, not {value!r}")
    return float(value)
