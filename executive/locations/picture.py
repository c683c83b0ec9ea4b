"""How a resolution came to its places, as a picture: the map from above, what was looked at, what became of it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from executive.locations.surroundings import Base
from planlang.protocols import Array

if TYPE_CHECKING:
    from executive.locations.rejections import Judged

Colour = tuple[int, int, int]

WIDTH, LEGEND, MARGIN, HEADER = 900, 330, 24, 64
"""Width of the map and of the legend, free border, height of the title [pixels]."""
FINE = 2
"""Everything is drawn so many times larger, then made smaller: smooth edges."""
SCORE_CELL = 0.05
"""Side of a cell of the score map [m]."""
TALLEST = 1200
"""Height that the map has at most [pixels]."""

REASONS: Mapping[str, Colour] = {
    "no room for the base": (150, 150, 150),
    "in collision": (204, 51, 51),
    "out of reach": (235, 140, 30),
    "not visible": (130, 80, 190),
    "too wide for the gripper": (120, 80, 40),
    "": (0, 130, 60),
}
"""Reason -> colour of its places; "" of those that were accepted."""
OTHERS: tuple[Colour, ...] = ((20, 120, 170), (200, 90, 150), (90, 110, 40), (60, 60, 120), (0, 140, 140))
"""Colours of other reasons, in the order of their names."""
_PALE, _DEEP = (232, 241, 250), (66, 133, 200)
_PAPER, _INK, _FAINT = (255, 255, 255), (40, 40, 40), (120, 120, 120)
_KINDS: Mapping[str, tuple[Colour, Colour]] = {
    "solid": ((224, 208, 184), (140, 115, 80)),
    "person": ((240, 205, 185), (170, 110, 85)),
    "meant": ((255, 226, 120), (190, 140, 0)),
    "marker": ((245, 245, 245), (190, 190, 190)),
}
"""Kind of body -> fill and outline."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A body from above: its name, a polygon (n, 2) in the map [m], "solid", "person", "meant" or "marker"."""

    name: str
    polygon: Array
    kind: str = "solid"


@dataclass(frozen=True, slots=True)
class Scenery:
    """What there is besides the resolution: the room's floor, the bodies, the robot's base and where it is."""

    bounds: tuple[float, float, float, float]
    bodies: Sequence[Outline]
    radius: float
    """Of the outline of what places are for [m]."""
    robot: Base
    robot_radius: float


@dataclass(frozen=True, slots=True)
class Resolution:
    """What a resolution looked at and came to, places best first."""

    title: str
    places: Sequence[Base]
    judged: Sequence[Judged]
    scored: Sequence[tuple[Array, Array]] = ()
    """Candidates (m, 3) before they were judged, and their scores (m,)."""
    counts: Mapping[str, int] = field(default_factory=dict)
    blocking: Mapping[str, int] = field(default_factory=dict)


def save_picture(path: Path, scenery: Scenery, resolution: Resolution) -> None:
    """Write a PNG; raises OSError as writing does."""
    drawing = _Drawing(scenery, resolution)
    drawing.draw().save(path, format="PNG")


def colours(reasons: Sequence[str]) -> dict[str, Colour]:
    """A colour for every reason, the same whatever else there is of the well-known ones."""
    unknown = sorted(set(reasons) - REASONS.keys())
    return {
        reason: REASONS[reason] if reason in REASONS else OTHERS[unknown.index(reason) % len(OTHERS)]
        for reason in dict.fromkeys(reasons)
    }


class _Drawing:
    def __init__(self, scenery: Scenery, resolution: Resolution) -> None:
        self.scenery, self.resolution = scenery, resolution
        x_min, y_min, x_max, y_max = scenery.bounds
        width, height = max(x_max - x_min, 1e-3), max(y_max - y_min, 1e-3)
        self.scale = FINE * min(WIDTH / width, TALLEST / height)
        """Pixels for one metre."""
        self.left, self.top = MARGIN * FINE, (HEADER + MARGIN) * FINE
        self.width, self.height = round(width * self.scale), round(height * self.scale)
        size = (self.width + (2 * MARGIN + LEGEND) * FINE, max(self.height + (HEADER + 2 * MARGIN) * FINE, 700 * FINE))
        self.image = Image.new("RGB", size, _PAPER)
        self.pen = ImageDraw.Draw(self.image)
        self.colours = colours([*resolution.counts, *(one.reason for one in resolution.judged), ""])

    def draw(self) -> Image.Image:
        """All of it, the back first."""
        self._title()
        self._floor()
        self._scores()
        self._bodies()
        self._judged()
        self._robot()
        self._places()
        self._names()
        self._legend()
        width, height = self.image.size
        return self.image.resize((width // FINE, height // FINE), Image.Resampling.LANCZOS)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        """The pixel of a point of the map: x to the right, y up."""
        x_min, _, _, y_max = self.scenery.bounds
        return self.left + (x - x_min) * self.scale, self.top + (y_max - y) * self.scale

    def _is_inside(self, x: float, y: float) -> bool:
        x_min, y_min, x_max, y_max = self.scenery.bounds
        return x_min <= x <= x_max and y_min <= y <= y_max

    def _disc(self, x: float, y: float, radius: float, **style: object) -> None:
        """A circle of so many pixels around a point of the map."""
        u, v = self._at(x, y)
        self.pen.ellipse((u - radius, v - radius, u + radius, v + radius), **style)  # type: ignore[arg-type]

    def _text(self, at: tuple[float, float], text: str, size: int, colour: Colour = _INK, anchor: str = "la") -> None:
        self.pen.text(at, text, fill=colour, font=_font(size), anchor=anchor)

    def _title(self) -> None:
        lines = _wrapped(self.resolution.title, _font(19), self.image.size[0] - 2 * MARGIN * FINE)
        for number, line in enumerate(lines[:2]):
            self._text((self.left, (MARGIN / 2 + 6 + 26 * number) * FINE), line, 19)

    def _floor(self) -> None:
        box = (self.left, self.top, self.left + self.width, self.top + self.height)
        self.pen.rectangle(box, fill=(250, 250, 247), outline=_FAINT, width=FINE)
        x_min, y_min, x_max, y_max = self.scenery.bounds
        for x in range(math.ceil(x_min), math.floor(x_max) + 1):
            self.pen.line((*self._at(x, y_min), *self._at(x, y_max)), fill=(228, 228, 224), width=FINE)
        for y in range(math.ceil(y_min), math.floor(y_max) + 1):
            self.pen.line((*self._at(x_min, y), *self._at(x_max, y)), fill=(228, 228, 224), width=FINE)

    def _scores(self) -> None:
        best: dict[tuple[int, int], float] = {}
        for bases, scores in self.resolution.scored:
            cells = np.floor(bases[:, :2] / SCORE_CELL).astype(int).tolist()
            for (column, row), score in zip(cells, scores.tolist(), strict=True):
                if not self._is_inside((column + 0.5) * SCORE_CELL, (row + 0.5) * SCORE_CELL):
                    continue
                best[column, row] = max(best.get((column, row), 0.0), score)
        top = max(best.values(), default=0.0)
        for (column, row), score in best.items():
            if top > 0 and score > 0:
                share = score / top
                colour = tuple(round(a + (b - a) * share) for a, b in zip(_PALE, _DEEP, strict=True))
                u, v = self._at(column * SCORE_CELL, (row + 1) * SCORE_CELL)
                side = SCORE_CELL * self.scale
                self.pen.rectangle((u, v, u + side, v + side), fill=colour)

    def _bodies(self) -> None:
        for body in self.scenery.bodies:
            fill, outline = _KINDS[body.kind]
            points = [self._at(float(x), float(y)) for x, y in body.polygon]
            if len(points) > 2:
                self.pen.polygon(points, fill=fill, outline=outline, width=FINE)

    def _names(self) -> None:
        taken: list[tuple[float, float, float, float]] = []
        for body in sorted(self.scenery.bodies, key=lambda body: (body.kind != "meant", body.name)):
            (u, high), (right, v) = self._corner(body, 0.0), self._corner(body, 1.0)
            small = right - u < 90 * FINE or v - high < 24 * FINE
            u, v = ((u + right) / 2, v + 8 * FINE) if small else (u + 6 * FINE, high + 12 * FINE)
            for offset in (0, 14, -14, 28, -28, 42, -42):
                at = (u, v + offset * FINE)
                box = self.pen.textbbox(at, body.name, font=_font(12), anchor="mm" if small else "lm")
                if not any(a < box[2] and c > box[0] and b < box[3] and d > box[1] for a, b, c, d in taken):
                    break
            taken.append(box)
            halo = {"stroke_width": 2 * FINE, "stroke_fill": (255, 255, 255)}
            place = ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
            self.pen.text(place, body.name, fill=_INK, font=_font(12), anchor="mm", **halo)  # type: ignore[arg-type]

    def _corner(self, body: Outline, share: float) -> tuple[float, float]:
        """A corner of the box around a body in the picture: 0 upper left, 1 lower right."""
        low, high = body.polygon.min(axis=0), body.polygon.max(axis=0)
        return self._at(float(low[0] + share * (high[0] - low[0])), float(high[1] - share * (high[1] - low[1])))

    def _judged(self) -> None:
        for one in sorted(self.resolution.judged, key=lambda one: one.reason == ""):
            x, y, yaw = one.base
            if not self._is_inside(x, y):
                continue
            colour, size = self.colours[one.reason], 2.6 * FINE
            self._disc(x, y, size, fill=colour)
            u, v = self._at(x, y)
            tick = 6 * FINE
            self.pen.line((u, v, u + tick * math.cos(yaw), v - tick * math.sin(yaw)), fill=colour, width=FINE)

    def _robot(self) -> None:
        x, y, yaw = self.scenery.robot
        radius = self.scenery.robot_radius
        self._disc(x, y, radius * self.scale, outline=_FAINT, width=FINE)
        self._arrow((x, y, yaw), radius, _FAINT)
        self._text(self._at(x, y - radius - 0.02), "robot", 12, _FAINT, "ma")

    def _places(self) -> None:
        for number, (x, y, yaw) in reversed(list(enumerate(self.resolution.places, 1))):
            colour = REASONS[""]
            self._disc(x, y, self.scenery.radius * self.scale, outline=colour, width=(3 if number == 1 else 1) * FINE)
            self._arrow((x, y, yaw), self.scenery.radius, colour)
            self._disc(x, y, 10 * FINE, fill=colour, outline=_PAPER)
            self._text(self._at(x, y), str(number), 13, _PAPER, "mm")

    def _arrow(self, base: Base, length: float, colour: Colour) -> None:
        x, y, yaw = base
        tip = self._at(x + length * math.cos(yaw), y + length * math.sin(yaw))
        self.pen.line((*self._at(x, y), *tip), fill=colour, width=2 * FINE)
        sides = [
            self._at(
                x + length * math.cos(yaw) - 0.09 * math.cos(yaw + a),
                y + length * math.sin(yaw) - 0.09 * math.sin(yaw + a),
            )
            for a in (0.5, -0.5)
        ]
        self.pen.polygon([tip, *sides], fill=colour)

    def _legend(self) -> None:
        left, row = self.left + self.width + MARGIN * FINE, self.top
        line = 22 * FINE

        def entry(text: str, colour: Colour = _INK, mark: Colour | None = None, size: int = 14) -> None:
            nonlocal row
            if mark is not None:
                self.pen.ellipse((left, row + 4 * FINE, left + 10 * FINE, row + 14 * FINE), fill=mark)
            shift = 18 * FINE if mark is not None else 0
            for part in _wrapped(text, _font(size), (LEGEND - 2 * MARGIN) * FINE - shift):
                self._text((left + shift, row), part, size, colour)
                row += line

        places, judged = self.resolution.places, self.resolution.judged
        entry(
            f"{len(places)} {'place' if len(places) == 1 else 'places'}, best first" if places else "no place", size=16
        )
        for number, (x, y, yaw) in enumerate(places[:6], 1):
            entry(f"{number}:  x {x:.3f}  y {y:.3f}  yaw {yaw:.2f}")
        row += line // 2
        entry("candidates, by what became of them", size=16)
        shown = Counter(one.reason for one in judged)
        entry(f"accepted: {shown['']}", mark=self.colours[""])
        for reason, number in self.resolution.counts.items():
            entry(f"{reason}: {number}", mark=self.colours[reason])
        if self.resolution.blocking:
            row += line // 2
            entry("in the way", size=16)
            for body, number in list(self.resolution.blocking.items())[:8]:
                entry(f"{body}: {number}")
        row += line // 2
        entry("score of a candidate", size=16)
        for step in range(100):
            share = step / 99
            colour = tuple(round(a + (b - a) * share) for a, b in zip(_PALE, _DEEP, strict=True))
            u = left + step * 1.6 * FINE
            self.pen.rectangle((u, row, u + 2 * FINE, row + 12 * FINE), fill=colour)
        row += 16 * FINE
        entry("low  ...  high; white: no candidate", _FAINT, size=12)
        entry("circle: outline of the base, arrow: heading; lines of the floor are 1 m apart", _FAINT, size=12)


def _font(size: int) -> ImageFont.FreeTypeFont:
    font = ImageFont.load_default(size * FINE)
    assert isinstance(font, ImageFont.FreeTypeFont)
    return font


def _wrapped(text: str, font: ImageFont.FreeTypeFont, width: float) -> list[str]:
    """Lines of a text that are no wider than so many pixels, broken between words."""
    lines: list[str] = []
    for word in text.split(" "):
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def circle(x: float, y: float, radius: float) -> Array:
    """The outline of something round, (24, 2)."""
    turns = np.arange(24) * 2 * math.pi / 24
    return np.column_stack([x + radius * np.cos(turns), y + radius * np.sin(turns)])
