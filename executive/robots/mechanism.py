"""A robot's URDF: its file, its tree of links and joints, and the names by which a self-model refers to them.

Words in names of links and joints tell what a part is, where the structure of the tree leaves it open. Names are split
into words at punctuation, digits and changes of case: "LHand_joint2" has the words "l", "hand" and "joint".
"""

from __future__ import annotations

import hashlib
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterable, Mapping, Sequence
from copy import deepcopy
from enum import Enum
from functools import cache
from importlib.metadata import Distribution, PackageNotFoundError, distribution, distributions
from itertools import chain
from pathlib import Path

import numpy as np

from executive.robots.robot import SelfModel
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, note
from planlang.geometry import Array
from planlang.geometry.matrices import moved, product, rotated
from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of
from planlang.geometry.urdf import Element, Joint, Urdf, origin_of, read_urdf
from planlang.geometry.urdf_schema import extents_of, numbers
from planlang.package_paths import file_places
from planlang.records import dataclass
from planlang.temporary import process_folder


class Part(Enum):
    """A kind of part that names tell."""

    WHEEL = "wheel"
    FINGER = "finger"
    THUMB = "thumb"
    HAND = "hand"
    WRIST = "wrist"
    HEAD = "head"
    LEG = "leg"
    PASSIVE = "passive"
    CAMERA = "camera"
    MOUNT = "mount"
    COLOUR = "colour"
    NO_PICTURE = "no picture"
    SPRING = "spring"
    SENSOR = "sensor"


_WORDS: Mapping[Part, str] = {
    Part.WHEEL: r"\w*wheels?\w*|castors?|casters?|\w*caster\w*|rollers?|rotors?|propellers?|mecanum|omni|"
    r"raeder|roue|rueda|ruota|sharin",
    Part.FINGER: r"\w*finger\w*|\w*fngr\w*|\w*thumb\w*|\w*jaw\w*|\w*claw\w*|\w*knuckle\w*|phalanx|tongs?|"
    r"index|middle|ring|pinky|little|proximal|distal|daumen|doigts?|pouce|dedos?|pulgar|dit[oa]|pollice|yubi|zhi",
    Part.THUMB: r"\w*thumb\w*|daumen|pouce|pulgar|pollice|oyayubi|th",
    Part.HAND: r"\w*grip\w*|\w*hand|hands|\w*pinch\w*|palm|grasper|clamp|"
    r"greifer\w*|pince\w*|pinza|mano|jiazhua|zhua",
    Part.WRIST: r"\w*wrist\w*|roll|rotate|rotation|twist|yaw|pitch|swivel|turn|spin",
    Part.HEAD: r"heads?|necks?|eyes?|kopf|hals|tete|cabeza|cuello|testa|collo|kubi|atama",
    Part.LEG: r"legs?|foot|feet|ankles?|knees?|thighs?|calf|calves|toes?|hips?|soles?|shanks?|shins?|"
    r"tibia|femur|pelvis|uleg|lleg|bein|fuss|knie|jambe|pied|pierna|gamba|piede|ashi",
    Part.PASSIVE: r"lamps?|lights?|leds?|lasers?|lidars?|radars?|antennas?|cables?|hoses?|bellows|imu|camera|cam|"
    r"linkage|dummy|logo|gauge|lampe|licht|kabel",
    Part.CAMERA: r"\w*camera\w*|\w*kinect\w*|\w*realsense\w*|\w*openni\w*|\w*xtion\w*|\w*stereo\w*|\w*rgbd?|"
    r"zed|astra|orbbec|oak|webcam|kamera|cams?|d4[0-9]5\w*",
    Part.MOUNT: r"mounts?|motor|screw|pole|adapter|bracket|gazebo|holder",
    Part.COLOUR: r"\w*rgbd?|colou?r|\w*stereo",
    Part.SPRING: r"springs?|compliant|compliance|elastic",
    Part.SENSOR: r"ft|sensors?|force|torque|dummy|bumpers?|encoders?",
    Part.NO_PICTURE: r"depth|infra\w*|ir|imu|gyro|accel|range|line",
}
"""Regular expressions that match whole words, or several words joined."""
_TOOL = re.compile(r"tool|tcp|grip_?point|grasp|flange", re.IGNORECASE)
_SPLIT = re.compile(r"[dD]4\d5\w?|[A-Z]+(?![a-z])|[A-Z]?[a-z]+|[^\W\d_]+")


@cache
def words_of(name: str) -> tuple[str, ...]:
    """Split a name into words, in lower case."""
    return tuple(word.lower() for word in _SPLIT.findall(name))


def names(part: Part, *texts: str) -> bool:
    """Check whether one of some names has a word for a kind of part."""
    pattern = re.compile(_WORDS[part])
    return any(pattern.fullmatch(word) for text in texts for word in words_of(text))


def is_tool(link: str) -> bool:
    """Check whether a link is named as the point of a tool."""
    return _TOOL.search(link) is not None


BASE, MOUNT = "mobile_base", "mobile_base_mount"
"""Link and joint of an added base."""
LEVEL = 0.01
"""Largest sine of the angle between a direction along the floor and the floor."""
FREELY = 4.0
"""Least travel along the floor of a joint that is no machine's rail [m]."""
MARKER = 0.01
"""Greatest distance from its frame of the shape of a link that only marks a point [m]: no palm is that small."""
STILL = 1e-6
"""Range below which a joint does not move [rad, m]."""
UPRIGHT = 0.999
"""Least cosine between vertical directions."""
_ODOMETRY = re.compile(r"odom|mobile|virtual|dummy|planar|footprint", re.IGNORECASE)


class NotInstalled(Exception):
    """The package with a URDF is not installed."""


@dataclass(frozen=True, slots=True)
class Mount:
    """A box or an upright cylinder on the floor, on which the root link of a URDF stands."""

    size: tuple[float, ...]
    """Extents in x, y, z, or diameter and height [m]."""
    at: tuple[float, float, float]
    """Position of the root link in the frame of the base, whose origin is the centre of its bottom [m]."""

    @property
    def radius(self) -> float:
        """Return the radius of its outline [m]."""
        return math.hypot(*self.size[:-1]) / 2


ToolPoint = tuple[str, tuple[float, float, float]]
"""A link, and a point in its frame [m]."""
Range = tuple[float, float]
"""Lower and upper limit of a joint [rad, m]."""
_copied: dict[Path, Path] = {}
"""Copy that ``mounted`` wrote -> the user's URDF."""


def packaged(name: str, file: str) -> Path:
    """Find a file of an installed package by the end of its path. Raises NotInstalled.

    The package goes by its name of distribution or of import: the distribution that provides ``pybullet`` depends on
    the version of Python.
    """
    package: Distribution | None
    try:
        package = distribution(name)
    except (PackageNotFoundError, ValueError):
        package = next((one for one in distributions() if name in (one.read_text("top_level.txt") or "").split()), None)
    if package is None:
        raise NotInstalled(f"the package {name} is not installed")
    parts = Path(file).parts
    for entry in package.files or ():
        if entry.parts[-len(parts) :] == parts and (path := Path(str(entry.locate()))).is_file():
            return path.resolve()
    raise NotInstalled(f"the installed package {name} has no {file}")


def mounted(
    urdf: Path,
    mount: Mount | None,
    tools: Mapping[str, ToolPoint] | None = None,
    ranges: Mapping[str, Range] | None = None,
) -> Path:
    """Write a copy of a URDF, put on a base, with additional links at tool points and other ranges of joints.

    Joints that move the robot as a whole, and still ones of sensors, are fixed in it; links that only mark a point have
    no shape. Returns its path. Paths of meshes are made absolute; the copy
    is in a folder of this process, in which no other one can change it. Raises BadInput for an invalid URDF.
    """
    content = _text(urdf, mount, tools or {}, ranges or {}).encode()
    path = process_folder() / f"{urdf.stem}-{hashlib.sha256(content).hexdigest()[:32]}.urdf"
    path.write_bytes(content)
    _copied[path] = source_of(urdf)
    return path


def grounded(urdf: Path) -> Path:
    """Return the path of a URDF in which no joint moves the robot as a whole, or is still and a sensor's.

    And no marker has a shape. It is a copy if the URDF has such joints or links.
    """
    found = read_urdf(urdf)
    return mounted(urdf, None) if base_joints(found) or still_sensors(found) or markers(urdf) else urdf


def still_sensors(urdf: Urdf) -> tuple[str, ...]:
    """List the joints that cannot move and whose names say that they carry a sensor or another passive part.

    They are drawn as joints to have a name for what the sensor measures, such as forces at a wrist.
    """
    followed = {joint.mimic.joint for joint in urdf.joints if joint.mimic is not None}
    return tuple(
        joint.name
        for joint in urdf.joints
        if is_still(joint)
        and joint.mimic is None
        and joint.name not in followed
        and any(names(part, joint.name, joint.child) for part in (Part.SENSOR, Part.PASSIVE))
    )


def is_still(joint: Joint) -> bool:
    """Check whether a joint's limits let it move nowhere."""
    return joint.kind in ("revolute", "prismatic") and joint.upper - joint.lower < STILL


def markers(urdf: Path) -> tuple[str, ...]:
    """List the links that are named as a tool's point and drawn as a dot there: they would be in the way of grasps."""
    found = read_urdf(urdf)
    ends = {joint.child for joint in found.joints if joint.kind == "fixed"} - {joint.parent for joint in found.joints}
    links = ((link, link.get("name", "")) for link in found.tree.findall("link"))
    return tuple(name for link, name in links if name in ends and is_tool(name) and _is_dot(urdf, link))


def _is_dot(urdf: Path, link: ElementTree.Element) -> bool:
    """Check whether all that a link touches with is at the origin of its frame."""
    shapes = link.findall("collision")
    return bool(shapes) and all(_farthest(urdf, shape) <= MARKER for shape in shapes)


def _farthest(urdf: Path, shape: ElementTree.Element) -> float:
    """Greatest distance of a shape from its link's frame, at most, [m]; infinite for one that cannot be measured."""
    solid, pose = shape.find("geometry/*"), origin_of(shape)
    if solid is None:
        return math.inf
    if solid.tag != "mesh":
        extents = [value for name in extents_of(solid) for value in numbers(solid.get(name, ""))]
        return math.hypot(*pose[:3, 3]) + math.hypot(*extents) if extents else math.inf
    for place in file_places(urdf, solid.get("filename", "")):
        try:
            vertices = mesh_of(mesh_content(place), place.suffix.lower()).vertices
        except (BadMesh, OSError):
            continue
        scale = numbers(solid.get("scale", "1 1 1"))
        return float(np.linalg.norm(moved(pose, vertices * scale), axis=1).max())
    return math.inf


def base_joints(urdf: Urdf) -> tuple[str, ...]:
    """List the joints that stand for the motion of the base: it drives, so they are no joints of an arm.

    These are joints of the types floating and planar, and odometry: joints above the first link with a shape that slide
    along the floor in two directions, or along one and turn, over metres or by their names.
    """
    free = tuple(joint.name for joint in urdf.joints if joint.kind in ("floating", "planar"))
    shaped = {
        link.get("name")
        for link in urdf.tree.findall("link")
        if not {"collision", "visual"}.isdisjoint(c.tag for c in link)
    }
    below: dict[str, list[Joint]] = {}
    for joint in urdf.joints:
        below.setdefault(joint.parent, []).append(joint)
    link, pose, slides, turns = urdf.root, np.eye(4), list[tuple[Joint, Array]](), list[Joint]()
    while link not in shaped and len(onwards := [one for one in below.get(link, ()) if one.child in below]) == 1:
        (joint,) = onwards
        pose = product(pose, joint.origin)
        axis = pose[:3, :3] @ joint.axis
        if joint.moves and joint.kind == "prismatic" and abs(axis[2]) < LEVEL:
            slides.append((joint, axis))
        elif joint.moves and joint.kind != "prismatic" and abs(axis[2]) > 1.0 - LEVEL:
            turns.append(joint)
        elif joint.moves:
            break
        link = joint.child
    travels = [joint.upper - joint.lower for joint, _ in slides]
    is_named = any(_ODOMETRY.search(name) for joint, _ in slides for name in (joint.name, joint.child))
    crosses = len(slides) > 1 and abs(slides[0][1] @ slides[1][1]) < 1.0 - LEVEL
    drives = crosses or (len(slides) == 1 and len(turns) > 0)
    if drives and (is_named or min(travels) >= (FREELY if crosses else 5 * FREELY)):
        return (*free, *(joint.name for joint, _ in slides), *(joint.name for joint in turns))
    return free


def source_of(urdf: Path) -> Path:
    """Return the user's file for a copy that :func:`mounted` wrote, else the path itself: messages name that."""
    return _copied.get(urdf, urdf)


def _text(urdf: Path, mount: Mount | None, tools: Mapping[str, ToolPoint], ranges: Mapping[str, Range]) -> str:
    robot = deepcopy(read_urdf(urdf).tree)
    for mesh in robot.iter("mesh"):
        name = mesh.get("filename", "")
        resolved = next((place for place in file_places(urdf, name) if place.is_file()), None)
        if resolved is not None:
            mesh.set("filename", str(resolved.resolve()))
    found, marking = read_urdf(urdf), markers(urdf)
    of_base, still = base_joints(found), still_sensors(found)
    for drawn in robot.findall("link"):
        for shape in drawn.findall("collision") if drawn.get("name") in marking else ():
            drawn.remove(shape)
    for joint in robot.findall("joint"):
        if joint.get("name") in of_base:
            joint.set("type", "fixed")
        elif joint.get("name") in ranges:
            _limit(joint, *ranges[joint.get("name", "")])
        elif joint.get("name") in still:
            joint.set("type", "fixed")
    if mount is not None:
        _put_on(robot, mount)
    for name, (link, at) in tools.items():
        ElementTree.SubElement(robot, "link", name=name)
        _fix(robot, link, name, f"{name}_joint", at)
    ElementTree.indent(robot)
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
    robot.insert(0, base)
    _fix(robot, BASE, roots[0] or "" if roots else "", MOUNT, mount.at)


def _limit(joint: ElementTree.Element, lower: float, upper: float) -> None:
    """Replace the range of a joint; one that turned without end has one then."""
    if joint.get("type") == "continuous":
        joint.set("type", "revolute")
    limit = joint.find("limit")
    limit = ElementTree.SubElement(joint, "limit") if limit is None else limit
    limit.attrib |= {"lower": repr(lower), "upper": repr(upper)}


def _fix(robot: Element, parent: str, child: str, name: str, at: tuple[float, float, float]) -> None:
    """Add a fixed joint between two links; ``at`` is its origin in the parent's frame [m]."""
    joint = ElementTree.SubElement(robot, "joint", name=name, type="fixed")
    ElementTree.SubElement(joint, "origin", xyz=" ".join(map(repr, at)))
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)


class Mechanism:
    """Kinematic tree of a URDF. Raises BadInput for an invalid file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file_name = source_of(path).name
        """Name of the user's file, for messages."""
        urdf = read_urdf(path)
        self.root = urdf.root
        self.joints: dict[str, Joint] = {joint.name: joint for joint in urdf.joints}
        self.above: dict[str, Joint] = {joint.child: joint for joint in self.joints.values()}
        """Link -> its parent joint."""
        self.links: dict[str, None] = {self.root: None}
        self.hung: dict[str, list[Joint]] = {}
        """Link -> the joints that hang from it, in the order of the file."""
        for joint in self.joints.values():
            self.links.update({joint.parent: None, joint.child: None})
            self.hung.setdefault(joint.parent, []).append(joint)

    def moves(self, name: str) -> bool:
        """Check whether a joint of this name exists and moves, actuated or mimicking another one."""
        joint = self.joints.get(name)
        return joint is not None and joint.moves

    def actuated(self, name: str) -> bool:
        """Check whether a joint of this name exists and is actuated: it moves, and mimics no other."""
        return self.moves(name) and self.joints[name].mimic is None

    def chain(self, link: str) -> tuple[Joint, ...]:
        """List the joints from the root to a link."""
        joints: list[Joint] = []
        while link in self.above and len(joints) <= len(self.joints):
            joints.append(self.above[link])
            link = joints[-1].parent
        return tuple(reversed(joints))

    def movers(self, link: str) -> tuple[str, ...]:
        """List the names of the actuated joints from the root to a link."""
        return tuple(joint.name for joint in self.chain(link) if self.actuated(joint.name))

    def ancestors(self, link: str) -> tuple[str, ...]:
        """List a link and its ancestors, up to the root."""
        return (link, *(joint.parent for joint in reversed(self.chain(link))))

    def common_ancestor(self, links: Iterable[str]) -> str:
        """Find the deepest link that is an ancestor of all links, or one of them."""
        paths = [self.ancestors(link) for link in links]
        return next(link for link in paths[0] if all(link in path for path in paths))

    def rigid_with(self, link: str) -> tuple[str, ...]:
        """List a link and all links rigidly attached to it, in the order of the file."""
        top = link
        while top in self.above and self.above[top].kind == "fixed":
            top = self.above[top].parent
        group = [top]
        for member in group:
            group += [j.child for j in self.joints.values() if j.parent == member and j.kind == "fixed"]
        return tuple(name for name in self.links if name in group)

    def below(self, link: str, but: Collection[Joint] = ()) -> list[Joint]:
        """List the joints below a link, each after those above it; ``but`` are left out with what they carry."""
        found: list[Joint] = []
        for parent in chain([link], (joint.child for joint in found)):
            found += [joint for joint in self.hung.get(parent, ()) if joint not in but]
        return found

    def fingers(self, hand: str) -> tuple[Joint, ...]:
        """List the moving joints below a link or the links rigidly attached to it, mimicking ones included."""
        group = self.rigid_with(hand)
        return tuple(j for j in self.joints.values() if j.parent in group and j.kind != "fixed")

    def lift(self, hands: Sequence[str]) -> Joint | None:
        """Find the joint that raises all hands straight up; None if there is none.

        Besides joints that slide, only those that carry several hands and turn about the vertical may be above it: the
        others are those of an arm.
        """
        chains = [[self.joints[name] for name in self.movers(hand)] for hand in hands]
        shared = [joint for joint in chains[0] if all(joint in chain for chain in chains)] if chains else []
        lifts = []
        for joint in shared:
            rise = abs(float(rotated(self.frame(joint.child)[:3, :3], joint.axis)[2]))
            if joint.kind == "prismatic" and rise > UPRIGHT:
                lifts.append(joint)
            elif joint.kind != "prismatic" and (len(chains) == 1 or rise < UPRIGHT):
                break
        return max(lifts, key=lambda joint: joint.upper - joint.lower, default=None)

    def frame(self, link: str) -> Array:
        """Pose (4, 4) of a link in the root frame, with all joints at zero."""
        matrix = np.eye(4)
        for joint in self.chain(link):
            matrix = product(matrix, joint.origin)
        return matrix


class Naming:
    """Maps IRIs of a self-model to links of a URDF, with a note for each guess."""

    def __init__(self, model: SelfModel, mechanism: Mechanism, diagnostics: list[Diagnostic]) -> None:
        self.model, self.mechanism, self.diagnostics = model, mechanism, diagnostics
        self._noted: set[str] = set()
        self._prefixes = self._find_prefixes()

    def _find_prefixes(self) -> tuple[str, ...]:
        """List the prefixes that local names have before URDF names, longest first."""
        prefixes: dict[str, None] = {}
        for iri, name in (*self.model.links.items(), *self.model.joints.items()):
            local = local_name(iri)
            if local.endswith(name) and local != name:
                prefixes[local.removesuffix(name)] = None
        for cls in (self.model.name, *map(local_name, self.model.types)):
            prefixes[f"{cls}_"] = None
        return tuple(sorted(prefixes, key=lambda prefix: (-len(prefix), prefix)))

    def link(self, iri: str, span: Span | None = None) -> str | None:
        """Find the link that an IRI refers to; for a joint, its child link; None if the URDF has none."""
        links, joints = self.mechanism.links, self.mechanism.joints
        name = self.model.links.get(iri)
        if name in links:
            return name
        joint = self.model.joints.get(iri)
        if joint in joints:
            child = joints[joint].child
            self._note(iri, f"{local_name(iri)} is a joint, not a link; its child link {child} is used", span)
            return child
        local = local_name(iri)
        shorter = [local.removeprefix(prefix) for prefix in self._prefixes if local.startswith(prefix)]
        for candidate in (local, *shorter):
            if candidate in links:
                message = f"{local} is matched by name to the link {candidate} of {self.mechanism.file_name}"
                self._note(iri, message, span)
                return candidate
            if candidate in joints:
                child = joints[candidate].child
                self._note(iri, f"{local} is a joint, not a link; its child link {child} is used", span)
                return child
        return None

    def _note(self, iri: str, message: str, span: Span | None) -> None:
        if iri not in self._noted:
            self._noted.add(iri)
            self.diagnostics.append(note("B003", message, span))

    def unknown(self) -> tuple[str, ...]:
        """List the names of links and joints that the URDF does not have, in the order of the self-model."""
        known = {*self.mechanism.links, *self.mechanism.joints}
        return tuple(name for name in (*self.model.links.values(), *self.model.joints.values()) if name not in known)
