"""Drawings of a task: its steps, what fills their properties, and what has to come before what.

General layout: ``task_graph`` turns checked recipes into groups of boxes and arrows, with names made safe to show;
``markup`` and ``svg`` write those in one format each; ``layers`` arranges what an SVG shows.
"""

from collections.abc import Callable, Mapping

from planlang.compiler.drawing.markup import dot, mermaid
from planlang.compiler.drawing.svg import figure, svg
from planlang.compiler.drawing.task_graph import Order, TaskGraph, task_graph

FORMATS: Mapping[str, Callable[[TaskGraph], str]] = {".svg": svg, ".dot": dot, ".mmd": mermaid}
"""Suffix of a file -> the function that writes this format; equal graphs give equal text."""

__all__ = ["FORMATS", "Order", "TaskGraph", "dot", "figure", "mermaid", "svg", "task_graph"]
