"""Drawings of a task: its steps with their properties, and the order of the steps.

General layout: ``task_graph`` turns checked recipes into groups of boxes and arrows, with names made safe to display;
``markup`` and ``svg`` write them as text; ``layers`` computes the layout of an SVG, which ``png`` draws; ``graph_file``
writes the file.
"""

from planlang.compiler.drawing.graph_file import FORMATS, GraphDrawing, unknown_format
from planlang.compiler.drawing.markup import dot, mermaid
from planlang.compiler.drawing.svg import figure, svg
from planlang.compiler.drawing.task_graph import Order, TaskGraph, task_graph

__all__ = [
    "FORMATS",
    "GraphDrawing",
    "Order",
    "TaskGraph",
    "dot",
    "figure",
    "mermaid",
    "svg",
    "task_graph",
    "unknown_format",
]
