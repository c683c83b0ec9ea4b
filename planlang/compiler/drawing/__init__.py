"""Drawings of a task: its steps, what fills their properties, and what has to come before what.

General layout: ``model`` turns checked recipes into groups of boxes and arrows; ``dot``, ``mermaid``, ``svg`` and
``page`` write those in one format each; ``layers`` and ``arrangement`` say where everything goes in an SVG; ``text``
makes names that strangers chose safe to show.
"""

from collections.abc import Callable, Mapping

from planlang.compiler.drawing.dot import dot
from planlang.compiler.drawing.mermaid import mermaid
from planlang.compiler.drawing.model import Arrow, Box, Group, Order, TaskGraph, task_graph
from planlang.compiler.drawing.page import page
from planlang.compiler.drawing.svg import svg

FORMATS: Mapping[str, Callable[[TaskGraph], str]] = {".svg": svg, ".dot": dot, ".mmd": mermaid, ".html": page}
"""Suffix of a file -> what writes that format; equal graphs give equal text."""

__all__ = [
    "FORMATS",
    "Arrow",
    "Box",
    "Group",
    "Order",
    "TaskGraph",
    "dot",
    "mermaid",
    "page",
    "svg",
    "task_graph",
]
