"""The SRDF of a robot (https://wiki.ros.org/srdf): end effectors, named postures, type of the base, allowed contacts.

It is untrusted, as the URDF is, and read with the same bounds; what of its end effectors and postures this robot does
not have is reported.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path

from executive.robots.mechanism import Mechanism
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.geometry.urdf_schema import expressions_in, numbers
from planlang.geometry.xml_tree import BadXml, Element, read_tree
from planlang.records import dataclass

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
