"""Picture of how a location was resolved: floor plan of the room with the candidates, a close view, a legend."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.pictures.scenery import Bounds, Outline, Region, Resolution, Scenery
from planlang.geometry import Array
from planlang.sheets import FAINT, FINE, INK, PAPER, Colour, Sheet, blended, font, wrapped

SCORES: tuple[Colour, ...] = ((226, 238, 250), (66, 133, 200))
"""Colour scale of scores, low to high."""
ACCEPTED: Colour = (0, 130, 60)
REGIONS: tuple[Colour, ...] = ((190, 20, 110), (110, 60, 10), (0, 110, 120), (90, 90, 200))
"""Colours of the outlines of regions in which conjuncts hold."""
CANDIDATE = 0.065
"""Radius of the disc that shows a candidate's score [m]."""
STEP = 2
"""Sampling distance of regions [pixels]."""
_FLOOR, _GRID, _ROBOT = (250, 250, 247), (228, 228, 224), (110, 110, 110)
_KINDS: Mapping[str, tuple[Colour, Colour]] = {
    "solid": ((224, 208, 184), (140, 115, 80)),
    "person": ((240, 205, 185), (170, 110, 85)),
    "meant": ((255, 226, 120), (190, 140, 0)),
    "marker": ((245, 245, 245), (190, 190, 190)),
}
"""Colours of fill and outline by kind of body."""


class FloorPlan:
    """Drawing of a part of the room on its own sheet."""

    def __init__(
        self,
        view: Bounds,
        scale: float,
        scenery: Scenery,
        resolution: Resolution,
        colours: Mapping[str, Colour],
    ) -> None:
        """Create an empty sheet of the area ``view`` with ``scale`` pixels per metre."""
        x_min, y_min, x_max, y_max = view
        self.view, self.scale, self.colours = view, scale * FINE, colours
        self.scenery, self.resolution = scenery, resolution
        self.sheet = Sheet(scale * (x_max - x_min), scale * (y_max - y_min))
        self.pen = self.sheet.pen

    def draw(self, *, numbered: int) -> Sheet:
        """Draw everything, back to front; the ``numbered`` best places get their numbers, the others a dot."""
        self._floor()
        if self.scenery.on_floor:
            self._candidates()
            self._bodies()
        else:
            self._bodies()
            self._candidates()
        self._regions()
        self._validated()
        self._robot()
        self._places(numbered)
        self._names()
        width, height = self.sheet.image.size
        self.pen.rectangle((0, 0, width - 1, height - 1), outline=FAINT, width=FINE)
        return self.sheet

    def _at(self, x: float, y: float) -> tuple[float, float]:
        """Map a point to the sheet, x to the right and y up."""
        return (x - self.view[0]) * self.scale, (self.view[3] - y) * self.scale

    def _pixels(self, points: Array) -> list[tuple[float, float]]:
        """Map points (n, 2 or 3) to the sheet; those outside the view are left out."""
        x_min, y_min, x_max, y_max = self.view
        x, y = points[:, 0], points[:, 1]
        inside = points[(x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)]
        return [self._at(x, y) for x, y in inside[:, :2].tolist()]

    def _floor(self) -> None:
        x_min, y_min, x_max, y_max = self.scenery.bounds
        self.pen.rectangle((*self._at(x_min, y_max), *self._at(x_max, y_min)), fill=_FLOOR)
        x_min, y_min, x_max, y_max = self.view
        for x in range(math.ceil(x_min), math.floor(x_max) + 1):
            self.pen.line((*self._at(x, y_min), *self._at(x, y_max)), fill=_GRID, width=FINE)
        for y in range(math.ceil(y_min), math.floor(y_max) + 1):
            self.pen.line((*self._at(x_min, y), *self._at(x_max, y)), fill=_GRID, width=FINE)

    def _candidates(self) -> None:
        self._scores()
        self._refused()

    def _scores(self) -> None:
        """Draw the scores of candidates as discs, the best on top."""
        scored = [(bases, scores) for bases, scores in self.resolution.scored if len(scores) and scores.max() > 0]
        if not scored:
            return
        points = np.concatenate([bases[:, :2] for bases, _ in scored])
        scores = np.concatenate([scores / scores.max() for _, scores in scored])
        radius = CANDIDATE if self.scenery.on_floor else CANDIDATE / 2.5
        for index in np.argsort(scores.round(6), kind="stable").tolist():
            for at in self._pixels(points[index : index + 1]):
                self.sheet.disc(at, radius * self.scale, fill=blended(SCORES, float(scores[index])))

    def _refused(self) -> None:
        for reason, bases in self.resolution.refused:
            for u, v in self._pixels(np.unique(bases[:, :2].round(4), axis=0)):
                side = 1.1 * FINE
                self.pen.rectangle((u - side, v - side, u + side, v + side), fill=self.colours[reason])

    def _bodies(self) -> None:
        for body in self.scenery.bodies:
            fill, outline = _KINDS[body.kind]
            points = [self._at(float(x), float(y)) for x, y in body.polygon]
            if len(points) > 2:
                self.pen.polygon(points, fill=fill, outline=outline, width=FINE)
            if body.facing is not None:
                x, y = body.polygon.mean(axis=0).tolist()
                self._arrow((x, y, body.facing), 0.3, outline)

    def _regions(self) -> None:
        """Draw the outlines of the regions in which conjuncts hold."""
        step = STEP * FINE / self.scale
        xs, ys, points = _grid_points(self.view, step)
        for number, region in enumerate(self.scenery.regions):
            inside = np.asarray(region.inside(points), bool).reshape(len(xs), len(ys))
            colour = REGIONS[number % len(REGIONS)]
            for column, row in np.argwhere(inside[1:] != inside[:-1]).tolist():
                x, y = xs[column] + step / 2, ys[row]
                ends = (*self._at(x, y - step / 2), *self._at(x, y + step / 2))
                self.pen.line(ends, fill=colour, width=2 * FINE)
            for column, row in np.argwhere(inside[:, 1:] != inside[:, :-1]).tolist():
                x, y = xs[column], ys[row] + step / 2
                ends = (*self._at(x - step / 2, y), *self._at(x + step / 2, y))
                self.pen.line(ends, fill=colour, width=2 * FINE)

    def _validated(self) -> None:
        for one in sorted(self.resolution.validated, key=lambda one: one.reason == ""):
            colour, tick = self.colours[one.reason], 6 * FINE
            for u, v in self._pixels(np.array([one.base])):
                yaw = one.base[2]
                self.sheet.disc((u, v), 2.6 * FINE, fill=colour)
                self.pen.line((u, v, u + tick * math.cos(yaw), v - tick * math.sin(yaw)), fill=colour, width=FINE)

    def _robot(self) -> None:
        x, y, yaw = self.scenery.robot
        radius = self.scenery.robot_radius
        self.sheet.ring(self._at(x, y), radius * self.scale, _ROBOT)
        self._arrow((x, y, yaw), radius, _ROBOT)
        self.sheet.halo(self._at(x, y - 0.5 * radius), "robot", 12, _ROBOT)

    def _places(self, numbered: int) -> None:
        for number, (x, y, yaw) in reversed(list(enumerate(self.resolution.places, 1))):
            self.sheet.ring(self._at(x, y), self.scenery.radius * self.scale, ACCEPTED, width=3 if number == 1 else 1)
            self._arrow((x, y, yaw), self.scenery.radius, ACCEPTED)
            self.sheet.disc(self._at(x, y), (10 if number <= numbered else 4) * FINE, fill=ACCEPTED, outline=PAPER)
            if number <= numbered:
                self.sheet.text(self._at(x, y), str(number), 13, PAPER, "mm")

    def _arrow(self, base: BasePose, length: float, colour: Colour) -> None:
        x, y, yaw = base
        head = min(0.09, 0.4 * length)
        tip = x + length * math.cos(yaw), y + length * math.sin(yaw)
        self.pen.line((*self._at(x, y), *self._at(*tip)), fill=colour, width=2 * FINE)
        sides = [
            self._at(tip[0] - head * math.cos(yaw + turn), tip[1] - head * math.sin(yaw + turn)) for turn in (0.5, -0.5)
        ]
        self.pen.polygon([self._at(*tip), *sides], fill=colour)

    def _names(self) -> None:
        """Label the bodies without overlap: large ones inside, others below."""
        placed: list[tuple[float, float, float, float]] = []
        width, height = self.sheet.image.size
        for body in sorted(self.scenery.bodies, key=lambda body: (body.kind != "meant", body.name)):
            (left, top), (right, bottom) = self._corner(body, 0.0), self._corner(body, 1.0)
            if right < 0 or left > width or bottom < 0 or top > height:
                continue
            half = font(12).getlength(body.name) / 2 + 3 * FINE
            inside = right - left > 2 * half and bottom - top > 24 * FINE
            u, v = (left + half + 3 * FINE, top + 12 * FINE) if inside else ((left + right) / 2, bottom + 9 * FINE)
            u, v = min(max(u, half), width - half), min(max(v, 9 * FINE), height - 9 * FINE)
            for offset in (0, 15, -15, 30, -30, 45, -45):
                box = (u - half, v + (offset - 8) * FINE, u + half, v + (offset + 8) * FINE)
                if not any(a < box[2] and c > box[0] and b < box[3] and d > box[1] for a, b, c, d in placed):
                    break
            placed.append(box)
            self.sheet.halo(((box[0] + box[2]) / 2, (box[1] + box[3]) / 2), body.name, 12, INK)

    def _corner(self, body: Outline, share: float) -> tuple[float, float]:
        """Corner of a body's bounding box on the sheet: upper left for 0, lower right for 1."""
        low, high = body.polygon.min(axis=0), body.polygon.max(axis=0)
        return self._at(float(low[0] + share * (high[0] - low[0])), float(high[1] - share * (high[1] - low[1])))


def _grid_points(bounds: Bounds, step: float) -> tuple[Array, Array, Array]:
    """Make a grid with spacing ``step`` [m]; returns its xs (n,), ys (m,) and points (n * m, 2)."""
    x_min, y_min, x_max, y_max = bounds
    xs, ys = np.arange(x_min, x_max, step), np.arange(y_min, y_max, step)
    return xs, ys, np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)


WIDTH, LEGEND, MARGIN = 900, 330, 24
"""Widths of the map and of the legend, free border [pixels]."""
TALLEST = 1200
"""Largest height of the map [pixels]."""
LINE = 22
"""Height of a line of the legend [pixels]."""
CLOSE = 0.45
"""Share of the room's width below which the places get a close view."""
EMPTY = 0.05
"""Grid spacing of the test whether a region is empty [m]."""
MOST_LISTED = 6
"""Largest number of places and of bodies in the legend."""

REASONS: Mapping[str, Colour] = {
    "no room for the base": (165, 165, 165),
    "no room for the object": (165, 165, 165),
    "in collision": (204, 51, 51),
    "out of reach": (235, 140, 30),
    "not visible": (130, 80, 190),
    "too wide for the gripper": (120, 80, 40),
    "": ACCEPTED,
}
"""Colours of candidates by the reason of their rejection; "" stands for accepted ones."""
OTHERS: tuple[Colour, ...] = ((110, 175, 205), (215, 150, 185), (150, 165, 110), (140, 140, 190), (110, 185, 180))
"""Colours of other reasons, assigned in alphabetical order."""


def picture(scenery: Scenery, resolution: Resolution) -> Sheet:
    """Draw title, map and legend, and a close view if the places are near to each other."""
    of = colours([*resolution.counts, *(one.reason for one in resolution.validated), *dict(resolution.refused), ""])
    x_min, y_min, x_max, y_max = scenery.bounds
    scale = min(WIDTH / max(x_max - x_min, 1e-3), TALLEST / max(y_max - y_min, 1e-3))
    near = close_view(scenery, resolution.places)
    plan = FloorPlan(scenery.bounds, scale, scenery, resolution, of).draw(numbered=1 if near else 99)
    legend, used = _legend(scenery, resolution, of)
    width = (LEGEND - MARGIN) * FINE
    close = None
    if near is not None:
        close = FloorPlan(near, (LEGEND - MARGIN) / (near[2] - near[0]), scenery, resolution, of).draw(numbered=99)
    plan_width, plan_height = plan.image.size
    title = wrapped(resolution.title, 19, plan_width + width)[:3]
    top = (2 * MARGIN + 26 * len(title)) * FINE
    right = used + (0 if close is None else (MARGIN + LINE) * FINE + close.image.height)
    sheet = Sheet((plan_width + width) / FINE + 3 * MARGIN, (top + max(plan_height, right)) / FINE + MARGIN)
    for number, line in enumerate(title):
        sheet.text((MARGIN * FINE, (MARGIN + 26 * number) * FINE), line, 19)
    sheet.paste(plan, (MARGIN * FINE, top))
    left = plan_width + 2 * MARGIN * FINE
    sheet.paste(legend, (left, top), used)
    if close is not None:
        below = top + used + MARGIN * FINE
        sheet.text((left, below), "close view", 16)
        sheet.paste(close, (left, below + LINE * FINE))
    return sheet


def close_view(scenery: Scenery, places: Sequence[tuple[float, float, float]]) -> Bounds | None:
    """Square around the places; None if there are none, or if they are spread over the room."""
    if not places:
        return None
    xs, ys = [x for x, _, _ in places], [y for _, y, _ in places]
    extent = max(max(xs) - min(xs), max(ys) - min(ys)) + 3.2 * scenery.radius + 0.1
    if extent > CLOSE * (scenery.bounds[2] - scenery.bounds[0]):
        return None
    x, y = (max(xs) + min(xs)) / 2, (max(ys) + min(ys)) / 2
    return x - extent / 2, y - extent / 2, x + extent / 2, y + extent / 2


def colours(reasons: Sequence[str]) -> dict[str, Colour]:
    """Assign a colour to each reason; the colours of common reasons are fixed."""
    unknown = sorted(set(reasons) - REASONS.keys())
    return {
        reason: REASONS[reason] if reason in REASONS else OTHERS[unknown.index(reason) % len(OTHERS)]
        for reason in dict.fromkeys(reasons)
    }


class _Legend:
    """The legend, written from the top of a sheet that is tall enough."""

    def __init__(self) -> None:
        self.sheet, self.used = Sheet(LEGEND, 2400), 0
        """The sheet, and the height used so far [oversampled pixels]."""

    def places(self, places: Sequence[BasePose], details: Sequence[str], message: str) -> None:
        """List the places, best first, or the reason why there is none."""
        self._entry(f"{len(places)} place{'' if len(places) == 1 else 's'}, best first" if places else "no place", 16)
        if not places and message:
            self._write(message)
        for number, (x, y, yaw) in enumerate(places[:MOST_LISTED]):
            detail = details[number] if number < len(details) else ""
            self._entry(f"{number + 1}:  x {x:.3f}  y {y:.3f}  yaw {yaw + 0.0:.2f}  {detail}".rstrip())

    def candidates(self, resolution: Resolution, of: Mapping[str, Colour]) -> None:
        """List numbers of candidates by result, and of collisions by body."""
        self._head("candidates by result")
        shown, accepted = len(resolution.places), sum(one.reason == "" for one in resolution.validated)
        others = f"{accepted}, others near these places" if accepted > shown else str(shown)
        self._entry(f"accepted: {others}", mark=ACCEPTED)
        for reason, number in Counter(resolution.counts).most_common():
            self._entry(f"{reason}: {number}", mark=of[reason])
        if resolution.blocking:
            self._head("in the way")
        for body, number in list(resolution.blocking.items())[:MOST_LISTED]:
            self._entry(f"{body}: {number}")

    def regions(self, regions: Sequence[Region], bounds: Bounds) -> None:
        """Explain the outlines of regions, and name empty regions, which have no outline."""
        if regions:
            self._head("outlines: regions of the conjuncts")
        for number, region in enumerate(regions):
            colour = REGIONS[number % len(REGIONS)]
            self.sheet.pen.line((0, self.used + 9 * FINE, 12 * FINE, self.used + 9 * FINE), fill=colour, width=2 * FINE)
            is_empty = not np.any(region.inside(_grid_points(bounds, EMPTY)[2]))
            self._write(region.words + (": nowhere on this floor" if is_empty else ""), shift=18 * FINE)

    def marks(self, scored: Sequence[tuple[Array, Array]]) -> None:
        """Explain the marks of the map, and the colour scale if a candidate has a score."""
        has_scores = any(len(scores) and scores.max() > 0 for _, scores in scored)
        if has_scores:
            self._head("score of a candidate")
            self.sheet.scale((0, self.used), (160 * FINE, 12 * FINE), SCORES)
            self.used += 16 * FINE
            self._write("low ... high; no disc: no candidate", 12, FAINT)
        self.used += 0 if has_scores else LINE * FINE // 2
        marks = "ring: size of the base or thing, arrow: its heading; yellow: bodies in the phrase; grid: 1 m"
        self._write(marks, 12, FAINT)

    def _head(self, text: str) -> None:
        self.used += LINE * FINE // 2
        self._entry(text, 16)

    def _entry(self, text: str, size: int = 14, mark: Colour | None = None) -> None:
        if mark is not None:
            self.sheet.disc((5 * FINE, self.used + 9 * FINE), 5 * FINE, fill=mark)
        self._write(text, size, shift=0 if mark is None else 18 * FINE)

    def _write(self, text: str, size: int = 14, colour: Colour = INK, shift: int = 0) -> None:
        for part in wrapped(text, size, (LEGEND - MARGIN) * FINE - shift):
            self.sheet.text((shift, self.used), part, size, colour)
            self.used += LINE * FINE


def _legend(scenery: Scenery, resolution: Resolution, of: Mapping[str, Colour]) -> tuple[Sheet, int]:
    """Draw the legend; returns its sheet and the height used [oversampled pixels]."""
    legend = _Legend()
    legend.places(resolution.places, resolution.details, resolution.message)
    legend.candidates(resolution, of)
    legend.regions(scenery.regions, scenery.bounds)
    legend.marks(resolution.scored)
    return legend.sheet, legend.used
