"""Maps of what the arms of a robot reach, as a picture from above and from the side."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap
from executive.pictures.drawing import FAINT, FINE, INK, Colour, Sheet, blended
from executive.robots.arms import ArmModel
from planlang.geometry import Array

Maps = Mapping[GraspClass, ReachabilityMap]

METRE, MARGIN, TITLE, CAPTION, LABELS = 130, 22, 104, 24, 16
"""Pixels of a metre; free border, heights of title and of captions, room for numbers at the axes."""
SPARE = 0.1
"""Margin of the panels around their contents [m]."""
SCALE: tuple[Colour, ...] = ((59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37))
"""Colours from few headings to all, of equal lightness steps."""
_GROUND, _LINE, _FRAME, _BASE = (247, 247, 244), (222, 222, 217), (170, 170, 165), (200, 60, 60)


def save_reach_picture(
    path: Path, name: str, models: Sequence[ArmModel], maps: Mapping[str, Maps], radius: float
) -> None:
    """Write a PNG of the maps of a robot's arms; ``radius``: of its base [m]. Raises OSError as writing does."""
    points = [maps[model.name][grasp].rows for model in models for grasp in GraspClass]
    ends = []
    for axis in ("x", "y", "z"):
        every = np.concatenate([CELL * rows[axis].astype(float) for rows in points] or [np.zeros(1)])
        low, high = (float(every.min()), float(every.max())) if len(every) else (0.0, 0.0)
        scene = 0.0 if axis == "z" else radius
        ends.append((min(low, -scene) - SPARE, max(high, scene) + SPARE))
    _Drawing(name, models, maps, radius, ends).sheet.save(path)


class _Drawing:
    def __init__(
        self,
        name: str,
        models: Sequence[ArmModel],
        maps: Mapping[str, Maps],
        radius: float,
        ends: Sequence[tuple[float, float]],
    ) -> None:
        self.radius = radius
        self.x, self.y, self.z = ends
        deep, wide, tall = (METRE * (high - low) for low, high in ends)
        column = wide + deep + 2 * (LABELS + MARGIN)
        row = CAPTION + max(deep, tall) + LABELS + MARGIN
        width = max(MARGIN + len(GraspClass) * column, 760)
        self.sheet = Sheet(width, TITLE + len(models) * row + MARGIN)
        self._title(name, models)
        for number, model in enumerate(models):
            for place, grasp in enumerate(GraspClass):
                corner = (MARGIN + place * column, TITLE + number * row)
                self._pair(corner, model, grasp, maps[model.name][grasp])

    def _title(self, name: str, models: Sequence[ArmModel]) -> None:
        sheet, left = self.sheet, MARGIN * FINE
        sheet.text((left, 14 * FINE), f"{name}: where its hands can be", 19)
        stated = f"of {YAWS} headings of the hand, how many are reached there:"
        sheet.text((left, 46 * FINE), stated, 13, FAINT)
        at = left + 370 * FINE
        sheet.text((at - 8 * FINE, 46 * FINE), "1", 13, FAINT, "ra")
        sheet.scale((at, 47 * FINE), (160 * FINE, 12 * FINE), SCALE)
        sheet.text((at + 168 * FINE, 46 * FINE), str(YAWS), 13, FAINT)
        lifts = [model.lift for model in models if model.lift is not None]
        rise = max((float(lift.rise(lift.highest)) for lift in lifts), default=0.0)
        lifted = f"; the torso at its lowest, it lifts all this by up to {rise:.2f} m" if rise else ""
        text = f"red: the base, and where the arm begins; numbers in metres{lifted}"
        sheet.text((left, 64 * FINE), text, 13, FAINT)
        text = "by the limits of the joints alone: collisions, with the robot itself too, are looked at with each place"
        sheet.text((left, 82 * FINE), text, 13, FAINT)

    def _pair(self, corner: tuple[float, float], model: ArmModel, grasp: GraspClass, found: ReachabilityMap) -> None:
        left, top = corner
        arm = model.name if model.name.endswith("arm") else f"{model.name} arm"
        title = f"{arm}, {'from the ' if grasp is not GraspClass.TILTED else ''}{grasp.value}"
        number = f"{len(found):,}".replace(",", " ")
        self.sheet.text((left * FINE, top * FINE), f"{title}: {number} poses", 14)
        top += CAPTION
        x, y, z = (CELL * found.rows[axis].astype(float) for axis in ("x", "y", "z"))
        headings = found.rows["yaw"].astype(int)
        shoulder = model.shoulder_low
        above = _Panel(self.sheet, (left + LABELS, top), self.y, self.x, flipped=True)
        above.cells(y, x, headings)
        above.axes("y, left", "x, ahead")
        above.circle(0.0, 0.0, self.radius)
        above.mark(float(shoulder[1]), float(shoulder[0]))
        wide = METRE * (self.y[1] - self.y[0])
        side = _Panel(self.sheet, (left + wide + MARGIN + 2 * LABELS, top), self.x, self.z)
        side.cells(x, z, headings)
        side.axes("x, ahead", "z, up")
        side.line((-self.radius, 0.0), (self.radius, 0.0))
        side.mark(float(shoulder[0]), float(shoulder[2]))


class _Panel:
    """A projection of space: ``across`` to the right (or, ``flipped``, to the left), ``up`` upwards; ends in metres."""

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
        """Return the pixel of a point [m]."""
        right = self.across[1] - across if self.flipped else across - self.across[0]
        return self.left + right * METRE * FINE, self.top + (self.up[1] - up) * METRE * FINE

    def cells(self, across: Array, up: Array, headings: Array) -> None:
        """Cells of the lattice by how many headings (m,) are reached in any of those behind each other."""
        places = np.stack([np.rint(across / CELL), np.rint(up / CELL), headings], axis=1).astype(int)
        cells, counts = np.unique(np.unique(places, axis=0)[:, :2], axis=0, return_counts=True)
        half = CELL / 2
        for (column, row), count in zip(cells.tolist(), counts.tolist(), strict=True):
            a, b = column * CELL, row * CELL
            box = (*self.at(a + half if self.flipped else a - half, b + half),)
            end = self.at(a - half if self.flipped else a + half, b - half)
            self.sheet.pen.rectangle((*box, *end), fill=blended(SCALE, (count - 1) / (YAWS - 1)))

    def axes(self, across: str, up: str) -> None:
        """Draw lines and numbers every half metre, and what the axes are."""
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
        """Draw the outline of the base with its front."""
        self.sheet.ring(self.at(across, up), radius * METRE * FINE, _BASE, 2)
        self.line((across, up), (across, up + radius))

    def line(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Draw a line of the robot."""
        self.sheet.pen.line((*self.at(*start), *self.at(*end)), fill=_BASE, width=2 * FINE)

    def mark(self, across: float, up: float) -> None:
        """Draw the shoulder."""
        self.sheet.disc(self.at(across, up), 4 * FINE, fill=_BASE, outline=(255, 255, 255))
