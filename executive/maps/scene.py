"""The scene of a map: bodies, supports, controls of devices, and start poses for a robot."""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from executive.maps.articulation import DEVICES, articulated
from executive.maps.classes import MapObject
from executive.maps.contents import is_content, movers_of, rules_of, with_contents
from executive.maps.doorways import with_doorways
from executive.maps.hollow import WALL, hollowed, open_at
from executive.maps.in_hand import STOWED, is_in_hand
from executive.maps.measures import stated_size
from executive.maps.object_models import Blade
from executive.maps.semantic_map import OPENINGS, SemanticMap
from executive.maps.supports import GAP, Standing, on_floors
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note, settled, unread, warning
from planlang.effects import number_of_class
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import corners, footprint
from planlang.ontology import shorten
from sim import Body, Scene
from sim.joints import Articulation, Control
from sim.scene import GRASPABLE_WIDTH, LONGEST, THIN, BodyShape, Cavity, Handle

ROUND = (
    "DrinkingVessel",
    "Bottle",
    "Vase",
    "Can",
    "Jar-Container",
    "DrinkingCan",
    "CookingVessel",
    "EatingVessel",
    "Bowl-Generic",
)
"""Classes of objects modelled as cylinders about their z axis."""

SOFT = ("TableCovering", "Napkin", "PaperTowel")
"""Classes of cloth and paper: fingers pinch a fold from above."""

LIGHT_FURNITURE = ("Table-PieceOfFurniture", "Chair-PieceOfFurniture", "SideTable", "Stool")
"""Classes of furniture that people push around, unless it has drawers or other parts."""

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
"""Classes of immovable objects, except for :data:`LIGHT_FURNITURE` and :data:`CARRIED`."""

CARRIED = ("PackagingContainerProduct",)
"""Classes of portable objects that are subclasses of :data:`FIXED` ones."""

CONTAINERS = ("StorageConstruct", "Box-Container", "Container", "Refrigerator", "Dishwasher", "Oven", "Shelf")
"""Classes of objects that may contain others: as a part of furniture, such an object is a compartment."""

NAMED = "#NamedIndividual"
"""Suffix of owl:NamedIndividual, the class of all individuals."""

ROOMY, STOREY = 1.5, 1.9
"""Least width and height at which an object of unknown class with others inside is presumed to be a room [m]."""

MARGIN = 1.5
"""Margin around all bodies in which a robot may drive if the map has no room [m]."""


def scene_of(semantic_map: SemanticMap, notes: list[Diagnostic] | None = None) -> Scene:
    """Build the scene of a map, with bodies in the order of the map; assumptions are appended to ``notes``.

    Poses are box centres, the floor is z = 0. Bottles, cups and the like are cylinders, a room with a size becomes its
    walls, and objects without a size are markers. Objects without a pose are left out. Furniture is hollow behind its
    doors, at its compartments and in its drawers. Leaves are closed unless the map states a joint position. Raises
    BadInput if something with a shape or a pose cannot be read, and the map does not ignore that.
    """
    found: list[Diagnostic] = []
    scene = _built(semantic_map, found)
    found = settled(found, ignore_unread=semantic_map.ignores_unread)
    if notes is not None:
        notes += found
    return scene


def _built(semantic_map: SemanticMap, notes: list[Diagnostic]) -> Scene:
    bodies = []
    handles = {iri for thing in semantic_map.objects for iri, _ in _handles(thing, semantic_map)}
    rooms = set(_presumed_rooms(semantic_map, notes))
    for thing in semantic_map.objects:
        if thing.iri in handles:
            continue  # a handle belongs to the body that it moves with
        if is_in_hand(thing, semantic_map) and thing.size is not None:
            bodies.append(_body(thing, STOWED, semantic_map))
        elif thing.pose is not None:
            bodies.append(_body(thing, thing.pose, semantic_map))
        elif thing.size is not None and not is_content(thing):
            message = f"{thing.name} has a size but no pose: it is not in the world"
            is_lost = _is_in_map(thing, semantic_map) and any(stated_size(semantic_map.ontology, thing.iri, []))
            notes.append((unread if is_lost else note)("M012", message, thing.span))
    bodies = [replace(body, shape=BodyShape.ROOM, movable=False) if body.iri in rooms else body for body in bodies]
    bodies, joints = articulated(bodies, semantic_map, notes)
    bodies = _opened(bodies, joints, semantic_map, notes)
    bodies = on_floors(bodies, lambda vessel, things: notes.append(_inside_of(vessel, things, semantic_map)))
    bodies = with_contents(bodies, semantic_map, notes)
    if sum(body.shape is BodyShape.ROOM for body in bodies) > 1 or any(joint.frame for joint in joints):
        bodies = with_doorways(bodies, semantic_map, notes, joints)
    if semantic_map.has_files:
        from executive.maps.occupied_space import with_obstacles  # imported late: few maps refer to files

        bodies = with_obstacles(bodies, semantic_map, notes)
    controls = controls_of(bodies, joints, semantic_map)
    rules = rules_of(semantic_map.declaring)
    movers = tuple(movers_of(bodies, semantic_map, notes))
    scene = Scene(tuple(bodies), _bounds(bodies), joints=joints, controls=controls, movers=movers, rules=rules)
    _check_support(scene, semantic_map, notes)
    return scene


def _is_in_map(thing: MapObject, semantic_map: SemanticMap) -> bool:
    """Check whether a map states that an object is in it, or is part of one that is: object models lie nowhere."""
    holder = semantic_map.holder(thing)
    is_part = holder is not None and holder.pose is not None
    return is_part or bool(semantic_map.ontology.iris(thing.iri, "describedInMap"))


def _presumed_rooms(semantic_map: SemanticMap, notes: list[Diagnostic]) -> Iterator[str]:
    """Yield the IRIs of objects of unknown class that are as large as rooms and contain others, with a note for each.

    As solid boxes they would make everything inside unreachable.
    """
    for thing in semantic_map.objects:
        classes = [cls for cls in thing.types if not cls.endswith(NAMED)]
        if thing.size is None or thing.pose is None or any(map(semantic_map.ontology.defined, classes)):
            continue
        if min(thing.size[:2]) < ROOMY or thing.size[2] < STOREY:
            continue
        others = [one.pose.position for one in semantic_map.objects if one.pose is not None and one is not thing]
        local = moved(thing.pose.inverse().matrix(), np.array(others).reshape(-1, 3))
        if (np.abs(local) < np.array(thing.size) / 2).all(axis=1).any():
            cls = local_name(classes[0]) if classes else "RoomOfMine"
            message = f"{thing.name} is presumed to be a room, as it contains other objects"
            help = f"define its class in the map: Class: {cls} SubClassOf: RoomInAConstruction"
            notes.append(note("M031", message, thing.span, help))
            yield thing.iri


def _body(thing: MapObject, pose: Pose, semantic_map: SemanticMap) -> Body:
    shape = _shape(thing, semantic_map)
    cls = next((cls for cls in thing.types if not cls.endswith(NAMED)), "")
    size, soft = thing.size or (0.0, 0.0, 0.0), semantic_map.is_a(thing, *SOFT)
    wall = number_of_class(semantic_map.ontology, thing.types, "wallThickness") or 0.0
    wall = wall if 4 * wall < min(size[:2]) and 2 * wall < size[2] else 0.0
    is_solid = shape in (BodyShape.BOX, BodyShape.CYLINDER)
    handles = tuple(_handles(thing, semantic_map))
    movable = is_solid and _movable(thing, semantic_map, math.inf if soft or wall > 0 or handles else GRASPABLE_WIDTH)
    blade = Blade.of(semantic_map.ontology, thing.iri) if thing.parts else None
    size, centre = (size, (0.0, 0.0, 0.0)) if blade is None else blade.box(size)
    wall *= movable
    body = Body(thing.name, pose, size, shape, thing.iri, shorten(cls), movable, centre=centre, wall=wall, soft=soft)
    ancestors = (above for one in thing.types for above in semantic_map.ontology.ancestors(one))
    kinds = tuple(dict.fromkeys(map(local_name, ancestors)))
    return replace(body, handles=tuple(handle for _, handle in handles), kinds=kinds)


def _handles(thing: MapObject, semantic_map: SemanticMap) -> Iterator[tuple[str, Handle]]:
    """Yield the handles of a movable object, with their IRIs; those of furniture and leaves are separate bodies."""
    if not thing.parts or thing.pose is None or semantic_map.is_a(thing, *LIGHT_FURNITURE):
        return
    if _movable(thing, semantic_map, math.inf) and _shape(thing, semantic_map) in (BodyShape.BOX, BodyShape.CYLINDER):
        for part in filter(None, map(semantic_map.find, thing.parts)):
            if part.pose is not None and part.size is not None and semantic_map.is_a(part, "Handle"):
                yield part.iri, Handle(thing.pose.inverse() @ part.pose, part.size)


def _shape(thing: MapObject, semantic_map: SemanticMap) -> BodyShape:
    if thing.size is None or semantic_map.is_a(thing, *OPENINGS):
        return BodyShape.MARKER
    if semantic_map.is_a(thing, "RoomInAConstruction"):
        return BodyShape.ROOM
    if semantic_map.is_a(thing, "Person"):
        return BodyShape.PERSON
    if semantic_map.is_a(thing, *ROUND) and 0.8 < thing.size[0] / thing.size[1] < 1.25:
        return BodyShape.CYLINDER
    return BodyShape.BOX


def _movable(thing: MapObject, semantic_map: SemanticMap, widest: float) -> bool:
    """Check whether an object is movable: if it is not thin, it can be grasped up to a width [m]."""
    if thing.size is None or thing.hinged_to or semantic_map.holder(thing):
        return False
    if semantic_map.is_a(thing, *LIGHT_FURNITURE):
        return not semantic_map.has_leaves(thing)  # they would stay behind, or count as around it
    if semantic_map.is_a(thing, *FIXED) and not semantic_map.is_a(thing, *CARRIED):
        return False
    return (min(thing.size[:2]) <= widest or thing.size[2] <= THIN) and max(thing.size) <= LONGEST


def is_too_wide(body: Body, semantic_map: SemanticMap) -> bool:
    """Check whether only its width keeps hands from taking a body: a thing of a size to carry, no furniture."""
    if body.graspable or (thing := semantic_map.find(body.iri)) is None or semantic_map.is_a(thing, *LIGHT_FURNITURE):
        return False
    return body.shape in (BodyShape.BOX, BodyShape.CYLINDER) and _movable(thing, semantic_map, math.inf)


def _opened(
    bodies: list[Body], joints: Sequence[Articulation], semantic_map: SemanticMap, notes: list[Diagnostic]
) -> list[Body]:
    """Make furniture hollow, with a diagnostic about each piece that contains movable objects."""
    by_iri = {body.iri: body for body in bodies}

    def stated(body: Body) -> Sequence[Cavity]:
        thing = semantic_map.find(body.iri)
        return () if thing is None else open_at(body.size, thing.open_sides, thing.boards, thing.walls or WALL)

    def compartments(body: Body) -> list[Body]:
        thing = semantic_map.find(body.iri)
        parts = (semantic_map.find(iri) for iri in (() if thing is None else thing.parts))
        containers = (part for part in parts if part is not None and semantic_map.is_a(part, *CONTAINERS))
        return [by_iri[part.iri] for part in containers if part.iri in by_iri]

    @cache
    def all_compartments() -> frozenset[str]:
        return frozenset(part.name for body in bodies for part in compartments(body))

    def report(body: Body, content: Sequence[Body], openings: Sequence[str]) -> None:
        thing, names = semantic_map.find(body.iri), ", ".join(one.name for one in content)
        span = None if thing is None else thing.span
        if openings:
            others = [one for one in openings if one != body.name]
            message = f"{names} inside {body.name}, which is hollow{' at ' if others else ''}{', '.join(others)}"
            notes.append(note("M013", message, span))
        elif body.name not in all_compartments():
            message = f"{names} inside {body.name}, which is modelled as a solid box: out of reach"
            help = f"place it on {body.name}, or state a door, a compartment or an openSide of {body.name}"
            notes.append(warning("M014", message, span, help))

    return hollowed(bodies, joints, stated, compartments, report)


def _inside_of(vessel: Body, things: Sequence[Body], semantic_map: SemanticMap) -> Diagnostic:
    """Write the note about things on the floor of a hollow body, lower than the map states."""
    stated, names = semantic_map.find(vessel.iri), ", ".join(one.name for one in things)
    message = f"{names} inside {vessel.name}, which is hollow: on its floor, not at the height of its rim"
    return note("M013", message, None if stated is None else stated.span)


def _check_support(scene: Scene, semantic_map: SemanticMap, notes: list[Diagnostic]) -> None:
    """Warn of objects that stand on nothing: the simulator keeps them in the air, which is rarely intended."""
    boxes = [body for body in scene.bodies if body.shape is BodyShape.BOX]
    turns = np.array([body.pose.rotation.T for body in boxes]).reshape(-1, 3, 3)
    centres = np.array([body.pose.position for body in boxes]).reshape(-1, 3)
    half, standing = np.array([body.size for body in boxes]).reshape(-1, 3) / 2, Standing(scene)
    all_corners = np.array([corners(body.pose, body.size) for body in boxes]).reshape(-1, 8, 3)
    outer = all_corners.min(axis=1), all_corners.max(axis=1)
    for body in scene.bodies:
        thing = semantic_map.find(body.iri)
        if not body.movable or thing is None or body.pose == STOWED:
            continue
        is_inside = (np.abs(rotated(turns, body.pose.position - centres)) < half).all(axis=1)
        around = [boxes[index] for index in np.flatnonzero(is_inside).tolist() if boxes[index] is not body]
        if not around and standing.support(body.name) is None:
            notes.append(_unsupported(body, boxes, outer, thing.span))
        for shelf in around:
            stated = semantic_map.find(shelf.iri)
            notes += _over_board(body, shelf, () if stated is None else stated.boards, thing.span)


def _unsupported(body: Body, boxes: Sequence[Body], around: tuple[Array, Array], span: Span | None) -> Diagnostic:
    """Write the warning about an object that stands on nothing, with the height at which it would stand.

    ``boxes`` are all bodies of that shape, ``around`` the lower and upper corners (n, 3) of what is around them.
    """
    heights = corners(body.pose, body.size)[:, 2]
    low, high, z = float(heights.min()), float(heights.max()), body.pose.position[2]
    middle, (lower, upper) = np.array(body.pose.position), around
    is_below = ((lower <= middle) & (upper >= middle))[:, :2].all(axis=1) & (upper[:, 2] < high)
    below = {boxes[k].name: float(upper[k, 2]) for k in np.flatnonzero(is_below).tolist() if boxes[k] is not body}
    name = max(below, key=below.__getitem__, default="the floor")
    top = below.get(name, 0.0)
    where = f"{low - top:.3f} m over {name}" if low >= top else f"{top - low:.3f} m inside {name}"
    message = f"{body.name} stands on nothing: its lowest point is {where}"
    help = f"a pose is that of the box centre: with z = {z + top - low:.3f}, {body.name} stands on {name}"
    return warning("M015", message, span, help)


def _over_board(body: Body, shelf: Body, boards: Sequence[float], span: Span | None) -> Iterator[Diagnostic]:
    """Yield the warning about a thing between the boards of a shelf that stands on none of them."""
    floor, low = (float(corners(one.pose, one.size)[:, 2].min()) for one in (shelf, body))
    below = [board for board in boards if floor + board <= body.pose.position[2]]
    if below and (gap := low - floor - below[-1]) > GAP:
        message = f"{body.name} stands on nothing: its lowest point is {gap:.3f} m over a board of {shelf.name}"
        help = f"a pose is that of the middle: {gap:.3f} m lower {body.name} stands on the board at {below[-1]} m"
        yield warning("M015", message, span, help)


def _bounds(bodies: Iterable[Body]) -> tuple[float, float, float, float]:
    """Bounding rectangle of the rooms, or of all bodies with a margin: x_min, y_min, x_max, y_max [m]."""
    bodies = tuple(bodies)
    rooms = [body for body in bodies if body.shape is BodyShape.ROOM]
    points = [
        footprint(body.pose, body.size)
        for body in (rooms or [b for b in bodies if b.shape is not BodyShape.MARKER] or bodies)
        if body.pose != STOWED
    ]
    if not points:
        return (-5.0, -5.0, 5.0, 5.0)
    margin = 0.0 if rooms else MARGIN
    low, high = np.vstack(points).min(axis=0) - margin, np.vstack(points).max(axis=0) + margin
    return (float(low[0]), float(low[1]), float(high[0]), float(high[1]))


GRIDS = ((10.0, 0.05), (50.0, 0.25), (1000.0, 5.0))
"""Half widths and steps of grids of start positions [m]; a coarser grid is searched only if the finer has no result."""

CLEARANCE = 0.1
"""Free distance around the robot's radius [m]."""

BLOCK = 500
"""Number of positions checked at once."""

HEADROOM = 2.0
"""Robots drive under bodies above this height [m]."""


def default_starts(scene: Scene, radius: float) -> Iterator[tuple[float, float, float]]:
    """Yield free start poses (x, y, yaw 0), nearest to the centre of the first room, or of all bodies, first.

    Free: a disc of ``radius`` and :data:`CLEARANCE` [m] touches no body and lies within a room. Ties are broken by x,
    then by y.
    """
    rooms = [body for body in scene.bodies if body.shape is BodyShape.ROOM]
    x_min, y_min, x_max, y_max = scene.bounds
    centre = np.array(rooms[0].pose.position[:2] if rooms else ((x_min + x_max) / 2, (y_min + y_max) / 2))
    inner = [footprint(room.pose, room.size) for room in rooms]
    solid = (body for body in scene.bodies if body.shape not in (BodyShape.MARKER, BodyShape.ROOM))
    placed = [(scene.first_pose(body), body.size) for body in solid if body.pose != STOWED]
    outer = [footprint(pose, size) for pose, size in placed if corners(pose, size)[:, 2].min() < HEADROOM]
    any_free = False
    for half_width, spacing in GRIDS:
        points = _grid(centre, min(half_width, max(x_max - x_min, y_max - y_min)), spacing)
        points = points[np.all((points >= (x_min, y_min)) & (points <= (x_max, y_max)), axis=1)]
        for first in range(0, len(points), BLOCK):
            block = points[first : first + BLOCK]
            free = block[_free(block, inner, outer, radius + CLEARANCE)]
            any_free = any_free or len(free) > 0
            yield from ((x + 0.0, y + 0.0, 0.0) for x, y in free.tolist())
        if any_free:
            return


def _grid(centre: Array, half_width: float, spacing: float) -> Array:
    """Build a square grid (n, 2) around the centre, sorted by distance, then by x and y."""
    steps = int(np.ceil(half_width / spacing))
    axis = spacing * np.arange(-steps, steps + 1)
    offsets = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    order = np.lexsort((offsets[:, 1], offsets[:, 0], np.hypot(*offsets.T).round(6)))
    points: Array = (offsets[order] + centre).round(6)
    return points


def _free(points: Array, rooms: Sequence[Array], bodies: Sequence[Array], clearance: float) -> NDArray[np.bool_]:
    """Mask (m,) of the points (m, 2) with enough clearance [m] from footprints of bodies and the edges of a room."""
    free = np.ones(len(points), bool)
    if rooms:
        free &= np.any([_signed_distance(room, points) <= -clearance for room in rooms], axis=0)
    low, high = points.min(axis=0) - clearance, points.max(axis=0) + clearance
    for body in bodies:
        if (body.max(axis=0) >= low).all() and (body.min(axis=0) <= high).all():
            free &= _signed_distance(body, points) >= clearance
    return free


def _signed_distance(polygon: Array, points: Array) -> Array:
    """Compute distances (m,) of points (m, 2) from a counter-clockwise convex polygon (n, 2), negative inside."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    lengths = np.maximum(np.linalg.norm(edges, axis=1), 1e-12)
    arrows = points[:, None] - polygon[None]
    along = np.clip(np.einsum("mnk,nk->mn", arrows, edges) / lengths**2, 0.0, 1.0)
    distances = np.linalg.norm(arrows - along[..., None] * edges, axis=2).min(axis=1)
    side = (edges[:, 0] * arrows[..., 1] - edges[:, 1] * arrows[..., 0]) / lengths
    signed: Array = np.where(np.all(side >= 0, axis=1), -distances, distances)
    return signed


CONTROLS = ("PushButton", "ControlKnob")
"""Classes of parts by which devices are switched."""
LOW = 0.15
"""Devices lower than this have their presumed button on top, as the front is too low for a hand [m]."""
FROM_EDGE = 0.03
"""Distance of a presumed button from the edge of its device [m]."""


def controls_of(
    bodies: Iterable[Body], joints: Iterable[Articulation], semantic_map: SemanticMap
) -> tuple[Control, ...]:
    """Find the controls of all devices, in the order of the map; a device without any gets a presumed button."""
    by_iri = {body.iri: body for body in bodies if body.shape in (BodyShape.BOX, BodyShape.CYLINDER)}
    leaves = {joint.leaf for joint in joints}
    moving = {name for joint in joints for name in joint.parts}
    controls: dict[str, list[Control]] = {
        thing.iri: [] for thing in semantic_map.objects if thing.iri in by_iri and semantic_map.is_a(thing, *DEVICES)
    }
    for thing in semantic_map.objects:
        body = by_iri.get(thing.iri)
        if body is None or body.name in moving or not semantic_map.is_a(thing, *CONTROLS):
            continue
        device = next((one.iri for one in _wholes(thing, semantic_map) if one.iri in controls), None)
        if device is not None:
            controls[device].append(_control(by_iri[device], body, leaves))
    for thing in semantic_map.objects:
        if thing.iri not in controls or controls[thing.iri]:
            continue
        if number_of_class(semantic_map.ontology, thing.types, "presumedButtons") != 0:
            controls[thing.iri].append(_presumed_button(by_iri[thing.iri]))
    return tuple(one for of_device in controls.values() for one in of_device)


def _control(device: Body, body: Body, leaves: Container[str]) -> Control:
    """Build a control from a button or a knob (a leaf): its normal is its shortest axis, away from the device."""
    axis = int(np.argmin(body.size))
    outwards = rotated(body.pose.rotation.T, np.array(body.pose.position) - device.pose.position)
    normal, point = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    normal[axis] = 1.0 if outwards[axis] >= 0 else -1.0
    point[axis] = normal[axis] * body.size[axis] / 2
    at, outward = (point[0], point[1], point[2]), (normal[0], normal[1], normal[2])
    return Control(device.name, body.name, at, outward, body.name in leaves)


def _presumed_button(device: Body) -> Control:
    depth, _, height = device.size
    if height < LOW:
        return Control(device.name, device.name, (depth / 2 - FROM_EDGE, 0.0, height / 2), (0.0, 0.0, 1.0))
    return Control(device.name, device.name, (depth / 2, 0.0, height / 2 - FROM_EDGE), (1.0, 0.0, 0.0))


def _wholes(thing: MapObject, semantic_map: SemanticMap) -> Iterator[MapObject]:
    """Yield what an object is a part of, from the inside out."""
    seen = {thing.iri}
    while (holder := semantic_map.holder(thing)) is not None and holder.iri not in seen:
        seen.add(holder.iri)
        yield holder
        thing = holder
