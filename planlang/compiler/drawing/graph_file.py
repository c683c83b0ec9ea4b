"""The drawing of a task as a file, and in a notebook."""

from __future__ import annotations

from functools import partial
from os import PathLike
from pathlib import Path

from planlang.compiler.drawing.markup import dot, mermaid
from planlang.compiler.drawing.svg import svg
from planlang.compiler.drawing.task_graph import TaskGraph
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.outputs import PNG, check_outputs, replace, write_text
from planlang.records import dataclass

FORMATS = {".svg": svg, ".dot": dot, ".mmd": mermaid}
"""Suffix of a file -> function that writes this format; equal graphs give equal text."""


@dataclass(frozen=True, slots=True)
class GraphDrawing:
    """The order of the steps of a task, displayed in a notebook as SVG."""

    graph: TaskGraph

    def __repr__(self) -> str:
        return f"<GraphDrawing of {self.graph.title}>"

    @property
    def svg(self) -> str:
        """The drawing as SVG."""
        return svg(self.graph)

    @property
    def dot(self) -> str:
        """The graph for Graphviz."""
        return dot(self.graph)

    @property
    def mermaid(self) -> str:
        """The graph as a flowchart for Mermaid."""
        return mermaid(self.graph)

    def save(self, path: str | PathLike[str], *, force: bool = False) -> Path:
        """Write the drawing in the format of the path's suffix: .svg, .dot, .mmd or .png. Gives the path.

        ``force`` overwrites a file that planlang did not write. Raises BadInput if the file cannot be written.
        """
        target = Path(path)
        problems = [*unknown_format(target), *check_outputs({"graph": target}, {}, force=force)]
        if problems:
            raise BadInput(problems)
        if target.suffix.lower() in PNG:
            from planlang.compiler.drawing.png import save_graph  # Pillow is slow to import

            replace(target, partial(save_graph, self.graph))
        else:
            write_text(target, FORMATS[target.suffix.lower()](self.graph))
        return target

    def _repr_svg_(self) -> str:
        return self.svg.partition("?>\n")[2]  # an HTML page must not contain the XML declaration


def unknown_format(path: Path) -> list[Diagnostic]:
    """Report an error if the suffix of a file is not a graph format."""
    known = (*FORMATS, *PNG)
    if path.suffix.lower() in known:
        return []
    message = f"unknown graph format {path.suffix or path.name}; known: {', '.join(known)}"
    return [error("C014", message, help=f"name a file such as {path.stem or 'graph'}.svg")]
