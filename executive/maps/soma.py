"""Maps in the words of SOMA: shapes, poses, parts and joints of objects, restated in the words of KnowRob.

SOMA, the ontology of KnowRob 2, states shape and place of an object as qualities, whose regions have the numbers:
``hasShape`` a Shape that ``hasRegion`` a BoxShape, CylinderShape, SphereShape or MeshShape; ``hasLocalization`` a
Localization that ``hasSpaceRegion`` a 6DPose. Files leave out one step or the other. The frame of an object is the
centre of its shape, unless the shape has an origin of its own (``hasOrigin``). Properties are known by their local
names, which have moved between namespaces (EASE, EASE-OBJ, SOMA-OBJ, SOMA, urdf).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from executive.maps.link_names import LINKS, with_links
from planlang.designators import local_name, unused_name
from planlang.diagnostics import Diagnostic, note, unread
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of
from planlang.measures import EXTENTS, LARGEST, lengths
from planlang.ontology import BNode, Literal, Ontology, Term, Triple, expand
from planlang.ontology.documents import Reading
from planlang.ontology.terms import RDF, XSD
from planlang.ontology.triples import Triples
from planlang.package_paths import file_places
from planlang.records import dataclass
from planlang.spelling import guess

SHAPES, SHAPE_OF = ("hasShape", "hasShapeRegion", "hasCollisionShape"), ("isShapeOf", "isShapeRegionOf")
PLACES, PLACE_OF = ("hasLocalization", "hasSpaceRegion", "hasPose"), ("isLocalizationOf",)
OF_OBJECTS = ("hasShape", "hasCollisionShape", "hasLocalization", "hasPose")
"""Those of them that no quality has."""
REGIONS = ("hasRegion", "hasShapeRegion", "hasSpaceRegion")
SIZES = ("hasDepth", "hasLength", "hasWidth", "hasHeight", "hasRadius", "hasFilePath")
POSITIONS = ("translation", "hasPositionVector", "hasPositionData", "hasPosition")
TURNS = ("quaternion", "hasOrientationVector", "hasOrientation", "hasQuaternion")
FRAMES = ("relativeTo", "hasReferenceFrame")
PARTS, WHOLES = ("hasPhysicalComponent", "hasComponent", "hasPart"), ("isPhysicalComponentOf", "isComponentOf")
INSIDE, ON = ("isInsideOf",), ("isOntopOf", "isSupportedBy")
CHILD, CHILD_OF = ("hasChildLink",), ("isChildLinkOf",)
PARENT, PARENT_OF = ("hasParentLink",), ("isParentLinkOf",)
LIMITS = ("hasJointLimit", "hasJointLimits")
LOWER, UPPER = ("hasJointPositionMin", "hasLowerLimit"), ("hasJointPositionMax", "hasUpperLimit")
STATES, POSITION = ("hasJointState", "hasJointPosition"), ("hasJointPosition", "hasPosition")
AXES, AXIS = ("hasJointAxis",), ("hasAxisVector",)
WORDS = (*SHAPES, *SHAPE_OF, *PLACES, *PLACE_OF, *CHILD, *CHILD_OF, *INSIDE, *ON)
"""Properties by one of which such a file is known."""
READ = (
    *WORDS, *REGIONS, *SIZES, *POSITIONS, *TURNS, *FRAMES, *PARTS, *WHOLES, *CHILD_OF, *PARENT, *PARENT_OF, *LIMITS,
    *LOWER, *UPPER, *STATES, *POSITION, *AXES, *AXIS, "hasOrigin",
)  # fmt: skip
"""All properties that are read of such a file."""
COMPONENTS = ("vectorX", "vectorY", "vectorZ")
MAP_FRAMES = frozenset(("", "map", "world"))
"""Names of the frame of a map, without slashes."""
JOINTS: dict[str, tuple[str, str]] = {"PrismaticJoint": ("PrismaticJoint", "Drawer")}
JOINTS |= dict.fromkeys(("RevoluteJoint", "HingeJoint", "ContinuousJoint"), ("HingedJoint", "Door"))
"""Class of a joint (local name) -> its class in KnowRob's words, and that of a leaf whose class says nothing."""
LEAVES = ("Door", "Drawer", "DoorwayCovering", "ContainerLid", "ControlKnob")
NOT_TURNED = Literal("0 0 0 1")


def in_known_words(ontology: Ontology, notes: list[Diagnostic]) -> Ontology:
    """Add what an ontology states in SOMA's words in those of maps, with an error for what cannot be read.

    An ontology without such words is returned unchanged.
    """
    if ontology.properties_named(*LINKS):
        ontology = with_links(ontology, notes)
    if not ontology.properties_named(*WORDS):
        return ontology
    return ontology.extended(_Restatement(ontology, notes).readings())


@dataclass(frozen=True, slots=True)
class _Frame:
    """The numbers of a pose as they are stated, and what it is relative to."""

    at: Triple
    """States the position."""
    translation: Literal
    quaternion: Literal
    relative_to: Triple | None = None


class _Restatement:
    def __init__(self, ontology: Ontology, notes: list[Diagnostic]) -> None:
        self.ontology, self.notes = ontology, notes
        self.stated: dict[str, list[Triple]] = {}
        """Restated triples by the file that they restate."""
        self.unnamed: dict[BNode, str] = {}
        """Object without an IRI -> the IRI that it is given."""
        self.used = {str(triple.subject) for triple in ontology.using(*WORDS)}
        self.shapes = self._linked(SHAPES, SHAPE_OF)
        self.places = self._linked(PLACES, PLACE_OF)
        self.framed: dict[str, str] = {}
        """Object whose shape has an origin of its own -> IRI of its frame."""

    def readings(self) -> list[Reading]:
        """Restate everything; gives one reading for each file."""
        origins = {thing: origin for thing, links in self.shapes.items() if (origin := self._shape(thing, links))}
        self.framed = {thing: self._free(f"{thing}_frame") for thing in origins}
        for thing, links in self.places.items():
            self._place(thing, links, origins.get(thing))
        for whole, part, triple in self._pairs(PARTS, WHOLES):
            if whole in self.shapes:  # others, such as the map itself, are nothing that a thing could be fixed to
                self._say(whole, "properPhysicalParts", part, triple)
        for words, prop in ((INSIDE, "in-ContGeneric"), (ON, "on-Physical")):
            for one, other, triple in self._pairs(words, ()):
                self._say(one, prop, other, triple)
        self._joints()
        documents = {str(one.path): one for one in self.ontology.documents}
        return [
            Reading(replace(documents[file], path=Path(f"{file}#")), Triples.of(triples, file), ())
            for file, triples in self.stated.items()
        ]

    def _say(self, subject: str, prop: str, value: Term, source: Triple) -> None:
        predicate = prop if prop == RDF.type else expand(prop)
        self.stated.setdefault(source.span.file, []).append(Triple(subject, predicate, value, source.span))

    def _free(self, iri: str) -> str:
        name = unused_name(iri, self.used)
        self.used.add(name)
        return name

    # Links

    def _linked(self, words: tuple[str, ...], inverses: tuple[str, ...]) -> dict[str, list[Triple]]:
        """Collect the links of each individual by these properties, or by their inverses from the other side."""
        links: dict[str, list[Triple]] = {}
        for subject, _, triple in self._ends(words, inverses):
            iri = subject if isinstance(subject, str) and self.ontology.is_individual(subject) else None
            if isinstance(subject, BNode) and local_name(triple.predicate) in OF_OBJECTS:
                iri = self._named(subject, triple)
            if iri is not None:
                links.setdefault(iri, []).append(triple)
        return links

    def _named(self, node: BNode, source: Triple) -> str | None:
        """Name an object without an IRI after its class; None for what has no class."""
        classes = self.ontology.types(node)
        if node not in self.unnamed and classes:
            base = (self.ontology.iri or "http://planlang.org/kb/map.owl").rstrip("#")
            iri = self.unnamed[node] = self._free(f"{base}#{local_name(classes[0])}_1")
            for cls in classes:
                self._say(iri, RDF.type, cls, source)
            message = f"an object without a name, of the class {local_name(classes[0])}, is called {local_name(iri)}"
            self.notes.append(note("M033", message, source.span))
        return self.unnamed.get(node)

    def _ends(self, words: tuple[str, ...], inverses: tuple[str, ...]) -> Iterator[tuple[Term, Term, Triple]]:
        yield from ((one.subject, one.object, one) for one in self.ontology.using(*words))
        if inverses:
            for one in self.ontology.using(*inverses):
                if not isinstance(one.object, Literal):
                    yield one.object, one.subject, replace(one, subject=one.object, object=one.subject)

    def _pairs(self, words: tuple[str, ...], inverses: tuple[str, ...]) -> Iterator[tuple[str, str, Triple]]:
        """Yield the pairs of individuals that a property relates."""
        for one, other, triple in self._ends(words, inverses):
            if isinstance(one, str) and isinstance(other, str) and self.ontology.is_individual(other):
                yield one, other, triple

    def _regions(self, links: Iterable[Triple], marks: tuple[str, ...]) -> Iterator[str | BNode]:
        """Yield the regions at the end of links, or of a quality between, that state one of ``marks``."""
        for link in links:
            if isinstance(link.object, Literal):
                continue
            steps = [link.object, *(one.object for one in self.ontology.said(link.object, *REGIONS))]
            yield from (one for one in steps if not isinstance(one, Literal) and self._last(one, marks))

    def _last(self, subject: str | BNode, names: tuple[str, ...]) -> Triple | None:
        """The last literal that a subject states by the first of these properties that it uses."""
        for name in names:
            stated = [one for one in self.ontology.said(subject, name) if isinstance(one.object, Literal)]
            if stated:
                return stated[-1]
        return None

    def _node(self, subject: str | BNode, *names: str) -> str | BNode | None:
        nodes = (one.object for one in self.ontology.said(subject, *names))
        return next((one for one in nodes if not isinstance(one, Literal)), None)

    # Shapes

    def _shape(self, thing: str, links: list[Triple]) -> _Frame | None:
        """Restate the size of an object; gives the frame of its shape in that of the object, if it has its own."""
        for region in self._regions(links, SIZES):
            depth, long, wide, tall, radius, path = (self._last(region, (name,)) for name in SIZES)
            sides = (depth or long, wide, tall)
            if radius is not None:
                sides = (None, None, long or tall)
                self._say(thing, "radius", radius.object, radius)
                numbers = self._numbers(radius)
                if sides[2] is None and numbers:  # a sphere
                    self._say(thing, "heightOfObject", Literal(repr(2 * numbers[0]), XSD.double), radius)
            elif path is not None and not any(sides):
                return self._mesh(thing, region, path)
            for prop, side in zip(EXTENTS, sides, strict=True):
                if side is not None:
                    self._say(thing, prop, side.object, side)
            return self._origin(region)
        self._unread(thing, links[0])
        return None

    def _origin(self, region: str | BNode) -> _Frame | None:
        origin = self._node(region, "hasOrigin", "hasSpaceRegion")
        return None if origin is None else self._frame(origin)

    def _mesh(self, thing: str, region: str | BNode, path: Triple) -> _Frame | None:
        """Restate the bounding box of a mesh; gives the frame of its centre."""
        name, scale = _text(path), self._last(region, ("hasShapeScale",))
        factors = (self._numbers(scale) if scale is not None else None) or (1.0,)
        try:
            low, high = _bounds(Path(path.span.file), name, factors)
        except BadMesh as problem:
            help = "put the mesh beside the map, or state hasDepth, hasWidth and hasHeight"
            message = f"the shape of {local_name(thing)} is the mesh {name[:120]}: {problem}"
            self.notes.append(unread("M033", message, path.span, help))
            return None
        for prop, side in zip(EXTENTS, (high - low).tolist(), strict=True):
            self._say(thing, prop, Literal(repr(side), XSD.double), path)
        x, y, z = ((low + high) / 2).tolist()
        centre, own = Pose((x, y, z)), self._origin(region)
        frame = centre if own is None else self._pose(own) @ centre
        return _Frame(path, _row(frame.position), _row(frame.orientation))

    def _pose(self, frame: _Frame) -> Pose:
        place, turn = (self._numbers(replace(frame.at, object=one)) for one in (frame.translation, frame.quaternion))
        if place is None or turn is None or len(place) != 3 or len(turn) != 4 or not any(turn):
            self._unread(local_name(str(frame.at.subject)), frame.at)
            return IDENTITY
        return Pose(place, turn)

    def _numbers(self, stated: Triple) -> tuple[float, ...] | None:
        return lengths(replace(stated, object=Literal(_text(stated))), self.notes, LARGEST)

    def _unread(self, thing: str, link: Triple) -> None:
        message = (
            f"the shape or pose of {local_name(thing)} is stated by {local_name(link.predicate)}, which is not read"
        )
        help = "its region must state hasDepth, hasWidth and hasHeight, or hasPositionVector and hasOrientationVector"
        self.notes.append(unread("M033", message, link.span, f"{help}: see docs/reference/formats.md"))

    # Places

    def _place(self, thing: str, links: list[Triple], origin: _Frame | None) -> None:
        """Restate the pose of an object: that of its frame, and in it that of the centre of its shape."""
        frame = next((one for region in self._regions(links, POSITIONS) if (one := self._frame(region))), None)
        if frame is None:
            self._unread(thing, links[0])
            return
        own = self._free(f"{thing}_pose")
        self._say(thing, "pose", own, frame.at)
        if origin is not None:
            self._state(own, replace(origin, relative_to=None))
            self._say(own, "relativeTo", self.framed[thing], origin.at)
        self._state(self.framed.get(thing, own), frame)

    def _frame(self, region: str | BNode) -> _Frame | None:
        """Read the pose that a region states; None if it states no position."""
        at, turn = self._last(region, POSITIONS), self._last(region, TURNS)
        if at is None:
            return None
        words = _text(at).split()
        both = len(words) == 7 and turn is None  # position and quaternion in one
        quaternion = Literal(" ".join(words[3:])) if both else Literal(_text(turn)) if turn else NOT_TURNED
        relative = next(self.ontology.said(region, *FRAMES), None)
        return _Frame(at, Literal(" ".join(words[:3] if both else words)), quaternion, relative)

    def _state(self, pose: str, frame: _Frame) -> None:
        self._say(pose, "translation", frame.translation, frame.at)
        self._say(pose, "quaternion", frame.quaternion, frame.at)
        if frame.relative_to is not None and (parent := self._parent(frame.relative_to)) is not None:
            self._say(pose, "relativeTo", parent, frame.relative_to)

    def _parent(self, stated: Triple) -> str | None:
        """IRI of the frame that a pose is relative to, which may be stated by its name; None for that of the map."""
        if isinstance(stated.object, BNode):
            return None
        name = _text(stated).strip("/") if isinstance(stated.object, Literal) else stated.object
        if name in MAP_FRAMES:
            return None
        named = self.frames.get(name, name)
        return self.framed.get(named, named)

    @cached_property
    def frames(self) -> dict[str, str]:
        """Name of a frame -> object: the local name of its IRI, or that of its link in a URDF."""
        names = {local_name(thing): thing for thing in (*self.places, *self.shapes)}
        links = (one for one in self.ontology.using(*LINKS) if isinstance(one.subject, str))
        return names | {_text(one): str(one.subject) for one in links}

    # Joints

    def _joints(self) -> None:
        children: dict[str | BNode, Triple] = {}
        for joint, child, triple in self._ends(CHILD, CHILD_OF):
            if isinstance(joint, (str, BNode)) and isinstance(child, str) and self._is_link(child, triple):
                children.setdefault(joint, triple)
        parents = {}
        for joint, parent, triple in self._ends(PARENT, PARENT_OF):
            parents[joint] = parent
            if isinstance(parent, str):
                self._is_link(parent, triple)
        for joint, triple in children.items():
            self._joint(joint, str(triple.object), parents.get(joint), triple)

    def _is_link(self, iri: str, source: Triple) -> bool:
        """Check whether the map describes what a joint connects, with an error if it does not."""
        if self.ontology.is_individual(iri):
            return True
        if not self.ontology.defined(iri):
            message = f"a joint connects {local_name(iri)}, which the map does not describe"
            near = guess(local_name(iri), (local_name(one) for one in (*self.shapes, *self.places)))
            self.notes.append(unread("M033", message, source.span, f"{near}give it a class"))
        return False

    def _joint(self, joint: str | BNode, child: str, parent: Term | None, source: Triple) -> None:
        """Restate a joint; one between a leaf and its handle is that of the leaf."""
        classes = [above for cls in self.ontology.types(joint) for above in self.ontology.ancestors(cls)]
        kind = next((JOINTS[name] for name in map(local_name, classes) if name in JOINTS), None)
        is_handle = self.ontology.is_a(child, "Handle")
        leaf = parent if is_handle and kind is not None and isinstance(parent, str) else child
        if isinstance(parent, str) and parent != leaf and parent in self.shapes:
            self._say(parent, "properPhysicalParts", leaf, source)
        if kind is None or not isinstance(leaf, str):
            return
        cls, usual = kind
        iri = joint if isinstance(joint, str) else self._free(f"{leaf}_joint")
        self._say(iri, RDF.type, expand(cls), source)
        self._say(iri, "connectedTo-Rigidly", leaf, source)
        if not self.ontology.any_is_a((leaf,), LEAVES):
            self._say(leaf, RDF.type, expand(usual), source)
        for node in self._limits(joint, classes):
            for words, prop in ((LOWER, "minJointValue"), (UPPER, "maxJointValue")):
                if (limit := self._last(node, words)) is not None:
                    self._say(iri, prop, limit.object, limit)
        state = self._node(joint, *STATES) or joint
        if (position := self._last(state, POSITION)) is not None:
            self._say(iri, "jointPosition", position.object, position)
        self._axis(joint, iri, cls, parent)

    def _limits(self, joint: str | BNode, classes: Iterable[str]) -> Iterator[str | BNode]:
        """Yield the limits of a joint: those it states itself, else those of its nearest class."""
        if (own := self._node(joint, *LIMITS)) is not None:
            yield own
            return
        restrictions = (one for cls in classes for one in self.ontology.restrictions(cls))
        fillers = (one.filler for one in restrictions if local_name(one.property) in LIMITS)
        yield from [one for one in fillers if not isinstance(one, Literal)][:1]

    def _axis(self, joint: str | BNode, iri: str, cls: str, parent: Term | None) -> None:
        """Restate axis and origin of a joint, the latter in the frame of its parent link."""
        node, origin = self._node(joint, *AXES), self._node(joint, "hasOrigin")
        axis = None if node is None else self._last(node, AXIS)
        frame = None if origin is None else self._frame(origin)
        numbers = self._numbers(axis) if axis is not None else None
        if axis is None or numbers is None or len(numbers) != 3 or frame is None or not isinstance(parent, str):
            return
        self._say(iri, "direction", f"{iri}_axis", axis)
        for prop, number in zip(COMPONENTS, numbers, strict=True):
            self._say(f"{iri}_axis", prop, Literal(repr(number), XSD.double), axis)
        self._say(iri, "pose", f"{iri}_pose", frame.at)
        self._state(f"{iri}_pose", replace(frame, relative_to=None))
        if parent in self.places:
            self._say(f"{iri}_pose", "relativeTo", self.framed.get(parent, parent), frame.at)


def _text(stated: Triple) -> str:
    """Text of a value, without the brackets and commas of lists."""
    text = stated.object.value if isinstance(stated.object, Literal) else str(stated.object)
    return text.translate(_BRACKETS)


_BRACKETS = str.maketrans("[](),", "     ")


def _row(numbers: Iterable[float]) -> Literal:
    return Literal(" ".join(repr(round(float(one), 9) + 0.0) for one in numbers))


def _bounds(owl: Path, name: str, factors: tuple[float, ...]) -> tuple[Array, Array]:
    """Ends of the bounding box of a mesh beside a map, each (3,) [m]. Raises BadMesh.

    For safety nothing is read outside the folder of the map and the one above it: packages have folders owl and meshes.
    """
    roots = (owl.resolve().parent, owl.resolve().parent.parent) if owl.is_file() else ()
    for place in file_places(owl, name):
        try:
            path = place.resolve()
            if path.is_file() and any(path.is_relative_to(root) for root in roots):
                vertices = mesh_of(mesh_content(path), path.suffix).vertices * np.broadcast_to(factors, 3)
                return vertices.min(axis=0), vertices.max(axis=0)
        except (OSError, ValueError):
            continue
    raise BadMesh("there is no such file in the folder of the map, nor in the one above it")
