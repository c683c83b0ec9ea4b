"""Object models: features of objects, which are parts that are points, lines or planes.

Position and direction of a feature are in the frame of the whole object; the position is that of its latest
perception, else of its ``orientation``. Features that no part provides are derived from the box: see :data:`DERIVED`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from executive.maps.measures import Size
from executive.maps.semantic_map import WHOLES, PosesOfThings
from executive.maps.soma import COMPONENTS
from planlang.designators import local_name
from planlang.geometry import Array
from planlang.geometry.matrices import product
from planlang.measures import length, read_transform
from planlang.motion_constraints import Feature, FeatureKind, Vector
from planlang.ontology import Ontology, expand
from planlang.records import dataclass
from sim.bodies import BLADE

PARTS = ("properPhysicalParts", "physicalParts", "properParts-Physical")
"""Properties from an object to its parts."""
UPWARDS = 0.9
"""Least cosine between up and the normal of a supporting plane."""
IN_THE_MIDDLE = 0.01
"""Within this distance of an object's centre, the grip or the palm is on neither side of it [m]."""
_DEEPEST = 20
"""Greatest depth of nested parts and of relative poses: a guard against cycles."""


@dataclass(frozen=True, slots=True)
class Thing:
    """An object with features: its individual, its size if known, and up in its own frame (3,)."""

    iri: str
    size: Size | None
    up: Array
    wall: float = 0.0
    """Thickness of the walls of a vessel that is open above; 0 for a solid object [m]."""
    grip: Array | None = None
    """Point in its own frame (3,) at which a hand holds it [m]."""
    palm: Array | None = None
    """Point of that hand's palm (3,) in the same frame, behind the grip [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Located:
    """A feature, or the whole object: its individual, if any, and position and direction in the object's frame."""

    iri: str | None
    position: Array
    direction: Array | None = None
    kind: FeatureKind = FeatureKind.POINT


class ObjectModels:
    """The object models of an ontology."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology
        self._poses = PosesOfThings(ontology, [])

    def grounded(self, feature: Feature, thing: Thing) -> Feature | None:
        """Ground a feature: look up its kind, position and direction in the model of its object; None if it has none.

        Of several matching parts, the one with the fewest steps from the whole is used, then the first of the file.
        """
        if feature.is_grounded:
            return feature
        whole = self._described(thing.iri, thing)
        located = next(self._along(feature.path, whole, thing), None)
        if located is None:
            return None
        direction = None if located.direction is None else _vector(located.direction)
        return replace(feature, kind=located.kind, position=_vector(located.position), direction=direction)

    def _along(self, path: Sequence[str], start: Located, thing: Thing) -> Iterator[Located]:
        """Yield the features at the end of a path of classes, nearest parts first."""
        if not path:
            yield start
            return
        cls = path[0]
        for iri in self._parts(start.iri):
            if iri == cls or self._is_a(iri, cls):
                yield from self._along(path[1:], self._described(iri, thing), thing)
        derived = DERIVED.get(local_name(cls))
        if derived is not None:
            yield from self._along(path[1:], derived(self, start, thing), thing)

    def _is_a(self, iri: str, cls: str) -> bool:
        types = self._ontology.types(iri)
        return self._ontology.is_a(iri, expand(cls)) or any(local_name(one) == local_name(cls) for one in types)

    def _parts(self, iri: str | None) -> list[str]:
        """List the parts of an object, breadth first."""
        parts = dict.fromkeys(() if iri is None else self._direct(iri))
        level = list(parts)
        for _ in range(_DEEPEST):
            level = [part for one in level for part in self._direct(one) if part not in parts and part != iri]
            parts.update(dict.fromkeys(level))
        return list(parts)

    def _direct(self, iri: str) -> list[str]:
        down = [part for parts in self._ontology.linked(iri, *PARTS) for part in parts]
        up = (triple.subject for triple in self._ontology.using(*WHOLES) if triple.object == iri)
        return list(dict.fromkeys((*down, *(one for one in up if isinstance(one, str)))))

    def parts_of_class(self, iri: str, cls: str) -> Iterator[Located]:
        """Yield the parts of an object that are of a class, nearest first."""
        thing = Thing(iri, None, np.array([0.0, 0.0, 1.0]))
        return self._along((cls,), self._described(iri, thing), thing)

    def _described(self, iri: str, thing: Thing) -> Located:
        position = np.zeros(3) if iri == thing.iri else self.matrix(iri, thing.iri)[:3, 3]
        for name, kind in (("longitudinalDirection", FeatureKind.LINE), ("normalDirection", FeatureKind.PLANE)):
            for vector in self._ontology.linked(iri, name)[0]:
                components = [self._number(vector, name) for name in COMPONENTS]
                if None not in components and any(components):
                    return Located(iri, position, np.array(components, float), kind)
        return Located(iri, position)

    def matrix(self, part: str, whole: str, depth: int = 0) -> Array:
        """Compute the pose (4, 4) of a part in the whole; a pose without ``relativeTo`` is already in that frame."""
        place = self._poses.place_of(part)
        matrix = read_transform(self._ontology, place, []) if place is not None else None
        if place is None or matrix is None:
            return np.eye(4)
        parent = next((one for one in self._ontology.linked(place, "relativeTo")[0] if one != whole), None)
        if parent is None or depth > _DEEPEST:
            return matrix
        return product(self.matrix(parent, whole, depth + 1), matrix)

    def _number(self, iri: str, name: str) -> float | None:
        """Read a number of an individual; 0 if it states none, None if it is invalid, as reported with the map."""
        triple = next(self._ontology.said(iri, name), None)
        return 0.0 if triple is None else length(triple, [])

    def _area(self, of: Located) -> float:
        return self._number(of.iri or "", "areaOfObject") or 0.0

    # Derived features

    def _main_axis(self, of: Located, thing: Thing) -> Located:
        """Main axis: a line itself, else the axis of the largest cone among the parts, else the z axis of the box."""
        if of.kind is FeatureKind.LINE:
            return of
        axes = self._features(of, thing, FeatureKind.LINE)
        if axes:
            return max(axes, key=self._area)
        return Located(None, np.zeros(3), np.array([0.0, 0.0, 1.0]), FeatureKind.LINE)

    def _centre(self, of: Located, thing: Thing) -> Located:
        return Located(of.iri, of.position)

    def _supporting_plane(self, of: Located, thing: Thing) -> Located:
        """Largest plane whose normal points up, else the upper side of the box."""
        planes = self._features(of, thing, FeatureKind.PLANE)
        up = [one for one in planes if one.direction is not None and _cosine(one.direction, thing.up) > UPWARDS]
        if up:
            return max(up, key=self._area)
        return self._upper_side(of, thing)

    def _upper_side(self, of: Located, thing: Thing) -> Located:
        axis = int(np.argmax(np.abs(thing.up)))
        normal = np.zeros(3)
        normal[axis] = 1.0 if thing.up[axis] >= 0 else -1.0
        return Located(None, normal * (0.0 if thing.size is None else thing.size[axis] / 2), normal, FeatureKind.PLANE)

    def _bottom_inside(self, of: Located, thing: Thing) -> Located:
        """Floor of a vessel, seen from inside; the top of a solid object."""
        height = 0.0 if thing.size is None else thing.size[2]
        floor = thing.wall - height / 2 if thing.wall else height / 2
        return Located(None, np.array([0.0, 0.0, floor]), np.array([0.0, 0.0, 1.0]), FeatureKind.PLANE)

    def _bottom_side(self, of: Located, thing: Thing) -> Located:
        """Lower side of the box, with its normal pointing up."""
        top = self._upper_side(of, thing)
        return replace(top, position=-top.position)

    def _flat_side(self, of: Located, thing: Thing) -> Located:
        """Largest side of the box that faces away from the palm, else down, with its normal outwards.

        The palm decides, not the grip, which is often in the middle whichever side the hand came from.
        """
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        axis = int(np.argsort(size, kind="stable")[0])
        above = thing.up if thing.palm is None or abs(thing.palm[axis]) <= IN_THE_MIDDLE else thing.palm
        normal = (-1.0 if above[axis] >= 0 else 1.0) * np.eye(3)[axis]
        return Located(None, normal * size[axis] / 2, normal, FeatureKind.PLANE)

    def _length(self, of: Located, thing: Thing) -> Located:
        return self._edge(thing, 2)

    def _width(self, of: Located, thing: Thing) -> Located:
        return self._edge(thing, 1)

    def _edge(self, thing: Thing, rank: int) -> Located:
        """Line through the centre of the box along an axis, by rank of extent: 0 the shortest, 2 the longest."""
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        axis = np.eye(3)[np.argsort(size, kind="stable")[rank]]
        return Located(None, np.zeros(3), axis, FeatureKind.LINE)

    def _tip(self, of: Located, thing: Thing) -> Located:
        """Front end of the longest axis, as a line pointing outwards; for a held object, the end away from the grip."""
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        along = int(np.argmax(size))
        sign = 1.0 if thing.grip is None or thing.grip[along] <= IN_THE_MIDDLE else -1.0
        axis = sign * np.eye(3)[along]
        return Located(None, axis * size[along] / 2, axis, FeatureKind.LINE)

    def _mouth(self, of: Located, thing: Thing) -> Located:
        """Cap of a bottle, else the centre of the upper rim with the vertical axis through it."""
        caps = [one for one in self._along(("BottleCap",), of, thing) if one.direction is not None]
        height = 0.0 if thing.size is None else thing.size[2]
        rim = Located(None, np.array([0.0, 0.0, height / 2]), np.array([0.0, 0.0, 1.0]), FeatureKind.LINE)
        return caps[0] if caps else rim

    def _features(self, of: Located, thing: Thing, kind: FeatureKind) -> list[Located]:
        every = (self._described(iri, thing) for iri in self._parts(of.iri))
        return [one for one in every if one.kind is kind]


DERIVED: dict[str, Callable[[ObjectModels, Located, Thing], Located]] = {
    "ObjectMainAxis": ObjectModels._main_axis,
    "CenterOfObject": ObjectModels._centre,
    "SupportingPlane": ObjectModels._supporting_plane,
    "TopSide": ObjectModels._upper_side,
    "BottomInside": ObjectModels._bottom_inside,
    "BottomSide": ObjectModels._bottom_side,
    "FlatSide": ObjectModels._flat_side,
    "LengthOfFlatSide": ObjectModels._length,
    "WidthOfFlatSide": ObjectModels._width,
    "ToolTip": ObjectModels._tip,
    "MouthOfVessel": ObjectModels._mouth,
}
"""Class of a feature -> how it is derived if no part of the object is of that class."""


@dataclass(frozen=True, slots=True, eq=False)
class Blade:
    """The blade of a tool in the tool's frame: position, vector to its front edge and unit normal, (3,) each."""

    position: Array
    ahead: Array
    normal: Array

    @staticmethod
    def of(ontology: Ontology, iri: str) -> Blade | None:
        """Find the blade in the model of a tool, and its front side; None if either is missing."""
        models = ObjectModels(ontology)
        for blade in models.parts_of_class(iri, "BladeOfADevice"):
            front = next(models.parts_of_class(blade.iri or "", "FrontSide"), None)
            if front is None or front.iri is None or blade.direction is None:
                continue
            normal = blade.direction / np.linalg.norm(blade.direction)
            ahead = models.matrix(front.iri, iri)[:3, 3] - blade.position
            ahead = ahead - (ahead @ normal) * normal
            if np.linalg.norm(ahead) > 0.0:
                return Blade(blade.position, ahead, normal)
        return None

    def box(self, size: Size) -> tuple[Size, Vector]:
        """Compute extents and centre, in the tool's frame, of a box around the tool that ends with the blade.

        The longest extent is along the axis nearest to ``ahead``, the shortest along that nearest to ``normal``; the
        blade is the lower side of the box.
        """
        along, normal = int(np.argmax(np.abs(self.ahead))), int(np.argmax(np.abs(self.normal)))
        short, middle, long = sorted(size)
        extents = np.full(3, middle)
        extents[along], extents[normal] = long, short
        centre = self.position + self.ahead
        centre[along] -= np.sign(self.ahead[along]) * long / 2
        centre[normal] = self.position[normal] + max(0.0, short - BLADE) / 2
        return _vector(extents), _vector(centre)


def _cosine(one: Array, other: Array) -> float:
    return float(one @ other / (np.linalg.norm(one) * np.linalg.norm(other)))


def _vector(values: Array) -> Vector:
    x, y, z = map(float, values)
    return x, y, z
