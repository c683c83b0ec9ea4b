"""Draft of a robot file from a URDF, and from an SRDF if there is one: derived, assumed and missing values.

Every value has a reason. Written out, it is a file for the user to complete, with missing values as comments; the same
text serves as robot file for a robot that is given by its URDF alone.

The SRDF (https://wiki.ros.org/srdf) states end effectors, named postures, the type of the base, and pairs of links
that may touch. It is untrusted, as the URDF is, and read with the same bounds; what of its
end effectors and postures this robot does not have is reported.
"""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from executive.robots import anatomy
from executive.robots.anatomy import TURNS, Anatomy, Limb, is_arm
from executive.robots.hand_shape import HandShape, shape_of
from executive.robots.mechanism import Mechanism, base_joints, grounded
from executive.robots.robot import CARRYING
from executive.robots.robot_file import DEFAULT_BASE, DEFAULT_LIMITS
from executive.robots.vetting import vet
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.geometry.urdf import BadXml, Element, read_tree, read_urdf
from planlang.geometry.urdf_schema import expressions_in, numbers
from planlang.records import dataclass
from planlang.visible import visible
from sim import CameraModel, PlanningWorld, RobotBody, Scene
from sim.description import read_description

LONGEST = 120
"""Greatest length of a line; a longer reason is written above its value."""
MARGIN = 0.02
"""Margin added to the radius of the base [m]."""
SUNK = 0.02
"""Depth in the floor that is reported [m]."""
PAYLOAD = 1.0
"""Default payload of an arm [kg], which any arm should carry: URDFs state none."""
USUAL_OPENING = 0.07
"""Example of an opening where it is missing [m]."""
USUAL_LIMITS = {"revolute": (-2.9, 2.9), "prismatic": (0.0, 0.3)}
"""Example of a range where the URDF's is implausible [rad, m]."""
_CARRYING = re.compile(r"carry|tuck|transport|travel|park|stow", re.IGNORECASE)


class Status(Enum):
    """Origin of a value; a MISSING one is written as an example in a comment."""

    DERIVED = "derived"
    ASSUMED = "assumed"
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class Entry:
    """A key of a table, with its value and the reason for it."""

    key: str
    value: Any
    why: str = ""
    status: Status = Status.DERIVED

    def lines(self) -> Iterator[str]:
        """Write the entry as TOML, line by line."""
        why = " ".join(self.why.split())
        line = f"{'# ' if self.status is Status.MISSING else ''}{toml(self.key, is_key=True)} = {toml(self.value)}"
        if why and len(line) + len(why) + 4 > LONGEST:
            yield f"# {why}"
            why = ""
        yield f"{line}  # {why}" if why else line


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the file; ``path`` are its keys from the top, none for the root table."""

    path: tuple[str, ...]
    entries: list[Entry] = field(default_factory=list)

    def add(self, key: str, value: Any, why: str = "", status: Status = Status.DERIVED) -> None:
        """Add an entry."""
        self.entries.append(Entry(key, value, why, status))

    @property
    def header(self) -> str:
        """Header line of the table."""
        return f"[{'.'.join(toml(key, is_key=True) for key in self.path)}]"

    def lines(self) -> Iterator[str]:
        """Write the table as TOML, line by line; a table with missing values only becomes a comment."""
        if self.path:
            is_missing = all(entry.status is Status.MISSING for entry in self.entries)
            yield from ("", f"# {self.header}" if is_missing else self.header)
        for entry in self.entries:
            yield from entry.lines()


@dataclass(frozen=True, slots=True)
class Draft:
    """Draft of a robot file."""

    urdf: Path
    tables: list[Table] = field(default_factory=list)
    unused: Sequence[Diagnostic] = ()
    """Warnings about what an SRDF states and this robot cannot do."""

    def table(self, *path: str) -> Table:
        """Append a new table to the file."""
        self.tables.append(Table(path))
        return self.tables[-1]

    def text(self) -> str:
        """Write the whole file."""
        head = f"# Made from {self.urdf.name} by planlang robot make. Lengths in metres, angles in radians, times in s."
        lines = [line for table in self.tables for line in table.lines()]
        return visible("\n".join([" ".join(head.split()), "", *lines]) + "\n")

    def diagnostics(self) -> list[Diagnostic]:
        """List assumed values as notes, and missing ones as warnings, by table, after what of an SRDF is not used."""
        diagnostics = list(self.unused)
        for table in self.tables:
            subject = table.header if table.path else "the robot"
            for status, severity, code in ((Status.ASSUMED, note, "B010"), (Status.MISSING, warning, "B016")):
                entries = [entry for entry in table.entries if entry.status is status]
                if entries:
                    reasons = "; ".join(f"{entry.key}: {entry.why}" if entry.why else entry.key for entry in entries)
                    help = (
                        f"if it has that, state it in {subject} of the robot file" if status is Status.MISSING else None
                    )
                    diagnostics.append(
                        severity(code, f"{subject} {status.value}: {reasons}", Span(str(self.urdf)), help)
                    )
        return diagnostics


def toml(value: Any, *, is_key: bool = False) -> str:
    """Write a value in TOML syntax; numbers are rounded to nine digits, so that positions at a limit stay there."""
    match value:
        case str():
            if is_key and re.fullmatch(r"[A-Za-z0-9_-]+", value):
                return value
            return visible(json.dumps(value, ensure_ascii=False))  # TOML takes no DEL
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
    """Draft the robot file of a URDF. Raises BadInput for files that cannot be read.

    ``srdf`` is by default the file of the same stem beside it, if there is one; ``named`` is the path of the URDF to
    write into the robot file.
    """
    still = grounded(urdf)
    mechanism = Mechanism(still)
    beside = urdf.with_suffix(".srdf")
    source = srdf if srdf is not None else beside if beside.is_file() else None
    srdf_content = read_srdf(source, mechanism) if source is not None else None
    vet(urdf)
    world = PlanningWorld(Scene(()), RobotBody(still, CameraModel(mechanism.root)))
    unused = srdf_content.unused if srdf_content is not None else ()
    try:
        return _Maker(Draft(urdf, unused=unused), mechanism, srdf_content, world).make(named or urdf.name)
    finally:
        world.close()


def sunk_in_floor(world: PlanningWorld) -> str:
    """Word how deep the links that no joint moves are in the floor; "" up to 2 cm: the root link is on the floor."""
    depth = -float(world.robot.ground_points()[:, 2].min(initial=0.0))
    if depth <= SUNK:
        return ""
    return f"the robot stands {depth:.2f} m in the floor: [mount] size raises its root link to the height of the mount"


class _Maker:
    """Fills a draft, table by table."""

    def __init__(self, draft: Draft, mechanism: Mechanism, srdf: Srdf | None, world: PlanningWorld) -> None:
        self.draft, self.mechanism, self.srdf, self.world = draft, mechanism, srdf, world
        self.anatomy = Anatomy(mechanism)
        self.limbs = self._limbs()
        self.lift = anatomy.lift(mechanism, [limb.hand for limb in self.limbs])
        self.movers = {name for limb in self.limbs for name in mechanism.movers(limb.hand)}
        """Joints that move a hand, those of a torso included."""

    def make(self, urdf: str) -> Draft:
        first = self.draft.table()
        first.add("name", read_urdf(self.draft.urdf).tree.get("name") or self.draft.urdf.stem)
        first.add("urdf", urdf)
        if self.lift is not None:
            first.add("torso", self.lift.name, "raises the arms")
        if self.srdf is not None and self.srdf.touching:
            first.add("allowed_contacts", self.srdf.touching, "pairs that may touch, by the SRDF")
        self._base()
        self._mount()
        names: list[str] = []
        for limb in self.limbs:
            self._arm(limb, names)
        if not self.limbs:
            self._no_arm()
        self._camera()
        self._speeds()
        self._postures()
        return self.draft

    def _limbs(self) -> list[Limb]:
        """Find the arms: those that end at end effectors of the SRDF, else those of the kinematic tree."""
        end_effectors = self.srdf.end_effectors if self.srdf is not None else ()
        at_end_effectors = (
            self.anatomy.limb_of(one.parent_link, one.parent_group or one.name) for one in end_effectors
        )
        return [limb for limb in at_end_effectors if limb is not None and is_arm(limb)] or self.anatomy.arms

    # The base

    def _base(self) -> None:
        table = self.draft.table("base")
        drives, why = self._drives()
        table.add("radius", *self._radius())
        is_said = self.srdf is not None and self.srdf.base_joint is not None
        table.add("fixed", not drives, why, Status.DERIVED if is_said or drives else Status.ASSUMED)
        if is_said and not drives:
            return
        for key in ("speed", "acceleration", "turn_speed", "turn_acceleration", "jerk"):
            table.add(key, getattr(DEFAULT_BASE, key), "a slow default", Status.ASSUMED)

    def _drives(self) -> tuple[bool, str]:
        if self.srdf is not None and self.srdf.base_joint is not None:
            kind = self.srdf.base_joint
            return kind in ("planar", "floating"), f"the virtual joint of the SRDF is {kind}"
        wheels, legs = self.anatomy.wheels, self.anatomy.legs
        if wheels:
            return True, f"{wheels[0].name} turns a wheel"
        if legs:
            return True, f"legs carry it, from {legs[0].name} on: it is moved as a whole, and its legs stay as they are"
        if "base_footprint" in self.mechanism.links:
            return True, "base_footprint is the frame of mobile bases (REP 120)"
        free = base_joints(read_urdf(self.draft.urdf))
        if free:
            return True, f"{free[0]} moves freely"
        return False, "no wheel in the URDF, false if it stands on a base that drives"

    def _radius(self) -> tuple[float, str, Status]:
        """Radius of the base, its reason and its status: that of a circle around all links that no joint moves."""
        points = self.world.robot.ground_points()
        if not len(points):
            return DEFAULT_BASE.radius, "no link of the base has a shape", Status.ASSUMED
        reach = float(np.hypot(points[:, 0], points[:, 1]).max()) + MARGIN
        return round(reach, 3), "around the links that no joint moves", Status.DERIVED

    def _mount(self) -> None:
        sunk = sunk_in_floor(self.world)
        if sunk or (self.limbs and not self._drives()[0]):
            lowest = round(float(self.world.robot.ground_points()[:, 2].min(initial=0.0)), 3) + 0.0
            why = f"if it does not stand on the floor: what it stands on; its lowest shape is at z = {lowest}"
            size = [0.4, 0.4, max(0.6, -lowest)]
            self.draft.table("mount").add("size", size, sunk or why, Status.MISSING)

    # Arms

    def _arm(self, limb: Limb, names: list[str]) -> None:
        shape, side = (
            shape_of(limb, self.mechanism, self.world),
            anatomy.side(self.mechanism, limb, self.limbs),
        )
        name = re.sub(r"[^A-Za-z0-9_-]", "_", side or limb.name or "arm")
        names.append(name)
        name += f"_{names.count(name)}" if names.count(name) > 1 else ""
        table = self.draft.table("arms", name)
        chain = f"{len(limb.joints)} joints, {limb.joints[0].name} to {limb.joints[-1].name}{self._torso_of(limb)}"
        if side is not None:
            table.add("side", side, "from its names, or the position of its shoulder")
        table.add("tip", shape.tip, chain)
        if shape.offset is not None:
            table.add("tool_offset", shape.offset, "grip point in the tip's frame: between the fingertips")
        elif not shape.is_measured:
            table.add(
                "tool_offset", (0.0, 0.0, 0.1), "grip point in the tip's frame, if not its origin", Status.MISSING
            )
        table.add("hand", limb.hand, "the link that carries the fingers" if limb.fingers else "the last link")
        status = Status.DERIVED if shape.is_measured else Status.ASSUMED
        measured = "from the wrist to the fingers" if shape.is_measured else "the axis of the last joint"
        table.add("approach", shape.approach, measured, status)
        across = "the direction in which the fingers move" if shape.opened else "perpendicular to the approach"
        table.add("closing", shape.closing, across, Status.DERIVED if shape.opened else Status.ASSUMED)
        table.add("payload", PAYLOAD, "largest mass that the hand carries [kg]", Status.ASSUMED)
        self._gripper(name, shape)
        for joint in limb.joints:
            if joint.kind in ("revolute", "prismatic") and not 1e-6 < joint.upper - joint.lower < TURNS:
                why = f"the URDF's range, {joint.lower:g} to {joint.upper:g}, is implausible"
                usual = USUAL_LIMITS[joint.kind]
                self.draft.table("joints", joint.name).add("limits", usual, why, Status.MISSING)

    def _torso_of(self, limb: Limb) -> str:
        """Word which joints are above an arm; "" if there are none."""
        above = [name for name in self.mechanism.movers(limb.joints[0].parent) if name != (self.lift and self.lift.name)]
        return f"; {' to '.join(dict.fromkeys((above[0], above[-1])))} above it" if above else ""

    def _no_arm(self) -> None:
        """Say what was found in place of arms."""
        deepest = max(self.mechanism.links, key=lambda link: len(self.mechanism.movers(link)))
        found = len(self.mechanism.movers(deepest))
        what = f"no chain of {anatomy.LEAST_ARM} or more joints ends in a hand: the robot cannot reach anything"
        if found:
            what += f"; most joints, {found}, move {deepest}: state tip = \"{deepest}\" if that is a hand"
        self.draft.table("arms", "arm").add("tip", deepest, what, Status.MISSING)

    def _gripper(self, name: str, shape: HandShape) -> None:
        table = self.draft.table("arms", name, "gripper")
        if not shape.opened:
            what = "the URDF has no moving finger: without a gripper the robot cannot grasp anything"
            table.add("opened", {"finger_joint": 0.04}, what, Status.MISSING)
            table.add("closed", {"finger_joint": 0.0}, "", Status.MISSING)
            table.add("max_opening", USUAL_OPENING, "", Status.MISSING)
            return
        status = Status.DERIVED if shape.max_opening else Status.MISSING
        table.add("opened", shape.opened, "fingers farthest apart, up to a gap that is wide enough", status)
        table.add("closed", shape.closed, "fingers together", status)
        table.add("fingers", shape.fingers, "", status)
        measured = "95 % of the gap between the opened fingers"
        if not shape.max_opening:
            why = "no gap between two fingers was found; take the greatest opening from the hand's data sheet"
            table.add("max_opening", USUAL_OPENING, why, status)
        elif any(one.code == "B013" for one in read_description(self.draft.urdf).diagnostics):
            coarse = f"{measured}, some of whose meshes may be missing"
            table.add("max_opening", shape.max_opening, coarse, Status.ASSUMED)
        else:
            table.add("max_opening", shape.max_opening, measured)

    # Head

    def _camera(self) -> None:
        arms = [joint.name for limb in self.limbs for joint in limb.joints if joint is not self.lift]
        link, table = anatomy.camera(self.mechanism, arms), self.draft.table("camera")
        if link is None:
            what = "no link of the body or head is named like a camera; without one the robot needs --trust-map"
            table.add("link", "camera_optical_frame", what, Status.MISSING)
            return
        table.add("link", link, "from its name")
        neck = [name for name in self.mechanism.movers(link) if name not in self.movers]
        if neck:
            table.add("neck", neck, "joints that move the camera but no hand")
        optical = anatomy.is_optical(link)
        status, why = (Status.DERIVED, "an optical frame") if optical else (Status.ASSUMED, "not an optical frame")
        table.add("forward", (0.0, 0.0, 1.0) if optical else (1.0, 0.0, 0.0), why, status)
        table.add("up", (0.0, -1.0, 0.0) if optical else (0.0, 0.0, 1.0), why, status)
        for key, value in (("fov", 1.0), ("near", 0.3), ("far", 4.0)):
            table.add(key, value, "a common value", Status.ASSUMED)

    # Motion

    def _speeds(self) -> None:
        table = self.draft.table("joints", "default")
        for key in ("speed", "acceleration", "jerk"):
            table.add(key, getattr(DEFAULT_LIMITS, key), "a slow default", Status.ASSUMED)

    def _postures(self) -> None:
        """Add the named states of the SRDF; one with a name like "tuck" or "carry" is the carrying posture."""
        states = self.srdf.states if self.srdf else {}
        carrying = next((name for name in states if _CARRYING.search(name)), None)
        if carrying is not None and CARRYING not in states:
            self._posture(CARRYING, states[carrying], f"the state {carrying} of the SRDF")
        for name, state in states.items():
            self._posture(name, state, "a state of the SRDF")

    def _posture(self, name: str, state: Mapping[str, float], why: str) -> None:
        table = self.draft.table("postures", name)
        for number, (joint, value) in enumerate(state.items()):
            table.add(joint, value, why if number == 0 else "")


IGNORED_REASONS = ("Never", "Adjacent")
"""Reasons of pairs that need no entry: they cannot touch, or are never checked."""


@dataclass(frozen=True, slots=True)
class EndEffector:
    """A hand, attached to the link ``parent_link`` of an arm."""

    name: str
    parent_link: str
    parent_group: str


@dataclass(frozen=True, slots=True)
class Srdf:
    """The contents of an SRDF."""

    path: Path
    end_effectors: tuple[EndEffector, ...]
    states: Mapping[str, Mapping[str, float]]
    """Name -> joint positions; states of several groups under one name are merged."""
    base_joint: str | None
    """Type of the virtual joint between world and robot: "fixed", "planar" or "floating"."""
    touching: tuple[tuple[str, str], ...]
    """Pairs of links that may touch."""
    unused: tuple[Diagnostic, ...] = ()
    """Warnings about positions and hands that cannot be used."""


def read_srdf(path: Path, mechanism: Mechanism) -> Srdf:
    """Read the SRDF of a URDF. Raises BadInput (B009)."""
    try:
        robot = read_tree(path)
        if robot.tag != "robot":
            raise BadXml(f"is not SRDF: its root element is <{robot.tag}>, not <robot>", robot.line)
        if robot.find("link") is not None:
            raise BadXml("is not SRDF, but a URDF: it has a <link>", robot.line)
        for what, element in expressions_in(robot):
            line = element.line if isinstance(element, Element) else 1
            raise BadXml(f"{what} is not expanded: write the file out with xacro first", line)
    except BadXml as problem:
        raise BadInput([error("B009", problem.problem, Span(str(path), problem.line))]) from None
    states: dict[str, dict[str, float]] = {}
    unused: list[Diagnostic] = []

    def drop(element: ElementTree.Element, problem: str) -> None:
        line = element.line if isinstance(element, Element) else 1
        unused.append(warning("B011", f"{problem}; it is not used", Span(str(path), line)))

    base = robot.find("virtual_joint")
    of_base = None if base is None else base.get("name")
    for state in robot.iterfind("group_state"):
        name = state.get("name", "")
        for joint in state.iterfind("joint"):
            moved = joint.get("name", "")
            why_not, value = _position(joint, mechanism)
            if why_not and moved != of_base:
                drop(joint, f"<group_state> {name!r}: {why_not}")
            elif name and mechanism.actuated(moved):  # the others follow or never move
                states.setdefault(name, {})[moved] = value
    end_effectors = []
    for one in robot.iterfind("end_effector"):
        hand = EndEffector(one.get("name", ""), one.get("parent_link", ""), one.get("parent_group", ""))
        if hand.parent_link in mechanism.links:
            end_effectors.append(hand)
        else:
            drop(one, f"<end_effector> {hand.name!r}: the URDF has no link {hand.parent_link!r}")
    return Srdf(
        path,
        tuple(end_effectors),
        states,
        base.get("type") if base is not None else None,
        tuple(pair for pair in _touching(robot) if set(pair) <= set(mechanism.links)),
        tuple(unused),
    )


def _position(stated: ElementTree.Element, mechanism: Mechanism) -> tuple[str, float]:
    """Read the position of a joint in a state, with the reason why it cannot be taken, or ""."""
    name, text = stated.get("name", ""), stated.get("value", "")
    joint, values = mechanism.joints.get(name), numbers(text)
    if joint is None:
        return f"the URDF has no joint {name!r}", 0.0
    if len(values) != 1:
        return f"joint {name!r} needs a single number, not {text[:60]!r}", 0.0
    if joint.kind in ("revolute", "prismatic") and not joint.lower <= values[0] <= joint.upper:
        return f"joint {name!r} is at {values[0]:g}, outside its limits [{joint.lower:g}, {joint.upper:g}]", 0.0
    return "", values[0]


def _touching(robot: Element) -> Iterator[tuple[str, str]]:
    for pair in robot.iterfind("disable_collisions"):
        if pair.get("reason") not in IGNORED_REASONS:
            yield pair.get("link1", ""), pair.get("link2", "")
