"""Anatomy of a robot, from the structure of its URDF and, where that is ambiguous, from names: arms, wheels, camera."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from executive.robots.mechanism import Mechanism
from executive.robots.robot import side_of
from planlang.geometry.urdf import Joint
from planlang.records import dataclass

LEAST_ARM = 4
"""Least number of joints of an arm: shorter chains are heads, fingers or rotating sensors."""
ASIDE = 0.03
"""Least distance of a left or right shoulder from the sagittal plane [m]."""
TOOL = re.compile(r"tool|tcp|grip_?point|grasp|flange", re.IGNORECASE)
_WHEEL = re.compile(r"wheel|caster|roller|rotor|propeller", re.IGNORECASE)
_GRASPER = re.compile(r"grip|finger|jaw|claw|hand|pinch", re.IGNORECASE)
_NO_ARM = re.compile("head|neck|legs?|foot|feet|ankle|knee|thigh|calf|toes?|hip|sole|shank")
"""Words in names of joints and links of heads and legs."""
_CAMERA = re.compile(r"optical|camera|kinect|realsense|openni|xtion|stereo", re.IGNORECASE)
_OPTICAL = re.compile(r"optical", re.IGNORECASE)
_COLOUR = re.compile(r"rgb|colou?r|stereo", re.IGNORECASE)
_NO_PICTURE = re.compile(r"depth|infra|(^|_)ir(_|\d|$)|imu|gyro|accel", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Limb:
    """A chain of joints that ends in a hand."""

    joints: tuple[Joint, ...]
    """Actuated joints, from where it branches off to the wrist."""
    hand: str
    """Link that carries the fingers; without fingers, the last one."""
    fingers: tuple[Joint, ...] = ()
    """Moving joints at the hand."""
    name: str = ""
    """Name in an SRDF."""


def moving_below(mechanism: Mechanism, link: str) -> tuple[Joint, ...]:
    """List the moving joints below a link or the links rigidly attached to it, without wheels."""
    group = frozenset(mechanism.rigid_with(link))
    return tuple(j for j in mechanism.joints.values() if j.parent in group and j.moves and not is_wheel(j))


def is_wheel(joint: Joint) -> bool:
    """Check whether a joint turns a wheel or a caster."""
    return joint.kind == "continuous" and any(_WHEEL.search(name) for name in (joint.name, joint.child))


def limb_of(mechanism: Mechanism, link: str, name: str) -> Limb | None:
    """Build the limb that ends at a link known to be a hand; None if too few joints move it."""
    movers = [joint for joint in mechanism.chain(link) if mechanism.actuated(joint.name)]
    if len(movers) < LEAST_ARM:
        return None
    limb_joints = next((limb.joints for limb in limbs(mechanism) if movers[-1] in limb.joints), tuple(movers))
    fingers = moving_below(mechanism, link)
    hand = fingers[0].parent if fingers else link
    return Limb(tuple(joint for joint in movers if joint in limb_joints), hand, fingers, name)


def limbs(mechanism: Mechanism) -> Iterator[Limb]:
    """Yield the limbs of a robot, depth first in the order of its joints.

    A limb begins where several chains branch off. It ends at the last link, or where fingers branch off: after
    :data:`LEAST_ARM` joints, two moving parts, or one with the name of a gripper.
    """
    stack: list[tuple[str, tuple[Joint, ...]]] = [(mechanism.root, ())]
    while stack:
        link, chain_joints = stack.pop()
        below = moving_below(mechanism, link)
        grasps = len(below) > 1 or any(_GRASPER.search(joint.name) for joint in below)
        if len(chain_joints) >= LEAST_ARM and (grasps or not below):
            yield Limb(chain_joints, below[0].parent if below else _last(mechanism, link), below)
            continue
        branch = chain_joints if len(below) == 1 else ()
        for joint in reversed(below):
            stack.append((joint.child, (*branch, joint) if mechanism.actuated(joint.name) else branch))


def _last(mechanism: Mechanism, link: str) -> str:
    """Find the end of the links fixed to a link: the last one named like a tool, else the link itself."""
    group = mechanism.rigid_with(link)
    return next((name for name in reversed(group) if TOOL.search(name)), link)


def is_arm(limb: Limb) -> bool:
    """Check whether a limb can be an arm: none of its joints or links is named like that of a leg or a head."""
    names = (name for joint in limb.joints for name in (joint.name, joint.child))
    words = (word.lower() for name in names for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name))
    return not any(map(_NO_ARM.fullmatch, words))


def side(mechanism: Mechanism, limb: Limb, *, is_alone: bool) -> str | None:
    """Determine the side of a limb, "left" or "right": from its names, else from the position of its shoulder.

    A limb that ``is_alone`` has a side only by name.
    """
    by_name = side_of(limb.name, limb.hand, *(joint.name for joint in limb.joints))
    short = {match[1].lower() for joint in limb.joints if (match := re.match(r"([lrLR])_", joint.name))}
    if by_name is None and len(short) == 1:
        by_name = {"l": "left", "r": "right"}[short.pop()]
    y = float(mechanism.frame(limb.joints[0].child)[1, 3])
    return by_name or (None if is_alone or abs(y) < ASIDE else "left" if y > 0 else "right")


def camera(mechanism: Mechanism, arms: Iterable[str]) -> str | None:
    """Find the camera that no joint in ``arms`` moves: optical frames first, then colour cameras."""
    arm_joints = frozenset(arms)

    def rank(link: str) -> tuple[bool, bool, bool]:
        return _OPTICAL.search(link) is None, _NO_PICTURE.search(link) is not None, _COLOUR.search(link) is None

    cameras = [
        link for link in mechanism.links if _CAMERA.search(link) and arm_joints.isdisjoint(mechanism.movers(link))
    ]
    return min(cameras, key=rank, default=None)


def is_optical(link: str) -> bool:
    """Check whether a camera link is an optical frame, which looks along z with y down (REP 103)."""
    return _OPTICAL.search(link) is not None


def wheels(mechanism: Mechanism) -> Sequence[str]:
    """List the names of the joints of wheels."""
    return [joint.name for joint in mechanism.joints.values() if is_wheel(joint)]
