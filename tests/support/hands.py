"""An arm on a box that drives, with hands of many builds, as URDF and robot file; the hands approach along z."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

BOX = '<collision><origin xyz="{at}"/><geometry><box size="{size}"/></geometry></collision>'
BASE = """
name = "mine"
urdf = "mine.urdf"
[base]
radius = 0.25
speed = 0.5
acceleration = 0.5
turn_speed = 1.0
turn_acceleration = 1.0
jerk = 5.0
"""


@dataclass(frozen=True)
class Hand:
    """A hand: its fingers, by name their place (x, y) on the palm and their travel [m], and links that do not move."""

    fingers: Mapping[str, tuple[float, float, float]]
    opening: float
    still: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    counted: Sequence[str] = ()
    """Further links that the robot file lists as fingers."""
    length: float = 0.08
    """Of the fingers [m]."""


TWO = Hand({"left": (0.0, 0.005, 0.04), "right": (0.0, -0.005, -0.04)}, 0.076)
PLATE = Hand({"finger": (0.0, -0.035, 0.08)}, 0.076, {"plate": (0.0, -0.045)})
"""A finger that slides towards a plate of the hand."""
THREE = Hand({"one": (0.0, -0.005, -0.04), "two": (-0.03, 0.005, 0.04), "three": (0.03, 0.005, 0.04)}, 0.076)
THUMB = Hand(
    {"thumb": (0.0, -0.005, -0.04)}
    | {name: (x, 0.005, 0.04) for name, x in zip(("index", "middle", "ring"), (-0.03, 0.0, 0.03), strict=True)},
    0.076,
)
SUCTION = Hand({}, 0.0)


def _joint(name: str, kind: str, parent: str, child: str, at: str, axis: str, limits: tuple[float, float]) -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>'
        f'<axis xyz="{axis}"/><limit lower="{limits[0]}" upper="{limits[1]}" effort="1" velocity="1"/></joint>'
    )


def _arm(side: str, hand: Hand, y: float) -> str:
    """Four joints from a box, a palm and its fingers; all names begin with the side."""
    links = ["base", *(f"{side}_l{k}" for k in range(1, 5))]
    parts = [f'<link name="{name}">{BOX.format(at="0 0 0.1", size="0.05 0.05 0.14")}</link>' for name in links[1:-1]]
    parts.append(f'<link name="{links[-1]}">{BOX.format(at="0 0 0", size="0.12 0.14 0.04")}</link>')
    for k, (parent, child) in enumerate(pairwise(links), 1):
        at = f"0.1 {y} 0.5" if k == 1 else "0 0 0.2"
        parts.append(_joint(f"{side}_j{k}", "revolute", parent, child, at, ("0 0 1", "0 1 0")[k > 1], (-2.5, 2.5)))
    middle = 0.02 + hand.length / 2
    shape = BOX.format(at=f"0 0 {middle}", size=f"0.02 0.01 {hand.length}")
    for name, (x, at, travel) in hand.fingers.items():
        limits = (min(travel, 0.0), max(travel, 0.0))
        parts.append(f'<link name="{side}_{name}">{shape}</link>')
        parts.append(
            _joint(f"{side}_{name}_joint", "prismatic", links[-1], f"{side}_{name}", f"{x} {at} 0", "0 1 0", limits)
        )
    for name, (x, at) in hand.still.items():
        parts.append(f'<link name="{side}_{name}">{shape}</link>')
        parts.append(
            _joint(f"{side}_{name}_joint", "fixed", links[-1], f"{side}_{name}", f"{x} {at} 0", "0 1 0", (0.0, 0.0))
        )
    return "".join(parts)


def _tables(side: str, hand: Hand) -> str:
    lines = [f"[arms.{side}]", f'tip = "{side}_l4"', f"tool_offset = [0.0, 0.0, {hand.length}]"]
    lines += ["approach = [0, 0, 1]", "closing = [0, 1, 0]"]
    if hand.fingers:
        opened = ", ".join(f"{side}_{name}_joint = {travel}" for name, (_, _, travel) in hand.fingers.items())
        closed = ", ".join(f"{side}_{name}_joint = 0.0" for name in hand.fingers)
        fingers = ", ".join(f'"{side}_{name}"' for name in (*hand.fingers, *hand.counted))
        lines += [f"[arms.{side}.gripper]", f"opened = {{ {opened} }}", f"closed = {{ {closed} }}"]
        lines += [f"fingers = [{fingers}]", f"max_opening = {hand.opening}"]
    return "\n".join(lines)


def robot_with(folder: Path, more: str = "", **hands: Hand) -> Path:
    """Write a robot with an arm for each hand, by side; ``more`` is added to its URDF. Return its robot file."""
    arms = "".join(_arm(side, hand, 0.2 * k) for k, (side, hand) in enumerate(hands.items()))
    base = f'<link name="base">{BOX.format(at="0 0 0.25", size="0.4 0.4 0.48")}</link>'
    (folder / "mine.urdf").write_text(f'<robot name="mine">{base}{arms}{more}</robot>')
    tables = "\n".join(_tables(side, hand) for side, hand in hands.items())
    (folder / "mine.toml").write_text(f"{BASE}{tables}\n")
    return folder / "mine.toml"
