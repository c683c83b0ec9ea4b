"""Reads SRDF, which says of a URDF which joints are an arm, where hands are, and named states.

Format: https://wiki.ros.org/srdf. It comes from a stranger, as the URDF does, and is read in the same bounds; what it
names and the URDF does not have is left out.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from planlang.diagnostics import BadInput, Span, error
from planlang.geometry.urdf import BadXml, Element, numbers, read_tree
from planlang.records import dataclass

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
