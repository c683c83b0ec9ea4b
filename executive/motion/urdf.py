"""Joints of a URDF file (http://wiki.ros.org/urdf/XML/joint), read without loading shapes or meshes."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from executive.motion.errors import BadRobotDescription, NoSuchChain
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, product, rotation_of

KINDS = ("revolute", "continuous", "prismatic", "fixed")
"""Joint types that a chain may contain; "floating" and "planar" are read and refused there."""


@dataclass(frozen=True, slots=True)
class Mimic:
    """A joint that follows another: its position is ``multiplier * position(joint) + offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One joint: ``origin`` (4, 4) of the child in the parent at zero, unit ``axis`` (3,) in the child's frame.

    Limits are in rad or m, ``velocity`` in rad/s or m/s; those of continuous joints are (-pi, pi), their range.
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


@dataclass(frozen=True, slots=True)
class Variable:
    """How a joint of a chain gets its position: ``multiplier * q[index] + offset``; index None is a fixed position."""

    index: int | None
    multiplier: float = 1.0
    offset: float = 0.0


def displacement(joint: Joint, value: float) -> Array:
    """The motion (4, 4) of a joint's child at a position, in the child's frame at zero."""
    moved = np.eye(4)
    if joint.kind == "prismatic":
        moved[:3, 3] = joint.axis * value
    elif joint.kind != "fixed":
        cross = cross_matrix(joint.axis)
        moved[:3, :3] += cross * np.sin(value) + product(cross, cross) * (1 - np.cos(value))
    return moved


def read_joints(path: Path) -> tuple[Joint, ...]:
    """All joints of a URDF file in its order; raises :class:`BadRobotDescription`."""
    try:
        root = ElementTree.parse(path).getroot()
    except OSError as error:
        raise BadRobotDescription(path, f"cannot be read ({error.strerror})") from error
    except ElementTree.ParseError as error:
        raise BadRobotDescription(path, f"is not well-formed XML ({error})") from error
    if root.tag != "robot":
        raise BadRobotDescription(path, f"is not URDF: its root element is <{root.tag}>, not <robot>")
    return tuple(_joint(path, element) for element in root.findall("joint"))


def joints_between(joints: Iterable[Joint], base_link: str, tip_link: str) -> tuple[Joint, ...]:
    """The joints from ``base_link`` out to ``tip_link``, base first; raises :class:`NoSuchChain`."""
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


def _joint(path: Path, element: ElementTree.Element) -> Joint:
    name, kind = element.get("name", ""), element.get("type", "")

    def bad(problem: str) -> BadRobotDescription:
        return BadRobotDescription(path, f"joint {name!r} {problem}")

    def numbers(tag: str, attribute: str, default: str) -> list[float]:
        child = element.find(tag)
        text = default if child is None else child.get(attribute, default)
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != len(default.split()) or not all(map(math.isfinite, values)):
            raise bad(f"has <{tag} {attribute}={text!r}>, expected {len(default.split())} number(s)")
        return values

    def link(tag: str) -> str:
        child = element.find(tag)
        found = None if child is None else child.get("link")
        if not found:
            raise bad(f"names no {tag} link")
        return found

    origin = np.eye(4)
    origin[:3, :3] = rotation_of(*numbers("origin", "rpy", "0 0 0"))
    origin[:3, 3] = numbers("origin", "xyz", "0 0 0")
    axis = np.array(numbers("axis", "xyz", "1 0 0"))
    length = float(np.linalg.norm(axis))
    if kind in KINDS[:3] and length < 1e-9:
        raise bad("has an axis of length zero")
    lower, upper = numbers("limit", "lower", "0")[0], numbers("limit", "upper", "0")[0]
    velocity = numbers("limit", "velocity", "0")[0]
    if kind == "continuous":
        lower, upper = -math.pi, math.pi
    elif kind in ("revolute", "prismatic") and not lower <= upper:
        raise bad(f"has limits [{lower}, {upper}] the wrong way round")
    mimic = None
    follows = element.find("mimic")
    if follows is not None:
        master = follows.get("joint", "")
        mimic = Mimic(master, numbers("mimic", "multiplier", "1")[0], numbers("mimic", "offset", "0")[0])
    return Joint(
        name, kind, link("parent"), link("child"), origin, axis / max(length, 1e-9), lower, upper, velocity, mimic
    )
