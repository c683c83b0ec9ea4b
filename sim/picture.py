"""Pictures of a scene for people: of all of it, or of things and the hand at them from where they are seen best."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import corners
from sim.bodies import FLOOR, Bodies
from sim.camera import Picture, raster
from sim.engine import bullet
from sim.people import People
from sim.robot import Robot

FIELD = math.radians(45)
"""Vertical opening angle of pictures [rad]: that of a common lens."""
AT_HAND = 0.5
"""A hand that is nearer to a thing than this belongs into its picture [m]: more than a hand's own length."""
LEAST_RADIUS = 0.3
"""Half the height that a picture shows at least [m]: a close-up of a bottle would not show where it is."""
AROUND, TILTS = 16, (20.0, 40.0, 60.0)
"""Directions from which a close view is tried: around the vertical, and above the horizon [deg]."""
SMALL = (96, 72)
"""Pixels of the pictures by which views are compared: enough to count a bottle's."""

_FORWARD = np.array([0.62, 0.62, -0.9]) / math.hypot(0.62, 0.62, 0.9)
_HEIGHT = 1.0  # what is higher may be cut off: the tops of walls
_BORDER = 0.96

Point = tuple[float, float, float]
View = tuple[Point, Point]
"""Eye and target, in the map."""


class Painter:
    """Takes pictures of the bodies, and of the robot, in one physics client."""

    def __init__(self, bodies: Bodies, people: People, robot: Robot | None) -> None:
        self.bodies, self.people, self.robot = bodies, people, robot

    def render(self, width: int, height: int, view: View) -> Picture:
        """Return a picture (height, width, 3); walls that stand between the eye and the room are left out."""
        image = self._raster(width, height, view, shadow=1)
        return np.asarray(image[2], dtype=np.uint8).reshape(height, width, 4)[:, :, :3].copy()

    def _raster(self, width: int, height: int, view: View, *, shadow: int = 0, links: bool = False) -> Sequence[object]:
        eye, target = view
        hidden = [index for index in range(len(self.bodies.pieces)) if self._in_the_way(index, eye)]
        self.bodies.hide(hidden)
        try:
            towards = bullet.computeViewMatrix(list(eye), list(target), [0.0, 0.0, 1.0])
            light = (-2.0, -3.0, 6.0)
            image: Sequence[object] = raster(
                self.bodies.client, width, height, towards, FIELD, shadow=shadow, light=light, links=links
            )
        finally:
            self.bodies.show(hidden)
        return image

    def _in_the_way(self, index: int, eye: Sequence[float]) -> bool:
        piece = self.bodies.pieces[index]
        if piece.part.outward is None or piece.body in self.bodies.removed:
            return False
        normal = rotated(piece.pose.rotation, np.asarray(piece.part.outward))
        return float((np.asarray(eye) - np.asarray(piece.pose.position)) @ normal) > 0.0

    def overview(self, aspect: float) -> View:
        """Return a view from above the corner of least x and y, as near as shows everything up to table height."""
        boxes = [self.bodies.box_of(name) for name in self.bodies.of if name != FLOOR]
        boxes = [box for box in boxes if np.isfinite(box[0]).all()] or [(np.full(3, -1.0), np.full(3, 1.0))]
        lower = np.min([box[0] for box in boxes], axis=0)
        upper = np.max([box[1] for box in boxes], axis=0)
        lower[2], upper[2] = max(lower[2], 0.0), min(upper[2], _HEIGHT)
        offsets = corners(Pose((0.0, 0.0, 0.0)), upper - lower)
        return _looking((lower + upper) / 2, _FORWARD, _distance(offsets, _FORWARD, aspect))

    def closeup(self, names: Collection[str], aspect: float) -> View | None:
        """Return the view in which things, the hand at them and people are seen best; None without things.

        The picture holds the things, the links of a hand that is near one of them, and a person's palms and shoulders.
        Of the directions around them that is taken in which the least visible of these has the most pixels.
        """
        people = [name for name in names if name in self.people.persons]
        things = [name for name in names if name not in people and name not in self.bodies.removed]
        things = [name for name in things if self.bodies.of.get(name) and self.bodies.bodies[name].graspable]
        if not things:
            return None
        boxes = [np.array(self.bodies.box_of(name)) for name in things]
        hands = self._hands_at(np.mean([box.mean(axis=0) for box in boxes], axis=0))
        points = [*boxes, *(np.array(box) for _, box in hands)]
        middle = np.concatenate(points).mean(axis=0)
        for name in people:
            shown = np.array([*(self.people.hand(name, k) for k in (0, 1)), *self.people.reach(name).shoulders])
            near = shown[np.linalg.norm(shown - middle, axis=1) < 2 * AT_HAND]
            points += [near] if len(near) else []
        every = np.concatenate(points)
        lower, upper = every.min(axis=0), every.max(axis=0)
        target, radius = (lower + upper) / 2, max(float(np.linalg.norm(upper - lower)) / 2, LEAST_RADIUS)
        distance = radius / math.sin(FIELD / 2) / min(1.0, aspect)
        groups = [[("body", name)] for name in (*things, *people)] + [[("link", link) for link, _ in hands]]
        views = [_looking(target, forward, distance) for forward in _directions()]
        return max(views, key=lambda view: self._worth(view, [group for group in groups if group]))

    def _hands_at(self, place: Array) -> list[tuple[str, tuple[Array, Array]]]:
        """Return the links of the hand that is nearest to a place and their boxes, if it is near."""
        best: tuple[float, str] | None = None
        for link in () if self.robot is None else self.robot.body.hands:
            assert self.robot is not None
            away = float(np.linalg.norm(np.asarray(self.robot.link_pose(link).position) - place))
            if away < AT_HAND and (best is None or away < best[0]):
                best = away, link
        if best is None or self.robot is None:
            return []
        numbers = sorted(self.robot.hand_of(best[1]))
        lower, upper = self.robot.boxes_of(numbers)
        return [(self.robot.solid_names[n], (lower[k], upper[k])) for k, n in enumerate(numbers)]

    def _worth(self, view: View, groups: Iterable[Iterable[tuple[str, str]]]) -> float:
        """Return the pixels of the group that has the fewest, as the least of a small picture."""
        mask = np.asarray(self._raster(*SMALL, view, links=True)[4])
        counts: dict[tuple[str, str], int] = {}
        for value, count in zip(*(row.tolist() for row in np.unique(mask, return_counts=True)), strict=True):
            uid, link = value & 0xFFFFFF, (value >> 24) - 1  # as PyBullet packs them
            if self.robot is not None and value >= 0 and uid == self.robot.uid:
                key = "link", self.robot.link_names.get(link, "")
            else:
                key = "body", self.bodies.name_of(uid) or ""
            counts[key] = counts.get(key, 0) + count
        return min(sum(counts.get(key, 0) for key in group) for group in groups)


def _directions() -> list[Array]:
    """Return the directions, from eye to target, of close views; level ones first."""
    found = []
    for tilt in np.radians(TILTS):
        for turn in np.arange(AROUND) * 2 * math.pi / AROUND:
            found.append(np.array([math.cos(turn) * math.cos(tilt), math.sin(turn) * math.cos(tilt), -math.sin(tilt)]))
    return found


def _looking(target: Array, forward: Array, distance: float) -> View:
    a, b, c = target.tolist()
    x, y, z = (target - forward * distance).tolist()
    return (x, y, z), (a, b, c)


def _distance(offsets: Array, forward: Array, aspect: float) -> float:
    """Return how far away an eye must be to have points (n, 3), as seen from the target, in a picture [m]."""
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    tall = math.tan(FIELD / 2) * _BORDER
    across = np.maximum(np.abs(offsets @ right) / (tall * aspect), np.abs(offsets @ np.cross(right, forward)) / tall)
    return float(np.max(across - offsets @ forward))


def save_png(path: Path, pixels: Picture) -> None:
    """Write pixels (height, width, 3) as a PNG file; raises OSError as writing does."""
    from PIL import Image  # slow to import, and most runs leave no picture

    Image.fromarray(pixels).save(path, format="PNG")
