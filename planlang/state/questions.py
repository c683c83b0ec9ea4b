"""Questions about any state of a world: of what class a thing is, what it holds, whether it is baked, what comes to be.

They are answered alike for the true world, what a robot believes, hypotheses, and scripted worlds without geometry.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol

from planlang.geometry import Pose
from planlang.geometry.shapes import Size
from planlang.state.matter import ROUNDING, Rules
from planlang.state.world import WorldState

Point = tuple[float, float, float]
LEAST = 1e-6
"""Tolerance of amounts [ml]: less than this counts as nothing."""
POURS = -1e-3
"""Vertical component of a vessel's unit axis below which it pours: beyond rounding, so that a lying one does not."""


class Thing(Protocol):
    """What changes need to know of a thing, besides the state."""

    @property
    def type(self) -> str:
        """Class of the thing at the start."""

    @property
    def size(self) -> Size:
        """Extents along its own axes [m]."""

    @property
    def capacity(self) -> float:
        """Capacity as a vessel [ml]; 0 for other things."""


class Queries(Protocol):
    """Answers about any state of one world; an engine computes them, a world without geometry knows of nothing below.

    Poses are in the map.
    """

    @property
    def rules(self) -> Rules:
        """What becomes of things, by their classes."""

    def thing(self, name: str) -> Thing | None:
        """Look up a thing of the start; None for a name that had no thing then."""

    def pose(self, state: WorldState, name: str) -> Pose:
        """Locate a thing; one that is held is in the hand."""

    def under(self, state: WorldState, name: str) -> str | None:
        """Find what a thing lies on."""

    def below(self, state: WorldState, point: Point, but: str) -> tuple[str | None, float]:
        """Find what is straight below a point, and at what height [m]; the thing ``but`` counts as absent."""

    def rest(self, state: WorldState, name: str) -> Pose | None:
        """Find where a thing would come to rest if released; None if nothing is below."""

    def heated_by(self, state: WorldState, name: str) -> tuple[str, bool] | None:
        """Find the device that heats a thing, and whether the thing is inside it."""


def thing_of(state: WorldState, name: str, queries: Queries) -> Thing:
    """Look up a thing of the start, or one that came to be; raises KeyError if there is none."""
    found = state.made.get(name) or queries.thing(name)
    if found is None:
        raise KeyError(f"there is no thing {name!r}")
    return found


def is_free(state: WorldState, name: str, queries: Queries) -> bool:
    """Check that no thing has a name, nor ever had it."""
    return name not in state.made and queries.thing(name) is None


def types_of(state: WorldState, name: str, queries: Queries) -> tuple[str, ...]:
    """List the classes that a thing has had, the present one first: heat may have changed it."""
    return state.matter.types.get(name) or (thing_of(state, name, queries).type,)


def type_of(state: WorldState, name: str, queries: Queries) -> str:
    """Class of a thing now, after changes by heat."""
    return types_of(state, name, queries)[0]


def is_vessel(state: WorldState, name: str, queries: Queries) -> bool:
    """Check whether a thing holds what is poured into it."""
    return thing_of(state, name, queries).capacity > 0


def amount_of(state: WorldState, name: str, type: str, queries: Queries) -> float:
    """Sum the volume of a class of substances in a thing, and in foods that lie on it [ml]."""
    lying = (food for food in state.matter.origins if state.there(food) and queries.under(state, food) == name)
    return sum(_amount_in(state, one, type, queries) for one in (name, *lying))


def _amount_in(state: WorldState, name: str, type: str, queries: Queries) -> float:
    content, is_a = state.matter.contents.get(name, {}).values(), queries.rules.is_a
    was_of_type = name in state.matter.types and any(is_a(one, type) for one in types_of(state, name, queries))
    return sum(portion.amount for portion in content if was_of_type or is_a(portion.type, type))


def contains(state: WorldState, name: str, type: str, queries: Queries, least: float | None = None) -> bool:
    """Check whether a thing contains a class of substances: at least some volume [ml], or any at all."""
    amount = amount_of(state, name, type, queries)
    return amount > LEAST if least is None else amount >= least - LEAST


def is_baked(state: WorldState, name: str, queries: Queries, seconds: float | None = None) -> bool:
    """Check whether both sides of a thing were heated for some time [s], by default as long as its class needs."""
    needed = min(_baking_times(state, name, queries), default=float("inf")) if seconds is None else seconds
    return min(state.matter.heated.get(name, (0.0, 0.0))) >= needed - ROUNDING


def _baking_times(state: WorldState, name: str, queries: Queries) -> Iterator[float]:
    """Yield the baking times [s] of rules whose output is the class of a thing or of its contents."""
    types = {type_of(state, name, queries), *state.matter.contents.get(name, {})}
    for rule in queries.rules.heating:
        if any(queries.rules.is_a(one, rule.output) for one in types):
            yield rule.seconds


def came_to_be(state: WorldState, type: str, queries: Queries) -> tuple[str, ...]:
    """List what was created of a class and still exists: things, and vessels that hold it."""
    is_a = queries.rules.is_a
    there = filter(state.there, state.matter.origins)
    things = [name for name in there if any(is_a(one, type) for one in types_of(state, name, queries))]
    holding = [
        name
        for name, content in state.matter.contents.items()
        if any(one.origins and is_a(one.type, type) for one in content.values())
    ]
    return tuple(dict.fromkeys((*things, *holding)))


def due(state: WorldState, names: Iterable[str], queries: Queries, type: str | None = None) -> Iterator[float]:
    """Yield the times [s] until heat makes something (of a class, if given) of things that are heated now."""
    for name in filter(state.there, names):
        if (heat := queries.heated_by(state, name)) is None:
            continue
        for one in (type_of(state, name, queries), *state.matter.contents.get(name, {})):
            result = queries.rules.result(one, type_of(state, heat[0], queries))
            if result is not None and (type is None or queries.rules.is_a(result.output, type)):
                yield max(0.0, result.seconds - max(state.matter.heated.get(name, (0.0, 0.0))))
