"""Merge links that never move into those that carry them, where a robot has more links than PyBullet takes.

Frames without a shape go first, since nothing can touch them; the merged ones keep their names and poses
(:attr:`sim.description.Description.merged`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from planlang.geometry import Array
from planlang.geometry.matrices import angles_of, product, rigid, rotation_of
from planlang.geometry.urdf import Element, Joint
from planlang.geometry.urdf_schema import numbers

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
    origin = element.find("origin")
    xyz, rpy = (numbers("0 0 0" if origin is None else origin.get(name, "0 0 0")) for name in ("xyz", "rpy"))
    pose = product(by, rigid(rotation_of(*rpy), np.array(xyz)))
    if origin is None:
        origin = Element("origin")
        element.insert(0, origin)
    for name, values in (("xyz", pose[:3, 3].tolist()), ("rpy", angles_of(pose[:3, :3]))):
        origin.set(name, " ".join(repr(round(float(value), 12)) for value in values))
