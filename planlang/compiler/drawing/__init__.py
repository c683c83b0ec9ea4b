"""Drawings of a task: its steps, what fills their properties, and what has to come before what.

General layout: ``task_graph`` turns checked recipes into groups of boxes and arrows, with names made safe to show;
``markup`` and ``svg`` write those in one format each; ``layers`` arranges what an SVG shows; ``graph_file`` writes
the file.
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
