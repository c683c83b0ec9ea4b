"""Joints of the doors, drawers, lids and knobs of a map: bodies, axes and limits.

Limits and axes that the map states take precedence. Otherwise they are derived from the box: a door hinges at the edge
opposite its handle, or, without a handle, at the edge closer to the side of its furniture; drawers slide out. Doors
between rooms hang in a doorway, a wall or a room.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.doorways import is_wall
from executive.maps.room_doors import (
    ROOM_DOORS,
    Frame,
    frame_of,
    lacking,
    side_of,
    unknown_hinge,
    without_frame,
)
from executive.maps.semantic_map import SemanticMap
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import half_extents
from planlang.measures import length, stated
from planlang.ontology import Ontology, expand
from planlang.records import dataclass
from sim import Body
from sim.joints import Articulation, JointKind
from sim.scene import BodyShape

DOORS = ("Door", "DoorwayCovering", "ContainerLid")
"""Classes of hinged leaves."""
BELOW = ("Oven", "Dishwasher")
"""Classes of furniture whose doors are hinged at the lower edge."""
KNOBS = ("ControlKnob",)
"""Classes that turn about their own axis, if they are part of a device or the map states a joint for them."""
DEVICES = ("PoweredDevice",)
"""Classes of objects that are switched on and off."""
GRIPS = ("Handle", *KNOBS)
"""Classes of parts by which a hand moves a leaf, the preferred one first."""
OPENED = 1.57
"""Default upper limit of a hinge [rad]: a right angle."""
EXTENDED = 0.8
"""Default travel of a drawer, as a fraction of its depth."""
UPRIGHT = 1.5
"""A door wider than this many times its height has a horizontal hinge, unless its handle is upright."""
LEVEL = 0.7
"""A unit vector with a greater vertical component points up or down (about 45 degrees)."""
AT_FACE = 0.03
"""A door within this distance of a face of its furniture closes that face [m]."""
AT_JAMB = 0.02
"""Distance from the wall at which the handle of a sliding door stops [m]."""
MIDWAY = 1e-3
"""A handle this near to the middle of a leaf is opposite none of its edges [m]."""
AT_EDGE = 0.05
"""A hinge within this distance of an edge of the door belongs to that edge [m]."""


def articulated(
    bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]
) -> tuple[list[Body], tuple[Articulation, ...]]:
    """Find the joints of a map, in the order of the map, and move misplaced doors to the face of their furniture.

    Returns all bodies and the joints. Assumptions and repairs are appended to ``notes``.
    """
    return _Reader(bodies, semantic_map, notes).read()


DEEPEST = 5
"""Greatest depth of nested parts of a leaf: a handle on the door of a drawer has depth 3."""


@dataclass(slots=True)
class _Leaf:
    """A leaf with its furniture and parts, and unit vectors in the map frame: outward normal and both edges."""

    thing: MapObject
    body: Body
    holder: Body
    parts: list[MapObject]
    handle: Body | None
    outwards: Array
    up: Array
    across: Array
    slide: Array | None = None
    """Direction in which it slides to open, if that is not outwards."""

    def half(self, direction: Array) -> float:
        """Half extent of the leaf along a unit vector of the map frame [m]."""
        return _half(self.body, direction)


class _Reader:
    def __init__(self, bodies: Sequence[Body], semantic_map: SemanticMap, notes: list[Diagnostic]) -> None:
        self.bodies = {body.iri: body for body in bodies}
        self.map, self.notes = semantic_map, notes
        self.things = {thing.iri: thing for thing in semantic_map.objects}
        self.wholes = {part: thing for thing in semantic_map.objects for part in thing.parts}

    def read(self) -> tuple[list[Body], tuple[Articulation, ...]]:
        joints = []
        for thing in self.map.objects:
            body = self.bodies.get(thing.iri)
            if body is None or body.shape is not BodyShape.BOX:
                continue
            if self.map.is_a(thing, *DOORS):
                joint = self._door(thing, body)
            elif self.map.is_a(thing, "Drawer"):
                joint = self._drawer(thing, body)
            else:
                joint = self._knob(thing, body) if self.map.is_a(thing, *KNOBS) else None
            if joint is not None:
                joints.append(joint if joint.is_knob else replace(joint, first=self._position(thing, joint)))
        moved = {name for joint in joints for name in joint.parts}  # a knob on a door moves with the door
        return list(self.bodies.values()), tuple(joint for joint in joints if joint.leaf not in moved)

    # Kinds

    def _door(self, thing: MapObject, body: Body) -> Articulation | None:
        holder = self._holder(thing)
        if holder is None:
            return self._room_door(thing, body) if self.map.is_a(thing, *ROOM_DOORS) else None
        if self.map.is_a(self.things[holder.iri], "Drawer"):
            return None  # a drawer's front slides with the drawer
        leaf = self._leaf(thing, body, holder)
        if not any(self._is_placed(iri) for iri in self._hinges(thing)):
            leaf = self._at_face(leaf)
        return self._stated(leaf) or self._hinged(leaf)

    def _room_door(self, thing: MapObject, body: Body) -> Articulation | None:
        frame, parts = self._frame(thing, body), self._parts(thing)
        handles = [self.bodies[part.iri] for part in parts if self.map.is_a(part, *GRIPS[:1])]
        handles = [handle for handle in handles if handle.shape is not BodyShape.MARKER]
        joints = self._hinges(thing)
        if frame is None:
            self.notes += [without_frame(thing)] if handles or joints else []
            return None
        self.notes += lacking(thing, body, frame, handles)
        outwards = frame.opens_into(body)
        handles.sort(key=lambda handle: -side_of(body, handle, outwards))
        leaf = _Leaf(thing, body, frame.body, parts, next(iter(handles), None), outwards, *_edges(body, outwards))
        aside = 0.0 if leaf.handle is None else float(_arrow(body, leaf.handle) @ leaf.across)
        if any(self._is_joint(iri, "PrismaticJoint") for iri in joints):
            leaf.slide = -math.copysign(1.0, aside) * leaf.across
            joint = self._stated(leaf, JointKind.PRISMATIC) or self._sliding(leaf, leaf.slide, handles)
        else:
            if abs(aside) <= MIDWAY and not any(iri in self.things and self.things[iri].pose for iri in joints):
                self.notes.append(unknown_hinge(body, thing))
            joint = self._stated(leaf, JointKind.HINGED) or self._hinged(leaf)
        others = tuple(handle.name for handle in handles[1:])
        return replace(joint, holder=None, frame=frame.names, other_handles=others)

    def _sliding(self, leaf: _Leaf, slide: Array, handles: Sequence[Body]) -> Articulation:
        """Derive how far a door slides: by its width, with handles on both sides until one is at the wall."""
        travel = 2 * leaf.half(leaf.across)
        if len(handles) > 1:
            behind = (float(-_arrow(leaf.body, one) @ slide) - _half(one, slide) for one in handles)
            travel = min(travel, leaf.half(slide) + min(behind) - AT_JAMB)
        return self._joint(leaf, JointKind.PRISMATIC, leaf.body.pose.position, slide, 0.0, travel)

    def _drawer(self, thing: MapObject, body: Body) -> Articulation:
        parts = self._parts(thing)
        fronts = [part for part in parts if self.map.is_a(part, *DOORS) and part.iri in self.bodies]
        handle = self._handle(parts)
        front = self.bodies[fronts[0].iri] if fronts else handle
        holder = self._holder(thing)
        outwards = _nearest_axis(body, None if front is None else _arrow(body, front))
        leaf = _Leaf(thing, body, holder or body, parts, handle, outwards, *_edges(body, outwards))
        return self._stated(leaf, JointKind.PRISMATIC) or self._joint(
            leaf, JointKind.PRISMATIC, body.pose.position, outwards, 0.0, EXTENDED * 2 * leaf.half(outwards)
        )

    def _knob(self, thing: MapObject, body: Body) -> Articulation | None:
        holder = self._holder(thing)
        leaf = None if holder is None else self._leaf(thing, body, holder)
        if leaf is None or holder is None:
            return None
        joint = self._stated(leaf)
        if joint is None and self.map.is_a(self.things[holder.iri], *DEVICES):
            joint = self._joint(leaf, JointKind.HINGED, body.pose.position, leaf.outwards, 0.0, OPENED)
        return None if joint is None else replace(joint, handle=body.name)

    def _hinged(self, leaf: _Leaf) -> Articulation:
        """Derive the hinge of a door from its box, its handle and its furniture."""
        to_handle = None if leaf.handle is None else np.array(leaf.handle.pose.position) - leaf.body.pose.position
        if abs(leaf.outwards[2]) > LEVEL:
            to_hinge = self._back_of_lid(leaf, to_handle)
        elif self._holder(leaf.thing) is not None and self._turns_level(leaf):
            is_upper = to_handle is None or float(to_handle @ leaf.up) > 0
            to_hinge = -leaf.up if is_upper or self.map.is_a(self.things[leaf.holder.iri], *BELOW) else leaf.up
        else:
            to_hinge = self._hinge_side(leaf, to_handle) * leaf.across
        x, y, z = (np.array(leaf.body.pose.position) + leaf.half(to_hinge) * to_hinge).tolist()
        # positive angles move the free edge outwards
        return self._joint(leaf, JointKind.HINGED, (x, y, z), np.cross(leaf.outwards, to_hinge), 0.0, OPENED)

    def _back_of_lid(self, leaf: _Leaf, to_handle: Array | None) -> Array:
        """Direction of a lid's hinge: opposite its handle, or the back of its furniture (-x) if that is midway."""
        aside = np.zeros(3) if to_handle is None else to_handle - float(to_handle @ leaf.outwards) * leaf.outwards
        backwards = -aside if float(np.linalg.norm(aside)) > MIDWAY else -leaf.holder.pose.rotation[:, 0]
        edges = [sign * edge for edge in (leaf.up, leaf.across) for sign in (1.0, -1.0)]
        return np.asarray(max(edges, key=lambda edge: round(float(edge @ backwards), 9)))

    def _turns_level(self, leaf: _Leaf) -> bool:
        """Check whether the hinge of a door is horizontal."""
        if self.map.is_a(self.things[leaf.holder.iri], *BELOW):
            return True
        handle = leaf.handle
        if handle is not None and self.map.is_a(self.things[handle.iri], *GRIPS[:1]):
            reach = half_extents(handle.pose, handle.size)
            if reach[2] > max(reach[:2]):
                return False
        return leaf.half(leaf.up) * UPRIGHT < leaf.half(leaf.across)

    def _hinge_side(self, leaf: _Leaf, to_handle: Array | None) -> float:
        """Find the hinged side, 1 or -1 along ``across``: opposite the handle, at a placed hinge, or the outer edge."""
        if to_handle is not None and abs(float(to_handle @ leaf.across)) > MIDWAY:
            return -math.copysign(1.0, float(to_handle @ leaf.across))
        edges = {
            side: np.array(leaf.body.pose.position) + side * leaf.half(leaf.across) * leaf.across
            for side in (-1.0, 1.0)
        }
        for hinge in self._hinges(leaf.thing):
            pose = self.things[hinge].pose if hinge in self.things else None
            if pose is not None:
                gaps = {s: abs(float((np.array(pose.position) - edge) @ leaf.across)) for s, edge in edges.items()}
                if min(gaps.values()) <= AT_EDGE:
                    return min(gaps, key=gaps.__getitem__)
        half = _half(leaf.holder, leaf.across)
        inset = {s: half - abs(float((edge - leaf.holder.pose.position) @ leaf.across)) for s, edge in edges.items()}
        return -1.0 if inset[-1.0] <= inset[1.0] else 1.0

    # Stated joints

    def _stated(self, leaf: _Leaf, kind: JointKind | None = None) -> Articulation | None:
        """Read the joint of a leaf from the map; None if the map states no upper limit, or another kind of joint."""
        for iri in self._hinges(leaf.thing):
            lower, upper = self._limit(iri, "minJointValue"), self._limit(iri, "maxJointValue")
            slides = self._is_joint(iri, "PrismaticJoint")
            stated_kind = JointKind.PRISMATIC if slides else JointKind.HINGED
            if upper is None or kind not in (None, stated_kind):
                continue
            direction = _vector(self.map.ontology, iri, "direction", self.notes)
            joint = self._with_axis(leaf, iri, stated_kind, direction)
            low, high = sorted((lower or 0.0, upper))
            if abs(low) > abs(high):  # opens towards smaller values
                x, y, z = joint.axis  # an axis derived from the box is already positive outwards
                joint = replace(joint, axis=(x, y, z) if direction is None else (-x, -y, -z), sign=-1.0)
                low, high = -high, -low
            if not low <= 0.0 < high:
                message = f"{leaf.body.name} cannot both open and close with the limits {lower} and {upper}"
                self.notes.append(
                    warning("M017", message, leaf.thing.span, "0 is closed; limits are in radians or metres")
                )
                continue
            return replace(joint, lower=low, upper=high)
        return None

    def _position(self, thing: MapObject, joint: Articulation) -> float:
        """Read the joint position of a leaf, clamped to the limits of its joint; closed if the map states none."""
        positions = (self._limit(iri, "jointPosition") for iri in (thing.iri, *self._hinges(thing)))
        position = next((value for value in positions if value is not None), 0.0)
        value = joint.sign * position + 0.0
        if joint.within(value) != value:
            low, high = sorted(joint.sign * limit + 0.0 for limit in (joint.lower, joint.upper))
            message = f"{joint.leaf} cannot be at {position}: its limits are {low} and {high}"
            self.notes.append(warning("M017", message, thing.span, "0 is closed; positions are in radians or metres"))
        return joint.within(value)

    def _with_axis(self, leaf: _Leaf, iri: str, kind: JointKind, direction: Array | None) -> Articulation:
        """Build a joint about the stated axis, a unit vector (3,) in the frame of the joint, else that of the box."""
        derived = self._hinged(leaf) if kind is JointKind.HINGED else None
        point = leaf.body.pose.position if derived is None else derived.point
        slide = leaf.outwards if leaf.slide is None else leaf.slide
        axis = slide if derived is None else np.array(derived.axis)
        pose = self.things[iri].pose if iri in self.things else None
        if direction is not None:
            axis = direction if pose is None else rotated(pose.rotation, direction)
            if pose is not None:
                point = pose.position
            else:
                radius = self._limit(iri, "turnRadius")
                if radius and derived is not None:
                    point = _at_radius(leaf, np.array(derived.point), radius)
        return self._joint(leaf, kind, point, axis, 0.0, OPENED)

    def _limit(self, iri: str, name: str) -> float | None:
        triple = stated(self.map.ontology, iri, name)
        return None if triple is None else length(triple, self.notes)

    def _is_placed(self, iri: str) -> bool:
        """Check whether the map describes a joint in full: limits, axis and a point on it."""
        is_described = self._limit(iri, "maxJointValue") is not None and stated(self.map.ontology, iri, "direction")
        return bool(is_described) and iri in self.things and self.things[iri].pose is not None

    def _hinges(self, thing: MapObject) -> list[str]:
        """Joints of an object: its parts, wholes that it is part of, and what it is hinged or rigidly connected to."""
        ontology, rigidly = self.map.ontology, expand("connectedTo-Rigidly")
        iris = [*thing.parts, *thing.hinged_to]
        for prop in (rigidly, expand("properPhysicalParts")):
            holders = (triple.subject for triple in ontology.triples(None, prop, thing.iri))
            iris += [one for one in holders if isinstance(one, str)]
        iris += [one for one in ontology.values(thing.iri, rigidly) if isinstance(one, str)]
        return [iri for iri in dict.fromkeys(iris) if self._is_joint(iri, "HingedJoint", "PrismaticJoint")]

    def _is_joint(self, iri: str, *classes: str) -> bool:
        """Check whether an individual of the map is a joint of one of the classes."""
        return self.map.ontology.any_is_a((iri,), classes)

    # Furniture and parts

    def _holder(self, thing: MapObject) -> Body | None:
        """Find the furniture of a leaf: its whole, or what it is hinged to, directly or by a joint."""
        for iri in self._holders(thing):
            body = self.bodies.get(iri)
            if body is not None and body.shape is BodyShape.BOX and not is_wall(body, self.map):
                return body
        return None

    def _frame(self, thing: MapObject, body: Body) -> Frame | None:
        """Find what a door between rooms hangs in."""
        return frame_of(body, self._holders(thing), self.bodies, self.map)

    def _holders(self, thing: MapObject) -> list[str]:
        """List the IRIs of what a leaf is a part of, or hinged to, directly or by a joint."""
        whole = self.wholes.get(thing.iri)
        iris = [*((whole.iri,) if whole is not None else ()), *thing.hinged_to]
        for joint in self._hinges(thing):
            connected = self.map.ontology.values(joint, expand("connectedTo-Rigidly"))
            iris += [one for one in connected if isinstance(one, str) and one != thing.iri]
            iris += [one.iri for one in self.map.objects if joint in one.parts and one.iri != thing.iri]
        return [iri for iri in iris if iri != thing.iri]

    def _parts(self, thing: MapObject) -> list[MapObject]:
        """List the parts of an object, level by level down to :data:`DEEPEST`, sorted by IRI within a level.

        Sorted, because the first handle is used, and the order of statements differs between syntaxes of one map.
        """
        seen, level = {thing.iri: thing}, [thing]
        for _ in range(DEEPEST):
            below = (
                self.things[iri] for iri in sorted({iri for one in level for iri in one.parts} & self.things.keys())
            )
            level = list({one.iri: one for one in below if one.iri not in seen}.values())
            seen |= {one.iri: one for one in level}
        parts = list(seen.values())[1:]
        return [one for one in parts if one.iri in self.bodies and not self._is_joint(one.iri, "Joint-Physical")]

    def _handle(self, parts: Sequence[MapObject]) -> Body | None:
        for cls in GRIPS:
            for part in parts:
                if self.map.is_a(part, cls) and self.bodies[part.iri].shape is not BodyShape.MARKER:
                    return self.bodies[part.iri]
        return None

    # Geometry of leaves

    def _leaf(self, thing: MapObject, body: Body, holder: Body) -> _Leaf:
        parts = self._parts(thing)
        handle = self._handle(parts)
        normal = body.pose.rotation[:, int(np.argmin(body.size))]
        inside = float((np.array(body.pose.position) - holder.pose.position) @ normal)
        gap = _half(holder, normal) - abs(inside)
        if abs(gap) > AT_FACE:  # deep inside its furniture, the position does not show which side is the front
            towards = _arrow(holder, handle) if handle is not None else holder.pose.rotation[:, 0]
            inside = float(towards @ normal)
        outwards = normal * math.copysign(1.0, inside)
        return _Leaf(thing, body, holder, parts, handle, outwards, *_edges(body, outwards))

    def _at_face(self, leaf: _Leaf) -> _Leaf:
        """Move a leaf along its normal to the face of its furniture, unless it is there already."""
        local = leaf.holder.pose.rotation.T @ leaf.outwards
        axis = int(np.argmax(np.abs(local)))
        normal = leaf.holder.pose.rotation[:, axis] * math.copysign(1.0, local[axis])
        offset = float((np.array(leaf.body.pose.position) - leaf.holder.pose.position) @ normal)
        missing = (leaf.holder.size[axis] / 2 - offset) / float(normal @ leaf.outwards)
        if abs(missing) <= AT_FACE:
            return leaf
        position = np.array(leaf.body.pose.position) + missing * leaf.outwards
        body = replace(leaf.body, pose=Pose(tuple(position.tolist()), leaf.body.pose.orientation))
        self.bodies[body.iri] = body
        where = "the face where its handle is" if leaf.handle is not None else "its front"
        message = f"{body.name} was moved by {abs(missing):.2f} m to {where} of {leaf.holder.name}"
        self.notes.append(note("M016", message, leaf.thing.span))
        return replace(leaf, body=body)

    def _joint(
        self, leaf: _Leaf, kind: JointKind, point: tuple[float, float, float], axis: Array, lower: float, upper: float
    ) -> Articulation:
        """Make the joint of a leaf from its axis and limits [rad or m], with all bodies referred to by name."""
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        parts = tuple(self.bodies[part.iri].name for part in leaf.parts)
        holder = None if leaf.holder is leaf.body else leaf.holder.name
        handle = None if leaf.handle is None else leaf.handle.name
        return Articulation(leaf.body.name, kind, point, (x, y, z), lower, upper, holder, parts, handle)


def _half(body: Body, direction: Array) -> float:
    """Half extent of a body's box along a unit vector of the map frame [m]."""
    return float(np.abs(body.pose.rotation.T @ direction) @ (np.asarray(body.size) / 2))


def _arrow(of: Body, to: Body) -> Array:
    return np.array(to.pose.position) - of.pose.position


def _nearest_axis(body: Body, arrow: Array | None) -> Array:
    """Find the horizontal axis of a body, in the map frame, that is closest to an arrow; its x axis without one."""
    if arrow is None:
        return np.asarray(body.pose.rotation[:, 0])
    axes = [sign * body.pose.rotation[:, k] for k in range(3) for sign in (1.0, -1.0)]
    return np.asarray(max((a for a in axes if abs(a[2]) < LEVEL), key=lambda a: round(float(a @ arrow), 9)))


def _edges(body: Body, outwards: Array) -> tuple[Array, Array]:
    """Find the two axes in the plane of a leaf: the more vertical one, pointing up, and the other."""
    normal = int(np.argmax(np.abs(body.pose.rotation.T @ outwards)))
    axes = [body.pose.rotation[:, k] for k in range(3) if k != normal]
    up, across = sorted(axes, key=lambda axis: -abs(round(float(axis[2]), 6)))
    return np.asarray(up * math.copysign(1.0, up[2])), np.asarray(across)


def _at_radius(leaf: _Leaf, point: Array, radius: float) -> tuple[float, float, float]:
    """Move a point of the hinge so that its distance from the free edge of the leaf is ``radius`` [m]."""
    centre = np.array(leaf.body.pose.position)
    towards = (point - centre) / np.linalg.norm(point - centre)
    x, y, z = (centre + (radius - leaf.half(towards)) * towards).tolist()
    return (x, y, z)


def _vector(ontology: Ontology, subject: str, prop: str, notes: list[Diagnostic]) -> Array | None:
    """Read the vector that a property refers to (vectorX, vectorY, vectorZ), normalised (3,); None if there is none."""
    triple = stated(ontology, subject, prop)
    if triple is None or not isinstance(triple.object, str):
        return None
    parts = [stated(ontology, triple.object, name) for name in ("vectorX", "vectorY", "vectorZ")]
    values = [None if part is None else length(part, notes) for part in parts]
    if None in values or not any(values):
        message = f"{local_name(triple.object)} is not a valid direction"
        notes.append(warning("M018", message, triple.span, "state vectorX, vectorY and vectorZ, not all 0"))
        return None
    vector = np.array(values, float)
    return np.asarray(vector / np.linalg.norm(vector))
