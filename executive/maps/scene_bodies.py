"""Bodies as relations ask about them: blocks, fronts, doors and level tops, wherever their poses come from."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.maps.semantic_map import SemanticMap
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from planlang.geometry.areas import Block, Door
from sim import Body, ComfortZone
from sim.joints import Articulation, JointKind
from sim.scene import BodyShape

LEANING = 0.05
"""Largest tilt of a top that counts as level [rad]: a bottle put down on it stays where it is."""


class SceneBodies(ABC):
    """Bodies by name; what is believed, or true, of them is up to the subclass."""

    @property
    @abstractmethod
    def map(self) -> SemanticMap:
        """The map whose ontology says what the bodies are."""

    @property
    @abstractmethod
    def joints(self) -> Mapping[str, Articulation]:
        """Leaf -> its joint."""

    @abstractmethod
    def names(self) -> Sequence[str]:
        """List all bodies."""

    @abstractmethod
    def body(self, name: str) -> Body:
        """Look up the description of a body."""

    @abstractmethod
    def pose(self, name: str) -> Pose:
        """Look up the map pose of a body."""

    @abstractmethod
    def zone(self, name: str) -> ComfortZone:
        """Look up the zone in which a person takes objects."""

    def size(self, name: str) -> tuple[float, float, float]:
        """Look up the extents of a body's box along its axes [m]."""
        return self.body(name).size

    def block(self, name: str) -> Block:
        """Compute the block of a body at its pose.

        Raises LocationUnresolvable if that pose is invalid.
        """
        pose, size = self.pose(name), self.size(name)
        if not all(map(math.isfinite, (*pose.position, *pose.orientation, *size))):
            problem = f"the pose or size of {name} is not finite: {pose}, {size}"
            raise LocationUnresolvable(problem, designator=name)
        if abs(math.hypot(*pose.orientation) - 1) > 1e-3:
            problem = f"the orientation of {name} is not a unit quaternion: {pose.orientation}"
            raise LocationUnresolvable(problem, designator=name)
        body, block = self.body(name), Block.of(pose, size, cylinder=self.is_round(name))
        stands = float(pose.rotation[2, 2]) >= math.cos(LEANING)
        return replace(block, wall=body.wall, soft=body.soft) if stands and (body.wall or body.soft) else block

    def is_person(self, name: str) -> bool:
        """Check whether a body is a person."""
        return self.body(name).shape is BodyShape.PERSON

    def is_room(self, name: str) -> bool:
        """Check whether a body is a room, which contains all others."""
        return self.body(name).shape is BodyShape.ROOM

    def is_graspable(self, name: str) -> bool:
        """Check whether a hand can grasp a body."""
        return self.body(name).graspable

    def is_round(self, name: str) -> bool:
        """Check whether a body is a cylinder."""
        return self.body(name).shape is BodyShape.CYLINDER

    def is_solid(self, name: str) -> bool:
        """Check whether a body can be touched, which a marker cannot."""
        return self.body(name).shape is not BodyShape.MARKER

    def rests_at(self, name: str) -> float | None:
        """Compute the height of a body's level top, or of a room's floor, to put objects on [m]; None without one."""
        shape, block = self.body(name).shape, self.block(name)
        if shape is BodyShape.ROOM:
            return block.low
        leans = np.abs(self.pose(name).matrix()[2, :3]).max() < math.cos(LEANING)
        lying = shape is BodyShape.CYLINDER and not block.round
        return None if shape in (BodyShape.PERSON, BodyShape.MARKER) or leans or lying else block.high

    def front(self, name: str) -> float | None:
        """Compute the heading of a body's front: a person's facing, the side of a door, or the x axis of furniture.

        None for graspable and round bodies, rooms and markers.
        """
        body = self.body(name)
        if body.shape is BodyShape.PERSON:
            return self.zone(name).heading
        if body.graspable or body.shape in (BodyShape.CYLINDER, BodyShape.MARKER, BodyShape.ROOM):
            return None
        block = self.block(name)
        for door in self.doors(name):
            if door.name != name:  # the side of the box that the door's middle is nearest to
                middle = np.array([[door.x, door.y]]) + door.width / 2 * np.array(
                    [[math.cos(door.heading), math.sin(door.heading)]]
                )
                x, y = block.to_local(middle)[0] / np.array([block.half_x, block.half_y])
                turn = (0.0 if x > 0 else math.pi) if abs(x) >= abs(y) else math.copysign(math.pi / 2, y)
                return block.yaw + turn
        return block.yaw

    def doors(self, name: str) -> Sequence[Door]:
        """Find the doors that a body is or has: objects of the class Door, itself, hinged to it, or parts of it."""
        known = {thing.iri: thing for thing in self.map.objects}
        things = [thing for thing in known.values() if thing.name == name and self._is_door(thing.types)]
        own = next((thing for thing in known.values() if thing.name == name), None)
        if own is not None and not things:
            hinged = (thing for thing in known.values() if own.iri in thing.hinged_to or thing.iri in own.parts)
            things = [thing for thing in hinged if self._is_door(thing.types)]
        return [self._door(thing.name, name) for thing in things if thing.name in self.names()]

    def _is_door(self, types: Sequence[str]) -> bool:
        return self.map.ontology.any_is_a(types, ("Door", "DoorwayCovering"))

    def _door(self, name: str, owner: str) -> Door:
        """Build a closed door; without a joint, its hinge is assumed at the edge nearer to a side of its owner."""
        joint = self.joints.get(name)
        if joint is not None and joint.kind is JointKind.HINGED and abs(joint.axis[2]) > 0.7:
            closed, (x, y, _) = self.body(name), joint.point
            heading = math.atan2(closed.pose.position[1] - y, closed.pose.position[0] - x)
            return Door(name, x, y, 2 * math.dist(closed.pose.position[:2], (x, y)), heading)
        leaf = self.block(name)
        along = leaf.yaw if leaf.half_x >= leaf.half_y else leaf.yaw + math.pi / 2
        half = max(leaf.half_x, leaf.half_y)
        hinge = -1.0
        if owner != name:
            frame = self.block(owner)
            edges = np.array(
                [[leaf.x + s * half * math.cos(along), leaf.y + s * half * math.sin(along)] for s in (-1, 1)]
            )
            gaps = np.array([frame.half_x, frame.half_y]) - np.abs(frame.to_local(edges))
            axis = int(np.argmax(np.abs(np.diff(frame.to_local(edges), axis=0))[0]))
            hinge = -1.0 if gaps[0, axis] <= gaps[1, axis] else 1.0
        x, y = leaf.x + hinge * half * math.cos(along), leaf.y + hinge * half * math.sin(along)
        return Door(name, x, y, 2 * half, along if hinge < 0 else along + math.pi)
