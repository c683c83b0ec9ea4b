"""Draft of a robot file from a URDF, and from an SRDF if there is one: derived, assumed and missing values.

Every value has a reason. Written out, it is a file for the user to complete, with missing values as comments; the same
text serves as robot file for a robot that is given by its URDF alone.
"""

from __future__ import annotations

import json
import re
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
from executive.robots.openings import REMEDY, in_series, replaced_meshes
from executive.robots.robot import CARRYING
from executive.robots.robot_file import DEFAULT_BASE, DEFAULT_LIMITS
from executive.robots.srdf import Srdf, read_srdf
from executive.robots.vetting import vet
from planlang.diagnostics import Diagnostic, Span, note, warning
from planlang.geometry.urdf import Joint, read_urdf
from planlang.records import dataclass
from planlang.visible import visible
from sim import CameraModel, PlanningWorld, RobotBody, Scene
from sim.contact import coarse_pairs

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
USUAL_FINGER = {"revolute": (0.0, 0.8), "continuous": (0.0, 0.8), "prismatic": (0.0, 0.04)}
"""The same for a finger [rad, m]."""
WIDEST_HAND = 0.3
"""Greatest plausible opening of a hand, and length of a finger [m]."""
LONGEST_FINGER = 3
"""Greatest number of joints of a finger that is no doubt one."""
UNEQUAL = 0.004
"""Difference between the openings of a left and a right hand with equal fingers that is reported [m]."""
PLATE = 0.01
"""Height of the plate on which a robot with legs stands, and gap between it and the soles [m]."""
_CARRYING = re.compile(r"carry|tuck|transport|travel|park|stow", re.IGNORECASE)


class Status(Enum):
    """Origin of a value; a MISSING one is written as an example in a comment."""

    DERIVED = "derived"
    ASSUMED = "assumed"
    DOUBTFUL = "doubtful"
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
        line = f"{'# ' if self.status is Status.MISSING else ''}{toml_key(self.key)} = {toml(self.value)}"
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
        return f"[{'.'.join(map(toml_key, self.path))}]"

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
        """List assumed values as notes, missing and doubtful ones as warnings, after what of an SRDF is not used."""
        diagnostics = list(self.unused)
        for table in self.tables:
            subject = table.header if table.path else "the robot"
            for status, (severity, code, advice) in _REPORTED.items():
                entries = [entry for entry in table.entries if entry.status is status]
                if entries:
                    reasons = "; ".join(f"{entry.key}: {entry.why}" if entry.why else entry.key for entry in entries)
                    message, help = f"{subject} {status.value}: {reasons}", advice and advice.format(subject)
                    diagnostics.append(severity(code, message, Span(str(self.urdf)), help))
        return diagnostics


_REPORTED = {
    Status.ASSUMED: (note, "B010", None),
    Status.MISSING: (warning, "B016", "if it has that, state it in {} of the robot file"),
    Status.DOUBTFUL: (warning, "B017", "compare it with the robot, and correct {} of the robot file"),
}
"""Status of values that are reported -> severity and code of the diagnostic, and its advice about a table."""


def toml_key(name: str) -> str:
    """Write the name of a value or a table in TOML syntax."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else toml(name)


def toml(value: Any) -> str:
    """Write a value in TOML syntax; numbers are rounded to nine digits, so that positions at a limit stay there."""
    match value:
        case str():
            return visible(json.dumps(value, ensure_ascii=False))  # TOML takes no DEL
        case bool():
            return "true" if value else "false"
        case float() | np.floating():
            return repr(round(float(value), 9) + 0.0)
        case Mapping():
            inner = ", ".join(f"{toml_key(key)} = {toml(one)}" for key, one in value.items())
            return f"{{ {inner} }}" if inner else "{}"
        case Sequence():
            return f"[{', '.join(map(toml, value))}]"
    return str(value)


def draft_of(
    urdf: Path, srdf: Path | None = None, *, named: str | None = None, hands: Sequence[str] = (), drives: str = ""
) -> Draft:
    """Draft the robot file of a URDF. Raises BadInput for files that cannot be read.

    ``srdf`` is by default the file of the same stem beside it, if there is one; ``named`` is the path of the URDF to
    write into the robot file. A self-model may say where arms end (links ``hands``), and that the base drives
    (``drives``: where it says so).
    """
    still = grounded(urdf)
    mechanism = Mechanism(still)
    beside = urdf.with_suffix(".srdf")
    source = srdf if srdf is not None else beside if beside.is_file() else None
    srdf_content = read_srdf(source, mechanism) if source is not None else None
    vet(urdf)
    parts = Anatomy(mechanism)
    standing = {joint.name for leg in parts.legs for joint in parts.subtree(leg)}
    moving = [joint for joint in mechanism.joints if joint not in standing]
    world = PlanningWorld(Scene(()), RobotBody(still, CameraModel(mechanism.root), moving=moving))
    unused = srdf_content.unused if srdf_content is not None else ()
    try:
        return _Maker(Draft(urdf, unused=unused), parts, srdf_content, world, hands, drives).make(named or urdf.name)
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

    def __init__(
        self, draft: Draft, parts: Anatomy, srdf: Srdf | None, world: PlanningWorld, hands: Sequence[str], drives: str
    ) -> None:
        self.draft, self.anatomy, self.srdf, self.world = draft, parts, srdf, world
        self.hands, self.drives = hands, drives
        self.mechanism = mechanism = parts.mechanism
        self.limbs = self._limbs()
        self.lift = mechanism.lift([limb.hand for limb in self.limbs])
        self.movers = dict.fromkeys(name for limb in self.limbs for name in mechanism.movers(limb.hand))
        """Joints that move a hand, those of a torso included."""

    def make(self, urdf: str) -> Draft:
        first = self.draft.table()
        first.add("name", read_urdf(self.draft.urdf).tree.get("name") or self.draft.urdf.stem)
        first.add("urdf", urdf)
        if self.lift is not None:
            first.add("torso", self.lift.name, "raises the arms")
        shapes = [shape_of(limb, self.mechanism, self.world) for limb in self.limbs]
        self._contacts(first, frozenset(finger for shape in shapes for finger in shape.fingers))
        self._base()
        self._mount()
        names: list[str] = []
        for limb, shape in zip(self.limbs, shapes, strict=True):
            self._arm(limb, shape, names, self._doubts(limb, shape, shapes))
        if not self.limbs:
            self._no_arm()
        self._camera()
        self._speeds()
        self._postures()
        return self.draft

    def _limbs(self) -> list[Limb]:
        """Find the arms: those that end at hands known as such, of a self-model or an SRDF, else by their joints."""
        if self.hands:
            return [limb for link in self.hands if (limb := self.anatomy.limb_of(link, "", least=1)) is not None]
        end_effectors = self.srdf.end_effectors if self.srdf is not None else ()
        at_end_effectors = (
            self.anatomy.limb_of(one.parent_link, one.parent_group or one.name) for one in end_effectors
        )
        return [limb for limb in at_end_effectors if limb is not None and is_arm(limb)] or self.anatomy.arms

    def _contacts(self, table: Table, fingers: frozenset[str]) -> None:
        """Add pairs of links that may touch; those of ``fingers`` may in any case.

        None for the robot of a self-model, which has nowhere to state that a shape is too coarse: it lifts its arms off
        the base instead, and has more room for their paths there.
        """
        if self.hands:
            return
        if self.srdf is not None and self.srdf.touching:
            table.add("allowed_contacts", self.srdf.touching, "pairs that may touch, by the SRDF")
            return
        slides = [name for name in self.movers if self.mechanism.joints[name].kind == "prismatic"]
        coarse = [list(pair) for pair in coarse_pairs(self.world.robot, slides) if not fingers.issuperset(pair)]
        if coarse:
            why = "near links that touch in most postures, or where a slide ends: their shapes are coarser"
            table.add("allowed_contacts", coarse, why)

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
        if self.drives:
            return True, self.drives
        wheels, legs = self.anatomy.wheels, self.anatomy.legs
        if wheels:
            return True, f"{wheels[0].name} turns a wheel"
        if legs:
            return True, f"legs carry it, from {legs[0].name} on: it is moved as a whole, and its legs stay as they are"
        footprint = next((link for link in self.mechanism.links if link.endswith("base_footprint")), None)
        if footprint is not None:
            return True, f"{footprint} is the frame of mobile bases (REP 120)"
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
        if sunk and self.anatomy.legs:
            points = self.world.robot.ground_points()
            size = [round(2 * float(np.abs(points[:, axis]).max()), 3) for axis in (0, 1)]
            why = "a thin plate under its feet: so they stay, as the base moves"
            table = self.draft.table("mount")
            table.add("size", [*size, PLATE], why)
            at = (0.0, 0.0, round(2 * PLATE - float(points[:, 2].min()), 3))
            table.add("at", at, "its root link, above the soles")
        elif sunk or (self.limbs and not self._drives()[0]):
            lowest = round(float(self.world.robot.ground_points()[:, 2].min(initial=0.0)), 3) + 0.0
            why = f"if it does not stand on the floor: what it stands on; its lowest shape is at z = {lowest}"
            size = [0.4, 0.4, max(0.6, -lowest)]
            self.draft.table("mount").add("size", size, sunk or why, Status.MISSING)

    # Arms

    def _arm(self, limb: Limb, shape: HandShape, names: list[str], doubts: Mapping[str, str]) -> None:
        side = anatomy.side(self.mechanism, limb, self.limbs)
        name = re.sub(r"[^A-Za-z0-9_-]", "_", side or limb.name or "arm")
        names.append(name)
        name += f"_{names.count(name)}" if names.count(name) > 1 else ""
        table = self.draft.table("arms", name)
        chain = f"{len(limb.joints)} joints, {limb.joints[0].name} to {limb.joints[-1].name}{self._torso_of(limb)}"
        if side is not None:
            table.add("side", side, "from its names, or the position of its shoulder")
        table.add("tip", shape.tip, chain)
        if shape.offset is not None:
            why = f"grip point in the tip's frame{', a guess' if shape.bare else ': between the fingertips'}"
            self._add_doubtful(table, "tool_offset", shape.offset, why, doubts)
        elif not shape.is_measured:
            table.add(
                "tool_offset", (0.0, 0.0, 0.1), "grip point in the tip's frame, if not its origin", Status.MISSING
            )
        carries = "the link that carries the fingers" if limb.fingers else "the last link"
        self._add_doubtful(table, "hand", limb.hand, carries, doubts)
        status = Status.DERIVED if shape.is_measured else Status.ASSUMED
        measured = "from the wrist to the fingers" if shape.is_measured else "the axis of the last joint"
        table.add("approach", shape.approach, measured, status)
        across = "the direction in which the fingers move" if shape.opened else "perpendicular to the approach"
        table.add("closing", shape.closing, across, Status.DERIVED if shape.opened else Status.ASSUMED)
        table.add("payload", PAYLOAD, "largest mass that the hand carries [kg]", Status.ASSUMED)
        self._gripper(name, shape, doubts)
        for joint in limb.joints:
            if joint.kind in ("revolute", "prismatic") and not 1e-6 < joint.upper - joint.lower < TURNS:
                self._limits(joint, USUAL_LIMITS)
        for joint in shape.stuck:
            self._limits(joint, USUAL_FINGER)

    def _limits(self, joint: Joint, usual: Mapping[str, tuple[float, float]]) -> None:
        """Say that a joint of the URDF lacks plausible limits."""
        is_endless = joint.kind == "continuous"
        why = f"{joint.lower:g} to {joint.upper:g}, is implausible" if not is_endless else "without end, is no finger's"
        table, (low, high) = self.draft.table("joints", joint.name), usual[joint.kind]
        limits = (-high, -low) if joint.lower < 0.0 >= joint.upper else (low, high)  # on the side of the URDF's range
        table.add("limits", limits, f"the URDF's range, {why}", Status.MISSING)

    @staticmethod
    def _add_doubtful(table: Table, key: str, value: object, why: str, doubts: Mapping[str, str]) -> None:
        if key in doubts:
            table.add(key, value, f"{why}; doubtful: {doubts[key]}", Status.DOUBTFUL)
        else:
            table.add(key, value, why)

    def _doubts(self, limb: Limb, shape: HandShape, shapes: Sequence[HandShape]) -> dict[str, str]:
        """Word what is implausible about a hand, by the key that states it."""
        doubts = {}
        joints = {finger.name: self.anatomy.motors(finger) for finger in limb.fingers}
        deepest = max(joints, key=lambda name: joints[name], default="")
        if joints and joints[deepest] > LONGEST_FINGER:
            doubts["hand"] = f"the finger from {deepest} on has {joints[deepest]} joints, it may be an arm"
        if shape.size > WIDEST_HAND:
            doubts["hand"] = f"a finger is {shape.size:.2f} m long, it may be an arm"
        if shape.unclear:
            doubts["max_opening"] = f"{shape.unclear}; the hand's data sheet says how far it opens"
        if shape.max_opening > WIDEST_HAND:
            doubts["max_opening"] = "wider than hands open"
        if shape.bare:
            doubts["tool_offset"] = doubts["max_opening"] = f"{shape.bare}; {REMEDY}"
            return doubts
        for other, twin in zip(self.limbs, shapes, strict=True):
            ranges = [
                sorted(round(abs(end), 3) for one in each.fingers for end in (one.lower, one.upper))
                for each in (limb, other)
            ]
            difference = abs(shape.max_opening - twin.max_opening)
            if ranges[0] == ranges[1] and min(shape.max_opening, twin.max_opening) > 0 and difference > UNEQUAL:
                advice = "compare the shapes of their fingers"
                doubts["max_opening"] = f"the other hand, with equal joints, opens {twin.max_opening:g} m: {advice}"
        return doubts

    def _torso_of(self, limb: Limb) -> str:
        """Word which joints are above an arm; "" if there are none."""
        lift = self.lift and self.lift.name
        above = [name for name in self.mechanism.movers(limb.joints[0].parent) if name != lift]
        return f"; {' to '.join(dict.fromkeys((above[0], above[-1])))} above it" if above else ""

    def _no_arm(self) -> None:
        """Say what was found in place of arms."""
        carrying = {
            one.child for joint in (*self.anatomy.wheels, *self.anatomy.legs) for one in self.anatomy.subtree(joint)
        }
        links = [link for link in self.mechanism.links if link not in carrying]
        deepest = max(links, key=lambda link: len(self.mechanism.movers(link)))
        found = len(self.mechanism.movers(deepest))
        what = f"no chain of {anatomy.LEAST_ARM} or more joints ends in a hand: the robot cannot reach anything"
        if found:
            what += f'; most joints, {found}, move {deepest}: state tip = "{deepest}" if that is a hand'
        self.draft.table("arms", "arm").add("tip", deepest, what, Status.MISSING)

    def _gripper(self, name: str, shape: HandShape, doubts: Mapping[str, str]) -> None:
        table = self.draft.table("arms", name, "gripper")
        if not shape.opened:
            found = f"finger {shape.stuck[0].name} with a plausible range" if shape.stuck else "moving finger"
            what = f"the URDF has no {found}: without a gripper the robot cannot grasp anything"
            if not shape.stuck:
                what += "; if it has one, merge its URDF into this one (docs/first_steps/own_robot.md)"
            table.add("opened", {"finger_joint": 0.04}, what, Status.MISSING)
            table.add("closed", {"finger_joint": 0.0}, "", Status.MISSING)
            table.add("max_opening", USUAL_OPENING, "", Status.MISSING)
            return
        status = Status.DERIVED if shape.max_opening else Status.MISSING
        table.add("opened", shape.opened, "fingers farthest apart", status)
        table.add("closed", shape.closed, "fingers together", status)
        table.add("fingers", shape.fingers, "", status)
        measured = "a guess" if shape.bare else "95 % of the gap between the opened fingers"
        sheet = "take the greatest opening from the hand's data sheet"
        if not shape.max_opening:
            cause = f", as {shape.bare}: {REMEDY}, or {sheet}" if shape.bare else f"; {sheet}"
            table.add("max_opening", USUAL_OPENING, f"no gap between two fingers was found{cause}", status)
        elif coarse := replaced_meshes(self.draft.urdf, shape.fingers):
            lost = f"boxes stand for the meshes of {in_series(coarse)}, which are missing or unreadable"
            why = f"95 % of the way of the fingertips; {lost}"
            table.add("max_opening", shape.max_opening, why, Status.ASSUMED)
        else:
            self._add_doubtful(table, "max_opening", shape.max_opening, measured, doubts)

    # Head

    def _camera(self) -> None:
        arms = [joint.name for limb in self.limbs for joint in limb.joints if joint is not self.lift]
        link, table = anatomy.camera(self.mechanism, arms), self.draft.table("camera")
        if link is None:
            on_arm = anatomy.camera(self.mechanism, ())
            what = "no link of the body or head is named like a camera; without one the robot has to trust the map"
            what += f"; {on_arm} does not look where a neck aims it, an arm moves it" if on_arm is not None else ""
            table.add("link", "camera_optical_frame", what, Status.MISSING)
            return
        table.add("link", link, "from its name")
        neck = [name for name in self.mechanism.movers(link) if name not in self.movers]
        if neck:
            table.add("neck", neck, "joints that move the camera but no hand")
        optical = anatomy.looks_along_z(self.mechanism, link)
        status, why = (Status.ASSUMED, "not an optical frame")
        if optical:
            named = anatomy.is_optical(link)
            status, why = (Status.DERIVED, "an optical frame") if named else (Status.ASSUMED, "by how it is mounted")
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
