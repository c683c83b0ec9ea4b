"""Models of things: their features, which are parts that are points, lines or planes, as an ontology states them.

A feature's position is that of its latest perception, else of its ``orientation``, in the frame of the whole thing, and
its direction is in that frame as well. Of what a thing has no model of, its box tells: see :data:`DERIVED`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from executive.maps.measures import Size, read_transform
from executive.maps.semantic_map import PosesOfThings
from planlang.designators import local_name
from planlang.geometry import Array
from planlang.geometry.matrices import product
from planlang.motion_constraints import Feature, FeatureKind, Vector
from planlang.ontology import Literal, Ontology, expand
from planlang.records import dataclass
from planlang.units import stated_number, unit_of_property
from sim.bodies import BLADE

PARTS = ("properPhysicalParts", "physicalParts", "properParts-Physical")
"""Properties from a thing to its parts."""
WHOLES = ("physicalPartOf", "properPhysicalPartOf", "partOf")
"""Properties from a part to what it is a part of."""
UPWARDS = 0.9
"""Least cosine between up and the normal of a plane that things stand on."""
IN_THE_MIDDLE = 0.01
"""Distance from a tool's middle up to which its grip, or the palm, is on neither side of it [m]."""
_DEEPEST = 20


@dataclass(frozen=True, slots=True)
class Thing:
    """A thing with features: its individual, its size if that is known, and up in its own frame (3,)."""

    iri: str
    size: Size | None
    up: Array
    wall: float = 0.0
    """Thickness of the walls of what is hollow and open above; 0 for what is solid [m]."""
    grip: Array | None = None
    """The place in its own frame (3,) at which a hand holds it."""
    palm: Array | None = None
    """The place of that hand's palm (3,), behind its grip."""


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A part, or a whole thing: position and direction in the frame of the thing, and which individual it is."""

    iri: str | None
    position: Array
    direction: Array | None = None
    kind: FeatureKind = FeatureKind.POINT


class ObjectModels:
    """The models that one ontology has."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology
        self._poses = PosesOfThings(ontology, [])

    def grounded(self, feature: Feature, thing: Thing) -> Feature | None:
        """Return a feature with the kind, position and direction that the model of its thing says; None without it.

        Where several parts fit, the one with the fewest steps from the whole is meant, then the first of the file.
        """
        if feature.is_grounded:
            return feature
        whole = self._described(thing.iri, thing)
        found = next(self._along(feature.path, whole, thing), None)
        if found is None:
            return None
        direction = None if found.direction is None else _vector(found.direction)
        return replace(feature, kind=found.kind, position=_vector(found.position), direction=direction)

    def _along(self, path: Sequence[str], start: Found, thing: Thing) -> Iterator[Found]:
        """Yield what a path of classes leads to, nearest parts first."""
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
        """Return the parts of a thing, and theirs, those with the fewest steps first."""
        found = dict.fromkeys(() if iri is None else self._direct(iri))
        level = list(found)
        for _ in range(_DEEPEST):
            level = [part for one in level for part in self._direct(one) if part not in found and part != iri]
            found.update(dict.fromkeys(level))
        return list(found)

    def _direct(self, iri: str) -> list[str]:
        down = [part for parts in self._ontology.linked(iri, *PARTS) for part in parts]
        up = (triple.subject for triple in self._ontology.using(*WHOLES) if triple.object == iri)
        return list(dict.fromkeys((*down, *(one for one in up if isinstance(one, str)))))

    def parts_of_class(self, iri: str, cls: str) -> Iterator[Found]:
        """Yield the features of a thing's parts of a class, the nearest first."""
        thing = Thing(iri, None, np.array([0.0, 0.0, 1.0]))
        return self._along((cls,), self._described(iri, thing), thing)

    def _described(self, iri: str, thing: Thing) -> Found:
        position = np.zeros(3) if iri == thing.iri else self.matrix(iri, thing.iri)[:3, 3]
        for name, kind in (("longitudinalDirection", FeatureKind.LINE), ("normalDirection", FeatureKind.PLANE)):
            for vector in self._ontology.linked(iri, name)[0]:
                direction = np.array([self._number(vector, f"vector{axis}") for axis in "XYZ"])
                if np.linalg.norm(direction) > 0.0:
                    return Found(iri, position, direction, kind)
        return Found(iri, position)

    def matrix(self, part: str, whole: str, depth: int = 0) -> Array:
        """Return the pose (4, 4) of a part in the whole; what is relative to nothing is taken as in the whole."""
        place = self._poses.place_of(part)
        matrix = read_transform(self._ontology, place, []) if place is not None else None
        if place is None or matrix is None:
            return np.eye(4)
        parent = next((one for one in self._ontology.linked(place, "relativeTo")[0] if one != whole), None)
        if parent is None or depth > _DEEPEST:
            return matrix
        return product(self.matrix(parent, whole, depth + 1), matrix)

    def _number(self, iri: str, name: str) -> float:
        """Return the number that an individual states; 0 if it states none."""
        for triple in self._ontology.said(iri, name):
            try:
                value = triple.object
                return stated_number(value, unit_of_property(name)) if isinstance(value, Literal) else 0.0
            except ValueError:
                return 0.0
        return 0.0

    # What follows from parts, and from the box

    def _main_axis(self, of: Found, thing: Thing) -> Found:
        """Return a line itself, else the largest cone of a thing, else the axis of its box that is up."""
        if of.kind is FeatureKind.LINE:
            return of
        axes = self._features(of, thing, FeatureKind.LINE)
        if axes:
            return max(axes, key=lambda one: self._number(one.iri or "", "areaOfObject"))
        return Found(None, np.zeros(3), np.array([0.0, 0.0, 1.0]), FeatureKind.LINE)

    def _centre(self, of: Found, thing: Thing) -> Found:
        return Found(of.iri, of.position)

    def _supporting_plane(self, of: Found, thing: Thing) -> Found:
        """Return the largest plane whose normal is up, else the upper side of the box."""
        planes = self._features(of, thing, FeatureKind.PLANE)
        up = [one for one in planes if one.direction is not None and _cosine(one.direction, thing.up) > UPWARDS]
        if up:
            return max(up, key=lambda one: self._number(one.iri or "", "areaOfObject"))
        return self._upper_side(of, thing)

    def _upper_side(self, of: Found, thing: Thing) -> Found:
        axis = int(np.argmax(np.abs(thing.up)))
        normal = np.zeros(3)
        normal[axis] = 1.0 if thing.up[axis] >= 0 else -1.0
        return Found(None, normal * (0.0 if thing.size is None else thing.size[axis] / 2), normal, FeatureKind.PLANE)

    def _bottom_inside(self, of: Found, thing: Thing) -> Found:
        """Return the floor of a vessel, as its upper side."""
        height = 0.0 if thing.size is None else thing.size[2]
        floor = thing.wall - height / 2 if thing.wall else height / 2
        return Found(None, np.array([0.0, 0.0, floor]), np.array([0.0, 0.0, 1.0]), FeatureKind.PLANE)

    def _bottom_side(self, of: Found, thing: Thing) -> Found:
        """Return the lower side of the box, with its normal up."""
        top = self._upper_side(of, thing)
        return replace(top, position=-top.position)

    def _flat_side(self, of: Found, thing: Thing) -> Found:
        """Return the largest side of the box that looks away from the palm, else down, with its normal outwards.

        The grip does not tell: it is often in the middle, whichever side the hand came from.
        """
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        axis = int(np.argsort(size, kind="stable")[0])
        above = thing.up if thing.palm is None or abs(thing.palm[axis]) <= IN_THE_MIDDLE else thing.palm
        normal = (-1.0 if above[axis] >= 0 else 1.0) * np.eye(3)[axis]
        return Found(None, normal * size[axis] / 2, normal, FeatureKind.PLANE)

    def _length(self, of: Found, thing: Thing) -> Found:
        return self._edge(thing, 2)

    def _width(self, of: Found, thing: Thing) -> Found:
        return self._edge(thing, 1)

    def _edge(self, thing: Thing, rank: int) -> Found:
        """Return the line through the middle of the box along the axis with so many shorter ones."""
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        axis = np.eye(3)[np.argsort(size, kind="stable")[rank]]
        return Found(None, np.zeros(3), axis, FeatureKind.LINE)

    def _tip(self, of: Found, thing: Thing) -> Found:
        """Return the front end of the longest axis, as a line out of it; of what is held that far from the hand."""
        size = np.ones(3) if thing.size is None else np.array(thing.size)
        along = int(np.argmax(size))
        sign = 1.0 if thing.grip is None or thing.grip[along] <= IN_THE_MIDDLE else -1.0
        axis = sign * np.eye(3)[along]
        return Found(None, axis * size[along] / 2, axis, FeatureKind.LINE)

    def _mouth(self, of: Found, thing: Thing) -> Found:
        """Return the cap of a bottle, else the middle of the upper rim with the axis through it."""
        caps = [one for one in self._along(("BottleCap",), of, thing) if one.direction is not None]
        height = 0.0 if thing.size is None else thing.size[2]
        rim = Found(None, np.array([0.0, 0.0, height / 2]), np.array([0.0, 0.0, 1.0]), FeatureKind.LINE)
        return caps[0] if caps else rim

    def _features(self, of: Found, thing: Thing, kind: FeatureKind) -> list[Found]:
        every = (self._described(iri, thing) for iri in self._parts(of.iri))
        return [one for one in every if one.kind is kind]


DERIVED: dict[str, Callable[[ObjectModels, Found, Thing], Found]] = {
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
"""Class of a feature that no part of a thing needs to be -> how it follows from the others, or from the thing's box."""


@dataclass(frozen=True, slots=True, eq=False)
class Blade:
    """The blade of a tool in the tool's frame: its position, the way to its front side, its unit normal, (3,) each."""

    position: Array
    ahead: Array
    normal: Array

    @staticmethod
    def of(ontology: Ontology, iri: str) -> Blade | None:
        """Return the blade that the model of a tool has, with its front side; None if it has none."""
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
        """Return extents and centre, in the tool's frame, of a box of some size that ends where the blade does.

        It lies along the axis that is nearest to the way ahead, and is thin along the one nearest to the normal; the
        blade is its lower side.
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
