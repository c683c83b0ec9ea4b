"""The buttons and knobs by which devices are turned on and off: those of a map, else where a device would have one.

A device without one is taken to have a button in the middle of its front, near the upper edge; one that is so low that
no hand comes to its front has it on top, near the front edge. Its front is where the x axis of its box points. Tools
for the hand have none (``presumedButtons``), though KnowRob calls knives and scissors powered.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from executive.maps.articulation import DEVICES
from executive.maps.semantic_map import MapObject, SemanticMap
from planlang.effects import number_of_class
from planlang.geometry.matrices import rotated
from sim import Body
from sim.controls import Control
from sim.joints import Articulation
from sim.scene import BodyShape

CONTROLS = ("PushButton", "ControlKnob")
"""Classes of parts by which they are."""
LOW = 0.15
"""Height below which the front of a device is too low for a hand [m]."""
FROM_EDGE = 0.03
"""Distance of a button that no map has from the edge [m]."""


def controls_of(
    bodies: Iterable[Body], joints: Iterable[Articulation], semantic_map: SemanticMap
) -> tuple[Control, ...]:
    """Return the controls of all devices, in the order of the map; of several the first is that of a device."""
    by_iri = {body.iri: body for body in bodies if body.shape in (BodyShape.BOX, BodyShape.CYLINDER)}
    leaves = {joint.leaf for joint in joints}
    moving = {name for joint in joints for name in joint.parts}
    found: dict[str, list[Control]] = {
        thing.iri: [] for thing in semantic_map.objects if thing.iri in by_iri and semantic_map.is_a(thing, *DEVICES)
    }
    for thing in semantic_map.objects:
        body = by_iri.get(thing.iri)
        if body is None or body.name in moving or not semantic_map.is_a(thing, *CONTROLS):
            continue
        device = next((one.iri for one in _around(thing, semantic_map) if one.iri in found), None)
        if device is not None:
            found[device].append(_on(by_iri[device], body, turns=body.name in leaves))
    for thing in semantic_map.objects:
        if thing.iri not in found or found[thing.iri]:
            continue
        if number_of_class(semantic_map.ontology, thing.types, "presumedButtons") != 0:
            found[thing.iri].append(_derived(by_iri[thing.iri]))
    return tuple(one for controls in found.values() for one in controls)


def _on(device: Body, body: Body, *, turns: bool) -> Control:
    """Return a button or knob: it shows away from its device, along its shortest extent."""
    axis = int(np.argmin(body.size))
    away = rotated(body.pose.rotation.T, np.array(body.pose.position) - device.pose.position)
    normal, point = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    normal[axis] = 1.0 if away[axis] >= 0 else -1.0
    point[axis] = normal[axis] * body.size[axis] / 2
    return Control(device.name, body.name, (point[0], point[1], point[2]), (normal[0], normal[1], normal[2]), turns)


def _derived(device: Body) -> Control:
    depth, _, height = device.size
    if height < LOW:
        return Control(device.name, device.name, (depth / 2 - FROM_EDGE, 0.0, height / 2), (0.0, 0.0, 1.0))
    return Control(device.name, device.name, (depth / 2, 0.0, height / 2 - FROM_EDGE), (1.0, 0.0, 0.0))


def _around(thing: MapObject, semantic_map: SemanticMap) -> Iterator[MapObject]:
    """Yield what a thing is a part of, and what that is a part of."""
    seen = {thing.iri}
    while (holder := semantic_map.holder(thing)) is not None and holder.iri not in seen:
        seen.add(holder.iri)
        yield holder
        thing = holder
