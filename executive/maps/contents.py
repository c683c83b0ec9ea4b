"""Contents, devices that are on, vessels and blades of a map, and the effects of heat in its ontology."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cache

from executive.maps.class_names import is_kind
from executive.maps.measures import read_size
from executive.maps.semantic_map import MapObject, SemanticMap
from planlang.diagnostics import BadInput, Diagnostic, Severity
from planlang.effects import effects_of, heat_effects, number_of_class, number_of_individual
from planlang.ontology import Ontology, expand, shorten
from sim import Body
from sim.matter import ON, Heating, Portion, Rules, Size

MASS = ("massOfObject", "weightOfObject")
"""Properties of a thing of a map with its mass [kg]."""
MOST = 1e6
"""Greatest amount [ml], capacity [ml] and mass [kg]; more is taken as this much."""
USUAL_AMOUNT = 100.0
"""Amount of a content of which nothing says how much it is [ml]."""


def rules_of(ontology: Ontology) -> Rules:
    """Return what heat does, and of which sizes things are that come into being; raises BadInput."""
    heating = tuple(
        Heating(_short(one.inputs), shorten(one.output), _short(one.devices), one.duration)
        for one in heat_effects(ontology)
    )
    flow = effects_of(ontology, expand("FluidFlow-Translation")).flow_rate
    return Rules(heating, _taxonomy(ontology), _sizes(ontology), 0.0 if flow is None else flow)


def _short(classes: Iterable[str]) -> tuple[str, ...]:
    return tuple(map(shorten, classes))


def _taxonomy(ontology: Ontology) -> Callable[[str, str], bool]:
    @cache
    def is_a(cls: str, above: str) -> bool:
        return cls == above or is_kind(ontology, cls, above)

    return is_a


def _sizes(ontology: Ontology) -> Callable[[str], Size | None]:
    @cache
    def size(cls: str) -> Size | None:
        return read_size(ontology, expand(cls), (expand(cls),), [])

    return size


def with_contents(bodies: Iterable[Body], semantic_map: SemanticMap, found: list[Diagnostic]) -> list[Body]:
    """Return bodies with what they hold, whether they are on, and what they are as vessels and tools.

    A number that is none is left out, with a warning in ``found``.
    """
    held, types, numbers = dict[str, list[Portion]](), dict[str, tuple[str, ...]](), _Numbers(semantic_map, found)
    for thing in semantic_map.objects:
        types[thing.iri] = thing.types
        for container in thing.inside if thing.pose is None else ():
            held.setdefault(container, []).append(_portion(thing, numbers))
    return [_with_content(body, held.get(body.iri, ()), types.get(body.iri, ()), numbers) for body in bodies]


class _Numbers:
    """Numbers of things and classes; what is none is left out, with a warning."""

    def __init__(self, semantic_map: SemanticMap, found: list[Diagnostic]) -> None:
        self.ontology = semantic_map.ontology
        self._found = found
        self._known: dict[tuple[tuple[str, ...], str], float | None] = {}

    def of_thing(self, iri: str, name: str) -> float | None:
        return self._read(lambda: number_of_individual(self.ontology, iri, name))

    def of_classes(self, types: tuple[str, ...], name: str) -> float | None:
        if (types, name) not in self._known:
            self._known[types, name] = self._read(lambda: number_of_class(self.ontology, types, name))
        return self._known[types, name]

    def _read(self, read: Callable[[], float | None]) -> float | None:
        try:
            number = read()
        except BadInput as bad:
            self._found += (replace(one, severity=Severity.WARNING) for one in bad.diagnostics)
            return None
        return None if number is None else min(number, MOST)


def is_content(thing: MapObject) -> bool:
    """Return whether a thing of a map is what another one holds: it is in something and has no place of its own."""
    return thing.pose is None and bool(thing.inside)


def _portion(thing: MapObject, numbers: _Numbers) -> Portion:
    amount = numbers.of_thing(thing.iri, "amount")
    if amount is None:
        amount = numbers.of_classes(thing.types, "amount")
    return Portion(shorten(thing.types[0]), USUAL_AMOUNT if amount is None else amount, (thing.name,))


def _mass(body: Body, portions: Sequence[Portion], types: tuple[str, ...], numbers: _Numbers) -> float:
    """Return the mass of a body [kg]: as the map says, else of its class with what it contains, a gram a millilitre."""
    stated = (numbers.of_thing(body.iri, name) for name in MASS)
    found = next((mass for mass in stated if mass is not None), None)
    empty = numbers.of_classes(types, "massOfObject")
    return found if found is not None else 0.0 if empty is None else empty + sum(one.amount for one in portions) / 1000


def _with_content(body: Body, portions: Sequence[Portion], types: tuple[str, ...], numbers: _Numbers) -> Body:
    ontology = numbers.ontology
    capacity = numbers.of_thing(body.iri, "capacity")
    if capacity is None:
        capacity = numbers.of_classes(types, "capacity")
    blade = numbers.of_classes(types, "bladeLength") or 0.0
    if body.movable and (tilt := numbers.of_classes(types, "largestTilt")) is not None:
        body = replace(body, largest_tilt=math.radians(tilt))
    if body.movable and (hands := numbers.of_classes(types, "handsNeeded")) is not None:
        body = replace(body, hands=max(1, round(hands)))
    if body.movable:
        body = replace(body, mass=_mass(body, portions, types, numbers))
    states = [shorten(one) for one in ontology.iris(body.iri, "stateOfObject")]
    if not (capacity or blade or states or portions):
        return body
    if capacity and not portions and ontology.any_is_a(types, ("FoodOrDrinkOrIngredient",)):
        amount = numbers.of_thing(body.iri, "amount")
        portions = (Portion(body.type, capacity if amount is None else amount, (body.name,)),)
    room = max(capacity or 0.0, sum(portion.amount for portion in portions))
    return replace(body, content=tuple(portions), capacity=room, is_on=ON in states, blade=min(blade, max(body.size)))
