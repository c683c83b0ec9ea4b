"""Facts about things that actions change, in the true world or in a believed one: the same questions for both."""

from __future__ import annotations

from collections.abc import Iterator

from sim.changes import Changes
from sim.matter import merged


def amount_of(changes: Changes, name: str, type: str) -> float:
    """Return how much of a class of substances is in a thing, or in foods that lie on it [ml]."""
    lying = (food for food in changes.matter.origins if _is_there(changes, food) and changes.under(food) == name)
    return sum(_amount_in(changes, one, type) for one in (name, *lying))


def _amount_in(changes: Changes, name: str, type: str) -> float:
    content = changes.matter.contents.get(name, {}).values()
    former = name in changes.matter.types and changes.was_ever(name, type)
    return sum(portion.amount for portion in content if former or changes.rules.is_a(portion.type, type))


def _is_there(changes: Changes, name: str) -> bool:
    return name in changes.bodies.bodies and name not in changes.bodies.removed


def is_baked(changes: Changes, name: str, seconds: float | None = None) -> bool:
    """Return whether both sides of a thing were over heat for some time [s], by default as long as its class needs."""
    sides = changes.matter.heated.get(name, (0.0, 0.0))
    needed = seconds if seconds is not None else min(_needed(changes, name), default=float("inf"))
    return min(sides) >= needed - 1e-6


def _needed(changes: Changes, name: str) -> Iterator[float]:
    """Yield how long heat takes to make a thing of the classes that a thing, or what is in it, is of [s]."""
    types = {changes.type_of(name), *changes.matter.contents.get(name, {})}
    for rule in changes.rules.heating:
        if any(changes.rules.is_a(one, rule.output) for one in types):
            yield rule.seconds


def came_to_be(changes: Changes, type: str) -> tuple[str, ...]:
    """Return what came into being of a class and is there: things, and vessels that hold it."""
    things = [name for name in changes.matter.origins if _is_there(changes, name) and changes.was_ever(name, type)]
    holding = [
        name
        for name, content in changes.matter.contents.items()
        if any(one.origins and changes.rules.is_a(one.type, type) for one in content.values())
    ]
    return tuple(dict.fromkeys((*things, *holding)))


def origins_of(changes: Changes, name: str) -> tuple[str, ...]:
    """Return the names of all that went into a thing, or into what is in it."""
    content = changes.matter.contents.get(name, {}).values()
    return merged(changes.matter.origins.get(name, ()), *(portion.origins for portion in content))
