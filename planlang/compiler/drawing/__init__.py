"""Drawings of a task: its steps with their properties, and the order of the steps.

General layout: ``task_graph`` turns checked recipes into groups of boxes and arrows, with names made safe to display;
``markup`` and ``svg`` write them as text; ``layers`` computes the layout of an SVG, which ``png`` draws; ``graph_file``
writes the file.
"""

from planlang.compiler.drawing.graph_file import FORMATS as FORMATS
from planlang.compiler.drawing.graph_file import GraphDrawing as GraphDrawing
from planlang.compiler.drawing.graph_file import unknown_format as unknown_format
from planlang.compiler.drawing.markup import dot as dot
from planlang.compiler.drawing.markup import mermaid as mermaid
from planlang.compiler.drawing.svg import figure as figure
from planlang.compiler.drawing.svg import svg as svg
from planlang.compiler.drawing.task_graph import Order as Order
from planlang.compiler.drawing.task_graph import TaskGraph as TaskGraph
from planlang.compiler.drawing.task_graph import task_graph as task_graph
