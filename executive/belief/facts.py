"""Conditions about the effects of actions, decided in the believed world."""

from __future__ import annotations

from collections.abc import Iterator

from executive.belief.belief import Belief
from executive.maps.classes import MapObject
from planlang.designators import Condition, Object
from planlang.failures import ObjectUnresolvable
from sim import PlanningWorld
from sim.changes import amount_of, came_to_be, is_baked, origins_of

LEAST = 1e-6
"""Tolerance of amounts [ml]: less than this counts as nothing."""


def decide(condition: Condition, belief: Belief, world: PlanningWorld) -> bool | None:
    """Decide a condition about contents, baking, devices, creation or destruction; None for other predicates."""
    changes = world.changes
    match condition:
        case Condition("contains", (Object() as what, Object() as substance)):
            return _amount(belief, world, what, substance) > LEAST
        case Condition("contains", (Object() as what, Object() as substance, int() | float() as least)):
            return _amount(belief, world, what, substance) >= least - LEAST
        case Condition("baked", (Object() as what,)):
            return any(is_baked(changes, name) for name in _candidates(belief, world, what))
        case Condition("baked", (Object() as what, int() | float() as seconds)):
            return any(is_baked(changes, name, seconds) for name in _candidates(belief, world, what))
        case Condition("switched_on", (Object() as what,)):
            name = belief.bind(what, world.configuration().base)
            return belief.witnessed(name) and changes.matter.is_on(name)
        case Condition("destroyed", (Object() as what,)):
            return any(thing.name in changes.matter.gone for thing in _named(belief, what))
        case Condition("created", (Object() as what,)):
            if what.iri is None:
                return bool(came_to_be(changes, what.type))
            made = belief.memory.made.values()
            return any(thing.iri == what.iri and thing.name in belief.names() for thing in made)
        case Condition("transformed_into", (Object() as source, Object() as result)):
            names = {thing.name for thing in _named(belief, source)}
            into = _candidates(belief, world, result)
            return any(not names.isdisjoint(origins_of(changes, name)) for name in into)
    return None


def _amount(belief: Belief, world: PlanningWorld, what: Object, substance: Object) -> float:
    return amount_of(world.changes, belief.bind(what, world.configuration().base), substance.type)


def _named(belief: Belief, what: Object) -> Iterator[MapObject]:
    """Yield the objects that match a designator, including destroyed ones."""
    exact = [thing for thing in belief.things if what.iri is not None and thing.iri == what.iri]
    yield from exact or (thing for thing in belief.things if belief.is_a(thing, what.type))


def _candidates(belief: Belief, world: PlanningWorld, what: Object) -> list[str]:
    """List the existing objects that match a designator, or else the one that contains such a substance."""
    existing = [thing.name for thing in _named(belief, what) if thing.name in belief.names()]
    try:
        bound = belief.bind(what, world.configuration().base)
    except ObjectUnresolvable:
        return existing
    return existing or [bound]
