"""Properties of bodies beyond their geometry: contents, capacity, mass, blades, running devices, heat effects, routes.

Things that move by themselves, such as other robots, do so on the routes that the map states.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np

from executive.maps.classes import MapObject, is_kind
from executive.maps.measures import read_size
from executive.maps.semantic_map import SemanticMap
from planlang.diagnostics import BadInput, Diagnostic, Severity, warning
from planlang.effects import effects_of, heat_effects, number_of_class, number_of_individual
from planlang.geometry.areas import Block
from planlang.geometry.shapes import Size
from planlang.measures import length, lengths, stated
from planlang.ontology import Literal, Ontology, expand, shorten
from planlang.state.matter import KG_PER_ML, ON, Heating, Portion, Rules
from sim import Body
from sim.movers import Mover
from sim.scene import BodyShape

MASS = ("massOfObject", "weightOfObject")
"""Properties that state the mass of an object [kg]."""
MOST = 1e6
"""Upper bound of amounts [ml], capacities [ml] and masses [kg]; greater numbers are clamped."""
USUAL_AMOUNT = 100.0
"""Default amount of a content [ml]."""


def rules_of(ontologies: Sequence[Ontology]) -> Rules:
    """Read the effects of heat, the default sizes of new objects and the flow rate. Raises BadInput."""
    heating = (
        Heating(_short(one.inputs), shorten(one.output), _short(one.devices), one.duration)
        for ontology in ontologies
        for one in heat_effects(ontology)
    )
    flow = effects_of(ontologies[0], expand("FluidFlow-Translation"), also=ontologies[1:]).flow_rate
    is_a, size = _taxonomy(ontologies), _sizes(ontologies)
    return Rules(tuple(dict.fromkeys(heating)), is_a, size, 0.0 if flow is None else flow)


def _short(classes: Iterable[str]) -> tuple[str, ...]:
    return tuple(map(shorten, classes))


def _taxonomy(ontologies: Sequence[Ontology]) -> Callable[[str, str], bool]:
    @cache
    def is_a(cls: str, above: str) -> bool:
        return cls == above or any(is_kind(ontology, cls, above) for ontology in ontologies)

    return is_a


def _sizes(ontologies: Sequence[Ontology]) -> Callable[[str], Size | None]:
    @cache
    def size(cls: str) -> Size | None:
        sizes = (read_size(ontology, expand(cls), (expand(cls),), []) for ontology in ontologies)
        return next(filter(None, sizes), None)

    return size


def with_contents(bodies: Iterable[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> list[Body]:
    """Add contents, capacities, masses, blades and on/off states to bodies.

    Invalid numbers are ignored, with a warning in ``notes``.
    """
    portions, types, numbers = dict[str, list[Portion]](), dict[str, tuple[str, ...]](), _Numbers(semantic_map, notes)
    for thing in semantic_map.objects:
        types[thing.iri] = thing.types
        for container in thing.inside if thing.pose is None else ():
            portions.setdefault(container, []).append(_portion(thing, numbers))
    return [_with_content(body, portions.get(body.iri, ()), types.get(body.iri, ()), numbers) for body in bodies]


class _Numbers:
    """Numeric properties of objects and classes; an invalid number is None, with a warning."""

    def __init__(self, semantic_map: SemanticMap, notes: list[Diagnostic]) -> None:
        self.ontology = semantic_map.ontology
        self._notes = notes
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
            self._notes += (replace(one, severity=Severity.WARNING) for one in bad.diagnostics)
            return None
        return None if number is None else min(number, MOST)


def is_content(thing: MapObject) -> bool:
    """Check whether an object is the content of another: it is inside something and has no pose of its own."""
    return thing.pose is None and bool(thing.inside)


def _portion(thing: MapObject, numbers: _Numbers) -> Portion:
    amount = numbers.of_thing(thing.iri, "amount")
    if amount is None:
        amount = numbers.of_classes(thing.types, "amount")
    return Portion(shorten(thing.types[0]), USUAL_AMOUNT if amount is None else amount, (thing.name,))


def _with_content(body: Body, portions: Sequence[Portion], types: tuple[str, ...], numbers: _Numbers) -> Body:
    ontology = numbers.ontology
    capacity = numbers.of_thing(body.iri, "capacity")
    if capacity is None:
        capacity = numbers.of_classes(types, "capacity")
    blade = numbers.of_classes(types, "bladeLength") or 0.0
    if not body.movable:
        drop = numbers.of_thing(body.iri, "largestDrop")
        body = replace(body, largest_drop=(numbers.of_classes(types, "largestDrop") or 0.0) if drop is None else drop)
    if body.movable and (tilt := numbers.of_classes(types, "largestTilt")) is not None:
        body = replace(body, largest_tilt=math.radians(tilt))
    if body.movable and (hands := numbers.of_classes(types, "handsNeeded")) is not None:
        body = replace(body, hands=max(1, round(hands)))
    if body.movable:
        # without what the map states to be in it [kg]: of the object, else of its class; 0 if unknown
        masses = (numbers.of_thing(body.iri, name) for name in MASS)
        mass = next((mass for mass in masses if mass is not None), None)
        body = replace(body, mass=(numbers.of_classes(types, "massOfObject") or 0.0) if mass is None else mass)
    mark, colour = (_text(ontology, body.iri, name) for name in ("markOfObject", "colourOfObject"))
    if mark is not None or colour is not None:
        body = replace(body, mark=mark, colour=colour)
    states = [shorten(one) for one in ontology.iris(body.iri, "stateOfObject")]
    if not (capacity or blade or states or portions):
        return body
    if capacity and not portions and ontology.any_is_a(types, ("FoodOrDrinkOrIngredient",)):
        amount = numbers.of_thing(body.iri, "amount")
        portions = (Portion(body.type, capacity if amount is None else amount, (body.name,)),)
        body = replace(body, mass=max(0.0, body.mass - portions[0].amount * KG_PER_ML))  # it is its own content
    room = max(capacity or 0.0, sum(portion.amount for portion in portions))
    return replace(body, content=tuple(portions), capacity=room, is_on=ON in states, blade=min(blade, max(body.size)))


def _text(ontology: Ontology, iri: str, name: str) -> str | None:
    """Read a text that an object states; None for an empty one, or without any."""
    values = (one.value.strip() for one in ontology.values(iri, expand(name)) if isinstance(one, Literal))
    return next(filter(None, values), None)


SPEED = 0.3
"""Speed of a robot of which the map states none [m/s]."""
BETWEEN = 0.05
"""Spacing of places on a route that are compared with the bodies beside it [m]."""
LONGEST = 1000.0
"""Length of a route beyond which a number in it is surely wrong [m]; places on routes are compared one by one."""


def movers_of(bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> Iterator[Mover]:
    """Yield what moves by itself: bodies with ``routePoints``, the points on the floor that they drive to, "x y x y".

    They begin where the map has them, and come back the same way. ``drivingSpeed`` is in metres per second.
    """
    ontology = semantic_map.ontology
    for body in bodies:
        triple = stated(ontology, body.iri, "routePoints")
        numbers = None if triple is None else lengths(triple, notes)
        if triple is None or numbers is None:
            continue
        points = (body.pose.position[:2], *zip(numbers[::2], numbers[1::2], strict=False))
        route = [points[0], *(point for before, point in pairwise(points) if math.dist(before, point) > 0)]
        if len(numbers) % 2 or len(route) < 2 or body.shape not in (BodyShape.BOX, BodyShape.CYLINDER):
            message = f"{body.name} does not move: a route is points on the floor, x and y of each, for a solid body"
            notes.append(warning("M002", message, triple.span))
            continue
        said = stated(ontology, body.iri, "drivingSpeed")
        speed = None if said is None else length(said, notes)
        mover = Mover(body.name, tuple(route), speed if speed is not None and speed > 0 else SPEED)
        if mover.length > LONGEST:
            message = f"{body.name} does not move: its route is {mover.length:.0f} m long, at most {LONGEST:.0f} m"
            notes.append(warning("M002", message, triple.span))
            continue
        if names := list(_driven_through(mover, body, bodies)):
            message = f"{body.name} drives through {', '.join(names)} on its route"
            radius = min(body.size[:2]) / 2
            advice = (
                f"state points with a way of {radius:.2f} m on both sides of each straight line, or move what is there"
            )
            notes.append(warning("M037", message, triple.span, advice))
        yield mover


def _driven_through(mover: Mover, body: Body, bodies: Iterable[Body]) -> Iterator[str]:
    """Yield the names of solid bodies that a mover certainly touches somewhere on its route, if nothing moves them."""
    own = Block.of(body.pose, body.size)
    places = np.array([mover.pose_at(gone, 0.0).position[:2] for gone in np.arange(0.0, mover.length, BETWEEN)])
    for other in bodies:
        if other is body or other.movable or other.shape in (BodyShape.ROOM, BodyShape.PERSON):
            continue
        block = Block.of(other.pose, other.size, cylinder=other.shape is BodyShape.CYLINDER)
        is_beside = block.low < own.high and own.low < block.high
        if is_beside and float(block.distance(places).min()) < min(own.half_x, own.half_y) - BETWEEN / 2:
            yield other.name
