"""Anatomy of a robot: what each subtree of the joints of its URDF is.

The tree is read from its root. Wheels and legs carry the base. Where several subtrees hang
from one link, each is looked at: those that are chains of :data:`LEAST_ARM` or more joints by themselves are arms, and
the joints above them a torso; those that are short beside the chain that carries them are fingers, if there are two or
if names say so, else passive parts, such as a lamp on a fore-arm. Names decide only what the structure leaves open.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

from executive.robots.mechanism import Mechanism, Part, is_tool, names
from executive.robots.robot import side_of
from planlang.geometry.urdf import Joint
from planlang.records import dataclass

LEAST_ARM = 4
"""Least number of joints of an arm: shorter chains are heads, fingers or rotating sensors."""
SHORT = 0.45
"""Greatest length of a finger, as a fraction of that of the arm: arms are longer than this beside their torso."""
ASIDE = 0.03
"""Least distance of a left or right shoulder from the sagittal plane [m]."""
TURNS = 8 * math.pi
"""Range of a revolute joint beyond which it turns wheels, or is an error [rad]."""
LEVEL_CAMERA = 0.5
"""Least cosine between the vertical and the axis of a camera that points up in its picture."""
_OPTICAL = re.compile(r"optical", re.IGNORECASE)


@dataclass(frozen=True, slots=True, eq=False)
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


class Anatomy:
    """The parts of a robot."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        self._top: dict[str, str] = {mechanism.root: mechanism.root}
        """Link -> the uppermost link rigidly attached to it."""
        self._length = dict.fromkeys(mechanism.links, 0.0)
        """Link -> greatest length of the chains below it, from joint to joint, all drawn out [m]."""
        self._depth = dict.fromkeys(mechanism.links, 0)
        """Link -> greatest number of moving joints in a row below it."""
        self._below: dict[str, list[Joint]] = {}
        """Uppermost link of a rigid group -> joints that move parts of it, in the order of the file."""
        ordered = mechanism.below(mechanism.root)
        for joint in ordered:
            self._top[joint.child] = self._top[joint.parent] if joint.kind == "fixed" else joint.child
        for joint in reversed(ordered):
            below, above = joint.child, joint.parent
            self._length[above] = max(self._length[above], self._length[below] + _step(joint))
            self._depth[above] = max(self._depth[above], self._depth[below] + (joint.kind != "fixed"))
        for joint in mechanism.joints.values():
            if joint.kind != "fixed":
                self._below.setdefault(self._top[joint.parent], []).append(joint)
        self._alone: dict[str, list[Limb]] = {}
        self.wheels = [joint for joint in mechanism.joints.values() if is_wheel(joint)]
        limbs = self._limbs(mechanism.root, ())
        self.arms = [limb for limb in limbs if is_arm(limb)]
        self.legs = [joint for joint in self.moving_below(mechanism.root) if self._is_leg(joint)]

    def limb_of(self, link: str, name: str, *, least: int = LEAST_ARM) -> Limb | None:
        """Build the limb that ends at a link known to be a hand; None if fewer than ``least`` joints move it."""
        movers = [joint for joint in self.mechanism.chain(link) if self.mechanism.actuated(joint.name)]
        if len(movers) < least:
            return None
        limbs = self._limbs(self.mechanism.root, ())
        joints = next((limb.joints for limb in limbs if movers[-1] in limb.joints), tuple(movers))
        fingers = tuple(joint for joint in self.moving_below(link) if not self._is_passive(joint))
        hand = self._palm(fingers) if fingers else link
        return Limb(tuple(joint for joint in movers if joint in joints), hand, fingers, name)

    def motors(self, joint: Joint) -> int:
        """Count the joints with motors of their own in a row from a joint on, where most are."""
        own = self.mechanism.actuated(joint.name) and not names(Part.SPRING, joint.name, joint.child)
        return own + max(map(self.motors, self.mechanism.hung.get(joint.child, ())), default=0)

    def moving_below(self, link: str) -> list[Joint]:
        """List the joints that move parts of a link or of the links rigidly attached to it, without wheels."""
        return [joint for joint in self._below.get(self._top[link], ()) if not self._rolls(joint)]

    # Kinds of subtrees

    def _is_leg(self, joint: Joint) -> bool:
        """Check whether a subtree without an arm is a leg, by the names of its joints and links."""
        subtree = self.subtree(joint)
        has_arm = any(joint in self.mechanism.chain(limb.hand) for limb in self.arms)
        return not has_arm and len(subtree) > 1 and any(names(Part.LEG, one.name, one.child) for one in subtree)

    def _rolls(self, joint: Joint) -> bool:
        """Check whether a joint turns a wheel, or carries wheels only: steering, suspension, a leg on a wheel."""
        below = self._below.get(joint.child, ())
        return is_wheel(joint) or (bool(below) and all(map(self._rolls, below)))

    def _is_passive(self, joint: Joint) -> bool:
        """Check whether a joint moves a lamp, cable or sensor, by its name; a camera on a neck is a head."""
        is_short = self._depth[joint.child] <= 1 and not self._fans(joint)
        is_head = names(Part.HEAD, joint.name)
        return is_short and names(Part.PASSIVE, joint.name, joint.child) and not is_head and not _grasps(joint)

    def _fans(self, joint: Joint) -> bool:
        """Check whether several parts hang from some link below a joint, as fingers from a palm."""
        below = self._below.get(joint.child, ())
        return len(below) > 1 or any(map(self._fans, below))

    def _weight(self, joint: Joint) -> int:
        """Count the joints of a subtree."""
        return 1 + sum(map(self._weight, self._below.get(joint.child, ())))

    def _limbs(self, link: str, chain: tuple[Joint, ...]) -> list[Limb]:
        """Find the limbs below a link, depth first; the first of them continues the joints of ``chain``."""
        below = [joint for joint in self.moving_below(link) if not self._is_passive(joint)]
        arm = tuple(joint for joint in chain if self.mechanism.actuated(joint.name))
        if not below:
            return [Limb(arm, _last(self.mechanism, link))] if len(arm) >= LEAST_ARM else []
        if len(arm) >= LEAST_ARM and (fingers := self._fingers(below, self._drawn_out(chain[0], link))):
            return [Limb(arm, self._palm(fingers), fingers)]
        if not chain and len(below) == 1:
            return self._limbs(below[0].child, (below[0],))
        limbs = {joint: self._limbs_at(joint) for joint in below}
        bearing = [joint for joint in below if limbs[joint]]
        others = [joint for joint in below if joint not in bearing]
        if len(bearing) > 1 or (bearing and any(map(self._is_separate, others))):
            return [limb for joint in bearing for limb in limbs[joint]]
        trunk, *rest = sorted(bearing or below, key=self._share_of_an_arm, reverse=True)
        if rest and self._share_of_an_arm(rest[0]) == self._share_of_an_arm(trunk):
            return []  # fingers of an arm that is too short
        return self._limbs(trunk.child, (*chain, trunk))

    def _share_of_an_arm(self, joint: Joint) -> tuple[bool, int, bool]:
        """Rank how likely an arm goes on at a joint: to a hand, over more joints, by its name."""
        return self._fans(joint), self._weight(joint), names(Part.WRIST, joint.name, joint.child)

    def _limbs_at(self, joint: Joint) -> list[Limb]:
        """Find the limbs that begin at a joint or below it."""
        if joint.name not in self._alone:
            self._alone[joint.name] = self._limbs(joint.child, (joint,))
        return self._alone[joint.name]

    def _is_separate(self, joint: Joint) -> bool:
        """Check whether a subtree without arms is a part of its own beside an arm, such as a head or a leg."""
        texts = [text for one in self.subtree(joint) for text in (one.name, one.child)]
        return self._depth[joint.child] > 0 or any(names(word, *texts) for word in (Part.HEAD, Part.LEG, Part.CAMERA))

    def subtree(self, joint: Joint) -> list[Joint]:
        """List a joint and all joints below it, fixed ones included."""
        return [joint, *self.mechanism.below(joint.child)]

    def _fingers(self, below: list[Joint], arm: float) -> tuple[Joint, ...]:
        """Choose the fingers among the parts at the end of an arm of some length [m]; none if the arm goes on."""
        if any(self._length[joint.child] > SHORT * arm for joint in below):
            return ()
        if len(below) == 1:
            (joint,) = below
            if self._fans(joint) or not _grasps(joint):
                return ()
            inner = [one for one in self._below.get(joint.child, ()) if joint.kind == one.kind == "prismatic"]
            return (joint, *inner)
        fanning = [joint for joint in below if self._fans(joint)]
        if len(fanning) == 1:
            heaviest = max(self._weight(joint) for joint in below if joint not in fanning)
            if self._weight(fanning[0]) > 2 * heaviest:
                return ()  # a wrist that carries a hand, beside a passive part
        others = [joint for joint in below if not _grasps(joint)]
        if any(names(Part.WRIST, joint.name, joint.child) for joint in others):
            return ()
        carrying = [joint for joint in others if any(_grasps(one) for one in self.subtree(joint) if one.moves)]
        if carrying and len(others) == len(below):
            return ()  # a hand is further on
        return tuple(joint for joint in below if not self._is_odd(joint, below))

    def _palm(self, fingers: Sequence[Joint]) -> str:
        """Find the link that carries fingers, or the links that they hang from."""
        parents = [joint.parent for joint in fingers if self._top[joint.parent] == self._top[fingers[0].parent]]
        return self.mechanism.common_ancestor(parents)

    def _is_odd(self, joint: Joint, all_of_them: list[Joint]) -> bool:
        """Check whether a joint among fingers differs in kind and name from all others, which have names of fingers."""
        others = [one for one in all_of_them if one is not joint]
        return len(others) > 1 and not _grasps(joint) and all(_grasps(one) and one.kind != joint.kind for one in others)

    def _drawn_out(self, first: Joint, link: str) -> float:
        """Length of the chain from a joint to a link, all drawn out [m]."""
        chain = self.mechanism.chain(link)
        return _stroke(first) + sum(map(_step, chain[chain.index(first) + 1 :]))


def _stroke(joint: Joint) -> float:
    return joint.upper - joint.lower if joint.kind == "prismatic" else 0.0


def _step(joint: Joint) -> float:
    """Greatest distance from the frame of a joint's parent to that of its child [m]."""
    return float(np.linalg.norm(joint.origin[:3, 3])) + _stroke(joint)


def _grasps(joint: Joint) -> bool:
    """Check whether a joint moves a finger, by its name; the joint "gripper_roll" is one of the wrist."""
    is_finger, is_hand = (names(part, joint.name, joint.child) for part in (Part.FINGER, Part.HAND))
    return is_finger or (is_hand and not names(Part.WRIST, joint.name))


def is_wheel(joint: Joint) -> bool:
    """Check whether a joint turns a wheel or a caster: it makes several turns, and is named so."""
    turns = joint.kind == "continuous" or (joint.kind == "revolute" and joint.upper - joint.lower > TURNS)
    return turns and names(Part.WHEEL, joint.name, joint.child)


def is_arm(limb: Limb) -> bool:
    """Check whether a limb can be an arm: none of its joints or links is named like that of a leg or a head."""
    return not any(names(part, one.name, one.child) for one in limb.joints for part in (Part.LEG, Part.HEAD))


def _last(mechanism: Mechanism, link: str) -> str:
    """Find the end of the links fixed to a link: the last one named like a tool, else the link itself."""
    group = mechanism.rigid_with(link)
    return next((name for name in reversed(group) if is_tool(name)), link)


def side(mechanism: Mechanism, limb: Limb, limbs: Sequence[Limb]) -> str | None:
    """Determine the side of a limb, "left" or "right": from its names, else from the position of its shoulder.

    Names may differ from those of another of the ``limbs`` by one letter alone: "arml_1" and "armr_1". A limb that is
    alone has a side only by name.
    """
    joint_names = [joint.name for joint in limb.joints]
    by_name = side_of(limb.name, limb.hand, *joint_names)
    if by_name is None:
        short = {match[1] for name in joint_names if (match := re.match(r"([lr])_", name, re.IGNORECASE))}
        twins = [(a, b.name) for one in limbs for a, b in zip(joint_names, one.joints, strict=False)]
        pairs = ({(x, y) for x, y in zip(a, b, strict=False) if x != y} for a, b in twins if len(a) == len(b))
        short |= {x for pair in pairs if len(pair) == 1 for x, y in pair if {x.lower(), y.lower()} == {"l", "r"}}
        letters = {letter.lower() for letter in short}
        by_name = {"l": "left", "r": "right"}[letters.pop()] if len(letters) == 1 else None
    y = float(mechanism.frame(limb.joints[0].child)[1, 3])
    return by_name or (None if len(limbs) == 1 or abs(y) < ASIDE else "left" if y > 0 else "right")


def camera(mechanism: Mechanism, arms: Iterable[str]) -> str | None:
    """Find the camera that no joint in ``arms`` moves: optical frames first, then colour cameras."""
    arm_joints = frozenset(arms)

    def rank(link: str) -> tuple[bool, bool, bool, bool, bool]:
        is_plain = not names(Part.CAMERA, link)
        has_no_picture, is_mount = names(Part.NO_PICTURE, link), names(Part.MOUNT, link)
        return is_mount, not is_optical(link), has_no_picture, not names(Part.COLOUR, link), is_plain

    cameras = [
        link
        for link in mechanism.links
        if (is_optical(link) or names(Part.CAMERA, link)) and arm_joints.isdisjoint(mechanism.movers(link))
    ]
    return min(cameras, key=rank, default=None)


def is_optical(link: str) -> bool:
    """Check whether a camera link is an optical frame, which looks along z with y down (REP 103)."""
    return _OPTICAL.search(link) is not None


def looks_along_z(mechanism: Mechanism, link: str) -> bool:
    """Check whether a camera looks along z with y down, by how it is mounted, else by its name."""
    frame = mechanism.frame(link)[:3, :3]
    plain, optical = float(frame[2, 2]), -float(frame[2, 1])
    return optical > plain if max(plain, optical) > LEVEL_CAMERA else is_optical(link)
