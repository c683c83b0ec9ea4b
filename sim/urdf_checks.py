"""What makes a URDF unusable: names, ends of joints, pieces, circles, numbers."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping, Sequence
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from sim.xml_tree import Element

MOST_JOINTS = 127
"""PyBullet tells the poses of this many links."""

_NUMBERS = {
    ("origin", "xyz"): 3,
    ("origin", "rpy"): 3,
    ("axis", "xyz"): 3,
    ("box", "size"): 3,
    ("cylinder", "radius"): 1,
    ("cylinder", "length"): 1,
    ("capsule", "radius"): 1,
    ("capsule", "length"): 1,
    ("sphere", "radius"): 1,
    ("mesh", "scale"): 3,
    ("color", "rgba"): 4,
    ("mass", "value"): 1,
    ("limit", "lower"): 1,
    ("limit", "upper"): 1,
    ("limit", "velocity"): 1,
    ("limit", "effort"): 1,
    ("mimic", "multiplier"): 1,
    ("mimic", "offset"): 1,
    **{("inertia", f"i{axes}"): 1 for axes in ("xx", "xy", "xz", "yy", "yz", "zz")},
}
"""(element, attribute) -> how many numbers it holds."""
_SHOWN = 4


def check(path: Path, robot: Element) -> str:
    """The root link of a robot; raises BadInput with all that is wrong."""
    return _Checker(path, robot).check()


class _Checker:
    """Looks for everything that makes a URDF unusable."""

    def __init__(self, path: Path, robot: Element) -> None:
        self.path, self.robot = path, robot
        self.found: list[Diagnostic] = []

    def check(self) -> str:
        """The root link; raises BadInput."""
        links, joints = self._named("link"), self._named("joint")
        if not links:
            self._bad("the robot has no links", self.robot)
        if len(joints) > MOST_JOINTS:
            self._bad(f"the robot has {len(joints)} joints; the simulator takes at most {MOST_JOINTS}", self.robot)
        above: dict[str, str] = {}
        for name, joint in joints.items():
            ends = [_linked(joint, end) for end in ("parent", "child")]
            for end, link in zip(("parent", "child"), ends, strict=True):
                if link not in links:
                    problem = f"has a {end} link {link!r} that is not described" if link else f"names no {end} link"
                    self._bad(f"joint {name!r} {problem}", joint)
            if ends[1] in above:
                self._bad(f"link {ends[1]!r} hangs from two joints", joint)
            above[ends[1]] = ends[0]
        roots = [name for name in links if name not in above]
        if not self.found:
            self._check_roots(links, above, roots)
        self._numbers()
        if self.found:
            raise BadInput(self.found)
        return roots[0]

    def _check_roots(self, links: Mapping[str, Element], above: Mapping[str, str], roots: Sequence[str]) -> None:
        """Exactly one root, from which everything hangs."""
        if len(roots) > 1:
            message = f"the robot falls into {len(roots)} pieces, which begin at {', '.join(roots[:_SHOWN])}"
            self._bad(message, links[roots[1]])
            return
        hanging = set(roots)
        waiting = [name for name in links if name not in hanging]
        while waiting:
            further = [name for name in waiting if above[name] not in hanging]
            if len(further) == len(waiting):
                self._bad(f"links hang from each other in a circle: {', '.join(further[:_SHOWN])}", links[further[0]])
                return
            hanging.update(set(waiting) - set(further))
            waiting = further

    def _named(self, tag: str) -> dict[str, Element]:
        named: dict[str, Element] = {}
        for element in self.robot:
            assert isinstance(element, Element)
            if element.tag == tag:
                name = element.get("name", "")
                if not name:
                    self._bad(f"a {tag} has no name", element)
                elif name in named:
                    self._bad(f"there are two {tag}s {name!r}", element)
                named[name] = element
        return named

    def _numbers(self) -> None:
        for element in self.robot.iter():
            for attribute, text in element.items():
                wanted = _NUMBERS.get((element.tag, attribute))
                if wanted is not None and len(numbers(text)) not in ({1, 3} if element.tag == "mesh" else {wanted}):
                    message = f"<{element.tag} {attribute}={text[:60]!r}>: {wanted} finite number(s) expected"
                    self._bad(message, element)
        for geometry in self.robot.iter("geometry"):
            for shape in geometry:
                needed = extents_of(shape)
                values = [value for attribute in needed for value in numbers(shape.get(attribute, ""))]
                if needed and not (values and min(values) >= 0):
                    self._bad(f"<{shape.tag}> needs {' and '.join(needed)}, not below zero", shape)

    def _bad(self, message: str, element: ElementTree.Element) -> None:
        assert isinstance(element, Element)
        self.found.append(error("B009", message, Span(str(self.path), element.line)))


def _linked(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def extents_of(shape: ElementTree.Element) -> list[str]:
    """Names of the attributes that say how large a primitive is."""
    return [attribute for tag, attribute in _NUMBERS if tag == shape.tag and tag != "mesh"]


def numbers(text: str) -> tuple[float, ...]:
    """Finite numbers in an attribute; empty if any of them is none."""
    try:
        values = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return values if all(map(math.isfinite, values)) else ()
