"""Quasi-static pushing: a hand moves things along their support, and doors, drawers and lids.

A thing gives way exactly as far as the hand would enter it. It slides and turns about the vertical as friction
dictates, with an ellipsoid as limit surface (R. Howe, M. Cutkosky, Practical force-motion models for sliding
manipulation, Int. J. Robotics Research 1996). The hand is frictionless: it pushes along the surface normal. Things
that stand on the pushed one move along; nothing tips over. Whatever stops the thing stops the hand.
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
from sim.contact import TOLERANCE, Contacts
from sim.falling import REST, Falling
from sim.leaves import Leaves

LEVEL = 0.5
"""Smallest horizontal share of a push direction: below it the thing is only pressed down."""
ALONG = 0.2
"""Smallest share of a push along a leaf's direction of motion, below which the leaf jams."""
STEPS = 12
"""Corrections within one world step until nothing penetrates any more."""
FREED = 1e-4
"""Clearance that a correction leaves between hand and thing [m]."""
SPREAD = 8 / 9
"""Squared ratio of greatest friction torque to greatest friction force, divided by the mean square distance of the
footprint from its centre; the value of a disc under even pressure."""


@dataclass(slots=True)
class Pushing:
    """Pushes in progress in one world."""

    bodies: Bodies
    leaves: Leaves
    contacts: Contacts
    falling: Falling
    hands: dict[str, frozenset[str]] = field(default_factory=dict)
    """Link of the robot -> names of the links of the hand there, which pushes."""
    touched: dict[str, set[str]] = field(default_factory=dict)
    """Thing pushed since a hand began to push -> bodies that it touched before."""

    def begin(self, link: str) -> None:
        """Let the hand at a link push obstacles."""
        self.hands[link] = self.contacts.robot.hand_links(link)

    def end(self, link: str) -> None:
        """Let obstacles stop the hand at a link again."""
        self.hands.pop(link, None)
        self.touched.clear()

    def contacts_after(self, find: Callable[[], tuple[Contact, ...]]) -> tuple[Contact, ...]:
        """Find the contacts that remain after pushed things have given way; if they cannot, restore their poses."""
        original = contacts = find()
        if not self.hands:
            return contacts
        poses, values = dict(self.bodies.poses), dict(self.leaves.values)
        for _ in range(STEPS):
            contact = next((one for one in contacts if self._is_pushed(one)), None)
            if contact is None:
                self._let_fall(poses)
                return contacts
            if not self._gives_way(contact):
                break
            contacts = find()
        self.leaves.values.update(values)
        for name, pose in poses.items():
            if self.bodies.poses[name] is not pose:
                self.bodies.place(name, pose)
        return original

    def _is_pushed(self, contact: Contact) -> bool:
        """Check whether the contact is between a pushing hand and something movable."""
        if not any(contact.part in links for links in self.hands.values()) or contact.body not in self.bodies.bodies:
            return False
        is_held = contact.body in self.contacts.held or self.leaves.leader(contact.body) is not None
        can_move = self.bodies.bodies[contact.body].movable or self.leaves.leaf_of(contact.body) is not None
        return can_move and not is_held

    def _gives_way(self, contact: Contact) -> bool:
        """Move the touched thing out of the hand's way; return False if something stops it."""
        touch = self.contacts.felt(contact)
        if touch is None:
            return False
        leaf = self.leaves.leaf_of(contact.body)
        moving = (contact.body, *self._on(contact.body)) if leaf is None else self.leaves.joints[leaf].bodies
        for name in moving:
            self.touched.setdefault(name, self.contacts.touching(name, REST))
        point, normal, depth = np.array(touch.point), -np.array(touch.normal), contact.depth + FREED
        if leaf is not None:
            moves = self._move_leaf(leaf, point, normal, depth)
        else:
            moves = self._slide(moving, point, normal, depth)
        return moves and not any(
            self.contacts.touching(name, -TOLERANCE) - self.touched[name] - set(moving) for name in moving
        )

    def _on(self, name: str) -> list[str]:
        """List the things that stand on a thing, directly or not."""
        return self.falling.standing_on(name, self.contacts.held)

    def _slide(self, moving: tuple[str, ...], point: Array, normal: Array, depth: float) -> bool:
        """Slide and turn a thing, with what is on it, so that ``point`` (3,) moves ``depth`` [m] along ``normal``."""
        share, pose = float(np.hypot(*normal[:2])), self.bodies.poses[moving[0]]
        if share < LEVEL or moving[0] in self.falling.on_the_way:
            return False
        ahead, arm = normal[:2] / share, point[:2] - pose.position[:2]
        level = np.argsort(np.abs(pose.rotation[2]), kind="stable")[:2]
        sides = np.array(self.bodies.bodies[moving[0]].size)[level]
        stiffness = SPREAD * float(sides @ sides) / 12
        torque = float(arm[0] * ahead[1] - arm[1] * ahead[0])
        distance = depth / share / (1 + torque**2 / stiffness)
        half_angle = distance * torque / stiffness / 2
        turn = Pose((0.0, 0.0, 0.0), (0.0, 0.0, math.sin(half_angle), math.cos(half_angle)))
        x, y, z = pose.position
        motion = Pose((x + distance * ahead[0], y + distance * ahead[1], z)) @ turn @ Pose((-x, -y, -z))
        for name in moving:
            self.bodies.place(name, motion @ self.bodies.poses[name])
        return True

    def _move_leaf(self, leaf: str, point: Array, normal: Array, depth: float) -> bool:
        """Move a leaf along its joint so that a point (3,) on it moves by ``depth`` along a normal (3,) [m]."""
        joint, value = self.leaves.joints[leaf], self.leaves.values[leaf]
        step = 1e-4
        back = joint.motion(value).inverse()
        gradient = (np.array((joint.motion(value + step) @ back @ Pose(tuple(point))).position) - point) / step
        along = float(gradient @ normal)
        if abs(along) < ALONG * float(np.linalg.norm(gradient)):
            return False
        new_value = joint.within(value + depth / along)
        self.leaves.put(leaf, new_value, self.leaves.inside(leaf, self.contacts.held))
        return abs(new_value - value) > abs(FREED / along) / 2

    def _let_fall(self, before: dict[str, Pose]) -> None:
        """Drop what was pushed over an edge, with what stands on it."""
        for name in self.touched:
            if self.bodies.poses[name] is before.get(name) or self.leaves.leaf_of(name) is not None:
                continue
            rest, support = self.falling.rest(name)
            if support is None or self.bodies.poses[name].position[2] - rest.position[2] > REST:
                self.falling.begin(name, self._on(name))
