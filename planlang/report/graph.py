"""The recipe's graph as the page draws it: boxes, frames and curves of the one layout that there is."""

from __future__ import annotations

from typing import Any

from planlang.compiler.drawing.svg import arranged, curve_of, middle_of
from planlang.compiler.drawing.task_graph import TaskGraph


def graph_of(graph: TaskGraph) -> dict[str, Any]:
    """Return sizes and corners [px], what boxes say, and the paths of arrows in the syntax of SVG."""
    found = arranged(graph.group)
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
        for placed in found.boxes
    ]
    frames = [
        {"name": one.name, "corner": [_n(one.x), _n(one.y)], "size": [_n(one.width), _n(one.height)]}
        for one in found.frames
    ]
    arrows = [
        {
            "path": curve_of(route),
            "order": route.arrow.order.value,
            "hover": route.arrow.hover,
            "label": route.arrow.label,
            "at": [_n(one) for one in middle_of(route.points)],
        }
        for route in found.routes
    ]
    size = [_n(found.width), _n(found.height)]
    return {"title": graph.title, "size": size, "boxes": boxes, "frames": frames, "arrows": arrows}


def _n(value: float) -> float:
    return round(value, 1)
