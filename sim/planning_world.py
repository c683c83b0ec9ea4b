"""The world that planning asks: contacts, room, visibility and rays for the robot at any configuration."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotations
from planlang.geometry.shapes import SolidKind, outline_of
from planlang.protocols import Configuration, Contact, Touch
from planlang.records import dataclass
from sim.contact import GROUND, Ignored, Query
from sim.kinematic import KinematicScene
from sim.robot import BASE

Size = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Solid:
    """A convex piece of a body where it is: "box", "cylinder" (about z) or "sphere", extents [m], pose in the map."""

    body: str
    kind: SolidKind
    size: Size
    pose: Pose
    limb: bool
    """Part of a person's arm that has left its rest, which hands may touch."""


Band = tuple[float, float, float]
"""z_low, z_high and radius about the vertical through the base [m]."""
Outline = tuple[float, float, Array]
"""z_low, z_high [m] and a convex polygon (n, 2), counter-clockwise, in the frame of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A robot in a posture from above, without some links, one entry for each solid link."""

    bands: tuple[Band, ...]
    outlines: tuple[Outline, ...]
    """They hold no more than the links do."""


MOST_LINES = 16_000
"""Lines that are cast in one go: PyBullet takes no more."""
MOST_SHAPES = 64
"""Postures of which the shape is kept."""
_shapes: dict[object, Shape] = {}


class PlanningWorld(KinematicScene):
    """A world in which nothing happens by itself: it is made equal to what is believed, and asked.

    A query about another configuration (:meth:`contacts`, :meth:`link_pose`, :meth:`visible`) shows the robot there and
    leaves it; whatever needs the robot where it is puts it back first, so that a series of queries costs no restoring.
    The true world (:class:`sim.world.PyBulletWorld`) has none of this: what masses and motors move there may not be
    moved by a question.
    """

    def link_pose(self, link: str, configuration: Configuration | None = None) -> Pose:
        """Return the pose of a link frame in the map, now or at another configuration; ``KeyError`` if unknown."""
        self._show(configuration or self._now)
        return self.robot.link_pose(link)

    def solid_frames(self, configuration: Configuration | None = None) -> Array:
        """Return (n, 4, 4) frames in the map of the robot's solid links, in order, now or at another configuration."""
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
        """Return the penetrations of the robot and of what it holds, here or elsewhere; joints not named stay.

        ``moving``: joint names, "x", "y", "yaw" or "base": look only at links that these move, and in self-collision
        only at pairs that they move against each other. ``ignore``: names of
        bodies or links, or (part, body) pairs, that may touch. In self-collision the body is a link's name as well.
        ``among``: the only pairs that can touch at all, where somebody knows; they are looked at, nothing else.
        Left out: penetrations up to 0.5 mm; a hand and what it holds; hands, or held objects, and a person's arms; up
        to 2 cm between a held object and what it has touched since it was grasped.
        """
        if self._robot is None:
            return ()
        links, itself, apart = None, True, None
        if moving is not None:
            links = self._moved(moving)
            itself = not set(moving) <= {*BASE, "base"}
            apart = self._robot.moved_apart(frozenset(moving)) if itself else None
        return self._find(configuration or self._now, Query(links, apart, ignore, itself=itself, among=among))

    def touches(self, links: Collection[str], configuration: Configuration | None = None) -> tuple[Touch, ...]:
        """Return what links feel, now or at another configuration, as ``touches`` of the true world."""
        self._show(configuration or self._now)
        return self._contacts.touches(links)

    def self_contacts(self, configuration: Configuration | None = None) -> tuple[Contact, ...]:
        """Return the :meth:`contacts` that do not depend on the robot's pose: with what it holds, and in itself."""
        return () if self._robot is None else self._find(configuration or self._now, Query(others=False))

    @property
    def self_pairs(self) -> Sequence[tuple[int, int]]:
        """Pairs of solid links, by number, that must not touch each other."""
        return self._contacts.self_pairs

    def passed(self, start: Configuration, steps: Sequence[Mapping[str, float]]) -> frozenset[str]:
        """Return bodies that the links which some joints move may meet on a way; no others can be touched there.

        ``start``: the configuration at the beginning; ``steps``: the joints' values, one after another.
        """
        self._show(start)
        links = self._moved(name for step in steps for name in step)
        lower, upper = self.robot.boxes_along(sorted(links), steps)
        near = self._bodies.near(lower, upper).any(axis=0)
        return frozenset(self._bodies.pieces[index].body for index in np.flatnonzero(near).tolist())

    def silhouette(self, without: Collection[str] = ()) -> tuple[Band, ...]:
        """Return what the robot, with what it holds, needs of room when it turns on the spot in its present posture.

        Bands (z_low, z_high, radius) [m] around the vertical through the base, one for each solid link and held object;
        what a joint of ``without`` moves is left out.
        """
        found, left_out = list(self._shape(without).bands), self._moved(without)
        for name, held in self._held.items():
            if not self.robot.carrier(held.link) & left_out:
                self._show(self._at_origin())
                low, high = self._bodies.box_of(name)
                radius = float(np.hypot(*np.maximum(np.abs(low[:2]), np.abs(high[:2]))))
                found.append((float(low[2]), float(high[2]), radius))
        self._here()
        return tuple(found)

    def outlines(self, without: Collection[str] = ()) -> tuple[Outline, ...]:
        """Return the robot from above in its present posture: z_low, z_high [m] and a polygon for each solid link.

        Polygons (n, 2) are in the frame of the base, counter-clockwise, and hold no more than the link does; what a
        joint of ``without`` moves is left out.
        """
        found = self._shape(without).outlines
        self._here()
        return found

    def _shape(self, without: Collection[str]) -> Shape:
        """Return the robot in its posture, without links that a joint of ``without`` moves; once in a process."""
        robot = self.robot
        posture = tuple((name, value) for name, value in self._now.joints.items() if name not in without)
        key = robot.key, tuple(sorted(without)), posture
        if key not in _shapes:
            self._show(self._at_origin())
            left_out = self._moved(without)
            numbers = [number for number in range(len(robot.solid)) if number not in left_out]
            lower, upper = (corners[:, 2].round(9).tolist() for corners in robot.boxes_of(numbers))
            radii = [round(robot.spread(number), 9) for number in numbers]
            polygons = [outline_of(points[:, :2].round(9)) for points in robot.points(numbers)]
            while len(_shapes) >= MOST_SHAPES:
                del _shapes[next(iter(_shapes))]
            bands, outlines = zip(lower, upper, radii, strict=True), zip(lower, upper, polygons, strict=True)
            _shapes[key] = Shape(tuple(bands), tuple(outlines))
        return _shapes[key]

    def _moved(self, names: Iterable[str]) -> frozenset[int]:
        """Return the numbers of the solid links that one of some joints, or coordinates of the base, moves."""
        return frozenset[int]().union(*map(self.robot.moved_by, names))

    def _at_origin(self) -> Configuration:
        return Configuration((0.0, 0.0, 0.0), self._now.joints)

    def solids(self) -> tuple[Solid, ...]:
        """Return the convex pieces of all bodies not held, where they are, floors left out."""
        self._here()
        found = []
        for piece, height in zip(self._bodies.pieces, self._bodies.upper[:, 2].tolist(), strict=True):
            if piece.body in self._held or piece.body in self._bodies.removed or height < GROUND:
                continue
            x, y, z = piece.part.size
            if piece.part.kind != SolidKind.BOX:
                x = y = max(x, y)
            found.append(Solid(piece.body, piece.part.kind, (x, y, z), piece.pose, piece.yields))
        return tuple(found)

    def touched_since_grasp(self, name: str) -> frozenset[str]:
        """Return bodies that a held one has touched ever since it was grasped: it may go on touching them a little."""
        return frozenset(self._held[name].touched)

    def clear_lines(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Return which lines from starts (n, 3) to ends (n, 3) meet no body, the robot left out, (n,)."""
        self._here()
        parts = range(0, len(starts), MOST_LINES)
        hits = [
            self._rays.free(starts[first : first + MOST_LINES], ends[first : first + MOST_LINES]) for first in parts
        ]
        return np.concatenate(hits) if hits else np.zeros(0, bool)

    def sight(self, name: str, configuration: Configuration | None = None) -> tuple[float, Mapping[str, int]]:
        """Return the share (0..1) of a body that lines of sight from the camera reach, and what the lines hit first.

        The latter as name -> lines; the robot's own links go by their names, and lines that reach the body count
        for it.
        """
        self.scene.body(name)
        self._show(configuration or self._now)
        pose = self.robot.link_pose(self._optics().link)
        return self._camera.sight(name, self._optics(), pose, self._rays.cast)
