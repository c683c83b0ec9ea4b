"""Makes a robot's URDF ready for PyBullet: checked, without extensions, with shapes in place of absent meshes.

Format: https://wiki.ros.org/urdf/XML. PyBullet itself refuses a file with one absent mesh, reads lines of at most 1024
characters, says what it dislikes on stdout only, and moves no joint that mimics another.
"""

from __future__ import annotations

import copy
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.geometry import Array
from planlang.geometry.matrices import angles_of, product, rotation_of
from planlang.geometry.urdf import Joint, extents_of, numbers, read_urdf
from planlang.geometry.xml_tree import Element, tree_of
from sim.meshes import THINNEST, find_mesh, inertia_box

MOST_JOINTS = 127
"""PyBullet gives the poses of this many links."""
_KEPT = {"robot", "link", "joint", "material"}
_SHOWN = 4


@dataclass(frozen=True, slots=True)
class Follower:
    """A joint that moves with another: its position is ``multiplier`` times the other's plus ``offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class Description:
    """A URDF that PyBullet can load."""

    path: Path
    """The file that was read."""
    text: str
    """What PyBullet gets."""
    root: str
    """The link that hangs from no joint."""
    followers: Mapping[str, tuple[Follower, ...]]
    """Joint -> those that mimic it, directly or not."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """At most one warning, about meshes."""


MOST_KEPT = 8
"""Descriptions that are kept."""
_meshless: dict[tuple[Path, bytes], Description] = {}
"""By file and content those that depend on nothing else: no mesh may come or go."""


def read_description(path: Path) -> Description:
    """Read and check a URDF, put shapes in place of absent meshes; raises BadInput with all that is wrong.

    A mesh that is not there or cannot be read is replaced: for contacts by the box that has the link's mass and
    inertia, for looks by the link's shapes for contacts; by nothing if there are none.
    """
    urdf = read_urdf(path)
    if (path, urdf.content) in _meshless:
        return _meshless[path, urdf.content]
    if len(urdf.joints) > MOST_JOINTS:
        message = f"the robot has {len(urdf.joints)} joints; the simulator takes at most {MOST_JOINTS}"
        raise BadInput([error("B009", message, Span(str(path), urdf.tree.line))])
    robot = tree_of(urdf.content)  # changed below
    for child in list(robot):
        if child.tag not in _KEPT:
            robot.remove(child)
    _without_empty_shapes(robot)
    meshless = next(robot.iter("mesh"), None) is None
    absent, bare = _without_absent_meshes(path, robot)
    found = (_warned(absent, bare, path),) if absent else ()
    ElementTree.indent(robot)
    description = Description(path, ElementTree.tostring(robot, "unicode"), urdf.root, _followers(urdf.joints), found)
    if meshless:
        while len(_meshless) >= MOST_KEPT:
            del _meshless[next(iter(_meshless))]
        _meshless[path, urdf.content] = description
    return description


@contextmanager
def loadable(description: Description) -> Iterator[Path]:
    """A temporary file with the description, for as long as PyBullet reads it."""
    with tempfile.TemporaryDirectory(prefix="planlang-") as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(description.text, encoding="utf-8")
        yield path


def _without_empty_shapes(robot: Element) -> None:
    """Real files have boxes of size 0 0 0 where nothing is meant; what is flat is given a thickness."""
    for link in robot.findall("link"):
        for shape in (*link.findall("collision"), *link.findall("visual")):
            for primitive in shape.iterfind("geometry/*"):
                names = extents_of(primitive)
                extents = {name: numbers(primitive.get(name, "")) for name in names}
                if names and max(map(max, extents.values())) <= 0:
                    link.remove(shape)
                    break
                for name, values in extents.items():
                    primitive.set(name, _text([max(value, THINNEST) if value == 0 else value for value in values]))


# Meshes


def _without_absent_meshes(path: Path, robot: Element) -> tuple[list[tuple[str, int]], list[str]]:
    """Replace meshes by files that are there, or by shapes.

    Names and lines of the absent ones, in order, and links that have no shape for contacts any more.
    """
    absent: list[tuple[str, int]] = []
    bare: list[str] = []
    known: dict[str, Path | None] = {}

    def is_absent(shape: ElementTree.Element) -> bool:
        mesh = shape.find("geometry/mesh")
        if mesh is None:
            return False
        name = mesh.get("filename", "")
        if name not in known:
            known[name] = find_mesh(path, name)
        file = known[name]
        if file is None:
            assert isinstance(mesh, Element)
            absent.append((name, mesh.line))
            return True
        mesh.set("filename", str(file))
        return False

    for link in robot.findall("link"):
        collisions, visuals = ([s for s in link.findall(kind) if is_absent(s)] for kind in ("collision", "visual"))
        for shape in (*collisions, *visuals):
            link.remove(shape)
        if collisions:
            link.extend(_box_of(link))
            if link.find("collision") is None:
                bare.append(link.get("name", ""))
        if visuals:
            link.extend(_looks_of(link))
    for texture_holder in robot.iter("material"):
        for texture in texture_holder.findall("texture"):
            texture_holder.remove(texture)
    return absent, bare


def _box_of(link: ElementTree.Element) -> list[ElementTree.Element]:
    """The box of the link's inertia as a collision element, if the link has one."""
    inertial = link.find("inertial")
    mass, moments = (None if inertial is None else inertial.find(tag) for tag in ("mass", "inertia"))
    if inertial is None or mass is None or moments is None:
        return []
    xx, xy, xz, yy, yz, zz = (float(moments.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    box = inertia_box(float(mass.get("value", "0")), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if box is None:
        return []
    extents, axes = box
    position, turned = _origin(inertial.find("origin"))
    collision = ElementTree.Element("collision")
    ElementTree.SubElement(collision, "origin", xyz=_text(position), rpy=_text(angles_of(product(turned, axes))))
    ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), "box", size=_text(extents))
    return [collision]


def _looks_of(link: ElementTree.Element) -> list[ElementTree.Element]:
    """The link's collision elements as visual ones."""
    looks = []
    for shape in link.findall("collision"):
        visual = ElementTree.Element("visual")
        visual.extend(copy.deepcopy(part) for part in shape if part.tag in ("origin", "geometry"))
        looks.append(visual)
    return looks


def _origin(element: ElementTree.Element | None) -> tuple[tuple[float, ...], Array]:
    xyz, rpy = ("0 0 0" if element is None else element.get(name, "0 0 0") for name in ("xyz", "rpy"))
    return numbers(xyz), rotation_of(*numbers(rpy))


def _text(values: Sequence[float] | Array) -> str:
    return " ".join(repr(round(float(value), 12)) for value in values)


def _warned(absent: Sequence[tuple[str, int]], bare: Sequence[str], path: Path) -> Diagnostic:
    names = list(dict.fromkeys(name for name, _ in absent))
    count = f"{len(names)} meshes are" if len(names) != 1 else "a mesh is"
    message = f"{count} not there or cannot be read; simple shapes stand in for them: {_some(names)}"
    if bare:
        links = f"{len(bare)} links have" if len(bare) != 1 else "a link has"
        message += f"; {links} no usable inertia either, so no shape: {_some(bare)}"
    advice = "put the packages that hold them beside the URDF, as OBJ, DAE or binary STL"
    return warning("B013", message, Span(str(path), absent[0][1]), advice)


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


# Joints that follow others


def _followers(joints: Sequence[Joint]) -> dict[str, tuple[Follower, ...]]:
    """Return per joint those that mimic it; chains of them are resolved, circles left out."""
    mimics = {joint.name: joint.mimic for joint in joints if joint.mimic is not None and joint.moves}
    found: dict[str, list[Follower]] = {}
    for name, mimic in mimics.items():
        master, multiplier, offset, seen = mimic.joint, mimic.multiplier, mimic.offset, {name}
        while master in mimics and master not in seen:
            seen.add(master)
            offset += multiplier * mimics[master].offset
            multiplier *= mimics[master].multiplier
            master = mimics[master].joint
        if master not in seen:
            found.setdefault(master, []).append(Follower(name, multiplier, offset))
    return {name: tuple(followers) for name, followers in found.items()}
