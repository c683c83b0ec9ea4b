"""The graph as a flowchart of Mermaid."""

from __future__ import annotations

from collections.abc import Iterator

from planlang.compiler.drawing.task_graph import LONGEST_LINE, Box, Group, Order, TaskGraph, for_mermaid, shown

_LINKS = {Order.STATED: "-->", Order.ADDED: "-.->", Order.TRANSITION: "-->", Order.OVERLAP: "-.-"}


def mermaid(graph: TaskGraph) -> str:
    """Return the graph as a flowchart: nested recipes are subgraphs, implied orders are left out, labels hold lines.

    Tooltips need a script in Mermaid, so that there are none.
    """
    title = f"{for_mermaid(graph.title)}<br/>{for_mermaid(graph.subtitle)}"
    lines = ["flowchart TD", f'    subgraph {graph.group.key}["{title}"]']
    lines += _group(graph.group, "        ")
    lines += ["    end", "    classDef abstract stroke-dasharray: 4 3"]
    unperformed = [box.key for group in graph.groups() for box in group.boxes if box.is_abstract]
    if unperformed:
        lines.append(f"    class {','.join(unperformed)} abstract")
    return "\n".join([*lines, ""])


def _group(group: Group, indent: str) -> Iterator[str]:
    for box in group.boxes:
        yield from _box(box, indent)
    for arrow in group.of(*_LINKS):
        label = f'|"{for_mermaid(arrow.label)}"|' if arrow.label else ""
        yield f"{indent}{arrow.before} {_LINKS[arrow.order]}{label} {arrow.after}"


def _box(box: Box, indent: str) -> Iterator[str]:
    lines = [*box.text(), *([f"line {box.line}"] if box.line is not None else [])]
    label = "<br/>".join(map(for_mermaid, lines))
    if not box.groups:
        yield f'{indent}{box.key}["{label}"]'
        return
    yield f'{indent}subgraph {box.key}["{label}"]'
    if len(box.groups) == 1:
        yield from _group(box.groups[0], indent + "    ")
    else:
        for group in box.groups:
            yield f'{indent}    subgraph {group.key}["one way: {for_mermaid(shown(group.name, LONGEST_LINE))}"]'
            yield from _group(group, indent + "        ")
            yield f"{indent}    end"
    yield f"{indent}end"
