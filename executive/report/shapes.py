"""What a recording draws: boxes, cylinders and spheres of bodies and of a robot's links."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from planlang.protocols import Pose

HERE = Pose((0.0, 0.0, 0.0))
GREY = (150, 150, 155, 255)


@dataclass(frozen=True, slots=True)
class Shape:
    """A primitive, placed in the frame of what it belongs to."""

    kind: str
    """"box", "cylinder" (axis along z) or "sphere"."""
    size: tuple[float, float, float]
    """Extents along x, y and z [m]."""
    pose: Pose = HERE
    colour: tuple[int, int, int, int] = GREY
    """Red, green, blue and opacity, 0..255."""


def link_shapes(urdf: Path) -> dict[str, tuple[Shape, ...]]:
    """The primitives of each link of a robot, in its link frame; links without any are left out.

    Collision elements are drawn where a link has no visual of a primitive: meshes are not read.
    Format: the URDF specification, elements ``visual``, ``collision``, ``geometry``, ``origin``, ``material``.
    """
    robot = ElementTree.parse(urdf).getroot()
    colours = {
        material.get("name"): colour
        for material in robot.iter("material")
        if (colour := _colour(material.find("color"))) is not None
    }
    shapes: dict[str, tuple[Shape, ...]] = {}
    for link in robot.iter("link"):
        drawn = _shapes(link.iter("visual"), colours) or _shapes(link.iter("collision"), colours)
        if drawn:
            shapes[link.get("name", "")] = drawn
    return shapes


def _shapes(
    elements: Iterable[ElementTree.Element], colours: dict[str | None, tuple[int, int, int, int]]
) -> tuple[Shape, ...]:
    shapes: list[Shape] = []
    for element in elements:
        geometry = element.find("geometry")
        found = None if geometry is None else _primitive(geometry)
        if found is not None and min(found[1]) > 0:
            material = element.find("material")
            colour = colours.get(material.get("name"), GREY) if material is not None else GREY
            shapes.append(Shape(*found, _origin(element.find("origin")), colour))
    return tuple(shapes)


def _primitive(geometry: ElementTree.Element) -> tuple[str, tuple[float, float, float]] | None:
    for element in geometry:
        match element.tag:
            case "box":
                x, y, z = _numbers(element.get("size"))
                return "box", (x, y, z)
            case "cylinder":
                diameter = 2 * float(element.get("radius", "0"))
                return "cylinder", (diameter, diameter, float(element.get("length", "0")))
            case "sphere":
                diameter = 2 * float(element.get("radius", "0"))
                return "sphere", (diameter, diameter, diameter)
    return None


def _origin(element: ElementTree.Element | None) -> Pose:
    if element is None:
        return HERE
    roll, pitch, yaw = _numbers(element.get("rpy", "0 0 0"))
    position = _numbers(element.get("xyz", "0 0 0"))
    turned = HERE
    for angle, axis in ((yaw, 2), (pitch, 1), (roll, 0)):  # URDF: roll, then pitch, then yaw about fixed axes
        quaternion = [0.0, 0.0, 0.0, math.cos(angle / 2)]
        quaternion[axis] = math.sin(angle / 2)
        turned = turned @ Pose((0.0, 0.0, 0.0), (quaternion[0], quaternion[1], quaternion[2], quaternion[3]))
    return Pose(position, turned.orientation)


def _colour(element: ElementTree.Element | None) -> tuple[int, int, int, int] | None:
    if element is None:
        return None
    red, green, blue, opacity = (round(255 * float(part)) for part in element.get("rgba", "0.6 0.6 0.6 1").split())
    return red, green, blue, opacity


def _numbers(text: str | None) -> tuple[float, float, float]:
    x, y, z = (float(part) for part in (text or "").split())
    return x, y, z
