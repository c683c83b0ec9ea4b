"""Reads a world in URDF as the statements of a semantic map: objects with classes, boxes and poses, and their joints.

Each link with a shape becomes an object: a box at the pose of its shape, and a part of the nearest ancestor link that
is an object. A revolute or prismatic joint becomes a HingedJoint or PrismaticJoint at its pose in the map. Facts that
a URDF cannot state (classes, boxes of missing meshes, open sides) come from labels: from the TOML file of the same name
beside the URDF, else from a bundled one for URDFs of that name, else from words in the names of links.
"""

from __future__ import annotations

import re
import tomllib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from fnmatch import fnmatchcase
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import bundled, decode, read_file
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product, rigid, rotation_of
from planlang.geometry.shapes import corners
from planlang.geometry.urdf import Element, Joint, Urdf, read_urdf
from planlang.geometry.urdf_schema import numbers
from planlang.ontology.terms import OWL, RDF, XSD, Literal, expand, is_vocabulary
from planlang.ontology.triples import Parsed, Triples, counted
from planlang.records import dataclass

NAMESPACE = "http://planlang.org/kb/urdf/"
"""Start of the ontology IRI of a URDF, followed by the name of its robot element; links are names in there."""
MOST_LINKS = 5000
"""Greatest number of links of a world; a house has some hundred."""
FARTHEST = 1000.0
"""Greatest distance from the origin, and greatest length of a box or a label [m]."""
USUAL = {"prismatic": "Drawer", "revolute": "Door", "continuous": "ControlKnob"}
"""Type of the joint above a link -> class of the link, if no label has one."""
SOMETHING = "FurniturePiece"
"""Class of all other links."""
SHOWN = 20
"""Greatest number of reported links without a box."""
LARGEST = 1_000_000
"""Greatest size of a file of labels [bytes]."""
MOST_LABELS = 2000
"""Greatest number of labelled links, and of meshes, in a file."""
SIDES = ("+x", "-x", "+y", "-y", "+z", "-z")
_KEYS = {"": ("robot", "meshes", "links"), "meshes": ("size", "centre")}
_KEYS["links"] = ("class", *_KEYS["meshes"], "open", "walls")

Triplet = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class _Box:
    pose: Pose
    """Pose of its centre in the frame of the link."""
    size: Triplet


def read_world(path: Path) -> Parsed:
    """Read the statements of a URDF and its labels. Raises BadInput with all errors in them."""
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
        """State all objects and joints."""
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
        """Compute the pose (4, 4) of each link in the map with all joints at zero, in the order of the file."""
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
        """Find the nearest ancestor link that is an object."""
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
        """Box of a link: from its label, else around its shapes; None, with a warning, if no mesh has a box."""
        label, element = self._label(name), self.elements[name]
        if label is not None and label.size is not None:
            return _Box(Pose(label.centre), label.size)
        shapes = element.findall("collision") or element.findall("visual")
        boxes = [box for shape in shapes if (box := self._shape(shape, self.labels)) is not None]
        if shapes and not boxes:
            files = ", ".join(mesh.get("filename", "")[:80] for shape in shapes for mesh in shape.iter("mesh"))
            help = "label the link or its mesh in a TOML file beside the URDF: size = [x, y, z]"
            message = f"link {name!r} is ignored: the size of {files or 'its shape'} is unknown"
            self.found.append(warning("M019", message, Span(self.file, element.line), help))
        if not boxes:
            return None
        box = boxes[0] if len(boxes) == 1 else _around(boxes)
        if min(box.size) <= 0 or max(box.size) > FARTHEST:
            message = f"link {name!r} is ignored: its box is {' x '.join(f'{e:g}' for e in box.size)} m"
            help = f"correct its shape or its label: lengths are greater than 0 and at most {FARTHEST:g} m"
            self.found.append(warning("M019", message, Span(self.file, element.line), help))
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


def _extents(tag: str, attributes: Mapping[str, str]) -> Triplet | None:
    """Extents of a primitive shape along its axes [m]; None for other shapes."""

    def length(name: str) -> float:
        return numbers(attributes.get(name, "0"))[0]

    match tag:
        case "box":
            return _triplet(np.array(numbers(attributes["size"])))
        case "cylinder":
            return (2 * length("radius"), 2 * length("radius"), length("length"))
        case "capsule":
            return (2 * length("radius"), 2 * length("radius"), length("length") + 2 * length("radius"))
        case "sphere":
            return (2 * length("radius"),) * 3
    return None


def _around(boxes: list[_Box]) -> _Box:
    """Bounding box of several boxes along the axes of the link."""
    points = np.vstack([corners(box.pose, box.size) for box in boxes])
    low, high = points.min(axis=0), points.max(axis=0)
    return _Box(Pose(_triplet((low + high) / 2)), _triplet(high - low))


def _triplet(values: Array) -> Triplet:
    x, y, z = values.tolist()
    return (x, y, z)


def _number(value: float) -> Literal:
    return Literal(repr(float(value)), XSD.double)


def _row(values: tuple[float, ...]) -> Literal:
    return Literal(" ".join(repr(round(float(value), 9) + 0.0) for value in values))


# Labels


@dataclass(frozen=True, slots=True)
class Label:
    """Label of a link, or of a mesh: then with ``size`` and ``centre`` only."""

    span: Span
    cls: str | None = None
    """Class of the object: a bare name of the vocabulary, or an IRI."""
    size: Triplet | None = None
    """Extents of its box [m]."""
    centre: Triplet = (0.0, 0.0, 0.0)
    """Centre of the box in the frame of the link, or of the mesh [m]."""
    open: tuple[str, ...] = ()
    """Open sides of the box, such as "+x"; a box with open sides is hollow."""
    walls: float | None = None
    """Thickness of its walls [m]."""


@dataclass(slots=True)
class Labels:
    """Labels of one file; names are shell patterns (fnmatch), of which the first match counts."""

    content: bytes
    """Bytes of the file."""
    robot: str | None = None
    """Name of the robot element of URDFs that it applies to; None: any."""
    meshes: dict[str, Label] = field(default_factory=dict)
    """File name of a mesh, without folder and suffix -> label."""
    links: dict[str, Label] = field(default_factory=dict)

    def link(self, name: str) -> Label | None:
        """Label of a link, if any."""
        return self.links.get(name) or _first(name, self.links)

    def mesh(self, file: str) -> Label | None:
        """Label with the box of a mesh, if any."""
        return _first(_stem(file), self.meshes)


def _first(name: str, patterns: Mapping[str, Label]) -> Label | None:
    return next((label for pattern, label in patterns.items() if fnmatchcase(name, pattern)), None)


def _stem(file: str) -> str:
    return re.split(r"[/\\]", file)[-1].rpartition(".")[0]


def labels_for(urdf: Path, robot: str) -> tuple[Labels, ...]:
    """Find the labels for a URDF, in order of precedence. Raises BadInput if the file beside it is invalid."""
    beside = urdf.with_suffix(".toml")
    own = (read_labels(beside),) if beside.is_file() else ()
    return (*own, *(one for one in _bundled() if one.robot in (robot, None)))


@cache
def _bundled() -> tuple[Labels, ...]:
    """Read the bundled labels; those for any URDF come last."""
    folder = bundled("ontologies") / "environments" / "labels"
    return tuple(sorted(map(read_labels, sorted(folder.glob("*.toml"))), key=lambda one: one.robot is None))


def read_labels(path: Path) -> Labels:
    """Read a file of labels. Raises BadInput with all its errors (M020)."""
    content = read_file(path, "M020", largest=LARGEST)
    text = decode(content, str(path)) if content.strip() else ""
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as problem:
        line = re.search(r"line (\d+)", str(problem))
        raise BadInput([error("M020", f"not TOML: {problem}", Span(str(path), int(line[1]) if line else 1))]) from None
    reader = _Reader(path, text.splitlines())
    labels = Labels(content)
    reader.read(table, labels)
    if reader.found:
        raise BadInput(reader.found)
    return labels


class _Reader:
    def __init__(self, path: Path, lines: Sequence[str]) -> None:
        self.path, self.lines = path, lines
        self.found: list[Diagnostic] = []

    def read(self, table: Mapping[str, Any], labels: Labels) -> None:
        """Read the labels of a table; errors are appended to ``found``."""
        self._check_keys("", table, self._span(""))
        robot = table.get("robot")
        if robot is not None and not isinstance(robot, str):
            self._bad("robot must be a string: the name of the URDF's robot element", self._span("robot"))
        labels.robot = robot if isinstance(robot, str) else None
        labels.meshes.update(self._entries("meshes", table))
        labels.links.update(self._entries("links", table))
        for label in labels.meshes.values():
            if label.size is None:
                self._bad("the label of a mesh needs a size = [x, y, z]", label.span)

    def _entries(self, kind: str, table: Mapping[str, Any]) -> Iterator[tuple[str, Label]]:
        entries = table.get(kind, {})
        if not isinstance(entries, dict) or len(entries) > MOST_LABELS:
            self._bad(f"{kind} must be a table of at most {MOST_LABELS} names", self._span(kind))
            return
        for name, entry in entries.items():
            span = self._span(name)
            if not isinstance(entry, dict):
                self._bad(f"{name} must be a table; its keys are {', '.join(_KEYS[kind])}", span)
                continue
            self._check_keys(kind, entry, span)
            yield name, self._label(entry, span)

    def _label(self, entry: Mapping[str, Any], span: Span) -> Label:
        size, centre = (self._lengths(entry, name, span) for name in ("size", "centre"))
        if size is not None and min(size) <= 0:
            self._bad("the three lengths of size must be greater than 0", span)
            size = None
        cls = self._of_kind(entry, "class", str, "the name of a class", span)
        if cls is not None and not is_vocabulary(cls) and ":" not in cls:
            self._bad(f"the vocabulary has no class {cls[:60]!r}", span)
        walls = self._of_kind(entry, "walls", (int, float), "a length in metres", span)
        if walls is not None and not 0 < walls <= FARTHEST:
            self._bad(f"walls must be a length in metres, greater than 0 and at most {FARTHEST:g}", span)
            walls = None
        sides = entry.get("open", ())
        sides = [sides] if isinstance(sides, str) else sides
        if not isinstance(sides, (list, tuple)) or not all(side in SIDES for side in sides):
            self._bad(f"open must be one or more of {', '.join(SIDES)}", span)
            sides = ()
        return Label(span, cls, size, centre or (0.0, 0.0, 0.0), tuple(sides), walls)

    def _of_kind(self, entry: Mapping[str, Any], name: str, kind: Any, what: str, span: Span) -> Any:
        value = entry.get(name)
        if value is not None and (not isinstance(value, kind) or isinstance(value, bool) or value == ""):
            self._bad(f"{name} must be {what}", span)
            return None
        return value

    def _lengths(self, entry: Mapping[str, Any], name: str, span: Span) -> Triplet | None:
        values = entry.get(name)
        if values is None:
            return None
        if isinstance(values, list) and len(values) == 3 and all(map(_is_length, values)):
            x, y, z = map(float, values)
            return (x, y, z)
        self._bad(f"{name} must be three lengths in metres, along x, y and z", span)
        return None

    def _check_keys(self, kind: str, table: Mapping[str, Any], span: Span) -> None:
        for key in table:
            if key not in _KEYS[kind]:
                self._bad(f"unknown key {key[:60]!r}; valid keys are {', '.join(_KEYS[kind])}", self._span(key, span))

    def _span(self, key: str, otherwise: Span | None = None) -> Span:
        """Position of the first line that defines a key."""
        quoted = re.compile(rf"""\s*(\[?links\.|\[?meshes\.|\[)?["']?{re.escape(key)}["']?\s*[=\].]""")
        line = next((n for n, line in enumerate(self.lines, 1) if key and quoted.match(line)), None)
        return Span(str(self.path), line) if line else otherwise or Span(str(self.path))

    def _bad(self, message: str, span: Span) -> None:
        self.found.append(error("M020", message, span))


def _is_length(value: object) -> bool:
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return number and isfinite(float(value)) and abs(float(value)) <= FARTHEST  # type: ignore[arg-type]
