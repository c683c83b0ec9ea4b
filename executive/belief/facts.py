"""Conditions about the effects of actions, decided in the believed world."""

from __future__ import annotations

from collections.abc import Iterator

from executive.belief.belief import Belief
from executive.belief.memory import BasePose
from executive.maps.classes import MapObject
from planlang.designators import Condition, Object
from planlang.failures import ObjectUnresolvable
from planlang.state import Queries
from planlang.state.questions import came_to_be, contains, is_baked


def decide(condition: Condition, belief: Belief, queries: Queries) -> bool | None:
    """Decide a condition about contents, baking, devices, creation or destruction; None for other predicates."""
    state = belief.state
    match condition:
        case Condition("contains", (Object() as what, Object() as substance)):
            return contains(state, belief.bind(what, _here(belief)), substance.type, queries)
        case Condition("contains", (Object() as what, Object() as substance, int() | float() as least)):
            return contains(state, belief.bind(what, _here(belief)), substance.type, queries, least)
        case Condition("baked", (Object() as what,)):
            return any(is_baked(state, name, queries) for name in _candidates(belief, what))
        case Condition("baked", (Object() as what, int() | float() as seconds)):
            return any(is_baked(state, name, queries, seconds) for name in _candidates(belief, what))
        case Condition("switched_on", (Object() as what,)):
            name = belief.bind(what, _here(belief))
            return belief.witnessed(name) and state.matter.is_on(name)
        case Condition("destroyed", (Object() as what,)):
            return any(thing.name in state.matter.gone for thing in _named(belief, what))
        case Condition("created", (Object() as what,)):
            if what.iri is None:
                return bool(came_to_be(state, what.type, queries))
            made = belief.memory.made.values()
            return any(thing.iri == what.iri and thing.name in belief.names() for thing in made)
        case Condition("transformed_into", (Object() as source, Object() as result)):
            names = {thing.name for thing in _named(belief, source)}
            return any(not names.isdisjoint(state.matter.went_into(name)) for name in _candidates(belief, result))
    return None


def _here(belief: Belief) -> BasePose:
    return belief.state.robots[belief.robot].base


def _named(belief: Belief, what: Object) -> Iterator[MapObject]:
    """Yield the objects that match a designator, including destroyed ones."""
    exact = [thing for thing in belief.things if what.iri is not None and thing.iri == what.iri]
    yield from exact or (thing for thing in belief.things if belief.is_a(thing, what.type))


def _candidates(belief: Belief, what: Object) -> list[str]:
    """List the existing objects that match a designator, or else the one that contains such a substance."""
    existing = [thing.name for thing in _named(belief, what) if thing.name in belief.names()]
    try:
        bound = belief.bind(what, _here(belief))
    except ObjectUnresolvable:
        return existing
    return existing or [bound]
