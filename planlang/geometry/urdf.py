"""The URDF reader: parses and checks the tree of links and joints, without loading shapes or meshes.

Format: https://wiki.ros.org/urdf/XML. URDFs are untrusted: the XML parser refuses entities and external references,
limits size and depth, and records the line of each element.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from xml.parsers import expat

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import open_regular, read_at_most
from planlang.geometry.matrices import Array, cross_matrix, product, rigid, rotation_of
from planlang.records import dataclass

LARGEST = 16_000_000
"""Limit in bytes; robot descriptions have up to 0.3 MB."""
DEEPEST = 100
"""Maximum nesting of elements."""
MOST = 200_000
"""Maximum number of elements."""


XACRO = "this is an expression of xacro; write it out first: xacro {0}.urdf.xacro > {0}.urdf"
"""Advice for a URDF that still has to be expanded."""
_OPTIONAL = re.compile(r"\$\(optenv +\w+ ?([^()]*)\)")
"""An expression that xacro leaves to the environment; its default is read, so that equal files are equal robots."""


class BadXml(Exception):
    """A file was refused; with the problem and the line."""

    def __init__(self, problem: str, line: int = 1) -> None:
        self.problem, self.line = problem, line
        super().__init__(f"line {line}: {problem}")


class Element(ElementTree.Element):
    """An element with its line in the file; namespace prefixes are part of its tag."""

    line = 1

    def __deepcopy__(self, memo: object) -> Element:
        """Copy the element with its line."""
        copied = Element(self.tag, dict(self.attrib))
        copied.line, copied.text = self.line, self.text
        copied.extend(deepcopy(child) for child in self)
        return copied


def read_tree(path: Path) -> Element:
    """Parse a file and return its root element; raises :class:`BadXml`."""
    return tree_of(read_content(path))


def tree_of(content: bytes, *, texts: bool = False) -> Element:
    """Parse XML and return its root element, with the text between the tags if ``texts`` is True.

    Raises :class:`BadXml`.
    """
    return _Reader(texts).read(content)


def read_content(path: Path) -> bytes:
    """Read a regular file. Raises BadXml."""
    try:
        with open_regular(path) as file:
            content = read_at_most(file, LARGEST + 1)
    except FileNotFoundError:
        raise BadXml("there is no such file") from None
    except OSError as problem:
        raise BadXml(f"it cannot be read: {problem.strerror}") from None
    if len(content) > LARGEST:
        raise BadXml(f"it is larger than {LARGEST // 1_000_000} MB")
    return content


class _Reader:
    def __init__(self, texts: bool) -> None:
        self._root: Element | None = None
        self._open: list[Element] = []
        self._count = 0
        self._parser = expat.ParserCreate()
        self._parser.StartElementHandler = self._start
        self._parser.EndElementHandler = self._end
        self._texts: list[str] = []
        self._has_defaults = False
        if texts:
            self._parser.buffer_text = True
            self._parser.CharacterDataHandler = self._texts.append
        self._parser.EntityDeclHandler = self._entity

    def read(self, content: bytes) -> Element:
        self._has_defaults = b"$(optenv" in content
        try:
            self._parser.Parse(content, True)
        except expat.ExpatError as problem:
            reason = expat.ErrorString(problem.code) or "not well-formed"
            raise BadXml(f"it is not XML: {reason}", problem.lineno) from None
        except (LookupError, ValueError) as problem:
            raise BadXml(f"it is not XML: {problem}") from None
        if self._root is None:
            raise BadXml("it is empty")
        return self._root

    def _end(self, name: str) -> None:
        element = self._open.pop()
        if self._texts and not len(element):  # text between children has no meaning in these formats
            element.text = "".join(self._texts)
        self._texts.clear()

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        self._count += 1
        self._texts.clear()
        if len(self._open) >= DEEPEST or self._count > MOST:
            raise BadXml("its elements are too many, or too deeply nested", self._parser.CurrentLineNumber)
        if self._has_defaults:
            attributes = {key: _OPTIONAL.sub(r"\1", value) for key, value in attributes.items()}
        element = Element(name, attributes)
        element.line = self._parser.CurrentLineNumber
        if self._open:
            self._open[-1].append(element)
        else:
            self._root = element
        self._open.append(element)

    def _entity(self, name: str, *_: object) -> None:
        raise BadXml(f"it declares an entity ({name}), which is refused", self._parser.CurrentLineNumber)


KINDS = ("revolute", "continuous", "prismatic", "fixed")
"""Joint types of kinematic chains; "floating" and "planar" joints are read, but no chain may contain them."""

_NUMBERS = {
    ("origin", "xyz"): 3,
    ("origin", "rpy"): 3,
    ("axis", "xyz"): 3,
    ("box", "size"): 3,
    ("cylinder", "radius"): 1,
    ("cylinder", "length"): 1,
    ("capsule", "radius"): 1,
    ("capsule", "length"): 1,
    ("sphere", "radius"): 1,
    ("mesh", "scale"): 3,
    ("color", "rgba"): 4,
    ("mass", "value"): 1,
    ("limit", "lower"): 1,
    ("limit", "upper"): 1,
    ("limit", "velocity"): 1,
    ("limit", "effort"): 1,
    ("mimic", "multiplier"): 1,
    ("mimic", "offset"): 1,
    **{("inertia", f"i{axes}"): 1 for axes in ("xx", "xy", "xz", "yy", "yz", "zz")},
}
"""(element, attribute) -> number of values."""
_SHOWN = 4
"""Names shown in a message."""


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: its position is ``multiplier * position(joint) + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint: ``origin`` (4, 4) of the child in the parent at position 0, unit ``axis`` (3,) in the child's frame.

    Limits are in rad or m, ``velocity`` is in rad/s or m/s; continuous joints have the limits -pi and pi.
    """

    name: str
    kind: str
    parent: str
    child: str
    origin: Array
    axis: Array
    lower: float
    upper: float
    velocity: float
    mimic: Mimic | None

    @property
    def moves(self) -> bool:
        """True if it moves along or about an axis, itself or as the mimic of another joint."""
        return self.kind in KINDS[:3]


@dataclass(frozen=True, slots=True, eq=False)
class Urdf:
    """A URDF that passed all checks."""

    path: Path
    """The file that was read."""
    content: bytes
    """Content of the file."""
    tree: Element
    """Root element; copy it before changing it."""
    root: str
    """The link that is no joint's child."""
    joints: tuple[Joint, ...]
    """The joints, in the order of the file."""


class NoSuchChain(Exception):
    """No chain of joints leads from the base link to the tip link."""

    def __init__(self, base_link: str, tip_link: str, problem: str, links: Iterable[str]) -> None:
        self.base_link = base_link
        self.tip_link = tip_link
        self.links = tuple(links)
        shown = ", ".join(self.links[:12]) + (", ..." if len(self.links) > 12 else "")
        super().__init__(f"no chain from {base_link!r} to {tip_link!r}: {problem} (links: {shown})")


MOST_KEPT = 8
"""Number of cached descriptions; a run reads its robot several times, and looks at the bundled ones."""
_kept: dict[tuple[Path, bytes], Urdf] = {}


def read_urdf(path: Path) -> Urdf:
    """Read and check a URDF; raises BadInput with all problems found (B009)."""
    try:
        content = read_content(path)
        if (path, content) in _kept:
            return _kept[path, content]
        robot = tree_of(content)
    except BadXml as problem:
        raise BadInput([error("B009", problem.problem, Span(str(path), problem.line))]) from None
    if robot.tag != "robot":
        message = f"is not URDF: its root element is <{robot.tag}>, not <robot>"
        raise BadInput([error("B009", message, Span(str(path), robot.line))])
    root = _Checker(path, robot).check()
    found = Urdf(path, content, robot, root, tuple(_joint(element) for element in robot.findall("joint")))
    while len(_kept) >= MOST_KEPT:
        del _kept[next(iter(_kept))]
    _kept[path, content] = found
    return found


def displacement(joint: Joint, value: float) -> Array:
    """Motion (4, 4) of a joint's child from position 0 to ``value``, in the child's frame (Rodrigues' formula)."""
    moved = np.eye(4)
    if joint.kind == "prismatic":
        moved[:3, 3] = joint.axis * value
    elif joint.kind != "fixed":
        cross = cross_matrix(joint.axis)
        moved[:3, :3] += cross * np.sin(value) + product(cross, cross) * (1 - np.cos(value))
    return moved


def joints_between(joints: Iterable[Joint], base_link: str, tip_link: str) -> tuple[Joint, ...]:
    """List the joints from ``base_link`` to ``tip_link``; raises :class:`NoSuchChain`."""
    to_child: dict[str, Joint] = {}
    links: dict[str, None] = {}
    for joint in joints:
        to_child.setdefault(joint.child, joint)
        links.update({joint.parent: None, joint.child: None})
    for link in (base_link, tip_link):
        if link not in links:
            raise NoSuchChain(base_link, tip_link, f"there is no link {link!r}", links)
    found: list[Joint] = []
    link = tip_link
    while link != base_link:
        above = to_child.get(link)
        if above is None or len(found) > len(links):
            raise NoSuchChain(base_link, tip_link, f"{tip_link!r} does not hang from {base_link!r}", links)
        found.append(above)
        link = above.parent
    return tuple(reversed(found))


def _joint(element: ElementTree.Element) -> Joint:
    """Convert the element of a checked joint."""

    def stated(tag: str, attribute: str, default: str) -> tuple[float, ...]:
        child = element.find(tag)
        return numbers(default if child is None else child.get(attribute, default))

    kind = element.get("type", "")
    origin = rigid(rotation_of(*stated("origin", "rpy", "0 0 0")), np.array(stated("origin", "xyz", "0 0 0")))
    axis = np.array(stated("axis", "xyz", "1 0 0"))
    lower, upper = stated("limit", "lower", "0")[0], stated("limit", "upper", "0")[0]
    if kind == "continuous":
        lower, upper = -math.pi, math.pi
    follows = element.find("mimic")
    mimic = None
    if follows is not None:
        mimic = Mimic(
            follows.get("joint", ""), stated("mimic", "multiplier", "1")[0], stated("mimic", "offset", "0")[0]
        )
    axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    velocity = stated("limit", "velocity", "0")[0]
    ends = _linked(element, "parent"), _linked(element, "child")
    return Joint(element.get("name", ""), kind, *ends, origin, axis, lower, upper, velocity, mimic)


class _Checker:
    """Collects everything that makes a URDF unusable."""

    def __init__(self, path: Path, robot: Element) -> None:
        self.path, self.robot = path, robot
        self.found: list[Diagnostic] = []

    def check(self) -> str:
        """Run all checks and return the root link; raises BadInput."""
        links, joints = self._named("link"), self._named("joint")
        if not links:
            self._bad("the robot has no links", self.robot)
        above: dict[str, str] = {}
        for name, joint in joints.items():
            ends = [_linked(joint, end) for end in ("parent", "child")]
            for end, link in zip(("parent", "child"), ends, strict=True):
                if link not in links:
                    problem = f"has a {end} link {link!r} that is not described" if link else f"names no {end} link"
                    self._bad(f"joint {name!r} {problem}", joint)
            if ends[1] in above:
                self._bad(f"link {ends[1]!r} hangs from two joints", joint)
            above[ends[1]] = ends[0]
        roots = [name for name in links if name not in above]
        if not self.found:
            self._check_roots(links, above, roots)
        self._numbers()
        for name, joint in joints.items():
            self._range(name, joint)
        if self.found:
            raise BadInput(self.found)
        return roots[0]

    def _check_roots(self, links: Mapping[str, Element], above: Mapping[str, str], roots: Sequence[str]) -> None:
        """Check that all links form one tree."""
        if len(roots) > 1:
            message = f"the robot has {len(roots)} separate parts, with the root links {', '.join(roots[:_SHOWN])}"
            self._bad(message, links[roots[1]])
            return
        below: dict[str, list[str]] = {}
        for child, parent in above.items():
            below.setdefault(parent, []).append(child)
        hanging = list(roots)
        for name in hanging:
            hanging += below.get(name, ())
        held = set(hanging)
        circling = [name for name in links if name not in held]
        if circling:
            self._bad(f"the joints form a loop through the links {', '.join(circling[:_SHOWN])}", links[circling[0]])

    def _named(self, tag: str) -> dict[str, Element]:
        named: dict[str, Element] = {}
        for element in self.robot:
            assert isinstance(element, Element)
            if element.tag == tag:
                name = element.get("name", "")
                if not name:
                    self._bad(f"a {tag} has no name", element)
                elif name in named:
                    self._bad(f"there are two {tag}s {name!r}", element)
                named[name] = element
        return named

    def _numbers(self) -> None:
        for element in self.robot.iter():
            for attribute, text in element.items():
                wanted = _NUMBERS.get((element.tag, attribute))
                if wanted is not None and len(numbers(text)) not in ({1, 3} if element.tag == "mesh" else {wanted}):
                    message = f"<{element.tag} {attribute}={text[:60]!r}>: {wanted} finite number(s) expected"
                    self._bad(message, element, XACRO.format(self.path.stem) if "${" in text or "$(" in text else None)
        for geometry in self.robot.iter("geometry"):
            for shape in geometry:
                needed = extents_of(shape)
                values = [value for attribute in needed for value in numbers(shape.get(attribute, ""))]
                if needed and not (values and min(values) >= 0):
                    self._bad(f"<{shape.tag}> needs a nonnegative {' and '.join(needed)}", shape)

    def _range(self, name: str, joint: Element) -> None:
        """Report moving joints with a zero axis or with reversed limits."""
        kind, axis, limit = joint.get("type", ""), joint.find("axis"), joint.find("limit")
        if kind in KINDS[:3] and axis is not None and not any(numbers(axis.get("xyz", "1 0 0"))):
            self._bad(f"joint {name!r} has an axis of length zero", joint)
        if kind in ("revolute", "prismatic") and limit is not None:
            lower, upper = (numbers(limit.get(end, "0")) for end in ("lower", "upper"))
            if lower and upper and lower[0] > upper[0]:
                self._bad(f"joint {name!r} has limits [{lower[0]}, {upper[0]}] the wrong way round", joint)

    def _bad(self, message: str, element: ElementTree.Element, help: str | None = None) -> None:
        assert isinstance(element, Element)
        self.found.append(error("B009", message, Span(str(self.path), element.line), help))


def _linked(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def extents_of(shape: ElementTree.Element) -> list[str]:
    """Names of the attributes that hold the extents of a primitive."""
    return [attribute for tag, attribute in _NUMBERS if tag == shape.tag and tag != "mesh"]


def numbers(text: str) -> tuple[float, ...]:
    """Parse the numbers of an attribute; empty unless all are finite."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return values if all(map(math.isfinite, values)) else ()
