"""The graph of a task as PNG: what its SVG has, drawn."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from executive.pictures.drawing import FINE, Colour, Point, Sheet
from planlang.compiler.drawing import TaskGraph, figure
from planlang.compiler.drawing.svg import STYLE
from planlang.diagnostics import BadInput, error

LARGEST = 25_000_000
"""Pixels of the largest picture; drawing one takes 12 bytes for each."""
_HEAD = ((-7.2, -3.2), (0.8, 0.0), (-7.2, 3.2))
"""Corners of an arrow's head around the end of its line, which leads along x [px]."""
_PARTS = 12
"""Straight pieces of a curved part of a line."""

Style = Mapping[str, str]


def save_graph(graph: TaskGraph, path: Path) -> None:
    """Write the graph as PNG. Raises BadInput for one that is too large, OSError as writing does."""
    root = ElementTree.fromstring(figure(graph))
    width, height = (float(root.attrib[name]) for name in ("width", "height"))
    if width * height > LARGEST:
        message = f"the graph takes a picture of {width:.0f} x {height:.0f} pixels, more than {LARGEST}"
        raise BadInput([error("C014", message, help="--graph with a name that ends in .svg writes it")])
    sheet = Sheet(width, height)
    for element, kinds, corner in _elements(root, (), (0.0, 0.0)):
        style = _style(element.tag, kinds)
        if element.tag == "rect":
            _rectangle(sheet, element, style, corner)
        elif element.tag == "path":
            _line(sheet, element, style, corner)
        elif element.tag == "text":
            _text(sheet, element, style, corner)
    sheet.save(path)


def _elements(
    parent: ElementTree.Element, kinds: tuple[str, ...], corner: Point
) -> Iterator[tuple[ElementTree.Element, tuple[str, ...], Point]]:
    """Yield what is drawn with the classes of its group and its own, and where (0, 0) of its group is [px]."""
    for child in parent:
        child.tag = child.tag.rpartition("}")[2]
        own = (*kinds, *child.get("class", "").split())
        if child.tag == "g":
            moved = re.findall(r"-?[\d.]+", child.get("transform", "translate(0 0)"))
            yield from _elements(child, own, (corner[0] + float(moved[0]), corner[1] + float(moved[1])))
        elif child.tag != "defs":
            yield child, own, corner


def _style(tag: str, kinds: Sequence[str]) -> Style:
    """Return the properties that the style sheet has for an element with some classes; later rules win."""
    selectors = {tag, *(f".{kind}" for kind in kinds), *(f".{kind} > {tag}" for kind in kinds)}
    found: dict[str, str] = {}
    for names, body in re.findall(r"([^{}]+)\{([^}]*)\}", STYLE):
        if selectors.intersection(name.strip() for name in names.split(",")):
            found |= dict(re.findall(r"([\w-]+):\s*([^;]+);", body))
    return found


def _rectangle(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    left, top, wide, high, radius = (float(element.get(name, 0)) for name in ("x", "y", "width", "height", "rx"))
    u, v = FINE * (corner[0] + left), FINE * (corner[1] + top)
    right, bottom = u + FINE * wide, v + FINE * high
    fill, outline = _colour(element.get("fill") or style.get("fill")), _colour(style.get("stroke"))
    is_dashed = "stroke-dasharray" in style
    sheet.pen.rectangle((u, v, right, bottom), fill, None if is_dashed else outline, FINE, FINE * radius)
    if is_dashed and outline is not None:
        for side in pairwise([(u, v), (right, v), (right, bottom), (u, bottom), (u, v)]):
            _stroke(sheet, side, style, outline)


def _line(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    # whole pixels: short pieces of one vertical line would be rounded to either side
    points = [
        (float(round(FINE * (corner[0] + x))), float(round(FINE * (corner[1] + y))))
        for x, y in _points(element.attrib["d"])
    ]
    colour = _colour(style.get("stroke"))
    assert colour is not None
    _stroke(sheet, points, style, colour)
    if element.get("marker-end"):
        (x, y), (end, below) = points[-2:]
        heading = math.atan2(below - y, end - x)
        cos, sin = FINE * math.cos(heading), FINE * math.sin(heading)
        sheet.pen.polygon([(end + cos * a - sin * b, below + sin * a + cos * b) for a, b in _HEAD], fill=colour)


def _points(path: str) -> list[Point]:
    """Return the points of a path: of its straight parts, and some of each curve of four points."""
    found: list[Point] = []
    for letter, text in re.findall(r"([MLC])([^MLC]*)", path):
        numbers = [float(one) for one in re.findall(r"-?[\d.]+", text)]
        corners = list(zip(numbers[::2], numbers[1::2], strict=True))
        if letter != "C":
            found += corners
            continue
        a, b, c, d = found[-1], *corners
        for part in range(1, _PARTS + 1):
            t = part / _PARTS
            shares = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
            x, y = (sum(s * p[axis] for s, p in zip(shares, (a, b, c, d), strict=True)) for axis in (0, 1))
            if (x, y) != found[-1]:  # a part without length has no direction
                found.append((x, y))
    return found


def _stroke(sheet: Sheet, points: Sequence[Point], style: Style, colour: Colour) -> None:
    """Draw a line through points of the sheet, in dashes if its style has some."""
    width = round(FINE * float(style.get("stroke-width", "1").removesuffix("px")))
    dashes = [FINE * float(one) for one in style.get("stroke-dasharray", "").split()]
    if not dashes:
        sheet.pen.line([*points], fill=colour, width=width)
        return
    place, left = 0, dashes[0]
    for (x, y), (end, below) in pairwise(points):
        length, done = math.dist((x, y), (end, below)), 0.0
        while done < length:
            step = min(left, length - done)
            ends = (done / length, (done + step) / length)
            if place % 2 == 0:
                sheet.pen.line([(x + (end - x) * t, y + (below - y) * t) for t in ends], fill=colour, width=width)
            done, left = done + step, left - step
            if left <= 0:
                place += 1
                left = dashes[place % len(dashes)]


def _text(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    size, colour = round(float(style["font-size"].removesuffix("px"))), _colour(style["fill"])
    assert colour is not None
    at = FINE * (corner[0] + float(element.attrib["x"])), FINE * (corner[1] + float(element.attrib["y"]))
    anchor = {"start": "ls", "middle": "ms", "end": "rs"}[element.get("text-anchor", "start")]
    # the font has no bold letters: they are drawn twice
    for shift in (0.0, 1.0) if style.get("font-weight") == "bold" else (0.0,):
        sheet.pen.text((at[0] + shift, at[1]), element.text or "", size, colour, anchor, halo="paint-order" in style)


def _colour(text: str | None) -> Colour | None:
    if text is None or text == "none":
        return None
    red, green, blue = (int(text[place : place + 2], 16) for place in (1, 3, 5))
    return red, green, blue
