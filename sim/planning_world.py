"""The world for planning queries: contacts, clearance, visibility and rays, for the robot at any configuration."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotations
from planlang.geometry.shapes import Size, SolidKind, footprint, outline_of
from planlang.kept import Latest
from planlang.protocols import Configuration, Contact, Touch
from planlang.records import dataclass
from sim.contact import GROUND, Ignored, Query
from sim.kinematic import KinematicScene
from sim.robot import BASE


@dataclass(frozen=True, slots=True)
class Solid:
    """Convex piece of a body: "box", "cylinder" (about z) or "sphere", extents [m], pose in the map."""

    body: str
    kind: SolidKind
    size: Size
    pose: Pose
    limb: bool
    """True for a part of a person's arm that has left its rest: hands may touch it."""


Band = tuple[float, float, float]
"""z_low, z_high and radius about the vertical through the base [m]."""
Outline = tuple[float, float, Array]
"""z_low, z_high [m] and a convex polygon (n, 2), counter-clockwise, in the frame of the base."""


@dataclass(slots=True, eq=False)
class Shape:
    """The robot in a posture seen from above, without some links; one entry per solid link."""

    bands: tuple[Band, ...]
    outlines: tuple[Outline, ...] | None = None
    """Inner approximations: within the links' true outlines; None until they are asked for, as they take long."""


INTO = 0.005
"""Depth of one body in another up to which they count as only touching [m]: more than what rests on others sinks in."""
MOST_LINES = 16_000
"""Number of lines per ray cast; PyBullet's limit."""
MOST_SHAPES = 64
"""Number of cached postures."""
_shapes: Latest[object, Shape] = Latest(MOST_SHAPES)


class PlanningWorld(KinematicScene):
    """A world in which nothing happens by itself: it is set to what is believed, and queried.

    A query about another configuration (:meth:`contacts`, :meth:`link_pose`, :meth:`visible`) leaves the robot there;
    whatever needs the robot's actual configuration restores it first, so that a series of queries needs no restoring.
    The true world (:class:`sim.world.PyBulletWorld`) has no such queries: they must not move what the robot acts on.
    """

    def link_pose(self, link: str, configuration: Configuration | None = None) -> Pose:
        """Pose of a link frame in the map, now or at another configuration; ``KeyError`` if unknown."""
        self._show(configuration or self._now)
        return self.robot.link_pose(link)

    def solid_frames(self, configuration: Configuration | None = None) -> Array:
        """Frames (n, 4, 4) in the map of the robot's solid links, in order, now or at another configuration."""
        self._show(configuration or self._now)
        places = self.robot.frames()
        frames = np.zeros((len(places), 4, 4))
        frames[:, :3, :3], frames[:, :3, 3], frames[:, 3, 3] = rotations(places[:, 3:]), places[:, :3], 1.0
        return frames

    def contacts(
        self,
        configuration: Configuration | None = None,
        moving: Collection[str] | None = None,
        *,
        ignore: Ignored = (),
        among: Collection[tuple[str, str]] | None = None,
    ) -> tuple[Contact, ...]:
        """Find the penetrations of the robot and what it holds, now or at another configuration.

        Joints not named keep their values. ``moving``: joint names, "x", "y", "yaw" or "base": test only links that
        these move, and for self-collision only pairs that they move relative to each other. ``ignore``: names of bodies
        or links, or (part, body) pairs, that may touch. For self-collision the body is also a link name. ``among``:
        candidate pairs, if it is known that no others can touch. Excluded: penetrations up to 0.5 mm; a hand and what
        it holds; hands, or held objects, and a person's arms; up to 2 cm between a held object and what it has touched
        since it was grasped.
        """
        if self._robot is None:
            return ()
        links, itself, apart = None, True, None
        if moving is not None:
            links = self._moved(moving)
            itself = not set(moving) <= {*BASE, "base"}
            apart = self._robot.moved_apart(frozenset(moving)) if itself else None
        return self._find(configuration or self._now, Query(links, apart, ignore, itself=itself, among=among))

    def overlapping(self, name: str, pose: Pose) -> tuple[str, ...]:
        """Name the bodies into which a body reaches by more than :data:`INTO` if it is put at a pose, where it stays.

        The robot is not counted.
        """
        self.set_pose(name, pose)
        return tuple(sorted(self._contacts.touching(name, -INTO)))

    def touches(self, links: Collection[str], configuration: Configuration | None = None) -> tuple[Touch, ...]:
        """List what links feel, now or at another configuration, as in the true world."""
        self._show(configuration or self._now)
        return self._contacts.touches(links)

    def self_contacts(self, configuration: Configuration | None = None) -> tuple[Contact, ...]:
        """Find the :meth:`contacts` that do not depend on the base pose: within the robot and with what it holds."""
        return () if self._robot is None else self._find(configuration or self._now, Query(others=False))

    @property
    def self_pairs(self) -> Sequence[tuple[int, int]]:
        """Pairs of solid links, by number, that must not touch each other."""
        return self._contacts.self_pairs

    def passed(self, start: Configuration, steps: Sequence[Mapping[str, float]]) -> frozenset[str]:
        """Find the bodies that moving links may meet along a joint path; a superset of those touched.

        ``start`` is the initial configuration, ``steps`` are the values of the moving joints, in order.
        """
        self._show(start)
        links = self._moved(name for step in steps for name in step)
        lower, upper = self.robot.boxes_along(sorted(links), steps)
        return frozenset(self._bodies.pieces[index].body for index in self._bodies.near(lower, upper)[1])

    def silhouette(self, without: Collection[str] = ()) -> tuple[Band, ...]:
        """Compute the space swept when the robot turns on the spot, with what it holds, in its present posture.

        Bands (z_low, z_high, radius) [m] around the vertical through the base, one for each solid link and held object,
        without what a joint of ``without`` moves.
        """
        bands, left_out = list(self._shape(without).bands), self._moved(without)
        for name, held in self.held.items():
            if not self.robot.carrier(held.link) & left_out:
                self._show(self._at_origin())
                low, high = self._bodies.box_of(name)
                radius = float(np.hypot(*np.maximum(np.abs(low[:2]), np.abs(high[:2]))))
                bands.append((float(low[2]), float(high[2]), radius))
        self._here()
        return tuple(bands)

    def outlines(self, without: Collection[str] = ()) -> tuple[Outline, ...]:
        """Compute the robot's outlines from above: z_low, z_high [m] and a polygon for each solid link and held piece.

        Polygons (n, 2) are in the frame of the base, counter-clockwise, and lie within the link; those of held pieces
        are around them. What a joint of ``without`` moves is left out.
        """
        shape, left_out = self._shape(without), self._moved(without)
        if shape.outlines is None:
            self._show(self._at_origin())
            numbers = self._numbers(without)
            polygons = (outline_of(points[:, :2].round(9)) for points in self.robot.points(numbers))
            shape.outlines = tuple(
                (low, high, polygon) for (low, high, _), polygon in zip(shape.bands, polygons, strict=True)
            )
        carried = []
        for name, held in self.held.items():
            if not self.robot.carrier(held.link) & left_out:
                self._show(self._at_origin())
                carried += [self._outline(index) for index in self._bodies.of[name]]
        self._here()
        return (*shape.outlines, *carried)

    def _outline(self, index: int) -> Outline:
        """Compute the outline of a piece of a body around where it is now."""
        piece, low, high = self._bodies.pieces[index], self._bodies.lower[index, 2], self._bodies.upper[index, 2]
        polygon = footprint(piece.pose, piece.part.size, cylinder=piece.part.kind == SolidKind.CYLINDER)
        return float(low), float(high), polygon

    def _shape(self, without: Collection[str]) -> Shape:
        """Compute the robot's shape in its posture, without links that a joint of ``without`` moves; cached."""
        robot = self.robot
        posture = tuple((name, value) for name, value in self._now.joints.items() if name not in without)
        key = robot.key, tuple(sorted(without)), posture
        if key not in _shapes:
            self._show(self._at_origin())
            numbers = self._numbers(without)
            lower, upper = (corners[:, 2].round(9).tolist() for corners in robot.boxes_of(numbers))
            radii = [round(robot.spread(number), 9) for number in numbers]
            _shapes[key] = Shape(tuple(zip(lower, upper, radii, strict=True)))
        return _shapes[key]

    def _numbers(self, without: Collection[str]) -> list[int]:
        """List the numbers of the solid links that no joint of ``without`` moves."""
        left_out = self._moved(without)
        return [number for number in range(len(self.robot.solid)) if number not in left_out]

    def _moved(self, names: Iterable[str]) -> frozenset[int]:
        """List the numbers of the solid links that any of these joints, or base coordinates, moves."""
        return frozenset[int]().union(*map(self.robot.moved_by, names))

    def _at_origin(self) -> Configuration:
        return Configuration((0.0, 0.0, 0.0), self._now.joints)

    def solids(self) -> tuple[Solid, ...]:
        """List the convex pieces of all bodies that are not held, without floors."""
        self._here()
        pieces = []
        for piece, height in zip(self._bodies.pieces, self._bodies.upper[:, 2].tolist(), strict=True):
            if piece.body in self.held or piece.body in self._bodies.removed or height < GROUND:
                continue
            x, y, z = piece.part.size
            if piece.part.kind != SolidKind.BOX:
                x = y = max(x, y)
            pieces.append(Solid(piece.body, piece.part.kind, (x, y, z), piece.pose, piece.yields))
        return tuple(pieces)

    def led_joints(self, configuration: Configuration) -> Mapping[str, float]:
        """Compute the joint values of leaves in a hand if the robot were at a configuration: they follow the hand."""
        self._show(configuration)
        return {leaf: self._leaves.values[leaf] for leaf in self._leaves.led}

    def touched_since_grasp(self, name: str) -> frozenset[str]:
        """Bodies in touch with a held one since it was grasped: slight contact with them is allowed."""
        return frozenset(self.held[name].touched)

    def still_touched(self, configuration: Configuration) -> Mapping[str, frozenset[str]]:
        """Compute what each held body would still touch of that if the robot were at a configuration."""
        self._show(configuration)
        return {name: frozenset(self._contacts.still_touched(name)) for name in self.held}

    def clear_lines(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Check which lines from starts (n, 3) to ends (n, 3) hit no body, ignoring the robot, (n,)."""
        self._here()
        parts = range(0, len(starts), MOST_LINES)
        hits = [
            self._rays.free(starts[first : first + MOST_LINES], ends[first : first + MOST_LINES]) for first in parts
        ]
        return np.concatenate(hits) if hits else np.zeros(0, bool)

    def sight(self, name: str, configuration: Configuration | None = None) -> tuple[float, Mapping[str, int]]:
        """Compute the share (0..1) of a body that the camera's lines of sight reach, and count what lines hit first.

        The counts include the robot's own links, and the body itself.
        """
        self.scene.body(name)
        self._show(configuration or self._now)
        pose = self.robot.link_pose(self._optics().link)
        return self._camera.sight(name, self._optics(), pose, self._rays.cast)
