"""Reads a world in URDF as the statements of a semantic map: objects with classes, boxes and poses, and their joints.

Each link with a shape becomes an object: a box at the pose of its shape, and a part of the nearest ancestor link that
is an object. A link whose shapes leave much of its footprint free, such as the walls of a room, becomes several boxes:
the largest is the object, the others are its parts. A revolute or prismatic joint becomes a HingedJoint or
PrismaticJoint at its pose in the map. Facts that a URDF cannot state (classes, boxes of missing meshes, open sides)
come from labels: from the TOML file of the same name beside the URDF, else from a bundled one for URDFs of that name,
else from words in the names of links.
"""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Container, Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from planlang.closure import grouped
from planlang.designators import unused_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, unread
from planlang.geometry import Array, Pose
from planlang.geometry.cover import FULL, boxes_of_surface, is_room, is_wide
from planlang.geometry.matrices import product
from planlang.geometry.mesh import BadMesh, Mesh, mesh_content, mesh_of
from planlang.geometry.shapes import corners, outline_of
from planlang.geometry.urdf import Element, Urdf, origin_of, read_urdf
from planlang.geometry.urdf_schema import numbers
from planlang.ontology.terms import MOVED_LINKS, OWL, RDF, URDF_WORLDS, XSD, Literal, expand
from planlang.ontology.triples import Parsed, Triples, counted
from planlang.ontology.urdf_labels import FARTHEST, Label, Triplet, labels_for
from planlang.package_paths import file_places
from planlang.records import dataclass

MOST_LINKS = 5000
"""Greatest number of links of a world; a house has some hundred."""
SOMETHING = "FurniturePiece"
"""Class of all other links."""
SHOWN = 20
"""Greatest number of reported links without a box."""
SHOWN_PLACES = 2
"""Greatest number of places of a missing mesh that a message names."""
FLOOR = 0.05
"""A part of a link up to this height is the floor, which is everywhere at z = 0 [m]."""
SAMPLED = 40
"""Number of points along each side of a footprint at which is checked how much of it shapes cover."""


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
        self.iri = URDF_WORLDS + quote(name, safe="")
        self.labels = labels_for(urdf.path, name)
        self.elements = {link.get("name", ""): link for link in urdf.tree.findall("link") if isinstance(link, Element)}
        self.above = {joint.child: joint for joint in urdf.joints}
        self.triples = Triples(self.file)
        self.found: list[Diagnostic] = []
        self.meshes: dict[str, Mesh | str] = {}
        """Name of a mesh -> the mesh, or why it cannot be read."""
        self.digest = hashlib.sha256()
        """Of the contents of all meshes."""
        if len(self.elements) > MOST_LINKS:
            message = f"a world has at most {MOST_LINKS} links; this one has {len(self.elements)}"
            raise BadInput([error("B009", message, Span(self.file, urdf.tree.line))])

    def read(self) -> Parsed:
        """State all objects and joints."""
        self._say(self.iri, RDF.type, OWL.Ontology, self.urdf.tree)
        poses = self._poses()
        things = {name: boxes for name in poses if (boxes := self._boxes(name, poses[name]))}
        names = set(self.elements)
        for name, (box, *others) in things.items():
            frame = Pose.from_matrix(poses[name])
            self._state_thing(name, frame @ box.pose, box)
            around = self._nearest(name, things)
            if around is not None:
                self._state_part(around, name)
            self._state_joint(name, poses[name])
            for other in others:
                names.add(part := unused_name(name, names))
                self.elements[part] = self.elements[name]
                self._say(self._name(part), RDF.type, expand(SOMETHING), self.elements[name])
                self._state_box(part, frame @ other.pose, other)
                self._state_part(name, part)
        shown, more = self.found[:SHOWN], len(self.found) - SHOWN
        files = (*(one.content for one in self.labels), *((self.digest.digest(),) if self.meshes else ()))
        return Parsed(self.triples, others=files, unread=counted(shown, more))

    # Statements

    def _state_thing(self, name: str, pose: Pose, box: _Box) -> None:
        iri, element, label = self._name(name), self.elements[name], self._label(name)
        self._say(iri, RDF.type, expand(self._class(name)), element)
        self._state_box(name, pose, box)
        for side in label.open if label else ():
            self._say(iri, expand("openSide"), Literal(side), element)
        if label is not None and label.walls is not None:
            self._say(iri, expand("wallThickness"), _number(label.walls), element)

    def _state_box(self, name: str, pose: Pose, box: _Box) -> None:
        iri, element = self._name(name), self.elements[name]
        for prop, extent in zip(("depthOfObject", "widthOfObject", "heightOfObject"), box.size, strict=True):
            self._say(iri, expand(prop), _number(extent), element)
        self._state_pose(iri, pose, element)

    def _state_part(self, whole: str, part: str) -> None:
        self._say(self._name(whole), expand("properPhysicalParts"), self._name(part), self.elements[part])

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
        below = grouped((joint.parent, joint) for joint in self.urdf.joints)
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

    def _nearest(self, name: str, things: Container[str]) -> str | None:
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
        return stated or MOVED_LINKS.get("" if joint is None else joint.kind, SOMETHING)

    # Boxes

    def _boxes(self, name: str, link: Array) -> list[_Box]:
        """Boxes of a link at a pose in the map (4, 4), the largest first: from its label, else around its shapes.

        None for a link without shapes, or, with an error, one whose shapes cannot be read.
        """
        label, element = self._label(name), self.elements[name]
        if label is not None and label.size is not None:
            boxes = [_Box(Pose(label.centre), label.size)]
        else:
            shapes = element.findall("collision") or element.findall("visual")
            try:
                parts = [part for shape in shapes for part in self._shape(shape, link)]
            except _Unread as problem:
                help = "label the link or its mesh in a TOML file beside the URDF: size = [x, y, z]"
                message = f"link {name!r} is not in the world: {problem}"
                self.found.append(unread("M019", message, Span(self.file, problem.line or element.line), help))
                return []
            boxes = _together(parts, link) if parts else []
        sizes = [box.size for box in boxes if min(box.size) <= 0 or max(box.size) > FARTHEST]
        if sizes:
            message = f"link {name!r} is not in the world: its box is {' x '.join(f'{e:g}' for e in sizes[0])} m"
            help = f"correct its shape or its label: lengths are greater than 0 and at most {FARTHEST:g} m"
            self.found.append(unread("M019", message, Span(self.file, element.line), help))
            return []
        return boxes

    def _shape(self, shape: ElementTree.Element, link: Array) -> list[_Box]:
        """Boxes of a shape in the frame of its link. Raises _Unread."""
        frame = Pose.from_matrix(origin_of(shape))
        for solid in (solid for geometry in shape.iter("geometry") for solid in geometry):
            if solid.tag == "mesh":
                return self._mesh(solid, frame, link)
            size = _extents(solid.tag, solid.attrib)
            if size is None:
                raise _Unread(f"<{solid.tag[:40]}> is no shape of URDF", _line(solid))
            return [_Box(frame, size)]
        raise _Unread(f"its {shape.tag} has no shape", _line(shape))

    def _mesh(self, element: ElementTree.Element, frame: Pose, link: Array) -> list[_Box]:
        """Boxes of a mesh: from its label, else those that cover the mesh in its file. Raises _Unread."""
        name, scale = element.get("filename", ""), np.broadcast_to(numbers(element.get("scale", "1")), 3)
        label = next((box for one in self.labels if (box := one.mesh(name)) is not None), None)
        if label is not None and label.size is not None:
            return [_Box(frame @ Pose(_triplet(scale * label.centre)), _triplet(np.abs(scale) * label.size))]
        if name not in self.meshes:
            self.meshes[name] = self._read_mesh(name)
        mesh = self.meshes[name]
        if isinstance(mesh, str):
            raise _Unread(mesh, _line(element))
        up = _vertical(link[:3, :3] @ frame.rotation)
        ends = boxes_of_surface(mesh.vertices * scale, mesh.parts, up)
        return [_Box(frame @ Pose(_triplet((low + high) / 2)), _triplet(high - low)) for low, high in ends]

    def _read_mesh(self, name: str) -> Mesh | str:
        """Read a mesh by the name that the URDF states; the reason if that is impossible."""
        tried, shown = file_places(self.urdf.path, name), name[:120] or "without a file name"
        for place in dict.fromkeys(tried):
            try:
                content = mesh_content(place)
                mesh = mesh_of(content, place.suffix)
            except BadMesh as problem:
                return f"the mesh {shown} cannot be read: {problem}"
            except (OSError, ValueError):
                continue
            self.digest.update(name.encode("utf-8", "replace") + hashlib.sha256(content).digest())
            return mesh
        places = list(dict.fromkeys(str(place) for place in tried))
        more = f" and in {len(places) - SHOWN_PLACES} other folders" if len(places) > SHOWN_PLACES else ""
        return f"there is no mesh {shown}; looked for {', '.join(places[:SHOWN_PLACES])}{more}"


class _Unread(Exception):
    """A shape cannot be read; with the reason and the line."""

    def __init__(self, problem: str, line: int | None) -> None:
        self.line = line
        super().__init__(problem)


def _line(element: ElementTree.Element) -> int | None:
    return element.line if isinstance(element, Element) else None


def _vertical(rotation: Array) -> int:
    """The axis of a frame that is nearest to vertical in the map; ``rotation`` is that of the frame (3, 3)."""
    return int(np.argmax(np.abs(rotation[2])))


def _together(parts: list[_Box], link: Array) -> list[_Box]:
    """One box around the parts of a link, unless they leave much of its footprint free; the largest box first."""
    if len(parts) == 1:
        return parts
    around, up = _around(parts), _vertical(link[:3, :3])
    if not is_wide(around.size, up) or (not is_room(around.size, up) and _covered(parts, around, up) >= FULL):
        return [around]
    tops = [corners(Pose.from_matrix(link) @ one.pose, one.size)[:, 2].max() for one in parts]
    parts = [one for one, top in zip(parts, tops, strict=True) if top > FLOOR] or parts
    return sorted(parts, key=lambda one: -one.size[0] * one.size[1] * one.size[2])


def _covered(parts: Sequence[_Box], around: _Box, up: int) -> float:
    """Share of the footprint of a box that boxes in it cover."""
    axes = [axis for axis in range(3) if axis != up]
    at = (np.arange(SAMPLED) + 0.5) / SAMPLED - 0.5
    points = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2) * np.take(around.size, axes)
    points += np.take(around.pose.position, axes)
    covered = np.zeros(len(points), dtype=bool)
    for part in parts:
        outline = outline_of(corners(part.pose, part.size)[:, axes])
        edges = np.roll(outline, -1, axis=0) - outline
        aside = points[:, None] - outline[None]
        covered |= (edges[:, 0] * aside[..., 1] - edges[:, 1] * aside[..., 0] >= -1e-9).all(axis=1)
    return float(covered.mean())


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
