"""Where each box and arrow of a task graph goes: nested recipes are laid out first, then take room as one box each."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.compiler.drawing.layers import Layers, Point, layered
from planlang.compiler.drawing.model import Arrow, Box, Group, Order
from planlang.compiler.drawing.text import LONGEST_LINE, shown, width

NAME_SIZE, LINE_SIZE, LINE_HEIGHT = 13.0, 11.0, 16.0
PADDING, GROUP_PADDING = 10.0, 16.0


@dataclass(frozen=True, slots=True)
class Placed:
    """A box in the drawing: its top left corner and size [px], the lines that fit in, and whether others are inside."""

    box: Box
    x: float
    y: float
    width: float
    height: float
    lines: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Frame:
    """Around one of several recipes that a step may be performed by."""

    name: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True, slots=True)
class Route:
    """An arrow in the drawing; its points as :class:`planlang.compiler.drawing.layers.Layers` tells.

    With ``is_upward`` they lead from its end to its beginning: it goes back to where others come from.
    """

    arrow: Arrow
    points: tuple[Point, ...]
    is_upward: bool = False


@dataclass(slots=True)
class Arrangement:
    """Everything that is drawn, an outer box before what is inside of it."""

    boxes: list[Placed]
    frames: list[Frame]
    routes: list[Route]
    width: float = 0.0
    height: float = 0.0


def arranged(group: Group) -> Arrangement:
    """Lay out a recipe and everything below it; the top left corner is (0, 0)."""
    found = Arrangement([], [], [])
    plan = _plan(group)
    found.width, found.height = plan.layers.width, plan.layers.height
    _put(plan, 0.0, 0.0, found)
    return found


@dataclass(frozen=True, slots=True)
class _Plan:
    """A recipe laid out by itself, with the plans of what is inside of its boxes."""

    group: Group
    boxes: tuple[_Sized, ...]
    arrows: tuple[Arrow, ...]
    layers: Layers


@dataclass(frozen=True, slots=True)
class _Sized:
    box: Box
    lines: tuple[str, ...]
    width: float
    height: float
    plans: tuple[_Plan, ...]

    @property
    def has_frames(self) -> bool:
        return len(self.plans) > 1


def _plan(group: Group) -> _Plan:
    boxes = tuple(_sized(box) for box in group.boxes)
    index = {box.key: number for number, box in enumerate(group.boxes)}
    arrows = tuple(
        arrow for arrow in group.of(Order.STATED, Order.ADDED, Order.TRANSITION) if arrow.before != arrow.after
    )
    edges = [(index[arrow.before], index[arrow.after]) for arrow in arrows]
    if group.of(Order.TRANSITION):  # which may lead in circles: boxes stand in the order in which they are reached
        edges = [(min(edge), max(edge)) for edge in edges]
    return _Plan(group, boxes, arrows, layered([(box.width, box.height) for box in boxes], edges))


def _sized(box: Box) -> _Sized:
    lines = box.text()
    wide = max(width(lines[0], NAME_SIZE) * 1.08, *(width(line, LINE_SIZE) for line in ("", *lines[1:]))) + 2 * PADDING
    high = LINE_HEIGHT * len(lines) + 2 * PADDING - 4
    plans = tuple(_plan(group) for group in box.groups)
    if plans:
        frame = _frame_margin(len(plans) > 1)
        inside = sum(plan.layers.width + 2 * frame for plan in plans) + GROUP_PADDING * (len(plans) + 1)
        wide = max(wide, inside)
        high += max(plan.layers.height + 2 * frame + (LINE_HEIGHT if frame else 0) for plan in plans) + GROUP_PADDING
    return _Sized(box, lines, wide, high, plans)


def _frame_margin(has_frames: bool) -> float:
    return GROUP_PADDING if has_frames else 0.0


def _put(plan: _Plan, x: float, y: float, found: Arrangement) -> None:
    for sized, (left, top) in zip(plan.boxes, plan.layers.corners, strict=True):
        corner = (x + left, y + top)
        found.boxes.append(Placed(sized.box, *corner, sized.width, sized.height, sized.lines))
        _put_inside(sized, *corner, found)
    index = {sized.box.key: number for number, sized in enumerate(plan.boxes)}
    for arrow, route in zip(plan.arrows, plan.layers.routes, strict=True):
        is_upward = arrow.order is Order.TRANSITION and index[arrow.before] > index[arrow.after]
        found.routes.append(Route(arrow, tuple((x + a, y + b) for a, b in route), is_upward))


def _put_inside(sized: _Sized, x: float, y: float, found: Arrangement) -> None:
    frame = _frame_margin(sized.has_frames)
    widths = [plan.layers.width + 2 * frame for plan in sized.plans]
    left = x + (sized.width - sum(widths) - GROUP_PADDING * (len(widths) - 1)) / 2
    top = y + LINE_HEIGHT * len(sized.lines) + 2 * PADDING - 4
    for plan, wide in zip(sized.plans, widths, strict=True):
        if frame:
            high = plan.layers.height + 2 * frame + LINE_HEIGHT
            found.frames.append(Frame(f"one way: {shown(plan.group.name, LONGEST_LINE)}", left, top, wide, high))
        _put(plan, left + frame, top + frame + (LINE_HEIGHT if frame else 0.0), found)
        left += wide + GROUP_PADDING
