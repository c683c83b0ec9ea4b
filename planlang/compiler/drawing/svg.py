"""Write the graph as SVG, with planlang's own layout."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from html import escape
from itertools import pairwise

from planlang.compiler.drawing.layers import Layers, Point, layered
from planlang.compiler.drawing.task_graph import (
    BOLD,
    INDENT,
    LONGEST_LINE,
    Arrow,
    Box,
    Group,
    Order,
    TaskGraph,
    shown,
    width,
)
from planlang.records import dataclass

MARGIN, HEAD = 24.0, 52.0

STYLE = """\
text { font-family: Helvetica, Arial, "Liberation Sans", "DejaVu Sans", sans-serif; fill: #1f2d3a; }
.title { font-size: 18px; font-weight: bold; }
.small, .line { font-size: 11px; fill: #51606e; }
.name { font-size: 13px; font-weight: bold; }
.step > rect { fill: #f5f8fb; stroke: #7d93a6; }
.recipe > rect { fill: #fbf9f3; stroke: #c7b98f; }
.abstract > rect { stroke-dasharray: 5 3; }
.frame { fill: none; stroke: #c7b98f; stroke-dasharray: 5 3; }
.order { fill: none; stroke: #44546a; stroke-width: 1.4; }
.added { stroke: #b0741a; stroke-dasharray: 6 4; }
.transition { stroke: #3f6b4f; }
.overlap { fill: none; stroke: #8a4f8f; stroke-width: 1.4; stroke-dasharray: 1.5 3; }
.label { font-size: 10px; fill: #3f6b4f; paint-order: stroke; stroke: #ffffff; stroke-width: 3px; }
.overlap-label { fill: #8a4f8f; }
.order:hover { stroke-width: 3; }
.head { fill: #44546a; }
.head-added { fill: #b0741a; }
.head-transition { fill: #3f6b4f; }
"""

_STYLED = f"<style>\n{STYLE}</style>"


def svg(graph: TaskGraph) -> str:
    """Draw the graph as an SVG document: stated orders solid, added ones dashed, implied ones left out."""
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{figure(graph, _STYLED)}'


def figure(graph: TaskGraph, *inside: str) -> str:
    """Draw the graph as an SVG element for a page that provides the style; ``inside`` are further elements."""
    layout = arranged(graph.group)
    has_added = any(route.arrow.order is Order.ADDED for route in layout.routes)
    legend = "dashed: added by the compiler, as steps at one place are performed together" if has_added else ""
    title, subtitle = shown(graph.title, 80), shown(graph.subtitle, 120)
    wide = max(layout.width, width(title, 18) * BOLD, width(subtitle, LINE_SIZE), width(legend, LINE_SIZE)) + 2 * MARGIN
    high = layout.height + HEAD + 2 * MARGIN + (LINE_HEIGHT * 1.5 if legend else 0.0)
    left, top = (wide - layout.width) / 2, MARGIN + HEAD
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_n(wide)}" height="{_n(high)}"'
        f' viewBox="0 0 {_n(wide)} {_n(high)}" role="img">',
        f"<title>{escape(graph.title)}</title>",
        *inside,
        *_heads(),
        f'<rect width="{_n(wide)}" height="{_n(high)}" fill="#ffffff"/>',
        f'<text class="title" x="{_n(MARGIN)}" y="{_n(MARGIN + 18)}">{escape(title)}</text>',
        f'<text class="small" x="{_n(MARGIN)}" y="{_n(MARGIN + 36)}">{escape(subtitle)}</text>',
        f'<g transform="translate({_n(left)} {_n(top)})">',
        *_drawing(layout),
        *_beside(graph, layout),
        "</g>",
    ]
    if legend:
        lines.append(f'<text class="small" x="{_n(MARGIN)}" y="{_n(high - MARGIN)}">{escape(legend)}</text>')
    return "\n".join([*lines, "</svg>", ""])


def _heads() -> Iterator[str]:
    yield "<defs>"
    for kind in ("head", "head-added", "head-transition"):
        yield (
            f'<marker id="{kind}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8"'
            f' markerUnits="userSpaceOnUse" orient="auto">'
            f'<path class="{kind}" d="M 0 1 L 10 5 L 0 9 z"/></marker>'
        )
    yield "</defs>"


def _drawing(arrangement: Arrangement) -> Iterator[str]:
    for placed in arrangement.boxes:
        yield from _box(placed)
    for frame in arrangement.frames:
        yield from _frame(frame)
    beside: dict[frozenset[str], list[Point]] = {}
    for route in arrangement.routes:
        yield _path(route.arrow, curve_of(route))
        if route.arrow.label:
            beside.setdefault(frozenset((route.arrow.before, route.arrow.after)), []).append(middle_of(route.points))
    for route in arrangement.routes:
        if route.arrow.label:
            x, y = middle_of(route.points)
            others = beside[frozenset((route.arrow.before, route.arrow.after))]
            anchor = "middle" if len(others) == 1 else "end" if x == min(others)[0] else "start"
            yield _label(route.arrow, (x + {"middle": 0, "end": -5, "start": 5}[anchor], y), anchor)


def _box(placed: Placed) -> Iterator[str]:
    box = placed.box
    kind = "step" + (" recipe" if box.groups else "") + (" abstract" if box.is_abstract else "")
    hover = "\n".join(map(escape, box.hover))
    yield f'<g class="{kind}"><title>{hover}</title>'
    yield (
        f'<rect x="{_n(placed.x)}" y="{_n(placed.y)}" width="{_n(placed.width)}" height="{_n(placed.height)}" rx="6"/>'
    )
    y = placed.y + PADDING + NAME_SIZE - 3
    for number, line in enumerate(placed.lines):
        kind = "line" if number else "name"
        bare = line.removeprefix(INDENT)
        x = placed.x + PADDING + width(line[: len(line) - len(bare)], LINE_SIZE)
        yield f'<text class="{kind}" x="{_n(x)}" y="{_n(y)}">{escape(bare)}</text>'
        y += LINE_HEIGHT
    yield "</g>"


def _frame(frame: Frame) -> Iterator[str]:
    yield (
        f'<rect class="frame" x="{_n(frame.x)}" y="{_n(frame.y)}" width="{_n(frame.width)}"'
        f' height="{_n(frame.height)}" rx="6"/>'
    )
    name = escape(shown(frame.name, LONGEST_LINE))
    yield f'<text class="line" x="{_n(frame.x + PADDING)}" y="{_n(frame.y + LINE_HEIGHT)}">{name}</text>'


def _beside(graph: TaskGraph, arrangement: Arrangement) -> Iterator[str]:
    """Draw overlaps between two boxes, and transitions from a state to itself."""
    where = {placed.box.key: placed for placed in arrangement.boxes}
    for group in graph.groups():
        for arrow in group.of(Order.OVERLAP):
            first, second = where[arrow.before], where[arrow.after]
            left, right = (first, second) if first.x <= second.x else (second, first)
            if abs(first.y - second.y) < min(first.height, second.height):
                start, end = (left.x + left.width / 2, left.y), (right.x + right.width / 2, right.y)
                high = min(start[1], end[1]) - 24
                curve = f"M {_p(start)} C {_p((start[0], high))}, {_p((end[0], high))}, {_p(end)}"
                middle = ((start[0] + end[0]) / 2, high + 9)
            elif left.x + left.width < right.x:
                start = (left.x + left.width, left.y + left.height / 2)
                end = (right.x, right.y + right.height / 2)
                curve = f"M {_p(start)} L {_p(end)}"
                middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2 - 4)
            else:
                start, end = (first.x, first.y + first.height / 2), (second.x, second.y + second.height / 2)
                out = min(start[0], end[0]) - 18 - abs(end[1] - start[1]) * 0.1
                curve = f"M {_p(start)} C {_p((out, start[1]))}, {_p((out, end[1]))}, {_p(end)}"
                middle = (out, (start[1] + end[1]) / 2)
            yield f'<path class="overlap" d="{curve}"><title>{escape(arrow.hover)}</title></path>'
            yield _label(arrow, middle)
        for arrow in group.of(Order.TRANSITION):
            if arrow.before == arrow.after:
                box = where[arrow.before]
                x, y = box.x + box.width, box.y + box.height / 2
                yield _path(
                    arrow, f"M {_p((x, y - 8))} C {_p((x + 30, y - 20))}, {_p((x + 30, y + 20))}, {_p((x, y + 8))}"
                )
                yield _label(arrow, (x + 24, y - 14))


def _label(arrow: Arrow, at: Point, anchor: str = "middle") -> str:
    kind = "label overlap-label" if arrow.order is Order.OVERLAP else "label"
    return f'<text class="{kind}" text-anchor="{anchor}" x="{_n(at[0])}" y="{_n(at[1])}">{escape(arrow.label)}</text>'


def middle_of(points: Sequence[Point]) -> Point:
    """Position of the label of a route: the middle of its first change of ranks."""
    (x, y), (other, below) = points[1:3] if len(points) > 2 else points[:2]
    return (x + other) / 2, (y + below) / 2 + 3


def _path(arrow: Arrow, curve: str) -> str:
    kind = "" if arrow.order is Order.STATED else f" {arrow.order.value}"
    head = "head" if arrow.order is Order.STATED else f"head-{arrow.order.value}"
    return (
        f'<path class="order{kind}" d="{curve}" marker-end="url(#{head})"><title>{escape(arrow.hover)}</title></path>'
    )


def curve_of(route: Route) -> str:
    """Path of an arrow in SVG syntax, from its beginning to its end."""
    points = route.points[::-1] if route.is_upward else route.points
    parts = [f"M {_p(points[0])}"]
    for number, (before, point) in enumerate(pairwise(points)):
        if point == before:
            continue  # a part without length would turn the arrow's head
        if (number % 2 == 0) is not route.is_upward:  # vertical and curved parts alternate
            parts.append(f"L {_p(point)}")
        else:
            middle = (before[1] + point[1]) / 2
            parts.append(f"C {_p((before[0], middle))}, {_p((point[0], middle))}, {_p(point)}")
    return " ".join(parts)


def _p(point: Point) -> str:
    return f"{_n(point[0])} {_n(point[1])}"


def _n(value: float) -> str:
    """Format a length with one decimal, which hides the rounding differences between machines."""
    return f"{value:.1f}".removesuffix(".0")


NAME_SIZE, LINE_SIZE, LINE_HEIGHT = 13.0, 11.0, 16.0
PADDING, GROUP_PADDING = 10.0, 16.0


@dataclass(slots=True)
class Placed:
    """A box in the drawing: its lines, size and top left corner [px], and the recipes laid out inside it."""

    box: Box
    lines: tuple[str, ...]
    width: float
    height: float
    inside: tuple[_Recipe, ...]
    x: float = 0.0
    y: float = 0.0


@dataclass(frozen=True, slots=True)
class Frame:
    """A frame around one of the alternative recipes of a step; its top left corner and size [px]."""

    name: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Route:
    """An arrow in the drawing; its points are those of :class:`planlang.compiler.drawing.layers.Layers`.

    With ``is_upward`` they lead from its end to its beginning, because it goes back to an earlier rank.
    """

    arrow: Arrow
    points: tuple[Point, ...]
    is_upward: bool


@dataclass(slots=True)
class Arrangement:
    """All elements of a drawing; an outer box precedes those inside it."""

    width: float
    height: float
    boxes: list[Placed] = field(default_factory=list)
    frames: list[Frame] = field(default_factory=list)
    routes: list[Route] = field(default_factory=list)


def arranged(group: Group) -> Arrangement:
    """Lay out a recipe and everything below it; the top left corner is (0, 0)."""
    recipe = _laid_out(group)
    arrangement = Arrangement(recipe.layers.width, recipe.layers.height)
    _put(recipe, 0.0, 0.0, arrangement)
    return arrangement


@dataclass(frozen=True, slots=True)
class _Recipe:
    """A recipe laid out by itself."""

    name: str
    boxes: tuple[Placed, ...]
    arrows: tuple[Arrow, ...]
    layers: Layers


def _laid_out(group: Group) -> _Recipe:
    boxes = tuple(map(_sized, group.boxes))
    index = {box.key: number for number, box in enumerate(group.boxes)}
    arrows = tuple(
        arrow for arrow in group.of(Order.STATED, Order.ADDED, Order.TRANSITION) if arrow.before != arrow.after
    )
    edges = [(index[arrow.before], index[arrow.after]) for arrow in arrows]
    if group.of(Order.TRANSITION):  # transitions may form cycles: keep the boxes in the order in which they are reached
        edges = [(min(edge), max(edge)) for edge in edges]
    return _Recipe(group.name, boxes, arrows, layered([(box.width, box.height) for box in boxes], edges))


def _sized(box: Box) -> Placed:
    lines = box.text()
    wide = max(width(lines[0], NAME_SIZE) * BOLD, *(width(line, LINE_SIZE) for line in ("", *lines[1:]))) + 2 * PADDING
    high = _text_height(lines)
    inside = tuple(map(_laid_out, box.groups))
    if inside:
        frame = _frame_margin(inside)
        wide = max(wide, sum(one.layers.width + 2 * frame + GROUP_PADDING for one in inside) + GROUP_PADDING)
        high += max(one.layers.height + 2 * frame + (LINE_HEIGHT if frame else 0) for one in inside) + GROUP_PADDING
    return Placed(box, lines, wide, high, inside)


def _text_height(lines: tuple[str, ...]) -> float:
    return LINE_HEIGHT * len(lines) + 2 * PADDING - 4


def _frame_margin(inside: tuple[_Recipe, ...]) -> float:
    return GROUP_PADDING if len(inside) > 1 else 0.0


def _put(recipe: _Recipe, x: float, y: float, arrangement: Arrangement) -> None:
    """Place the boxes and arrows of a recipe, and everything inside, with its top left corner at (x, y)."""
    for placed, (left, top) in zip(recipe.boxes, recipe.layers.corners, strict=True):
        placed.x, placed.y = x + left, y + top
        arrangement.boxes.append(placed)
        frame = _frame_margin(placed.inside)
        widths = [one.layers.width + 2 * frame for one in placed.inside]
        at = placed.x + (placed.width - sum(widths) - GROUP_PADDING * (len(widths) - 1)) / 2
        below = placed.y + _text_height(placed.lines)
        for one, wide in zip(placed.inside, widths, strict=True):
            if frame:
                high = one.layers.height + 2 * frame + LINE_HEIGHT
                arrangement.frames.append(Frame(f"one way: {shown(one.name, LONGEST_LINE)}", at, below, wide, high))
            _put(one, at + frame, below + frame + (LINE_HEIGHT if frame else 0.0), arrangement)
            at += wide + GROUP_PADDING
    index = {placed.box.key: number for number, placed in enumerate(recipe.boxes)}
    for arrow, route in zip(recipe.arrows, recipe.layers.routes, strict=True):
        is_upward = arrow.order is Order.TRANSITION and index[arrow.before] > index[arrow.after]
        arrangement.routes.append(Route(arrow, tuple((x + a, y + b) for a, b in route), is_upward))
