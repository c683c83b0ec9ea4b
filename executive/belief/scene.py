"""The world of a map: every thing with a place becomes a body of the simulator."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from executive.belief.semantic_map import MapObject, SemanticMap
from executive.belief.support import PENETRATION, footprint, holds, support_of
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Pose
from planlang.geometry.box import corners
from planlang.ontology import expand, shorten
from sim import Body, Scene
from sim.scene import GRASPABLE_WIDTH, BodyShape

ROUND = ("DrinkingVessel", "Bottle", "Vase", "Can", "Jar-Container", "DrinkingCan", "CookingVessel")
"""Classes of things that are cylinders about their z axis."""

LIGHT_FURNITURE = ("Table-PieceOfFurniture", "Chair-PieceOfFurniture", "SideTable", "Stool")
"""Classes of furniture that people push around."""

FIXED = (
    "FurniturePiece",
    "Box-Container",
    "StorageConstruct",
    "ConstructionArtifact",
    "FixedStructure",
    "PhysicalPartOfObject",
    "DoorwayCovering",
    "Appliance",
    "HouseholdAppliance",
    "Place",
    "SpaceRegion",
)
"""Classes of things that stay where the map says, light furniture left out."""

CONTAINERS = ("StorageConstruct", "Box-Container", "Container", "Refrigerator", "Dishwasher", "Oven", "Shelf")
"""Classes of things inside of which others may lie: as a part of something larger, such a thing is a compartment."""

LONGEST = 0.6
"""What is longer than this is nothing a hand takes [m]."""

MARGIN = 1.5
"""How far around all things a robot may drive where the map has no room [m]."""


def scene_of(semantic_map: SemanticMap, found: list[Diagnostic] | None = None) -> Scene:
    """The bodies of a map, in its order; what was decided on the way is appended to ``found``.

    Poses are box centres, the floor is z = 0. Bottles, cups and the like are cylinders, persons are persons, a room
    with a size is its walls; things without size are markers. Things without place are left out.
    """
    found = [] if found is None else found
    bodies = []
    for thing in semantic_map.objects:
        if thing.pose is not None:
            bodies.append(_body(thing, thing.pose, semantic_map))
        elif thing.size is not None:
            found.append(note("M012", f"{thing.name} has a size but no place: not in the world", thing.span))
    scene = Scene(tuple(_opened(bodies, semantic_map, found)), _bounds(bodies))
    _check_support(scene, semantic_map, found)
    return scene


def _body(thing: MapObject, pose: Pose, semantic_map: SemanticMap) -> Body:
    shape = _shape(thing, semantic_map)
    cls = next((cls for cls in thing.types if not cls.endswith("#NamedIndividual")), "")
    movable = shape in (BodyShape.BOX, BodyShape.CYLINDER) and _movable(thing, semantic_map)
    size = thing.size or (0.0, 0.0, 0.0)
    return Body(thing.name, pose, size, shape, thing.iri, shorten(cls), movable)


def _is_a(thing: MapObject, semantic_map: SemanticMap, classes: Iterable[str]) -> bool:
    return any(semantic_map.ontology.is_a(cls, expand(name)) for cls in thing.types for name in classes)


def _shape(thing: MapObject, semantic_map: SemanticMap) -> BodyShape:
    if thing.size is None:
        return BodyShape.MARKER
    if _is_a(thing, semantic_map, ("RoomInAConstruction",)):
        return BodyShape.ROOM
    if _is_a(thing, semantic_map, ("Person",)):
        return BodyShape.PERSON
    if _is_a(thing, semantic_map, ROUND) and 0.8 < thing.size[0] / thing.size[1] < 1.25:
        return BodyShape.CYLINDER
    return BodyShape.BOX


def _movable(thing: MapObject, semantic_map: SemanticMap) -> bool:
    if thing.size is None or thing.hinged_to or semantic_map.holder(thing):
        return False
    if _is_a(thing, semantic_map, LIGHT_FURNITURE):
        return True
    if _is_a(thing, semantic_map, FIXED):
        return False
    return min(thing.size[:2]) <= GRASPABLE_WIDTH and max(thing.size) <= LONGEST


def _opened(bodies: list[Body], semantic_map: SemanticMap, found: list[Diagnostic]) -> list[Body]:
    """Containers in which movable things lie: a compartment becomes a place, others stay solid and are reported."""
    opened = []
    for body in bodies:
        thing = semantic_map.find(body.iri)
        inside = [other.name for other in bodies if other.movable and other.name != body.name and holds(body, other)]
        if thing is None or body.shape is not BodyShape.BOX or body.movable or not inside:
            opened.append(body)
            continue
        holder = semantic_map.holder(thing)
        if holder is not None and _is_a(thing, semantic_map, CONTAINERS):
            found.append(note("M013", f"{body.name} is a compartment of {holder.name}: a place, not a box", thing.span))
            opened.append(Body(body.name, body.pose, body.size, BodyShape.MARKER, body.iri, body.type))
            continue
        message = f"{', '.join(inside)} inside {body.name}, which is modelled as a solid box: out of reach"
        found.append(warning("M014", message, thing.span, f"place it on {body.name}, or leave {body.name} out"))
        opened.append(body)
    return opened


def _check_support(scene: Scene, semantic_map: SemanticMap, found: list[Diagnostic]) -> None:
    """Things that stand nowhere are reported: the simulator keeps them in the air, but it is rarely meant."""
    for body in scene.bodies:
        thing = semantic_map.find(body.iri)
        if not body.movable or thing is None or any(holds(b, body) for b in scene.bodies if b.shape is BodyShape.BOX):
            continue
        if support_of(scene, body.name) is None:
            low = float(corners(body.pose, body.size)[:, 2].min())
            message = f"{body.name} stands on nothing: its lowest point is {low:.3f} m over the floor"
            help = f"objects may sink into what they stand on by at most {PENETRATION} m"
            found.append(warning("M015", message, thing.span, help))


def _bounds(bodies: Iterable[Body]) -> tuple[float, float, float, float]:
    """Rectangle around the rooms, or around everything with a margin."""
    bodies = tuple(bodies)
    rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
    points = [footprint(body) for body in (rooms or [b for b in bodies if b.shape is not BodyShape.MARKER] or bodies)]
    if not points:
        return (-5.0, -5.0, 5.0, 5.0)
    margin = 0.0 if rooms else MARGIN
    low, high = np.vstack(points).min(axis=0) - margin, np.vstack(points).max(axis=0) + margin
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
