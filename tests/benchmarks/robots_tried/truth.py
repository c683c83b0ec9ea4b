"""What robots are by their data sheets, SRDFs, READMEs, or their URDFs read by hand, and whether drafts agree with it.

``truth.toml`` states it, a table for each robot: ``urdf`` (relative to the folder of robots), ``maker``, ``package``,
``version``; ``base`` in words and whether it is ``fixed``; ``lift``, the joint that lifts the arms, if there is one;
``torso``, all joints between base and arms; ``camera``, frames of which each is right, none if there is no camera;
``says``, the robot in words; ``mount``, what a fixed arm has to stand on [m]. For each arm: ``hand``, any link that is
rigid with the last one; ``joints``, how many of its joints turn; ``opening`` and its ``source``, the gap between
the opened fingers [m], where something but a guess states it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from planlang.geometry.urdf import Joint, read_urdf

CLOSE = 0.005
"""Largest difference of two openings that agree [m]."""
USABLE = 0.95
"""Part of the gap between opened fingers that a robot file states as their opening."""


@dataclass(frozen=True)
class TrueArm:
    """An arm as it is."""

    hand: str
    joints: int
    opening: float | None = None
    source: str = ""


@dataclass(frozen=True)
class Truth:
    """A robot as it is."""

    urdf: str
    maker: str = ""
    package: str = ""
    version: str = ""
    base: str = ""
    fixed: bool | None = None
    lift: str = ""
    torso: tuple[str, ...] = ()
    camera: tuple[str, ...] = ()
    says: str = ""
    mount: tuple[float, ...] = ()
    arms: tuple[TrueArm, ...] = ()


@dataclass(frozen=True)
class Drafted:
    """What of a robot was drafted: from the robot file, and from what the robot is bound to."""

    fixed: bool
    torso: str
    camera: str
    arms: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """By name: ``tip``, ``hand``, ``opening`` (None without one), and ``joints``, the names of those that turn.

    Those of a torso may be among them: planlang moves it with the arm that reaches."""


def truth_of(table: Mapping[str, Any]) -> Truth:
    """Return the facts that a table states; raises TypeError for a key that is none."""
    given = {key: tuple(value) if isinstance(value, list) else value for key, value in table.items()}
    return Truth(**given | {"arms": tuple(TrueArm(**arm) for arm in table.get("arms", ()))})


def differences(truth: Truth, drafted: Drafted, urdf: Path) -> Iterator[tuple[str, str]]:
    """Yield what does not agree: "base", "arms", "tip", "opening", "camera" or "torso", and the difference in words."""
    if truth.fixed is not None and drafted.fixed != truth.fixed:
        yield "base", f"the base {'stands' if drafted.fixed else 'drives'}"
    joints = read_urdf(urdf).joints
    left = dict(drafted.arms)
    for arm in truth.arms:
        link = _rigid_with(joints, arm.hand)
        name = next((key for key, one in left.items() if {one["tip"], one["hand"]} & link), None)
        if name is None:
            yield "tip", f"no arm ends at {arm.hand}"
            continue
        yield from _arm_differences(arm, left.pop(name), name, truth.torso)
    for name, one in left.items():
        yield "arms", f"an arm {name} to {one['tip']}"
    if drafted.camera not in (truth.camera or ("",)):
        right = f"instead of {truth.camera[0]}" if truth.camera else "though it has none"
        yield "camera", f"{drafted.camera or 'no camera'} {right}"
    wanted = (truth.lift,) if truth.lift else ("", *truth.torso)
    if drafted.torso not in wanted:
        yield "torso", f"{drafted.torso or 'none'} instead of {truth.lift or ', '.join(truth.torso) or 'none'}"


def _arm_differences(
    arm: TrueArm, drafted: Mapping[str, Any], name: str, torso: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    count = sum(joint not in torso for joint in drafted["joints"])
    if count != arm.joints:
        yield "arms", f"the arm {name} has {count} joints that turn instead of {arm.joints}"
    opening = drafted["opening"]
    if arm.opening is not None and (opening is None or abs(opening - USABLE * arm.opening) > CLOSE):
        yield "opening", f"{name} opens {'unknown' if opening is None else f'{opening:.3f}'} of {arm.opening:g} m"


def _rigid_with(joints: tuple[Joint, ...], link: str) -> set[str]:
    """Return the links that no joint moves relative to one."""
    found, before = {link}, 0
    while len(found) > before:
        before = len(found)
        for joint in joints:
            if joint.kind == "fixed" and {joint.parent, joint.child} & found:
                found |= {joint.parent, joint.child}
    return found
