"""A robot file made from a URDF, and a SRDF if there is one: what can be derived, what is assumed, and what is missing.

Every value has its reason. As text it is a file for a user to complete, in which what is missing stands as a comment;
the same text is the robot when a URDF is all that there is of it.

The SRDF (https://wiki.ros.org/srdf) says which joints are an arm, where hands are, and named states. It comes from a
stranger, as the URDF does, and is read in the same bounds; what it names and the URDF does not have is left out.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from executive.robots import anatomy
from executive.robots.anatomy import Limb
from executive.robots.hand_shape import HandShape, shape_of
from executive.robots.mechanism import Mechanism
from executive.robots.robot import CARRYING
from executive.robots.robot_file import DEFAULT_BASE, DEFAULT_LIMITS
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.geometry import Array
from planlang.geometry.urdf import BadXml, Element, numbers, read_tree, read_urdf
from planlang.records import dataclass
from sim import CameraModel, PlanningWorld, RobotBody, Scene
from sim.description import read_description

LONGEST = 120
"""Columns of a line; a longer reason stands above its value."""
MARGIN = 0.02
"""Room that is added around the base [m]."""
PAYLOAD = 1.0
"""Mass that any arm carries [kg]: a URDF does not say."""
USUAL_OPENING = 0.07
"""Opening that stands as an example where it is missing [m]."""
TURNS = 8 * np.pi
"""Range of a turning joint that nobody can have meant [rad]."""
_CARRYING = re.compile(r"carry|tuck|transport|travel|park|stow", re.IGNORECASE)
_UNSAFE = {"\x7f": "\\u007f"}


class Status(Enum):
    """The origin of a value. MISSING: it stands as an example, in a comment."""

    DERIVED = "derived"
    ASSUMED = "assumed"
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class Entry:
    """A key of a table with its value and the reason for it."""

    key: str
    value: Any
    why: str = ""
    status: Status = Status.DERIVED

    def lines(self) -> Iterator[str]:
        """Yield the entry as TOML."""
        why = " ".join(self.why.split())
        line = f"{'# ' if self.status is Status.MISSING else ''}{toml(self.key, is_key=True)} = {toml(self.value)}"
        if why and len(line) + len(why) + 4 > LONGEST:
            yield f"# {why}"
            why = ""
        yield f"{line}  # {why}" if why else line


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the file. ``path`` are the keys that lead to it; none for the first values."""

    path: tuple[str, ...]
    entries: list[Entry] = field(default_factory=list)

    def add(self, key: str, value: Any, why: str = "", status: Status = Status.DERIVED) -> None:
        """Add an entry."""
        self.entries.append(Entry(key, value, why, status))

    @property
    def header(self) -> str:
        """Return the header of the table."""
        return f"[{'.'.join(toml(key, is_key=True) for key in self.path)}]"

    def lines(self) -> Iterator[str]:
        """Yield the table as TOML; a table of which all is missing is a comment as a whole."""
        if self.path:
            is_missing = all(entry.status is Status.MISSING for entry in self.entries)
            yield from ("", f"# {self.header}" if is_missing else self.header)
        for entry in self.entries:
            yield from entry.lines()


@dataclass(frozen=True, slots=True)
class Draft:
    """A robot file in the making."""

    urdf: Path
    tables: list[Table] = field(default_factory=list)

    def table(self, *path: str) -> Table:
        """Return a new table at the end of the file."""
        self.tables.append(Table(path))
        return self.tables[-1]

    def text(self) -> str:
        """Return the file."""
        head = f"# Made from {self.urdf.name} by planlang robot make. Lengths in metres, angles in radians, times in s."
        lines = [line for table in self.tables for line in table.lines()]
        return "\n".join([" ".join(head.split()), "", *lines]) + "\n"

    def diagnostics(self) -> list[Diagnostic]:
        """Return notes on what is assumed, by table, and warnings about what is missing."""
        found: list[Diagnostic] = []
        for table in self.tables:
            named = table.header if table.path else "the robot"
            for status, tell, code in ((Status.ASSUMED, note, "B010"), (Status.MISSING, warning, "B016")):
                entries = [entry for entry in table.entries if entry.status is status]
                if entries:
                    told = "; ".join(f"{entry.key}: {entry.why}" if entry.why else entry.key for entry in entries)
                    found.append(tell(code, f"{named} {status.value}: {told}", Span(str(self.urdf))))
        return found


def toml(value: Any, *, is_key: bool = False) -> str:
    """Return a value in TOML's syntax; numbers rounded to nine digits, so that what is at a limit stays there."""
    match value:
        case str():
            if is_key and re.fullmatch(r"[A-Za-z0-9_-]+", value):
                return value
            return "".join(_UNSAFE.get(c, c) for c in json.dumps(value, ensure_ascii=False))
        case bool():
            return "true" if value else "false"
        case float() | np.floating():
            return repr(round(float(value), 9) + 0.0)
        case Mapping():
            inner = ", ".join(f"{toml(key, is_key=True)} = {toml(one)}" for key, one in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case Sequence():
            return f"[{', '.join(map(toml, value))}]"
    return str(value)


def draft_of(urdf: Path, srdf: Path | None = None, *, named: str | None = None) -> Draft:
    """Return what a URDF tells of a robot; raises BadInput for files that cannot be read.

    ``srdf``: by default the file of the same stem beside it, if there is one. ``named``: the URDF in the robot file.
    """
    mechanism = Mechanism(urdf)
    beside = urdf.with_suffix(".srdf")
    source = srdf if srdf is not None else beside if beside.is_file() else None
    said = read_srdf(source, mechanism.joints, mechanism.links) if source is not None else None
    world = PlanningWorld(Scene(()), RobotBody(urdf, CameraModel(mechanism.root)))
    try:
        return _Maker(Draft(urdf), mechanism, said, world).make(named or urdf.name)
    finally:
        world.close()


class _Maker:
    """Fills a draft, table by table."""

    def __init__(self, draft: Draft, mechanism: Mechanism, said: Srdf | None, world: PlanningWorld) -> None:
        self.draft, self.mechanism, self.said, self.world = draft, mechanism, said, world
        self.limbs = self._limbs()
        self.movers = {name for limb in self.limbs for name in mechanism.movers(limb.hand)}
        """Joints that move a hand, those of a torso included."""

    def make(self, urdf: str) -> Draft:
        first = self.draft.table()
        first.add("name", read_urdf(self.draft.urdf).tree.get("name") or self.draft.urdf.stem)
        first.add("urdf", urdf)
        if self.said is not None and self.said.touching:
            first.add("allowed_contacts", self.said.touching, "pairs that the SRDF says may touch")
        self._base()
        self._mount()
        names: list[str] = []
        for limb in self.limbs:
            self._arm(limb, names)
        if not self.limbs:
            what = f"no chain of {anatomy.LEAST_ARM} joints or more ends in a hand: nothing can be reached"
            self.draft.table("arms", "arm").add("tip", self.mechanism.root, what, Status.MISSING)
        self._camera()
        self._speeds()
        self._postures()
        return self.draft

    def _limbs(self) -> list[Limb]:
        """Return the arms: up to the end effectors of the SRDF, else those that the tree shows."""
        said = self.said.end_effectors if self.said is not None else ()
        stated = (anatomy.limb_of(self.mechanism, one.parent_link, one.parent_group or one.name) for one in said)
        arms = [limb for limb in stated if limb is not None] or list(anatomy.limbs(self.mechanism))
        return [limb for limb in arms if anatomy.is_arm(limb)]

    # The base

    def _base(self) -> None:
        table = self.draft.table("base")
        drives, why = self._drives()
        table.add("radius", *self._radius())
        is_said = self.said is not None and self.said.base_joint is not None
        table.add("fixed", not drives, why, Status.DERIVED if is_said or drives else Status.ASSUMED)
        if is_said and not drives:
            return
        for key in ("speed", "acceleration", "turn_speed", "turn_acceleration", "jerk"):
            table.add(key, getattr(DEFAULT_BASE, key), "slow", Status.ASSUMED)

    def _drives(self) -> tuple[bool, str]:
        if self.said is not None and self.said.base_joint is not None:
            kind = self.said.base_joint
            return kind in ("planar", "floating"), f"the virtual joint of the SRDF is {kind}"
        wheels = anatomy.wheels(self.mechanism)
        if wheels:
            return True, f"{wheels[0]} turns a wheel"
        if "base_footprint" in self.mechanism.links:
            return True, "base_footprint is the frame of bases that drive (REP 120)"
        loose = [joint.name for joint in self.mechanism.joints.values() if joint.kind in ("planar", "floating")]
        if loose:
            return True, f"{loose[0]} lets it go anywhere"
        return False, "no wheel in the URDF, false if it stands on a base that drives"

    def _radius(self) -> tuple[float, str, Status]:
        """Return the radius of what no joint lifts."""
        points = self._ground()
        if not len(points):
            return DEFAULT_BASE.radius, "no link of the base has a shape", Status.ASSUMED
        reach = float(np.hypot(points[:, 0], points[:, 1]).max()) + MARGIN
        return round(reach, 3), "around the links that no joint moves", Status.DERIVED

    def _ground(self) -> Array:
        """Return points (n, 3) of the links that no joint moves, in the frame of the root."""
        return np.concatenate([np.zeros((0, 3)), *self.world.robot.points(sorted(self.world.robot.grounded))])

    def _mount(self) -> None:
        if self.limbs and not self._drives()[0]:
            table = self.draft.table("mount")
            where = round(float(self._ground()[:, 2].min(initial=0.0)), 3) + 0.0
            why = f"what it stands on, if not the floor; its lowest shape is at z = {where}"
            table.add("size", [0.4, 0.4, 0.6], why, Status.MISSING)

    # Arms

    def _arm(self, limb: Limb, names: list[str]) -> None:
        shape, side = (
            shape_of(limb, self.mechanism, self.world),
            anatomy.side(self.mechanism, limb, is_alone=len(self.limbs) == 1),
        )
        name = re.sub(r"[^A-Za-z0-9_-]", "_", side or limb.name or "arm")
        names.append(name)
        name += f"_{names.count(name)}" if names.count(name) > 1 else ""
        table = self.draft.table("arms", name)
        chain = f"{len(limb.joints)} joints, {limb.joints[0].name} to {limb.joints[-1].name}"
        if side is not None:
            table.add("side", side, "by its names, or by where its shoulder is")
        table.add("tip", shape.tip, chain)
        if shape.offset is not None:
            table.add("tool_offset", shape.offset, "grip point in the tip's frame: between the ends of the fingers")
        elif not shape.is_measured:
            table.add(
                "tool_offset", (0.0, 0.0, 0.1), "grip point in the tip's frame, if not its origin", Status.MISSING
            )
        table.add("hand", limb.hand, "carries the fingers" if limb.fingers else "the last link")
        status = Status.DERIVED if shape.is_measured else Status.ASSUMED
        measured = "from the wrist to the fingers" if shape.is_measured else "the axis of the last joint"
        table.add("approach", shape.approach, measured, status)
        across = "along which the fingers move" if shape.opened else "at a right angle to the approach"
        table.add("closing", shape.closing, across, Status.DERIVED if shape.opened else Status.ASSUMED)
        table.add("payload", PAYLOAD, "largest mass that the hand carries [kg]", Status.ASSUMED)
        self._gripper(name, shape)
        for joint in limb.joints:
            if joint.kind in ("revolute", "prismatic") and not 1e-6 < joint.upper - joint.lower < TURNS:
                low, high = joint.lower, joint.upper
                table.add(f"limits of {joint.name}", [low, high], "the URDF's range is not believable", Status.MISSING)

    def _gripper(self, name: str, shape: HandShape) -> None:
        table = self.draft.table("arms", name, "gripper")
        if not shape.opened:
            what = "no finger of the URDF moves: without a gripper nothing can be grasped"
            table.add("opened", {"finger_joint": 0.04}, what, Status.MISSING)
            table.add("closed", {"finger_joint": 0.0}, "", Status.MISSING)
            table.add("max_opening", USUAL_OPENING, "", Status.MISSING)
            return
        status = Status.DERIVED if shape.max_opening else Status.MISSING
        table.add("opened", shape.opened, "fingers farthest from each other, as far as a hand has to open", status)
        table.add("closed", shape.closed, "fingers together", status)
        table.add("fingers", shape.fingers, "", status)
        measured = "95 % of the gap between the opened fingers"
        if not shape.max_opening:
            why = "no gap between two fingers can be measured; the data sheet of the hand says what fits"
            table.add("max_opening", USUAL_OPENING, why, status)
        elif any(one.code == "B013" for one in read_description(self.draft.urdf).diagnostics):
            coarse = f"{measured}, whose meshes may be among those that are not there"
            table.add("max_opening", shape.max_opening, coarse, Status.ASSUMED)
        else:
            table.add("max_opening", shape.max_opening, measured)

    # Head

    def _camera(self) -> None:
        arms = [joint.name for limb in self.limbs for joint in limb.joints]
        link, table = anatomy.camera(self.mechanism, arms), self.draft.table("camera")
        if link is None:
            what = "no link of the body or head is called a camera: only --trust-map lets it handle things"
            table.add("link", "camera_optical_frame", what, Status.MISSING)
            return
        table.add("link", link, "by its name")
        neck = [name for name in self.mechanism.movers(link) if name not in self.movers]
        if neck:
            table.add("neck", neck, "joints that move the camera and no hand")
        optical = anatomy.is_optical(link)
        status, why = (Status.DERIVED, "an optical frame") if optical else (Status.ASSUMED, "not an optical frame")
        table.add("forward", (0.0, 0.0, 1.0) if optical else (1.0, 0.0, 0.0), why, status)
        table.add("up", (0.0, -1.0, 0.0) if optical else (0.0, 0.0, 1.0), why, status)
        for key, value in (("fov", 1.0), ("near", 0.3), ("far", 4.0)):
            table.add(key, value, "as usual", Status.ASSUMED)

    # Motion

    def _speeds(self) -> None:
        table = self.draft.table("joints", "default")
        for key in ("speed", "acceleration", "jerk"):
            table.add(key, getattr(DEFAULT_LIMITS, key), "slow", Status.ASSUMED)

    def _postures(self) -> None:
        """Add the named states of the SRDF; one for driving is the carrying posture."""
        states = {name: self._within(state) for name, state in self.said.states.items()} if self.said else {}
        states = {name: state for name, state in states.items() if state}
        carrying = next((name for name in states if _CARRYING.search(name)), None)
        if carrying is not None and CARRYING not in states:
            self._posture(CARRYING, states[carrying], f"the state {carrying} of the SRDF")
        for name, state in states.items():
            self._posture(name, state, "a state of the SRDF")

    def _within(self, state: Mapping[str, float]) -> dict[str, float]:
        """Return the joints of a state that move by themselves, at positions that they can have."""
        found = {}
        for name, value in state.items():
            joint = self.mechanism.joints[name]
            is_possible = joint.kind == "continuous" or joint.lower <= value <= joint.upper
            if self.mechanism.actuated(name) and is_possible:
                found[name] = value
        return found

    def _posture(self, name: str, state: Mapping[str, float], why: str) -> None:
        table = self.draft.table("postures", name)
        for number, (joint, value) in enumerate(state.items()):
            table.add(joint, value, why if number == 0 else "")


HARMLESS = ("Never", "Adjacent")
"""Reasons why a pair is not checked that say nothing: it cannot touch, or is left out anyhow."""


@dataclass(frozen=True, slots=True)
class EndEffector:
    """A hand: the link of the arm that it hangs from or is."""

    name: str
    parent_link: str
    parent_group: str


@dataclass(frozen=True, slots=True)
class Srdf:
    """The contents of an SRDF."""

    path: Path
    end_effectors: tuple[EndEffector, ...]
    states: Mapping[str, Mapping[str, float]]
    """Name -> joint positions; states of several groups by one name are one."""
    base_joint: str | None
    """Type of the virtual joint that holds the robot in the world: "fixed", "planar" or "floating"."""
    touching: tuple[tuple[str, str], ...]
    """Pairs of links that may touch."""


def read_srdf(path: Path, joints: Iterable[str], links: Iterable[str]) -> Srdf:
    """Read a SRDF about a URDF with these joints and links; raises BadInput (B009)."""
    try:
        robot = read_tree(path)
    except BadXml as problem:
        raise BadInput([error("B009", problem.problem, Span(str(path), problem.line))]) from None
    if robot.tag != "robot":
        message = f"is not SRDF: its root element is <{robot.tag}>, not <robot>"
        raise BadInput([error("B009", message, Span(str(path), robot.line))])
    known_joints, known_links = frozenset(joints), frozenset(links)
    states: dict[str, dict[str, float]] = {}
    for state in robot.iterfind("group_state"):
        positions = states.setdefault(state.get("name", ""), {})
        positions |= {name: value for name, value in _positions(state) if name in known_joints}
    base = robot.find("virtual_joint")
    return Srdf(
        path,
        tuple(one for one in _end_effectors(robot) if one.parent_link in known_links),
        {name: positions for name, positions in states.items() if name and positions},
        base.get("type") if base is not None else None,
        tuple(pair for pair in _touching(robot) if known_links.issuperset(pair)),
    )


def _end_effectors(robot: Element) -> Iterator[EndEffector]:
    for one in robot.iterfind("end_effector"):
        yield EndEffector(one.get("name", ""), one.get("parent_link", ""), one.get("parent_group", ""))


def _positions(state: ElementTree.Element) -> Iterator[tuple[str, float]]:
    """Yield joints with one position; a joint with several axes has more."""
    for joint in state.iterfind("joint"):
        values = numbers(joint.get("value", ""))
        if len(values) == 1:
            yield joint.get("name", ""), values[0]


def _touching(robot: Element) -> Iterator[tuple[str, str]]:
    for pair in robot.iterfind("disable_collisions"):
        if pair.get("reason") not in HARMLESS:
            yield pair.get("link1", ""), pair.get("link2", "")
