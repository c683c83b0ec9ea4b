"""What the format of URDF requires of each element: attributes, children, numbers and their ranges.

Source: https://wiki.ros.org/urdf/XML, and where it leaves something open, the parser urdfdom. PyBullet, which refuses
such files without a reason or crashes, is a little laxer in two places, and so is this: joints may leave out effort and
velocity, inertias the products. What the format leaves optional has its default. ``capsule`` and ``plane`` are shapes
of PyBullet.
"""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from planlang.records import dataclass

TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
"""Types of joints; those that move along or about one axis first."""
FARTHEST = 10_000.0
"""Greatest length [m] and angle [rad]; the limits of real odometry joints go up to 1000 m."""
SLOWEST = 1e-4
"""Least speed limit of a joint [rad/s, m/s]; 0 means that the file states none."""
LONGEST_NAME = 255
"""Greatest length of a name in UTF-8 [bytes]: PyBullet reads names into buffers of 1024 bytes, whole lines included."""
_HEAVIEST = 1e12
"""Greatest mass [kg], moment of inertia, scale, colour or ratio."""


@dataclass(frozen=True, slots=True)
class Attribute:
    """An attribute: text if ``count`` is 0, else so many numbers between ``least`` and ``most``."""

    count: int = 0
    required: bool = False
    least: float = -math.inf
    most: float = math.inf
    blank: bool = False
    """True if the text may be empty."""


@dataclass(frozen=True, slots=True)
class Rule:
    """The attributes and children of an element; others are extensions, and ignored."""

    attributes: dict[str, Attribute]
    children: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
    several: bool = False
    """True if it has any number of each child; else the first of each counts."""


_TEXT, _NAME = Attribute(), Attribute(required=True)
_EXTENT = Attribute(1, True, 0.0, FARTHEST)
_VECTOR = Attribute(3, False, -FARTHEST, FARTHEST)
_FACTOR = Attribute(1, False, -_HEAVIEST, _HEAVIEST)
_MOMENT = Attribute(1, True, -_HEAVIEST, _HEAVIEST)
SHAPES = ("box", "cylinder", "sphere", "capsule", "mesh", "plane")

RULES = {
    "robot": Rule({"name": _NAME}, ("link", "joint", "material"), several=True),
    "link": Rule({"name": _NAME}, ("inertial", "collision", "visual"), several=True),
    "inertial": Rule({}, ("origin", "mass", "inertia"), ("mass", "inertia")),
    "visual": Rule({"name": _TEXT}, ("origin", "geometry", "material"), ("geometry",)),
    "collision": Rule({"name": _TEXT}, ("origin", "geometry"), ("geometry",)),
    "geometry": Rule({}, SHAPES),
    "origin": Rule({"xyz": _VECTOR, "rpy": _VECTOR}),
    "mass": Rule({"value": Attribute(1, True, 0.0, _HEAVIEST)}),
    "inertia": Rule({f"i{ax}": _MOMENT if ax[0] == ax[1] else _FACTOR for ax in ("xx", "xy", "xz", "yy", "yz", "zz")}),
    "box": Rule({"size": Attribute(3, True, 0.0, FARTHEST)}),
    "cylinder": Rule({"radius": _EXTENT, "length": _EXTENT}),
    "capsule": Rule({"radius": _EXTENT, "length": _EXTENT}),
    "sphere": Rule({"radius": _EXTENT}),
    "plane": Rule({"normal": _VECTOR}),
    "mesh": Rule({"filename": _NAME, "scale": Attribute(3, False, -_HEAVIEST, _HEAVIEST)}),
    "material": Rule({"name": Attribute(required=True, blank=True)}, ("color",)),  # SolidWorks names none
    "color": Rule({"rgba": Attribute(4, False, -_HEAVIEST, _HEAVIEST)}),
    "joint": Rule(
        {"name": _NAME, "type": _NAME}, ("origin", "parent", "child", "axis", "limit", "mimic"), ("parent", "child")
    ),
    "parent": Rule({"link": _NAME}),
    "child": Rule({"link": _NAME}),
    "axis": Rule({"xyz": Attribute(3, False, -_HEAVIEST, _HEAVIEST)}),
    "limit": Rule({"lower": Attribute(1), "upper": Attribute(1), "velocity": Attribute(1, False, 0.0)}),
    "mimic": Rule({"joint": _NAME, "multiplier": _FACTOR, "offset": _FACTOR}),
}
"""Tag -> rule; the limits of a joint have ranges that depend on its type."""
WITHOUT_SHAPE = ("robot", "inertial", "mass", "inertia", "material", "color")
"""Elements without shape or pose: only who loads the URDF into a simulator needs them complete."""


def problems_in(element: ElementTree.Element, owner: str = "") -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield what is wrong with an element and those inside it, each with the element at fault.

    ``owner`` names the link or joint around it.
    """
    tag, name = element.tag, element.get("name", "")[:60]
    if tag not in RULES:  # a shape that nobody knows
        return
    rule = RULES[tag]
    what = f"<{tag}> of {owner}" if owner else f"<{tag}> {name!r}" if name else f"<{tag}>"
    if tag in ("link", "joint"):
        owner = f"{tag} {name!r}" if name else f"a {tag}"
    for attribute, wanted in rule.attributes.items():
        text = element.get(attribute)
        if text is None or not (wanted.count or wanted.blank or text.strip()):
            if wanted.required:
                yield f"{what} has no {attribute}", element
        elif wanted.count:
            yield from _number_problems(element, attribute, text, wanted, owner)
        elif attribute != "filename" and len(text.encode()) > LONGEST_NAME:
            yield f"{what} has a {attribute} of more than {LONGEST_NAME} bytes", element
    for missing in rule.required:
        if element.find(missing) is None:
            yield f"{what} has no <{missing}>", element
    if tag == "geometry" and not len(element):
        yield f"{what} has no shape, such as {', '.join(f'<{shape}>' for shape in SHAPES[:5])}", element
    if tag == "joint":
        yield from _joint_problems(element, owner)
    for child in children_of(element):
        yield from problems_in(child, owner)


def children_of(element: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """Yield the children that count: of a geometry its first shape, or what it has instead of one."""
    tag = element.tag
    if tag == "geometry":
        shape = next((child for child in element if child.tag in SHAPES), None)
        yield from element[:1] if shape is None else (shape,)
    elif tag in RULES:
        seen = set()
        for child in element:
            if child.tag in RULES[tag].children and (RULES[tag].several or child.tag not in seen):
                seen.add(child.tag)
                yield child


def _number_problems(
    element: ElementTree.Element, attribute: str, text: str, wanted: Attribute, owner: str
) -> Iterator[tuple[str, ElementTree.Element]]:
    values, tag = numbers(text), element.tag
    what = f"<{tag} {attribute}={text[:60]!r}> of {owner}"
    if len(values) not in ({1, 3} if tag == "mesh" else {wanted.count}):
        yield f"{what}: {wanted.count} finite number(s) expected", element
    elif wanted.least == 0 and min(values) < 0:
        unknown = "; 0 stands for unknown" if attribute == "velocity" else ""
        yield f"{what}: <{tag}> needs a nonnegative {attribute}{unknown}", element
    elif min(values) < wanted.least or max(values) > wanted.most:
        yield f"{what}: numbers of at most {wanted.most:g} expected", element


def _joint_problems(joint: ElementTree.Element, owner: str) -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield what is wrong with type, axis and limits of a joint."""
    kind, axis, limit, mimic = joint.get("type", ""), joint.find("axis"), joint.find("limit"), joint.find("mimic")
    if kind and kind not in TYPES:
        yield f"{owner} has the unknown type {kind[:60]!r}; the types are {', '.join(TYPES)}", joint
    if kind in TYPES[:3] and axis is not None and numbers(axis.get("xyz", "1 0 0")) in _ZEROS:
        yield f"{owner} has an axis of length zero", axis
    if kind not in ("revolute", "prismatic"):
        return
    if limit is None:
        if mimic is None:  # else its range follows from the other joint's
            yield f"{owner} is {kind} and has no <limit>", joint
        return
    lower, upper, speed = (numbers(limit.get(name, "0")) for name in ("lower", "upper", "velocity"))
    if lower and upper and lower[0] > upper[0]:
        yield f"{owner} has limits [{lower[0]}, {upper[0]}] the wrong way round", limit
    if speed and 0 < speed[0] < SLOWEST:
        yield f"{owner} has a velocity of {speed[0]:g}; plausible are {SLOWEST:g} and more, or 0 for unknown", limit


_ZEROS = ((0.0, 0.0, 0.0),)


def slides_too_far(joint: ElementTree.Element) -> str | None:
    """Word why the limits of a sliding joint are beyond :data:`FARTHEST`; None if they are not.

    Joints that move the robot as a whole may go on for ever: files write 999999.
    """
    limit = joint.find("limit")
    if joint.get("type") != "prismatic" or limit is None:
        return None
    lower, upper = (numbers(limit.get(name, "0")) for name in ("lower", "upper"))
    if not lower or not upper or max(-lower[0], upper[0]) <= FARTHEST:
        return None
    name = joint.get("name", "")[:60]
    return f"joint {name!r} has limits [{lower[0]}, {upper[0]}]; at most {FARTHEST:g} m are plausible"


def expressions_in(robot: ElementTree.Element) -> Iterator[tuple[str, ElementTree.Element]]:
    """Yield what xacro has to expand, with the element: its elements, and expressions anywhere but in mesh names."""
    for element in robot.iter():
        if element.tag.startswith("xacro:"):
            yield f"<{element.tag}>", element
        for attribute, text in element.items():
            if attribute != "filename" and ("${" in text or "$(" in text):
                yield f"<{element.tag} {attribute}={text[:60]!r}>", element


def extents_of(shape: ElementTree.Element) -> list[str]:
    """Names of the attributes that hold the extents of a primitive."""
    known = RULES[shape.tag].attributes if shape.tag in RULES else {}
    return [name for name, one in known.items() if one.required and one.count]


def numbers(text: str) -> tuple[float, ...]:
    """Parse the numbers of an attribute; empty unless all are finite, and written as C reads them."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return values if "_" not in text and text.isascii() and all(map(math.isfinite, values)) else ()
