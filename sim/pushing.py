"""Things that a hand pushes along what they stand on, and doors, drawers and lids that it pushes.

A thing gives way as far as the hand goes into it, no faster: it slides and turns about the vertical as friction below
lets it, the limit surface of which is taken as an ellipsoid (R. Howe, M. Cutkosky, Practical force-motion models for
sliding manipulation, Int. J. Robotics Research 1996). The hand is smooth: it pushes along the normal of the surface
that it meets. What stands on the thing goes with it; nothing tips over. What stops the thing stops the hand.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import field

import numpy as np

from planlang.geometry import Array, Pose
from planlang.protocols import Contact
from planlang.records import dataclass
from sim.bodies import Bodies
from sim.changes import REST, Changes
from sim.contact import TOLERANCE, Contacts
from sim.leaves import Leaves

LEVEL = 0.5
"""Least level share of the direction in which a thing is pushed: from above it is only pressed down."""
ALONG = 0.2
"""Least share of the direction of a push along the way of a leaf, below which it jams."""
STEPS = 12
"""Corrections in one step of the world until nothing penetrates any more."""
FREED = 1e-4
"""Room that a correction leaves between the hand and the thing [m]."""
SPREAD = 8 / 9
"""Square of the greatest torque of friction over the greatest force, over the mean square distance of the footprint's
points from its middle, as for a disc under even pressure."""


@dataclass(slots=True)
class Pushing:
    """The pushes of one world."""

    bodies: Bodies
    leaves: Leaves
    contacts: Contacts
    changes: Changes
    hands: dict[str, frozenset[str]] = field(default_factory=dict)
    """Link of the robot -> names of the links of the hand there, which pushes."""
    touched: dict[str, set[str]] = field(default_factory=dict)
    """Thing that has been pushed since a hand began to push -> bodies that it touched before."""

    def begin(self, link: str) -> None:
        """Let the hand at a link push what it meets."""
        self.hands[link] = self.contacts.robot.hand_links(link)

    def end(self, link: str) -> None:
        """Let it be stopped by what it meets again."""
        self.hands.pop(link, None)
        self.touched.clear()

    def contacts_after(self, find: Callable[[], tuple[Contact, ...]]) -> tuple[Contact, ...]:
        """Return the contacts that are left when what hands push has given way; if it cannot, it stays where it was."""
        first = found = find()
        if not self.hands:
            return found
        poses, values = dict(self.bodies.poses), dict(self.leaves.values)
        for _ in range(STEPS):
            met = next((one for one in found if self._is_pushed(one)), None)
            if met is None:
                self._let_fall(poses)
                return found
            if not self._gives_way(met):
                break
            found = find()
        self.leaves.values.update(values)
        for name, pose in poses.items():
            if self.bodies.poses[name] is not pose:
                self.bodies.place(name, pose)
        return first

    def _is_pushed(self, contact: Contact) -> bool:
        """Return whether a hand that pushes meets something that can move."""
        if not any(contact.part in links for links in self.hands.values()) or contact.body not in self.bodies.bodies:
            return False
        is_held = contact.body in self.contacts.held or self.leaves.leader(contact.body) is not None
        can_move = self.bodies.bodies[contact.body].movable or self.leaves.leaf_of(contact.body) is not None
        return can_move and not is_held

    def _gives_way(self, contact: Contact) -> bool:
        """Move what a hand meets out of its way; return False if something stops it."""
        touch = self.contacts.felt(contact)
        if touch is None:
            return False
        leaf = self.leaves.leaf_of(contact.body)
        moving = (contact.body, *self._on(contact.body)) if leaf is None else self.leaves.joints[leaf].bodies
        for name in moving:
            self.touched.setdefault(name, self.contacts.touching(name, REST))
        point, normal, depth = np.array(touch.point), -np.array(touch.normal), contact.depth + FREED
        if leaf is not None:
            moves = self._turned(leaf, point, normal, depth)
        else:
            moves = self._slid(moving, point, normal, depth)
        return moves and not any(
            self.contacts.touching(name, -TOLERANCE) - self.touched[name] - set(moving) for name in moving
        )

    def _on(self, name: str) -> list[str]:
        """Return what stands on a thing, and on that."""
        return self.changes.falling.standing_on(name, self.contacts.held)

    def _slid(self, moving: tuple[str, ...], point: Array, normal: Array, depth: float) -> bool:
        """Slide and turn a thing, with what is on it, so that a point (3,) goes so far along a normal (3,) [m]."""
        share, pose = float(np.hypot(*normal[:2])), self.bodies.poses[moving[0]]
        if share < LEVEL or moving[0] in self.changes.falling.on_the_way:
            return False
        ahead, arm = normal[:2] / share, point[:2] - pose.position[:2]
        level = np.argsort(np.abs(pose.rotation[2]), kind="stable")[:2]
        sides = np.array(self.bodies.bodies[moving[0]].size)[level]
        stiffness = SPREAD * float(sides @ sides) / 12
        torque = float(arm[0] * ahead[1] - arm[1] * ahead[0])
        way = depth / share / (1 + torque**2 / stiffness)
        half = way * torque / stiffness / 2
        turn = Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(half), math.cos(half)))
        x, y, z = pose.position
        motion = Pose((x + way * ahead[0], y + way * ahead[1], z)) @ turn @ Pose((-x, -y, -z))
        for name in moving:
            self.bodies.place(name, motion @ self.bodies.poses[name])
        return True

    def _turned(self, leaf: str, point: Array, normal: Array, depth: float) -> bool:
        """Move a leaf along its joint so that a point (3,) of it goes so far along a normal (3,) [m]."""
        joint, value = self.leaves.joints[leaf], self.leaves.values[leaf]
        step = 1e-4
        back = joint.motion(value).inverse()
        way = (np.array((joint.motion(value + step) @ back @ Pose(tuple(point))).position) - point) / step
        along = float(way @ normal)
        if abs(along) < ALONG * float(np.linalg.norm(way)):
            return False
        there = joint.within(value + depth / along)
        self.leaves.put(leaf, there, self.leaves.inside(leaf, self.contacts.held))
        return abs(there - value) > abs(FREED / along) / 2

    def _let_fall(self, before: dict[str, Pose]) -> None:
        """Let fall what was pushed over an edge, with what stands on it."""
        falling = self.changes.falling
        for name in self.touched:
            if self.bodies.poses[name] is before.get(name) or self.leaves.leaf_of(name) is not None:
                continue
            rest, support = falling.rest(name)
            if support is None or self.bodies.poses[name].position[2] - rest.position[2] > REST:
                falling.begin(name, self._on(name))
