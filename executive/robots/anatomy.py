"""Anatomy of a robot from its URDF: arms with their hands, wheels, a camera; names decide if it does not."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from executive.robots.mechanism import Mechanism
from executive.robots.robot import side_of
from planlang.geometry.urdf import Joint
from planlang.records import dataclass

LEAST_ARM = 4
"""Joints of an arm at least: what has fewer is a head, a finger or a sensor that turns."""
ASIDE = 0.03
"""Distance from the middle of the robot at which a shoulder is on one side [m]."""
TOOL = re.compile(r"tool|tcp|grip_?point|grasp|flange", re.IGNORECASE)
_WHEEL = re.compile(r"wheel|caster|roller|rotor|propeller", re.IGNORECASE)
_GRASPER = re.compile(r"grip|finger|jaw|claw|hand|pinch", re.IGNORECASE)
_NO_ARM = re.compile("head|neck|legs?|foot|feet|ankle|knee|thigh|calf|toes?|hip|sole|shank")
"""Words in the names of joints that are of no arm."""
_CAMERA = re.compile(r"optical|camera|kinect|realsense|openni|xtion|stereo", re.IGNORECASE)
_OPTICAL = re.compile(r"optical", re.IGNORECASE)
_COLOUR = re.compile(r"rgb|colou?r|stereo", re.IGNORECASE)
_NO_PICTURE = re.compile(r"depth|infra|(^|_)ir(_|\d|$)|imu|gyro|accel", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Limb:
    """A chain of joints that ends in a hand."""

    joints: tuple[Joint, ...]
    """Joints that move by themselves, from where it branches off to the wrist."""
    hand: str
    """Link that carries the fingers; without fingers, the last one."""
    fingers: tuple[Joint, ...] = ()
    """Moving joints at the hand."""
    name: str = ""
    """A name that somebody gave it."""


def moving_below(mechanism: Mechanism, link: str) -> tuple[Joint, ...]:
    """Return the moving joints that hang from a link or from what is rigid with it; wheels are left out."""
    group = frozenset(mechanism.rigid_with(link))
    return tuple(j for j in mechanism.joints.values() if j.parent in group and j.moves and not is_wheel(j))


def is_wheel(joint: Joint) -> bool:
    """Return whether a joint turns a wheel or a caster."""
    return joint.kind == "continuous" and any(_WHEEL.search(name) for name in (joint.name, joint.child))


def limb_of(mechanism: Mechanism, link: str, name: str) -> Limb | None:
    """Return the limb that ends at a link which is known to be a hand; None if too few joints move it."""
    movers = [joint for joint in mechanism.chain(link) if mechanism.actuated(joint.name)]
    if len(movers) < LEAST_ARM:
        return None
    whole = next((limb.joints for limb in limbs(mechanism) if movers[-1] in limb.joints), tuple(movers))
    fingers = moving_below(mechanism, link)
    hand = fingers[0].parent if fingers else link
    return Limb(tuple(joint for joint in movers if joint in whole), hand, fingers, name)


def limbs(mechanism: Mechanism) -> Iterator[Limb]:
    """Yield the limbs of a robot, in the order of its joints.

    A limb begins where several chains branch off. It ends at the last link, or where fingers branch off: after enough
    joints two moving parts, or one that is called a gripper.
    """
    open_: list[tuple[str, tuple[Joint, ...]]] = [(mechanism.root, ())]
    while open_:
        link, own = open_.pop()
        below = moving_below(mechanism, link)
        grasps = len(below) > 1 or any(_GRASPER.search(joint.name) for joint in below)
        if len(own) >= LEAST_ARM and (grasps or not below):
            yield Limb(own, below[0].parent if below else _last(mechanism, link), below)
            continue
        before = own if len(below) == 1 else ()
        for joint in reversed(below):
            open_.append((joint.child, (*before, joint) if mechanism.actuated(joint.name) else before))


def _last(mechanism: Mechanism, link: str) -> str:
    """Return the link in which fixed links end: a named tool, else the link itself."""
    group = mechanism.rigid_with(link)
    return next((name for name in reversed(group) if TOOL.search(name)), link)


def is_arm(limb: Limb) -> bool:
    """Return whether a limb may be an arm: none of its joints is called that of a leg or of a head."""
    names = (name for joint in limb.joints for name in (joint.name, joint.child))
    words = (word.lower() for name in names for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+", name))
    return not any(map(_NO_ARM.fullmatch, words))


def side(mechanism: Mechanism, limb: Limb, *, is_alone: bool) -> str | None:
    """Return "left" or "right", as the names of a limb say, else as its shoulder is beside the middle of the robot.

    What stands alone has a side only by name.
    """
    said = side_of(limb.name, limb.hand, *(joint.name for joint in limb.joints))
    short = {match[1].lower() for joint in limb.joints if (match := re.match(r"([lrLR])_", joint.name))}
    if said is None and len(short) == 1:
        said = {"l": "left", "r": "right"}[short.pop()]
    y = float(mechanism.frame(limb.joints[0].child)[1, 3])
    return said or (None if is_alone or abs(y) < ASIDE else "left" if y > 0 else "right")


def camera(mechanism: Mechanism, arms: Iterable[str]) -> str | None:
    """Return the link of the camera that no joint of an arm moves: an optical frame first, of a camera for colours."""
    carried = frozenset(arms)

    def rank(link: str) -> tuple[bool, bool, bool]:
        return _OPTICAL.search(link) is None, _NO_PICTURE.search(link) is not None, _COLOUR.search(link) is None

    found = [link for link in mechanism.links if _CAMERA.search(link) and carried.isdisjoint(mechanism.movers(link))]
    return min(found, key=rank, default=None)


def is_optical(link: str) -> bool:
    """Return whether a camera's frame looks along z, with y down, as frames called optical do."""
    return _OPTICAL.search(link) is not None


def wheels(mechanism: Mechanism) -> Sequence[str]:
    """Return the joints of wheels."""
    return [joint.name for joint in mechanism.joints.values() if is_wheel(joint)]
