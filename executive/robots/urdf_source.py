"""Where a robot's URDF comes from: a file, a file of an installed package, maybe put on a base of a primitive shape.

What is not a plain file is composed once, kept in the user's cache, and written to a folder of each process.
"""

from __future__ import annotations

import atexit
import hashlib
import shutil
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from planlang.cache import Cache
from planlang.geometry.mesh import mesh_places
from planlang.geometry.xml_tree import BadXml, Element, read_content, read_tree

VERSION = 1
"""Raised whenever the same source is written otherwise."""
_CACHE = Cache("urdf", most=50)
BASE, MOUNT = "mobile_base", "mobile_base_mount"
"""Link and joint of a base that is added."""


class NotInstalled(Exception):
    """The package that holds a URDF is not there."""


@dataclass(frozen=True, slots=True)
class Mount:
    """A box or an upright cylinder on the floor, on which the URDF's root link stands."""

    size: tuple[float, ...]
    """Extents in x, y, z, or diameter and height [m]."""
    at: tuple[float, float, float]
    """Where the root link is in the frame of the base, which is in the middle of the base's floor [m]."""


def packaged(name: str, file: str) -> Path:
    """A file of an installed distribution, by the end of its path; raises NotInstalled."""
    try:
        entries = distribution(name).files or ()
    except (PackageNotFoundError, ValueError):
        raise NotInstalled(f"the package {name} is not installed") from None
    wanted = Path(file).parts
    for entry in entries:
        if entry.parts[-len(wanted) :] == wanted and (path := Path(str(entry.locate()))).is_file():
            return path.resolve()
    raise NotInstalled(f"the installed package {name} has no {file}")


def composed(urdf: Path, mount: Mount | None) -> Path:
    """A copy of a URDF whose meshes are named by full paths, on a base if one is asked for.

    A URDF that cannot be read is returned as it is, so that its reader tells what is wrong with it.
    """
    try:
        facts = repr((VERSION, str(urdf), hashlib.sha256(read_content(urdf)).hexdigest(), mount))
        content = _CACHE.load(facts)
        if content is None:
            content = _text(urdf, mount).encode()
            _CACHE.keep(facts, content)
    except BadXml:
        return urdf
    path = _own_folder() / f"{urdf.stem}-{hashlib.sha256(facts.encode()).hexdigest()[:32]}.urdf"
    path.write_bytes(content)
    return path


@cache
def _own_folder() -> Path:
    """A folder of this process alone: what PyBullet reads there is what was written there."""
    folder = tempfile.mkdtemp(prefix="planlang-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def _text(urdf: Path, mount: Mount | None) -> str:
    robot = read_tree(urdf)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        found = next((place for place in mesh_places(urdf, name) if place.is_file()), None)
        if found is not None:
            mesh.set("filename", str(found.resolve()))
    if mount is not None:
        _put_on(robot, mount)
    for child in list(robot):
        if child.tag not in ("link", "joint", "material"):
            robot.remove(child)  # extensions that some readers stumble over
    ElementTree.indent(robot)  # PyBullet reads lines of 1024 characters at most
    return ElementTree.tostring(robot, "unicode")


def _put_on(robot: Element, mount: Mount) -> None:
    children = {child.get("link") for child in robot.iterfind("joint/child")}
    roots = [name for link in robot.findall("link") if (name := link.get("name")) not in children]
    base = ElementTree.Element("link", name=BASE)
    height = mount.size[-1]
    for kind in ("collision", "visual"):
        shape = ElementTree.SubElement(base, kind)
        ElementTree.SubElement(shape, "origin", xyz=f"0 0 {height / 2!r}")
        geometry = ElementTree.SubElement(shape, "geometry")
        if len(mount.size) == 3:
            ElementTree.SubElement(geometry, "box", size=" ".join(map(repr, mount.size)))
        else:
            ElementTree.SubElement(geometry, "cylinder", radius=repr(mount.size[0] / 2), length=repr(height))
    joint = ElementTree.Element("joint", name=MOUNT, type="fixed")
    ElementTree.SubElement(joint, "origin", xyz=" ".join(map(repr, mount.at)))
    ElementTree.SubElement(joint, "parent", link=BASE)
    ElementTree.SubElement(joint, "child", link=roots[0] or "" if roots else "")
    robot.insert(0, base)
    robot.insert(1, joint)
