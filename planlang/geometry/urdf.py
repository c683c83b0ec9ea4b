"""The URDF reader: parses and checks the tree of links and joints, without loading shapes or meshes.

URDFs are untrusted: planlang/geometry/xml_tree.py reads their elements with lines, urdf_schema.py has what the format
requires.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from planlang.closure import grouped
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note
from planlang.geometry.matrices import Array, cross_matrix, product, rigid, rotation_of
from planlang.geometry.urdf_schema import (
    FARTHEST,
    RULES,
    TYPES,
    WITHOUT_SHAPE,
    children_of,
    expressions_in,
    numbers,
    problems_in,
    slides_too_far,
)
from planlang.geometry.xml_tree import BadXml, Element, read_content, tree_of
from planlang.kept import Latest
from planlang.records import dataclass

XACRO = "this is an expression of xacro; write it out first: xacro {0}.urdf.xacro > {0}.urdf"
"""Advice for a URDF that still has to be expanded."""

KINDS = TYPES[:4]
"""Joint types of kinematic chains; "floating" and "planar" joints are read, but no chain may contain them."""
DIRECTION = "1 0 0"
"""Axis of a joint that states none."""
_SHOWN = 4
"""Names shown in a message."""
_ROUNDED = 1e-3
"""Error in the length of an axis that comes from rounding."""


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: its position is ``multiplier * position(joint) + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint: ``origin`` (4, 4) of the child in the parent at position 0, unit ``axis`` (3,) in the child's frame.

    Limits are in rad or m, ``velocity`` is in rad/s or m/s; continuous joints have the limits -pi and pi. A joint that
    mimics another and states no limits has those that follow from the other's.
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

    def nearest(self, position: float) -> float:
        """Return the position within its limits that is nearest to a position [rad, m]."""
        return min(max(position, self.lower), self.upper)


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
    diagnostics: tuple[Diagnostic, ...] = ()
    """Notes about what was read otherwise than it is written."""
    gaps: tuple[Diagnostic, ...] = ()
    """Errors in masses, materials and the name of the robot, which have no shape or pose."""

    def joint(self, name: str) -> Joint:
        """Find a joint by its name. Raises KeyError."""
        found = next((joint for joint in self.joints if joint.name == name), None)
        if found is None:
            raise KeyError(f"{self.path.name} has no joint {name!r}")
        return found

    def plain(self) -> Element:
        """Copy what the format knows, without extensions; joints have the type, axis and limits that were read."""
        robot = _plain(self.tree)
        for element, joint in zip(robot.findall("joint"), self.joints, strict=True):
            element.set("type", joint.kind)
            axis, limit = element.find("axis"), element.find("limit")
            if (
                axis is not None
            ):  # PyBullet has no default for an axis without direction, and slides along by its length
                stated = np.array(numbers(axis.get("xyz", DIRECTION)))
                is_unit = abs(float(np.linalg.norm(stated)) - 1.0) < _ROUNDED
                axis.set("xyz", axis.get("xyz", DIRECTION) if is_unit else " ".join(map(repr, joint.axis.tolist())))
            if joint.kind in ("revolute", "prismatic") and _limits(limit) != (joint.lower, joint.upper):
                limit = ElementTree.SubElement(element, "limit") if limit is None else limit
                limit.attrib |= {"lower": repr(joint.lower), "upper": repr(joint.upper)}
        return robot


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
_kept: Latest[tuple[Path, bytes], Urdf] = Latest(MOST_KEPT)


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
    checker = _Checker(path, robot)
    root = checker.check()
    joints = _with_followed_limits({element.get("name", ""): _joint(element) for element in robot.findall("joint")})
    found = Urdf(path, content, robot, root, joints, (*checker.endless(), *checker.colours), tuple(checker.gaps))
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


def master_of(joint: Joint, every: Mapping[str, Joint]) -> Mimic:
    """Find what a joint of a checked URDF follows in the end, through others that mimic; itself if it mimics none."""
    multiplier, offset = 1.0, 0.0
    while joint.mimic is not None and joint.mimic.joint in every:
        offset += multiplier * joint.mimic.offset
        multiplier *= joint.mimic.multiplier
        joint = every[joint.mimic.joint]
    return Mimic(joint.name, multiplier, offset)


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


def origin_of(element: ElementTree.Element) -> Array:
    """Read the pose (4, 4) that an element's <origin> states; the identity without one."""
    origin = element.find("origin")
    xyz, rpy = (numbers("0 0 0" if origin is None else origin.get(name, "0 0 0")) for name in ("xyz", "rpy"))
    return rigid(rotation_of(*rpy), np.array(xyz))


def _joint(element: ElementTree.Element) -> Joint:
    """Convert the element of a checked joint."""

    def stated(tag: str, attribute: str, default: str) -> tuple[float, ...]:
        child = element.find(tag)
        return numbers(default if child is None else child.get(attribute, default))

    kind = element.get("type", "")
    axis = np.array(stated("axis", "xyz", DIRECTION))
    lower, upper = _limits(element.find("limit"))
    if kind == "continuous" or _is_endless(element):
        kind, lower, upper = "continuous", -math.pi, math.pi
    follows = element.find("mimic")
    mimic = None
    if follows is not None:
        mimic = Mimic(
            follows.get("joint", ""), stated("mimic", "multiplier", "1")[0], stated("mimic", "offset", "0")[0]
        )
    axis = axis / max(float(np.linalg.norm(axis)), 1e-9)
    velocity = stated("limit", "velocity", "0")[0]
    ends = _linked(element, "parent"), _linked(element, "child")
    return Joint(element.get("name", ""), kind, *ends, origin_of(element), axis, lower, upper, velocity, mimic)


def _limits(limit: ElementTree.Element | None) -> tuple[float, float]:
    lower, upper = ("0", "0") if limit is None else (limit.get("lower", "0"), limit.get("upper", "0"))
    return numbers(lower)[0], numbers(upper)[0]


def _is_endless(joint: ElementTree.Element) -> bool:
    """Check whether a revolute joint has limits that stand for none: converters write 1e16 for a wheel."""
    return joint.get("type") == "revolute" and max(map(abs, _limits(joint.find("limit")))) > FARTHEST


def _with_followed_limits(joints: dict[str, Joint]) -> tuple[Joint, ...]:
    """Give joints that mimic others and have no range of their own the range that follows from the others'."""
    found: dict[str, Joint] = {}

    def completed(joint: Joint) -> Joint:
        mimic = joint.mimic
        if joint.name in found or mimic is None or joint.kind not in ("revolute", "prismatic"):
            return found.setdefault(joint.name, joint)
        if joint.lower == joint.upper == 0:
            other = completed(joints[mimic.joint])
            ends = sorted(mimic.multiplier * end + mimic.offset for end in (other.lower, other.upper))
            joint = replace(joint, lower=ends[0], upper=ends[1])
        return found.setdefault(joint.name, joint)

    return tuple(map(completed, joints.values()))


def _plain(element: ElementTree.Element) -> Element:
    known = RULES[element.tag].attributes if element.tag in RULES else ()
    copied = Element(element.tag, {name: text for name, text in element.items() if name in known})
    copied.line = element.line if isinstance(element, Element) else 1
    copied.extend(
        _plain(child) for child in children_of(element) if child.tag != "color" or not any(problems_in(child))
    )
    return copied


class _Checker:
    """Collects everything that makes a URDF unusable."""

    def __init__(self, path: Path, robot: Element) -> None:
        self.path, self.robot = path, robot
        self.found: list[Diagnostic] = []
        self.gaps: list[Diagnostic] = []
        self.colours: list[Diagnostic] = []

    def check(self) -> str:
        """Run all checks and return the root link; raises BadInput."""
        for what, element in expressions_in(self.robot):  # the first: all other problems may follow from it
            self._bad(f"{what} is not expanded", element, XACRO.format(self.path.stem.removesuffix(".urdf")))
            raise BadInput(self.found)
        links, joints = self._named("link"), self._named("joint")
        if not links:
            self._bad("the robot has no links", self.robot)
        above: dict[str, str] = {}
        for name, joint in joints.items():
            ends = [_linked(joint, end) for end in ("parent", "child")]
            for end, link in zip(("parent", "child"), ends, strict=True):
                if link and link not in links:
                    advice = f'add <link name="{link}"/>, or the file that describes it' if end == "parent" else None
                    self._bad(f"joint {name!r} has a {end} link {link!r} that is not described", joint, advice)
            if ends[1] and ends[1] in above:
                self._bad(f"link {ends[1]!r} hangs from two joints", joint)
            above[ends[1]] = ends[0]
            self._check_mimic(name, joints)
        roots = [name for name in links if name not in above]
        if not self.found and all(child and parent for child, parent in above.items()):
            self._check_roots(links, above, roots)
        for problem, element in problems_in(self.robot):
            assert isinstance(element, Element)
            span = Span(str(self.path), element.line)
            if element.tag == "color":  # the only one that nothing but pictures need
                self.colours.append(note("B010", f"{problem}; it is left out", span))
                continue
            found = self.gaps if element.tag in WITHOUT_SHAPE else self.found
            found.append(error("B009", problem, span))
        bearing = self._bearing(joints, roots)
        for name in (name for name in joints if name not in bearing):
            if (too_far := slides_too_far(joints[name])) is not None:
                limit = joints[name].find("limit")
                self._bad(too_far, joints[name] if limit is None else limit)
        if self.found:
            raise BadInput([*self.found, *self.gaps])
        return roots[0]

    def _bearing(self, joints: Mapping[str, Element], roots: Sequence[str]) -> set[str]:
        """Find the joints above the first link with a shape: they move the robot as a whole."""
        bodiless = {
            link.get("name", "")
            for link in self.robot.findall("link")
            if not link.findall("visual") + link.findall("collision")
        }
        found: set[str] = set()
        reached = set(roots) & bodiless
        while more := {name for name, one in joints.items() if name not in found and _linked(one, "parent") in reached}:
            found |= more
            reached |= {_linked(joints[name], "child") for name in more} & bodiless
        return found

    def endless(self) -> Iterator[Diagnostic]:
        """Yield a note for each revolute joint that is read as continuous."""
        for joint in self.robot.findall("joint"):
            if _is_endless(joint):
                message = f"joint {joint.get('name')!r} turns without end: its limits are beyond {FARTHEST:g} rad"
                line = joint.line if isinstance(joint, Element) else 1
                yield note("B010", message, Span(str(self.path), line), 'write type="continuous"')

    def _check_mimic(self, name: str, joints: Mapping[str, Element]) -> None:
        """Check that a joint that mimics others follows, in the end, one that mimics none."""
        followed, at = [name], joints[name].find("mimic")
        while at is not None and (mimic := joints[followed[-1]].find("mimic")) is not None:
            other = mimic.get("joint", "")
            if other in followed:
                if other == name:  # each joint of a circle is reported once, those that lead to it are not
                    circle = "itself" if len(followed) == 1 else " and ".join((*followed[1:], "so itself"))
                    self._bad(f"joint {name!r} mimics {circle}", at)
                return
            if other not in joints:
                if len(followed) == 1 and other:
                    self._bad(f"joint {name!r} mimics a joint {other!r} that is not described", at)
                return
            followed.append(other)

    def _check_roots(self, links: Mapping[str, Element], above: Mapping[str, str], roots: Sequence[str]) -> None:
        """Check that all links form one tree."""
        if len(roots) > 1:
            message = f"the robot has {len(roots)} separate parts, with the root links {', '.join(roots[:_SHOWN])}"
            alone = ", ".join([root for root in roots if root not in above.values()][:_SHOWN])
            advice = f"nothing hangs from {alone}: remove it, or add" if alone else "add"
            self._bad(message, links[roots[1]], f"{advice} a fixed joint between {roots[0]} and {roots[1]}")
            return
        below = grouped((parent, child) for child, parent in above.items())
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
                if name and name in named:
                    self._bad(f"there are two {tag}s {name!r}", element)
                named[name] = element
        return named

    def _bad(self, message: str, element: ElementTree.Element, help: str | None = None) -> None:
        assert isinstance(element, Element)
        self.found.append(error("B009", message, Span(str(self.path), element.line), help))


def _linked(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")
