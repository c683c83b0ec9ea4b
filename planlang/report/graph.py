"""The recipe's graph for the page: boxes, frames and curves of the compiler's layout."""

from __future__ import annotations

from typing import Any

from planlang.compiler.drawing.svg import arranged, curve_of, middle_of
from planlang.compiler.drawing.task_graph import TaskGraph


def graph_of(graph: TaskGraph) -> dict[str, Any]:
    """Sizes and corners [px], texts of boxes, and the paths of arrows in SVG syntax."""
    arrangement = arranged(graph.group)
    boxes = [
        {
            "name": placed.box.name,
            "lines": list(placed.lines),
            "hover": list(placed.box.hover),
            "line": placed.box.line,
            "corner": [_n(placed.x), _n(placed.y)],
            "size": [_n(placed.width), _n(placed.height)],
            "abstract": placed.box.is_abstract,
            "inner": bool(placed.inside),
        }
        for placed in arrangement.boxes
    ]
    frames = [
        {"name": one.name, "corner": [_n(one.x), _n(one.y)], "size": [_n(one.width), _n(one.height)]}
        for one in arrangement.frames
    ]
    arrows = [
        {
            "path": curve_of(route),
            "order": route.arrow.order.value,
            "hover": route.arrow.hover,
            "label": route.arrow.label,
            "at": [_n(one) for one in middle_of(route.points)],
        }
        for route in arrangement.routes
    ]
    size = [_n(arrangement.width), _n(arrangement.height)]
    return {"title": graph.title, "size": size, "boxes": boxes, "frames": frames, "arrows": arrows}


def _n(value: float) -> float:
    return round(value, 1)
