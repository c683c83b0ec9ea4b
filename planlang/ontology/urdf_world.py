"""Reads a world in URDF as the statements of a semantic map: things with classes, boxes and poses, and their joints.

Each link with a shape is a thing: a box, whose pose is that of its shape. What hangs from a link is a part of the
nearest thing above. A joint that turns or slides is a HingedJoint or PrismaticJoint at its place in the map. What a
URDF does not say (classes, boxes for meshes that are not there) is taken from labels.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import quote

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product, rigid, rotation_of
from planlang.geometry.shapes import corners
from planlang.geometry.urdf import Element, Joint, Urdf, numbers, read_urdf
from planlang.ontology.terms import OWL, RDF, XSD, Literal, expand
from planlang.ontology.triples import Parsed, Triples, counted
from planlang.ontology.urdf_labels import Label, Labels, labels_for
from planlang.records import dataclass

NAMESPACE = "http://planlang.org/kb/urdf/"
"""The name that a URDF gives itself is put behind it; links are names in there."""
MOST_LINKS = 5000
"""Links of a world: a house has some hundred."""
FARTHEST = 1000.0
"""Greatest distance from the origin, and greatest extent of a box [m]."""
USUAL = {"prismatic": "Drawer", "revolute": "Door", "continuous": "ControlKnob"}
"""Class of a link of which no label says one, by the joint that moves it."""
SOMETHING = "FurniturePiece"
"""Class of all others."""
SHOWN = 20
"""Links without a box that are reported."""


@dataclass(frozen=True, slots=True)
class _Box:
    pose: Pose
    """Its middle and axes in the frame of the link."""
    size: tuple[float, float, float]


def read_world(path: Path) -> Parsed:
    """Return what a URDF and its labels state; raises BadInput with all that is wrong in them."""
    return _World(read_urdf(path)).read()


class _World:
    def __init__(self, urdf: Urdf) -> None:
        self.file, self.urdf = str(urdf.path), urdf
        name = urdf.tree.get("name") or urdf.path.stem
        self.iri = NAMESPACE + quote(name, safe="")
        self.labels = labels_for(urdf.path, name)
        self.elements = {link.get("name", ""): link for link in urdf.tree.findall("link") if isinstance(link, Element)}
        self.above = {joint.child: joint for joint in urdf.joints}
        self.triples = Triples(self.file)
        self.found: list[Diagnostic] = []
        if len(self.elements) > MOST_LINKS:
            message = f"a world has at most {MOST_LINKS} links; this one has {len(self.elements)}"
            raise BadInput([error("B009", message, Span(self.file, urdf.tree.line))])

    def read(self) -> Parsed:
        """Return the statements."""
        self._say(self.iri, RDF.type, OWL.Ontology, self.urdf.tree)
        poses = self._poses()
        things = {name: box for name in poses if (box := self._box(name)) is not None}
        for name, box in things.items():
            self._state_thing(name, Pose.from_matrix(poses[name]) @ box.pose, box)
            around = self._nearest(name, things)
            if around is not None:
                self._say(self._name(around), expand("properPhysicalParts"), self._name(name), self.elements[name])
            self._state_joint(name, poses[name])
        shown, more = self.found[:SHOWN], len(self.found) - SHOWN
        return Parsed(self.triples, counted(shown, more), others=tuple(one.content for one in self.labels))

    # Statements

    def _state_thing(self, name: str, pose: Pose, box: _Box) -> None:
        iri, element, label = self._name(name), self.elements[name], self._label(name)
        self._say(iri, RDF.type, expand(self._class(name)), element)
        for prop, extent in zip(("depthOfObject", "widthOfObject", "heightOfObject"), box.size, strict=True):
            self._say(iri, expand(prop), _number(extent), element)
        self._state_pose(iri, pose, element)
        for side in label.open if label else ():
            self._say(iri, expand("openSide"), Literal(side), element)
        if label is not None and label.walls is not None:
            self._say(iri, expand("wallThickness"), _number(label.walls), element)

    def _state_pose(self, iri: str, pose: Pose, element: Element) -> None:
        self._say(iri, expand("pose"), f"{iri}_pose", element)
        self._say(f"{iri}_pose", expand("translation"), _row(pose.position), element)
        self._say(f"{iri}_pose", expand("quaternion"), _row(pose.orientation), element)

    def _state_joint(self, name: str, link: Array) -> None:
        """State the joint that moves a link; ``link`` is its pose in the map (4, 4)."""
        joint = self.above.get(name)
        if joint is None or not joint.moves:
            return
        element = self.elements[name]
        iri = f"{self.iri}#{quote(joint.name, safe='')}"
        slides = joint.kind == "prismatic"
        self._say(iri, RDF.type, expand("PrismaticJoint" if slides else "HingedJoint"), element)
        self._say(iri, expand("connectedTo-Rigidly"), self._name(name), element)
        self._say(iri, expand("minJointValue"), _number(joint.lower), element)
        self._say(iri, expand("maxJointValue"), _number(joint.upper), element)
        self._say(iri, expand("direction"), f"{iri}_axis", element)
        self._say(f"{iri}_axis", RDF.type, expand("Vector"), element)
        for prop, value in zip(("vectorX", "vectorY", "vectorZ"), joint.axis.tolist(), strict=True):
            self._say(f"{iri}_axis", expand(prop), _number(value), element)
        self._state_pose(iri, Pose.from_matrix(link), element)

    def _say(self, subject: str, predicate: str, value: str | Literal, element: Element) -> None:
        self.triples.state(subject, predicate, value, Span(self.file, element.line))

    def _name(self, link: str) -> str:
        return f"{self.iri}#{quote(link, safe='')}"

    # What links are

    def _poses(self) -> dict[str, Array]:
        """Return the pose (4, 4) of each link in the map, in the order of the file; all joints are at zero."""
        poses = {self.urdf.root: np.eye(4)}
        below: dict[str, list[Joint]] = {}
        for joint in self.urdf.joints:
            below.setdefault(joint.parent, []).append(joint)
        waiting = [self.urdf.root]
        for link in waiting:
            for joint in below.get(link, ()):
                poses[joint.child] = product(poses[link], joint.origin)
                waiting.append(joint.child)
        far = [name for name in self.elements if not np.abs(poses[name][:3, 3]).max() <= FARTHEST]
        if far:
            message = f"link {far[0]!r} is more than {FARTHEST:g} m away from the origin"
            raise BadInput([error("B009", message, Span(self.file, self.elements[far[0]].line))])
        return {name: poses[name] for name in self.elements}

    def _nearest(self, name: str, things: Mapping[str, _Box]) -> str | None:
        """Return the nearest link above that is a thing."""
        while name in self.above:
            name = self.above[name].parent
            if name in things:
                return name
        return None

    def _label(self, name: str) -> Label | None:
        return next((label for file in self.labels if (label := file.link(name)) is not None), None)

    def _class(self, name: str) -> str:
        labels = (file.link(name) for file in self.labels)
        stated = next((label.cls for label in labels if label is not None and label.cls is not None), None)
        joint = self.above.get(name)
        return stated or USUAL.get("" if joint is None else joint.kind, SOMETHING)

    # Boxes

    def _box(self, name: str) -> _Box | None:
        """Return the box of a link: that of its label, else around its shapes; None, reported, for meshes without."""
        label, element = self._label(name), self.elements[name]
        if label is not None and label.size is not None:
            return _Box(Pose(label.centre), label.size)
        shapes = element.findall("collision") or element.findall("visual")
        boxes = [box for shape in shapes if (box := self._shape(shape, self.labels)) is not None]
        if shapes and not boxes:
            files = ", ".join(mesh.get("filename", "")[:80] for shape in shapes for mesh in shape.iter("mesh"))
            help = "label the link or its mesh in a TOML file beside the URDF: size = [x, y, z]"
            message = f"link {name!r} is left out: nothing tells the box of {files or 'its shape'}"
            self.found.append(warning("M019", message, Span(self.file, element.line), help))
        if not boxes:
            return None
        box = boxes[0] if len(boxes) == 1 else _around(boxes)
        if min(box.size) <= 0 or max(box.size) > FARTHEST:
            message = f"link {name!r} is left out: its box is {' x '.join(f'{e:g}' for e in box.size)} m"
            self.found.append(warning("M019", message, Span(self.file, element.line)))
            return None
        return box

    def _shape(self, shape: ElementTree.Element, labels: tuple[Labels, ...]) -> _Box | None:
        origin = shape.find("origin")
        xyz, rpy = (numbers("0 0 0" if origin is None else origin.get(at, "0 0 0")) for at in ("xyz", "rpy"))
        frame = Pose.from_matrix(rigid(rotation_of(*rpy), np.array(xyz)))
        for geometry in shape.iter("geometry"):
            for solid in geometry:
                if solid.tag == "mesh":
                    file = solid.get("filename", "")
                    label = next((box for one in labels if (box := one.mesh(file)) is not None), None)
                    if label is None or label.size is None:
                        return None
                    scale = np.broadcast_to(numbers(solid.get("scale", "1")), 3)
                    return _Box(frame @ Pose(_triplet(scale * label.centre)), _triplet(np.abs(scale) * label.size))
                size = _extents(solid.tag, solid.attrib)
                return None if size is None else _Box(frame, size)
        return None


def _extents(tag: str, attributes: Mapping[str, str]) -> tuple[float, float, float] | None:
    """Return the extents of a primitive shape along its axes."""

    def stated(name: str) -> float:
        return numbers(attributes.get(name, "0"))[0]

    match tag:
        case "box":
            return _triplet(np.array(numbers(attributes["size"])))
        case "cylinder":
            return (2 * stated("radius"), 2 * stated("radius"), stated("length"))
        case "capsule":
            return (2 * stated("radius"), 2 * stated("radius"), stated("length") + 2 * stated("radius"))
        case "sphere":
            return (2 * stated("radius"),) * 3
    return None


def _around(boxes: list[_Box]) -> _Box:
    """Return the box around several, along the axes of the link."""
    points = np.vstack([corners(box.pose, box.size) for box in boxes])
    low, high = points.min(axis=0), points.max(axis=0)
    return _Box(Pose(_triplet((low + high) / 2)), _triplet(high - low))


def _triplet(values: Array) -> tuple[float, float, float]:
    x, y, z = values.tolist()
    return (x, y, z)


def _number(value: float) -> Literal:
    return Literal(repr(float(value)), XSD.double)


def _row(values: tuple[float, ...]) -> Literal:
    return Literal(" ".join(repr(round(float(value), 9) + 0.0) for value in values))
