"""The graph of a task as PNG, drawn from its SVG."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from planlang.compiler.drawing.svg import STYLE, figure
from planlang.compiler.drawing.task_graph import TaskGraph
from planlang.diagnostics import BadInput, error
from planlang.sheets import FINE, Colour, Point, Sheet

LARGEST = 25_000_000
"""Largest picture [pixels]; drawing takes 12 bytes per pixel."""
_HEAD = ((-7.2, -3.2), (0.8, 0.0), (-7.2, 3.2))
"""Corners of an arrowhead relative to the end of a line along x [px]."""
_PARTS = 12
"""Straight segments that approximate a Bezier curve."""

Style = Mapping[str, str]


def save_graph(graph: TaskGraph, path: Path) -> None:
    """Write the graph as PNG. Raises BadInput (C014) if it is too large; OSError."""
    root = ElementTree.fromstring(figure(graph))
    width, height = (float(root.attrib[name]) for name in ("width", "height"))
    if width * height > LARGEST:
        message = f"the graph needs a picture of {width:.0f} x {height:.0f} pixels, more than {LARGEST}"
        raise BadInput([error("C014", message, help="write it as SVG: give it a name that ends in .svg")])
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
    """Yield the elements to draw, each with its classes, including those of its groups, and its group's origin [px]."""
    for child in parent:
        child.tag = child.tag.rpartition("}")[2]
        own = (*kinds, *child.get("class", "").split())
        if child.tag == "g":
            moved = re.findall(r"-?[\d.]+", child.get("transform", "translate(0 0)"))
            yield from _elements(child, own, (corner[0] + float(moved[0]), corner[1] + float(moved[1])))
        elif child.tag != "defs":
            yield child, own, corner


def _style(tag: str, kinds: Sequence[str]) -> Style:
    """Look up the properties of an element in the style sheet by its tag and classes; later rules win."""
    selectors = {tag, *(f".{kind}" for kind in kinds), *(f".{kind} > {tag}" for kind in kinds)}
    properties: dict[str, str] = {}
    for names, body in re.findall(r"([^{}]+)\{([^}]*)\}", STYLE):
        if selectors.intersection(name.strip() for name in names.split(",")):
            properties |= dict(re.findall(r"([\w-]+):\s*([^;]+);", body))
    return properties


def _rectangle(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    left, top, width, height, radius = (float(element.get(name, 0)) for name in ("x", "y", "width", "height", "rx"))
    u, v = FINE * (corner[0] + left), FINE * (corner[1] + top)
    right, bottom = u + FINE * width, v + FINE * height
    fill, outline = _colour(element.get("fill") or style.get("fill")), _colour(style.get("stroke"))
    is_dashed = "stroke-dasharray" in style
    sheet.pen.rectangle((u, v, right, bottom), fill, None if is_dashed else outline, FINE, FINE * radius)
    if is_dashed and outline is not None:
        for side in pairwise([(u, v), (right, v), (right, bottom), (u, bottom), (u, v)]):
            _stroke(sheet, side, style, outline)


def _line(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    # rounded here, since Pillow would round segments of one vertical line to different columns
    points = [
        (float(round(FINE * (corner[0] + x))), float(round(FINE * (corner[1] + y))))
        for x, y in _points(element.attrib["d"])
    ]
    colour = _colour(style.get("stroke"))
    assert colour is not None
    _stroke(sheet, points, style, colour)
    if element.get("marker-end"):
        (x, y), (end_x, end_y) = points[-2:]
        heading = math.atan2(end_y - y, end_x - x)
        cos, sin = FINE * math.cos(heading), FINE * math.sin(heading)
        sheet.pen.polygon([(end_x + cos * a - sin * b, end_y + sin * a + cos * b) for a, b in _HEAD], fill=colour)


def _points(path: str) -> list[Point]:
    """Flatten an SVG path of straight lines and cubic Bezier curves into points."""
    points: list[Point] = []
    for letter, text in re.findall(r"([MLC])([^MLC]*)", path):
        numbers = [float(one) for one in re.findall(r"-?[\d.]+", text)]
        corners = list(zip(numbers[::2], numbers[1::2], strict=True))
        if letter != "C":
            points += corners
            continue
        a, b, c, d = points[-1], *corners
        for part in range(1, _PARTS + 1):
            t = part / _PARTS
            weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
            x, y = (sum(w * p[axis] for w, p in zip(weights, (a, b, c, d), strict=True)) for axis in (0, 1))
            if (x, y) != points[-1]:  # a segment of zero length has no direction for an arrowhead
                points.append((x, y))
    return points


def _stroke(sheet: Sheet, points: Sequence[Point], style: Style, colour: Colour) -> None:
    """Draw a polyline, dashed if its style has a dash array."""
    width = round(FINE * float(style.get("stroke-width", "1").removesuffix("px")))
    dashes = [FINE * float(one) for one in style.get("stroke-dasharray", "").split()]
    if not dashes:
        sheet.pen.line([*points], fill=colour, width=width)
        return
    index, left = 0, dashes[0]  # even dashes are drawn, odd ones are gaps; a dash continues around corners
    for (x, y), (end_x, end_y) in pairwise(points):
        length, done = math.dist((x, y), (end_x, end_y)), 0.0
        while done < length:
            step = min(left, length - done)
            ends = (done / length, (done + step) / length)
            if index % 2 == 0:
                sheet.pen.line([(x + (end_x - x) * t, y + (end_y - y) * t) for t in ends], fill=colour, width=width)
            done, left = done + step, left - step
            if left <= 0:
                index += 1
                left = dashes[index % len(dashes)]


def _text(sheet: Sheet, element: ElementTree.Element, style: Style, corner: Point) -> None:
    size, colour = round(float(style["font-size"].removesuffix("px"))), _colour(style["fill"])
    assert colour is not None
    at = FINE * (corner[0] + float(element.attrib["x"])), FINE * (corner[1] + float(element.attrib["y"]))
    anchor = {"start": "ls", "middle": "ms", "end": "rs"}[element.get("text-anchor", "start")]
    # the font has no bold face: bold text is drawn twice, shifted by a pixel
    for shift in (0.0, 1.0) if style.get("font-weight") == "bold" else (0.0,):
        sheet.pen.text((at[0] + shift, at[1]), element.text or "", size, colour, anchor, halo="paint-order" in style)


def _colour(text: str | None) -> Colour | None:
    if text is None or text == "none":
        return None
    red, green, blue = (int(text[place : place + 2], 16) for place in (1, 3, 5))
    return red, green, blue
