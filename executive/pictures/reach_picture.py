"""Picture of a robot: its body and hands, and the reachability maps of its arms, from above and from the side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from executive.locations.capabilities import Maps
from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap
from executive.pictures.rendering import Image
from executive.pictures.robot_picture import hand_picture, robot_picture
from executive.robots import Robot
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.sheets import FAINT, FINE, INK, Colour, Sheet, blended
from sim import PlanningWorld

METRE, MARGIN, TITLE, CAPTION, LABELS = 130, 22, 104, 24, 16
"""Pixels per metre; margin, heights of title and captions, and room for numbers at the axes [pixels]."""
BODY, HAND = 420, 300
"""Sides of the pictures of the robot and of its hands [pixels]."""
SPARE = 0.1
"""Margin of the panels around their contents [m]."""
SCALE: tuple[Colour, ...] = ((59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))
"""Colour scale from one heading to all of them, with even steps of lightness."""
_GROUND, _LINE, _FRAME, _BASE = (247, 247, 244), (222, 222, 217), (170, 170, 165), (200, 60, 60)


def save_reach_picture(
    path: Path, robot: Robot, world: PlanningWorld, models: Sequence[ArmModel], maps: Mapping[str, Maps]
) -> None:
    """Write a PNG or SVG of a robot and the maps of its arms; opens its hands in ``world``. Raises OSError."""
    radius = robot.base.radius
    points = [maps[model.name][grasp].rows for model in models for grasp in GraspClass]
    ends = []
    for axis in ("x", "y", "z"):
        coordinates = np.concatenate([CELL * rows[axis].astype(float) for rows in points] or [np.zeros(1)])
        low, high = (float(coordinates.min()), float(coordinates.max())) if len(coordinates) else (0.0, 0.0)
        base = 0.0 if axis == "z" else radius
        ends.append((min(low, -base) - SPARE, max(high, base) + SPARE))
    body = robot_picture(robot, world, (BODY, BODY))
    hands = [(arm.name, hand_picture(robot, arm, world, (HAND, HAND))) for arm in robot.arms]
    _Drawing(robot.name, models, maps, radius, ends, [("", body), *hands]).sheet.save(path)


class _Drawing:
    def __init__(
        self,
        name: str,
        models: Sequence[ArmModel],
        maps: Mapping[str, Maps],
        radius: float,
        ends: Sequence[tuple[float, float]],
        pictures: Sequence[tuple[str, Image]],
    ) -> None:
        self.radius = radius
        self.x, self.y, self.z = ends
        deep, wide, tall = (METRE * (high - low) for low, high in ends)
        column = wide + deep + 2 * (LABELS + MARGIN)
        row = CAPTION + max(deep, tall) + LABELS + MARGIN
        width = max(
            MARGIN + len(GraspClass) * column, 2 * MARGIN + sum(image.shape[1] + MARGIN for _, image in pictures)
        )
        top = CAPTION + BODY + MARGIN
        self.sheet = Sheet(width, top + TITLE + len(models) * row + MARGIN)
        self._pictures(name, pictures)
        self._title(name, models, top)
        for number, model in enumerate(models):
            for index, grasp in enumerate(GraspClass):
                corner = (MARGIN + index * column, top + TITLE + number * row)
                self._pair(corner, model, grasp, maps[model.name][grasp])

    def _pictures(self, name: str, pictures: Sequence[tuple[str, Image]]) -> None:
        """Draw the pictures of the robot and its hands in a row."""
        left = MARGIN
        for title, image in pictures:
            said = f"{title} hand, open" if title else name
            self.sheet.text((left * FINE, 14 * FINE), said, 14 if title else 19)
            self.sheet.picture((left * FINE, (CAPTION + MARGIN) * FINE), image)
            left += image.shape[1] + MARGIN
        legend = (
            "black arrow: forward; x red, y green, z blue; fingers orange; between the fingers the greatest opening, "
            "from the camera its view"
        )
        self.sheet.text(((2 * MARGIN + BODY) * FINE, (CAPTION + BODY) * FINE), legend, 13, FAINT)

    def _title(self, name: str, models: Sequence[ArmModel], top: float) -> None:
        sheet, left, above = self.sheet, MARGIN * FINE, top * FINE
        sheet.text((left, above + 14 * FINE), f"{name}: reach of its hands", 19)
        text = f"reachable headings of the hand, out of {YAWS}:"
        sheet.text((left, above + 46 * FINE), text, 13, FAINT)
        at = left + 370 * FINE
        sheet.text((at - 8 * FINE, above + 46 * FINE), "1", 13, FAINT, "ra")
        sheet.scale((at, above + 47 * FINE), (160 * FINE, 12 * FINE), SCALE)
        sheet.text((at + 168 * FINE, above + 46 * FINE), str(YAWS), 13, FAINT)
        lifts = [model.lift for model in models if model.lift is not None]
        rise = max((float(lift.rise(lift.highest)) for lift in lifts), default=0.0)
        lifted = f"; torso at its lowest: it raises all of this by up to {rise:.2f} m" if rise else ""
        text = f"red: the base and the shoulder; axes in metres{lifted}"
        sheet.text((left, above + 64 * FINE), text, 13, FAINT)
        text = "joint limits only: collisions, also with the robot itself, are checked for each base pose later"
        sheet.text((left, above + 82 * FINE), text, 13, FAINT)

    def _pair(self, corner: tuple[float, float], model: ArmModel, grasp: GraspClass, reach: ReachabilityMap) -> None:
        """Draw the view from above and the view from the side of one map."""
        left, top = corner
        arm = model.name if model.name.endswith("arm") else f"{model.name} arm"
        title = f"{arm}, {'from the ' if grasp is not GraspClass.TILTED else ''}{grasp.value}"
        number = f"{len(reach):,}".replace(",", " ")
        self.sheet.text((left * FINE, top * FINE), f"{title}: {number} poses", 14)
        top += CAPTION
        x, y, z = (CELL * reach.rows[axis].astype(float) for axis in ("x", "y", "z"))
        headings = reach.rows["yaw"].astype(int)
        shoulder = model.shoulder_low
        above = _Panel(self.sheet, (left + LABELS, top), self.y, self.x, flipped=True)
        along_x, along_y = reach.spacing
        above.cells((y, along_y), (x, along_x), headings)
        above.axes("y, left", "x, ahead")
        above.circle(0.0, 0.0, self.radius)
        above.mark(float(shoulder[1]), float(shoulder[0]))
        width = METRE * (self.y[1] - self.y[0])
        side = _Panel(self.sheet, (left + width + MARGIN + 2 * LABELS, top), self.x, self.z)
        side.cells((x, along_x), (z, CELL), headings)
        side.axes("x, ahead", "z, up")
        side.line((-self.radius, 0.0), (self.radius, 0.0))
        side.mark(float(shoulder[0]), float(shoulder[2]))


class _Panel:
    """A parallel projection: ``across`` to the right (to the left if ``flipped``), ``up`` upwards; ranges in metres."""

    def __init__(
        self,
        sheet: Sheet,
        corner: tuple[float, float],
        across: tuple[float, float],
        up: tuple[float, float],
        *,
        flipped: bool = False,
    ) -> None:
        self.sheet, self.across, self.up, self.flipped = sheet, across, up, flipped
        self.left, self.top = corner[0] * FINE, corner[1] * FINE
        box = (*self.at(across[flipped], up[1]), *self.at(across[not flipped], up[0]))
        sheet.pen.rectangle(box, fill=_GROUND)

    def at(self, across: float, up: float) -> tuple[float, float]:
        """Map a point [m] to the sheet."""
        right = self.across[1] - across if self.flipped else across - self.across[0]
        return self.left + right * METRE * FINE, self.top + (self.up[1] - up) * METRE * FINE

    def cells(self, across: tuple[Array, float], up: tuple[Array, float], headings: Array) -> None:
        """Draw grid cells, coloured by the number of distinct headings (m,) along the line of sight.

        ``across`` and ``up`` are their middles (m,) and their sides [m].
        """
        (columns, wide), (rows, high) = across, up
        entries = np.stack([np.rint(columns / CELL), np.rint(rows / CELL), headings], axis=1).astype(int)
        cells, counts = np.unique(np.unique(entries, axis=0)[:, :2], axis=0, return_counts=True)
        half, above = (-wide if self.flipped else wide) / 2, high / 2
        for (column, row), count in zip(cells.tolist(), counts.tolist(), strict=True):
            a, b = column * CELL, row * CELL
            box = (*self.at(a - half, b + above), *self.at(a + half, b - above))
            self.sheet.pen.rectangle(box, fill=blended(SCALE, (count - 1) / (YAWS - 1)))

    def axes(self, across: str, up: str) -> None:
        """Draw a grid line every half metre, a number every metre, and the names of the axes."""
        pen = self.sheet.pen
        for step in range(math.ceil(2 * self.across[0]), math.floor(2 * self.across[1]) + 1):
            u, v = self.at(step / 2, self.up[0])
            pen.line((u, v, u, self.at(step / 2, self.up[1])[1]), fill=_LINE, width=1)
            if step % 2 == 0:
                self.sheet.text((u, v + 2 * FINE), str(step // 2), 11, FAINT, "ma")
        for step in range(math.ceil(2 * self.up[0]), math.floor(2 * self.up[1]) + 1):
            u, v = self.at(self.across[self.flipped], step / 2)
            pen.line((u, v, self.at(self.across[not self.flipped], step / 2)[0], v), fill=_LINE, width=1)
            if step % 2 == 0:
                self.sheet.text((u - 3 * FINE, v), str(step // 2), 11, FAINT, "rm")
        u, v = self.at(self.across[not self.flipped], self.up[0])
        self.sheet.text((u - 3 * FINE, v - 2 * FINE), across, 11, INK, "rs")
        u, v = self.at(self.across[self.flipped], self.up[1])
        self.sheet.text((u + 3 * FINE, v + 2 * FINE), up, 11, INK)
        end = self.at(self.across[not self.flipped], self.up[0])
        pen.rectangle((u, v, *end), outline=_FRAME, width=FINE)

    def circle(self, across: float, up: float, radius: float) -> None:
        """Draw the outline of the base, with a line towards its front."""
        self.sheet.ring(self.at(across, up), radius * METRE * FINE, _BASE, 2)
        self.line((across, up), (across, up + radius))

    def line(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Draw a line that belongs to the robot."""
        self.sheet.pen.line((*self.at(*start), *self.at(*end)), fill=_BASE, width=2 * FINE)

    def mark(self, across: float, up: float) -> None:
        """Draw the shoulder."""
        self.sheet.disc(self.at(across, up), 4 * FINE, fill=_BASE, outline=(255, 255, 255))
