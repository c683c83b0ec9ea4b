"""Prepare a robot's URDF for PyBullet: check meshes, substitute shapes for missing ones, strip extensions.

PyBullet itself refuses a file with one missing mesh, crashes on a broken one, reads lines of at most 1024 characters,
reports warnings on stdout only, and does not move joints that mimic another. Where a robot has more links than it
takes, links that never move are merged into those that carry them: frames without a shape go first, since nothing can
touch them; the merged ones keep their names and poses (:attr:`Description.merged`).
"""

from __future__ import annotations

import copy
import hashlib
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field
from functools import lru_cache
from pathlib import Path

import numpy as np

from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.geometry import Array
from planlang.geometry.matrices import angles_of, product
from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of
from planlang.geometry.urdf import Joint, Urdf, master_of, origin_of, read_urdf
from planlang.geometry.urdf_schema import extents_of, numbers
from planlang.geometry.xml_tree import Element
from planlang.kept import Latest
from planlang.package_paths import case_differs, file_places
from planlang.records import dataclass
from planlang.temporary import temporary_folder


class Meshes:
    """Meshes named by a URDF; valid ones are rewritten as files named by their content."""

    def __init__(self, urdf: Path) -> None:
        self.urdf = urdf
        self.files: dict[str, bytes] = {}
        self.absent: dict[str, tuple[int, str]] = {}
        """Name of a missing or unreadable mesh -> line that names it, and the reason if the file exists."""
        self.other_cases: dict[str, tuple[int, str]] = {}
        """Name of a mesh whose file has another case -> line that names it, and the name of the file."""
        self._names: dict[str, str | None] = {}

    def replace(self, mesh: Element) -> bool:
        """Point an element to the rewritten mesh; return False if the mesh is unusable or the geometry is unknown."""
        if mesh.tag != "mesh":
            self.absent[f"<{mesh.tag}>"] = mesh.line, "not a URDF geometry"
            return False
        name = mesh.get("filename", "")
        if name not in self._names:
            self._names[name] = self._read(name, mesh.line)
        file_name = self._names[name]
        if file_name is not None:
            mesh.set("filename", file_name)
        return file_name is not None

    def _read(self, name: str, line: int) -> str | None:
        reason = ""
        for place in file_places(self.urdf, name):
            try:
                suffix, content = checked_mesh(place)
            except BadMesh as problem:
                reason = reason or str(problem)
                continue
            except OSError:
                continue
            if case_differs(name, place):
                self.other_cases[name] = line, place.name
            own = hashlib.sha256(content).hexdigest()[:32] + suffix
            self.files[own] = content
            return own
        self.absent[name] = line, reason
        return None


@lru_cache(maxsize=256)
def _checked(content: bytes, suffix: str) -> tuple[str, bytes]:
    return mesh_of(content, suffix).written()


def checked_mesh(path: Path) -> tuple[str, bytes]:
    """Read a mesh file and return the suffix and content of a file that PyBullet reads safely.

    Raises OSError if the file is missing, :class:`BadMesh` if it is unusable. Results are cached for the process, since
    many worlds load the same mesh.
    """
    return _checked(mesh_content(path), path.suffix.lower())


Merged = Mapping[str, tuple[str, Array]]
"""Merged link -> the link that carries it, and its pose (4, 4) there."""


def merge_fixed(robot: Element, joints: Sequence[Joint], most: int) -> Merged:
    """Merge as many links at fixed joints as it takes for ``most`` joints, as far as there are so many."""
    links = {link.get("name", ""): link for link in robot.findall("link") if isinstance(link, Element)}
    elements = {joint.get("name", ""): joint for joint in robot.findall("joint") if isinstance(joint, Element)}
    fixed = [joint for joint in joints if joint.kind == "fixed"]
    fixed.sort(key=lambda joint: any(True for _ in _shapes(links[joint.child])))  # stable: else as in the file
    carried: dict[str, tuple[str, Array]] = {}
    for joint in fixed[: max(0, len(joints) - most)]:
        carried[joint.child] = joint.parent, joint.origin
        robot.remove(elements.pop(joint.name))
        robot.remove(links[joint.child])
    merged = {name: _carrier(name, carried) for name in carried}
    for name, (carrier, pose) in merged.items():
        for shape in _shapes(links[name]):
            _move(shape, pose)
            links[carrier].append(shape)
    for element in elements.values():
        parent = element.find("parent")
        if parent is not None and (name := parent.get("link", "")) in merged:
            carrier, pose = merged[name]
            parent.set("link", carrier)
            _move(element, pose)
    return merged


def _shapes(link: Element) -> Iterator[Element]:
    return (part for part in link if isinstance(part, Element) and part.tag in ("collision", "visual"))


def _carrier(name: str, carried: Mapping[str, tuple[str, Array]]) -> tuple[str, Array]:
    """Find the link that stays and carries a link, and the pose (4, 4) of the link there."""
    pose = np.eye(4)
    while name in carried:
        name, step = carried[name]
        pose = product(step, pose)
    return name, pose


def _move(element: Element, by: Array) -> None:
    """Give the pose of an element in a carried link as one in the link that carries it."""
    origin, pose = element.find("origin"), product(by, origin_of(element))
    if origin is None:
        origin = Element("origin")
        element.insert(0, origin)
    for name, values in (("xyz", pose[:3, 3]), ("rpy", angles_of(pose[:3, :3]))):
        origin.set(name, _text(values))


MOST_JOINTS = 127
"""Number of links, beside the root, whose poses PyBullet returns."""
_PRIMITIVES = {"box", "cylinder", "sphere", "capsule", "plane"}
"""Shapes other than meshes that PyBullet reads on every platform."""
_SHOWN = 4
"""Number of names that a message lists before it abbreviates."""
THINNEST = 0.002
"""Smallest extent of a box made from an inertia [m]."""
LIGHTEST = 30.0
"""Density of foam [kg/m3]. Inertias that give lighter boxes are placeholders, not measurements: measured ones in real
URDFs give 300 and more, the frequent 0.1 kg with 0.01 kg m2 gives 0.2."""


SWEEPS = 6
"""Sweeps of Jacobi rotations: each squares the error, and four are enough for three axes."""
ROUNDED = 1e-12
"""Product of inertia that counts as zero [kg m^2]: between equal moments it would turn the axes arbitrarily."""


@dataclass(frozen=True, slots=True)
class Follower:
    """Joint that mimics another: its position is ``multiplier`` times the other's plus ``offset``."""

    joint: str
    multiplier: float
    offset: float


@dataclass(frozen=True, slots=True)
class Description:
    """A URDF that PyBullet can load."""

    path: Path
    """The file it was read from."""
    text: str
    """URDF text for PyBullet."""
    meshes: Mapping[str, bytes]
    """Mesh files to write beside it: content by name; names follow from content."""
    root: str
    """Link without a parent joint."""
    followers: Mapping[str, tuple[Follower, ...]]
    """Joint -> joints that mimic it, directly or not."""
    merged: Merged = field(default_factory=dict)
    """Links that are parts of others for PyBullet: the other link, and the pose there."""
    diagnostics: tuple[Diagnostic, ...] = ()
    """Up to two warnings, about meshes and shapes."""


MOST_KEPT = 8
"""Number of cached descriptions."""
_meshless: Latest[tuple[Path, bytes], Description] = Latest(MOST_KEPT)
"""Cached descriptions by path and content: only those without meshes, since mesh files may change."""


def read_description(path: Path) -> Description:
    """Read and check a URDF and its meshes; raise BadInput with everything that makes it unusable.

    A missing or unreadable mesh is replaced: for contacts by the box with the link's mass and inertia, for looks by the
    link's collision shapes; by nothing if there are none. If no link has a collision shape, visual shapes serve as
    such.
    """
    urdf = read_urdf(path)
    if (path, urdf.content) in _meshless:
        return _meshless[path, urdf.content]
    if urdf.gaps:
        raise BadInput(urdf.gaps)
    _check_number(urdf)
    robot = urdf.plain()
    _without_empty_shapes(robot)
    meshless = all(shape.tag in _PRIMITIVES for shape in robot.iterfind("link/*/geometry/*"))
    warnings = list(urdf.diagnostics)
    if robot.find("link/collision") is None:
        warnings.append(_visuals_as_collisions(path, robot))
    files: Mapping[str, bytes] = {}
    if not meshless:
        meshes = Meshes(path)
        shapeless = _replace_meshes(robot, meshes.replace)
        files = meshes.files
        warnings += _case_notes(meshes.other_cases, path)
        if meshes.absent:
            warnings.append(_mesh_warning(meshes.absent, shapeless, path))
    merged = merge_fixed(robot, urdf.joints, MOST_JOINTS)
    ElementTree.indent(robot)
    text = ElementTree.tostring(robot, "unicode")
    description = Description(path, text, files, urdf.root, _followers(urdf.joints), merged, tuple(warnings))
    if meshless:
        _meshless[path, urdf.content] = description
    return description


def _check_number(urdf: Urdf) -> None:
    """Raise BadInput if there are too many links even if those that never move are merged."""
    moving = [joint for joint in urdf.joints if joint.kind != "fixed"]
    if len(moving) <= MOST_JOINTS:
        return
    message = f"the robot has {len(moving)} moving joints; the simulator takes at most {MOST_JOINTS}"
    mimics = sum(joint.mimic is not None for joint in moving)
    followers = f", {mimics} of them mimic others" if mimics else ""
    advice = f'make those fixed (type="fixed") that no plan needs, such as wheels and fingers{followers}: '
    advice += f"{len(moving) - MOST_JOINTS} or more"
    raise BadInput([error("B009", message, Span(str(urdf.path), urdf.tree.line), advice)])


@contextmanager
def loadable(description: Description) -> Iterator[Path]:
    """Yield the path of a temporary file with the description, while PyBullet reads it."""
    with temporary_folder() as folder:
        path = folder / "robot.urdf"
        path.write_text(description.text, encoding="utf-8")
        for name, content in description.meshes.items():
            (path.parent / name).write_bytes(content)
        yield path


def _without_empty_shapes(robot: Element) -> None:
    """Thicken flat shapes and remove empty ones: real files have boxes of size 0 0 0 as placeholders."""
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


def _visuals_as_collisions(path: Path, robot: Element) -> Diagnostic:
    """Use the links' visual shapes as collision shapes."""
    for link in robot.findall("link"):
        link.extend(_shapes_as(link, "visual", "collision"))
    span = Span(str(path), robot.line)
    if robot.find("link/collision") is None:
        advice = "give the robot's body at least one"
        return warning("B015", "no link has a shape (<collision> or <visual>)", span, advice)
    message = "no link has a <collision> shape; the <visual> shapes are used instead"
    return warning("B015", message, span)


def _shapes_as(link: ElementTree.Element, kind: str, other: str) -> list[ElementTree.Element]:
    """Copy the link's shapes of one kind (collision, visual) as shapes of the other."""
    shapes = []
    for shape in link.findall(kind):
        copied = ElementTree.Element(other)
        copied.extend(copy.deepcopy(part) for part in shape if part.tag in ("origin", "geometry"))
        shapes.append(copied)
    return shapes


def _replace_meshes(robot: Element, replace: Callable[[Element], bool]) -> list[str]:
    """Replace meshes by checked ones or shapes, and unknown geometry; list links left without a collision shape."""
    shapeless: list[str] = []

    def is_absent(shape: ElementTree.Element) -> bool:
        solid = shape.find("geometry/*")
        return isinstance(solid, Element) and solid.tag not in _PRIMITIVES and not replace(solid)

    for link in robot.findall("link"):
        collisions, visuals = ([s for s in link.findall(kind) if is_absent(s)] for kind in ("collision", "visual"))
        for shape in (*collisions, *visuals):
            link.remove(shape)
        if collisions:
            link.extend(_box_of(link))
            if link.find("collision") is None:
                shapeless.append(link.get("name", ""))
        if visuals:
            link.extend(_shapes_as(link, "collision", "visual"))
    return shapeless


def _box_of(link: ElementTree.Element) -> list[ElementTree.Element]:
    """Build a collision element with the box of the link's inertia; empty if the link has none."""
    inertial = link.find("inertial")
    mass, moments = (None if inertial is None else inertial.find(tag) for tag in ("mass", "inertia"))
    if inertial is None or mass is None or moments is None:
        return []
    xx, xy, xz, yy, yz, zz = (float(moments.get(name, "0")) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    box = inertia_box(float(mass.get("value", "0")), np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    if box is None:
        return []
    extents, axes = box
    pose = origin_of(inertial)
    turned = angles_of(product(pose[:3, :3], axes))
    collision = ElementTree.Element("collision")
    ElementTree.SubElement(collision, "origin", xyz=_text(pose[:3, 3]), rpy=_text(turned))
    ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), "box", size=_text(extents))
    return [collision]


def inertia_box(mass: float, inertia: Array) -> tuple[Array, Array] | None:
    """Compute the extents (3,) [m] and axes (3, 3), as columns, of the homogeneous box of a mass and an inertia (3, 3).

    Solves m / 12 (b^2 + c^2) and so on for the principal moments. None without mass or moments, and for a box lighter
    than foam (:data:`LIGHTEST`). An impossible inertia (one moment above the sum of the others) gives the thinnest box.
    """
    moments, axes = _principal(inertia)
    if mass <= 0 or moments.max() <= 0:
        return None
    squares = 6.0 / mass * (moments.sum() - 2.0 * moments)
    extents = np.maximum(np.sqrt(np.maximum(squares, 0.0)), THINNEST)
    return (extents, axes) if mass >= LIGHTEST * float(np.prod(extents)) else None


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Compute the principal moments (3,) and axes (3, 3), as columns, right-handed, near the given axes.

    Jacobi rotations (G. H. Golub and C. F. Van Loan, Matrix Computations, 8.5), bit-equal on every machine: LAPACK's
    eigenvectors differ in their last digits between processors, and so would a robot's shapes.
    """
    moments, axes = inertia, np.eye(3)
    for p, q in SWEEPS * ((0, 1), (0, 2), (1, 2)):
        if abs(moments[p, q]) <= ROUNDED:
            continue
        theta = (moments[q, q] - moments[p, p]) / (2 * moments[p, q])
        tangent = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta**2 + 1))  # the smaller of two angles
        cosine = 1 / math.sqrt(tangent**2 + 1)
        turn = np.eye(3)
        turn[p, p] = turn[q, q] = cosine
        turn[p, q], turn[q, p] = tangent * cosine, -tangent * cosine
        moments, axes = product(product(turn.T, moments), turn), product(axes, turn)
    return np.diag(moments), axes


def _text(values: Sequence[float] | Array) -> str:
    return " ".join(repr(round(float(value), 12)) for value in values)


def _mesh_warning(absent: Mapping[str, tuple[int, str]], shapeless: Sequence[str], path: Path) -> Diagnostic:
    count = f"{len(absent)} meshes are" if len(absent) != 1 else "a mesh is"
    names = [f"{name} ({reason})" if reason else name for name, (_, reason) in absent.items()]
    message = f"{count} missing or unreadable and replaced by simple shapes: {_some(names)}"
    if shapeless:
        links = f"{len(shapeless)} links have" if len(shapeless) != 1 else "a link has"
        message += f"; {links} no usable inertia either and get no shape: {_some(shapeless)}"
    advice = (
        "put the packages that hold them beside the URDF, or their folders into ROS_PACKAGE_PATH; as OBJ, DAE or STL"
    )
    return warning("B013", message, Span(str(path), next(iter(absent.values()))[0]), advice)


def _case_notes(found: Mapping[str, tuple[int, str]], path: Path) -> Iterator[Diagnostic]:
    """Yield a note if meshes were found under other cases: Windows does not distinguish them, ROS on Linux does."""
    if found:
        name, (line, there) = next(iter(found.items()))
        more = f", and {len(found) - 1} more" if len(found) > 1 else ""
        message = f"mesh {name} is read from {there}, whose name has another case{more}"
        yield note("B010", message, Span(str(path), line), "rename the file, or write its name as it is")


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


# Joints that follow others


def _followers(joints: Sequence[Joint]) -> dict[str, tuple[Follower, ...]]:
    """Map each joint to the joints that mimic it, directly or not."""
    every, followers = {joint.name: joint for joint in joints}, dict[str, list[Follower]]()
    for joint in (one for one in joints if one.mimic is not None and one.moves):
        master = master_of(joint, every)
        followers.setdefault(master.joint, []).append(Follower(joint.name, master.multiplier, master.offset))
    return {name: tuple(several) for name, several in followers.items()}
