"""Links of a robot, and things, as spheres and as convex pieces, each in its own frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from executive.motion.hulls import Hull
from executive.motion.solids import Solids
from executive.motion.spheres import Spheres, kept_spheres
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from planlang.geometry.solid import ConvexSolid, SolidKind, convex_solid
from sim import PlanningWorld, Solid

_PLAIN = (SolidKind.BOX, SolidKind.CYLINDER, SolidKind.SPHERE)
"""Kinds that pieces can be."""


@dataclass(frozen=True, eq=False)
class Shaped:
    """A link or a thing, which consists of convex shapes."""

    name: str
    shapes: Sequence[ConvexSolid]

    @cached_property
    def spheres(self) -> tuple[tuple[Array, float], ...]:
        """Return for each shape the spheres in it, centres and radii (k, 4), and how far it sticks out of them [m]."""
        return tuple((np.column_stack([found.centres, found.radii]), found.slack) for found in self._filled)

    @cached_property
    def _filled(self) -> tuple[Spheres, ...]:
        return tuple(map(_filled, self.shapes))

    @cached_property
    def pieces(self) -> tuple[Solids, float]:
        """Return its pieces as an obstacle: plain shapes, the spheres in others; and how far these stick out [m]."""
        pieces: list[Solid] = []
        slack = 0.0
        for number, shape in enumerate(self.shapes):
            if shape.kind in _PLAIN:
                pieces.append(Solid(self.name, shape.kind, shape.size, shape.pose, limb=False))
                continue
            found = self._filled[number] if "_filled" in self.__dict__ else _filled(shape)
            slack = max(slack, found.slack)
            for centre, radius in zip(found.centres.tolist(), found.radii.tolist(), strict=True):
                size = (2 * radius, 2 * radius, 2 * radius)
                pieces.append(Solid(self.name, SolidKind.SPHERE, size, Pose(tuple(centre)), limb=False))
        return Solids.of(pieces), slack

    @property
    def exact(self) -> bool:
        """Return True if the pieces are all of it."""
        return all(shape.kind in _PLAIN for shape in self.shapes)


def links_of(world: PlanningWorld) -> tuple[Shaped, ...]:
    """Return the solid links of a world's robot, in their order."""
    robot = world.robot
    return tuple(Shaped(name, robot.hulls(number)) for number, name in enumerate(robot.solid_names))


def thing_in(world: PlanningWorld, name: str) -> Shaped:
    """Return a body of a world."""
    return Shaped(name, [convex_solid(part.kind, _even(part.kind, part.size), at) for part, at in world.pieces(name)])


def _filled(shape: ConvexSolid) -> Spheres:
    """Return the spheres in a shape, in the frame in which its pose is given."""
    spheres = kept_spheres(Hull(shape.points, shape.radius, shape.beyond))
    pose = shape.pose.matrix()
    return Spheres(moved(pose, spheres.centres), spheres.radii, spheres.slack)


def _even(kind: str, size: tuple[float, float, float]) -> tuple[float, float, float]:
    """Return the extents of a round piece as the world makes it: as wide as its larger side."""
    x, y, z = size
    return size if kind == SolidKind.BOX else (max(x, y), max(x, y), z)
